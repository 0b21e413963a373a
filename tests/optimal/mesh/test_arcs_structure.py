"""Multipliers of a solution that contradict its structure."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.mesh.detection import with_overlooked, without_idle_touches, without_vanished
from armdyn.optimal.mesh.phases import solve_phases
from armdyn.optimal.problem.policy import Policy
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import Arc, Mode
from problems import cart, solved

U, L, V = Mode.UPPER, Mode.LOWER, Mode.VELOCITY_UPPER


def numbers(problem):
    return Policy.of(problem).arcs


def modes(arcs):
    return [arc.modes for arc in arcs]


@pytest.mark.parametrize("arm", ["r", "rr"])
def test_the_structure_of_an_optimum_needs_no_change(arm):
    solution = solved(arm)
    phases, problem = solution.phases, solution.problem
    assert with_overlooked(problem, phases, numbers(problem)) == []
    assert without_vanished(phases, numbers(problem)) == []
    assert without_idle_touches(phases) == []


def test_an_arc_that_has_vanished_goes():
    solution = solved("rr")
    phases = solution.phases
    first, *rest = phases.arcs
    gone = Arc(1e-12 * phases.duration, tuple(U if mode is L else L for mode in first.modes))
    fewer = without_vanished(replace(phases, arcs=(gone, first, *rest)), numbers(solution.problem))
    assert modes(fewer) == modes(phases.arcs)
    assert without_vanished(replace(phases, arcs=(gone,)), numbers(solution.problem)) == []  # the last one stays


def test_a_velocity_limit_that_is_not_named_is_overlooked():
    """The cart cruises; with a free torque in its middle, its multipliers still show that a limit holds it."""
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], velocity_limit=0.8)
    t = np.array([0.0, 0.8, 2.5, 3.3])
    q, v, tau = ([0.0, 0.32, 1.68, 2.0], [0.0, 0.8, 0.8, 0.0], [1.0, 0.0, -1.0, -1.0])
    guess = ad.Trajectory(t, *(np.array(each)[:, None] for each in (q, v, tau)), problem.robot.joint_names, "known")
    given = [Arc(0.8, (U,)), Arc(1.7, (V,)), Arc(0.8, (L,))]
    phases = solve_phases(Task.of(problem, ad.MinimumTimeOptions(compile=False)), given, guess, 24)
    assert modes(phases.arcs) == [(U,), (V,), (L,)]
    unnamed = tuple(replace(arc, modes=(Mode.FREE,)) if arc.modes == (V,) else arc for arc in phases.arcs)
    found = with_overlooked(problem, replace(phases, arcs=unnamed), numbers(problem))
    assert (V,) in modes(found)
    assert sum(arc.duration for arc in found) == pytest.approx(phases.duration, rel=1e-12)


@pytest.mark.parametrize(("pull", "wanted"), [(-1e-3, True), (1e-3, False)])
def test_a_touch_stays_where_the_limit_pushes_back(pull, wanted):
    phases = solved("r").phases
    first, last = phases.arcs
    touching = (replace(first, touches=((0, Mode.POSITION_UPPER),)), last)
    pulls = np.full_like(phases.knot_multiplier, pull)
    found = without_idle_touches(replace(phases, arcs=touching, knot_multiplier=pulls))
    assert found == ([] if wanted else list(phases.arcs))
