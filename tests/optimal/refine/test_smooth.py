"""Time-energy optima by the direct method."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.refine.smooth import cost, resolved_near, smooth_optima, trajectory_cost
from armdyn.optimal.search.starts import spline
from armdyn.optimal.task.task import Task
from problems import cart, paper_problem


def search(problem, count, stop=None):
    optima, _ = smooth_optima(Task.of(problem, stop=stop), 6, count)
    return optima


def test_cost_of_linear_torques_is_exact():
    motion = ad.Trajectory([0, 1, 3], np.zeros((3, 1)), np.zeros((3, 1)), [[0], [2], [-1]])
    # ∫ τ² = 4/3 on the first second, 2 (4 - 2 + 1)/3 on the other two.
    assert trajectory_cost(motion, 1.0) == pytest.approx(3 + (4 / 3 + 2) / 2)
    assert trajectory_cost(motion, 0.0) == 3


def test_double_integrator_in_closed_form():
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[1.0], effort_weight=2.0, effort_limit=50.0)
    phases = resolved_near(Task.of(problem), spline(problem, []))
    duration = (18 * 2.0) ** 0.25  # of J = T + 6 w d²/T³
    assert phases.duration == pytest.approx(duration, rel=1e-7)  # J is flat there: IPOPT's 1e-10 leaves 1e-8
    assert cost(problem, phases) == pytest.approx(4 / 3 * duration, rel=1e-9)


def test_optima_come_by_cost_and_the_first_is_not_the_fastest():
    problem = paper_problem("rr", effort_weight=1.0)
    found = search(problem, 6)
    costs = [cost(problem, phases) for phases in found]
    assert len(found) >= 2 and np.all(np.diff(costs) > 0)
    assert costs[0] == pytest.approx(0.5577320121886695, rel=1e-7)  # the reference's J
    assert found[1].duration < found[0].duration  # by duration the choice would be wrong


def test_as_many_as_asked_and_none_once_stopped():
    problem = paper_problem("rr", effort_weight=1.0)
    assert len(search(problem, 1)) == 1
    assert search(problem, 6, Stop(deadline=0.0)) == ()
