"""One mesh, one guess, one call of IPOPT."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.mesh.direct import solve_on_mesh
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.options import Scheme
from armdyn.optimal.problem.task import Task
from problems import cart


@pytest.mark.parametrize("control", ["linear", "constant"])
def test_double_integrator_converges_to_the_closed_form_from_above(control):
    # Unit force and mass over 2 m: 2√2 s. Both controls keep the bound, so no mesh can be faster.
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0])
    task = replace(Task.of(problem), scheme=Scheme(control))
    excess = []
    for n in (11, 22, 44):  # no multiple puts a knot on the switch of all meshes
        attempt = solve_on_mesh(task, spline(problem, []), n, task.alone())
        assert attempt.usable
        excess.append(attempt.trajectory.duration - 2 * np.sqrt(2))
    assert min(excess) > -1e-7  # IPOPT relaxes bounds by 1e-8 of the scaled problem
    assert excess[-1] < 1e-3
