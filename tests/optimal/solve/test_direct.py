"""One mesh, one guess, one call of IPOPT."""

import numpy as np
import pytest

import armdyn as ad
from problems import cart, solve


@pytest.mark.parametrize("control", ["linear", "constant"])
@pytest.mark.parametrize("form", ["forward", "inverse"])
def test_double_integrator_converges_to_the_closed_form_from_above(control, form):
    # Unit force and mass over 2 m: 2√2 s. Both controls keep the bound, so no mesh can be faster.
    robot = cart()
    problem = ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[2.0])
    excess = []
    for n in (11, 22, 44):  # no multiple puts a knot on the switch of all meshes
        solution = solve(problem, intervals=n, max_intervals=n, arcs=False, control=control, dynamics=form)
        excess.append(solution.duration - 2 * np.sqrt(2))
    assert min(excess) > -1e-7  # IPOPT relaxes bounds by 1e-8 of the scaled problem
    assert excess[-1] < 1e-3
