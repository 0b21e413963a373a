"""Durations of arcs of known structure, and messages where they are not found."""

from dataclasses import replace

import numpy as np
import pytest

from armdyn.optimal.mesh.phases import Unresolved, solve_phases
from armdyn.optimal.problem.status import Stop
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import Mode
from armdyn.optimal.verify.phases import Phases
from problems import solved


@pytest.fixture(scope="module")
def solution():
    return solved("rr")


def again(solution, stop=None, intervals=None, **aim):
    task, phases = Task.of(solution.problem, stop=stop), solution.phases
    return solve_phases(task, phases.arcs, phases.torques, intervals or phases.arc_of.size, **aim)


def test_another_mesh_finds_the_same_durations(solution):
    found, before = again(solution, intervals=48), solution.phases
    assert isinstance(found, Phases)
    lengths = [[arc.duration for arc in phases.arcs] for phases in (found, before)]
    # Ninth order: the difference is IPOPT's 1e-10, and the first one's aim off the goal by its own error.
    np.testing.assert_allclose(lengths[0], lengths[1], atol=1e-7)
    assert found.t[-1] == found.duration and found.arc_of.size == 48
    np.testing.assert_allclose(np.bincount(found.arc_of, np.diff(found.t)), lengths[0], rtol=1e-12)


def test_it_ends_off_the_goal_by_the_given_error(solution):
    offset = np.array([1e-3, -2e-3, 0.01, 0.02])
    found = again(solution, warm=True, offset=offset)
    np.testing.assert_allclose(np.hstack([found.q[-1], found.v[-1]]), solution.problem.x_goal + offset, atol=1e-12)


def test_costates_are_how_the_time_to_go_depends_on_the_state(solution):
    """Differences of t_f for neighbouring goals, against the costate at the end: ρ there is −∂t_f/∂x_goal."""
    step = 1e-4
    for i in range(4):
        beside = [again(solution, warm=True, offset=sign * step * np.eye(4)[i]) for sign in (1, -1)]
        slope = (beside[0].duration - beside[1].duration) / (2 * step)
        assert -solution.phases.costate[-1, i] == pytest.approx(slope, rel=1e-4)


def test_phases_that_do_not_converge_are_of_another_type(solution):
    found = again(solution, stop=Stop(deadline=0.0))
    assert isinstance(found, Unresolved)
    assert found.message == "time limit reached" and isinstance(found.last, Phases)
    assert found.last.iterations == found.iterations


def test_more_conditions_than_unknowns_are_not_solved(solution, capfd):
    """Touching a limit takes a duration, and bang-bang arcs have but one for each condition of the goal."""
    task, phases = Task.of(solution.problem), solution.phases
    first = replace(phases.arcs[0], touches=((0, Mode.VELOCITY_UPPER),))
    task = replace(task, problem=solution.problem.variant(velocity_limit=100.0))
    found = solve_phases(task, [first, *phases.arcs[1:]], phases.torques, phases.arc_of.size)
    assert isinstance(found, Unresolved) and found.iterations == 0
    assert found.message == "the structure has more conditions than unknowns, by 1"
    assert capfd.readouterr() == ("", "")
