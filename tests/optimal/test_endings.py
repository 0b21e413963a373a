"""How a solve ends that finds nothing, or not in time, or is not let finish."""

import os
import signal

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.phases import Unresolved
from armdyn.optimal.refine.smooth import time_energy
from armdyn.optimal.task.task import Task
from problems import paper_problem, solved


def test_unreachable_goal_is_reported_not_pretended():
    # A torque that cannot even lift the arm's own weight leaves no motion to the goal.
    with pytest.warns(ad.ArmdynWarning, match="hold the goal"):
        problem = paper_problem("r", 1.0, effort_limit=0.05, position_limit=(-1.6, 0.2))
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(starts=2, max_iterations=200))
    assert not solution.success
    assert solution.status in (ad.Status.INFEASIBLE, ad.Status.ITERATION_LIMIT, ad.Status.FAILED)
    assert solution.worst_violation is not None
    assert "joint1" in solution.message


def test_time_limit_returns_what_there_is():
    solution = ad.solve_minimum_time(paper_problem("rrr"), ad.MinimumTimeOptions(time_limit=1e-3))
    assert not solution.success
    assert solution.status is ad.Status.TIME_LIMIT
    assert solution.trajectory.duration > 0


@pytest.mark.parametrize("more", [{}, {"effort_weight": 1.0}, {"acceleration_limit": 50.0}])
def test_nothing_is_built_when_the_time_is_up(more, monkeypatch):
    """A hundredth of a second is gone when the search begins: then it ends without a program, or a fork."""
    monkeypatch.setattr("armdyn.optimal.solve.registry._built", lambda *_: pytest.fail("a program is built"))
    solution = ad.solve_minimum_time(paper_problem("rrr", **more), ad.MinimumTimeOptions(time_limit=1e-9))
    assert solution.status is ad.Status.TIME_LIMIT and not solution.moves
    assert solution.message == "no motion was found: time limit reached"


def test_optima_that_only_a_coarse_mesh_has_are_none_and_a_curve_is_the_answer(monkeypatch):
    def resist(task, guess):
        phases = solved("r").phases
        return Unresolved("Restoration Failed", ad.Status.INFEASIBLE, 7, phases)

    monkeypatch.setattr("armdyn.optimal.refine.smooth.resolved_near", resist)
    problem = paper_problem("r", effort_weight=1.0, effort_limit=30.0)
    optima, found = time_energy(Task.of(problem))
    assert not optima and found.failed[0].status is ad.Status.INFEASIBLE
    assert "what converged on a coarse mesh does not on" in found.failed[0].message
    assert "Restoration Failed" in found.failed[0].message
    solution = ad.solve_minimum_time(problem)
    assert solution.usable and not solution.arcs and solution.intervals > 0


def test_interrupt_returns_what_there_is():
    told = []

    def press(text):
        if not told:
            os.kill(os.getpid(), signal.SIGINT)
        told.append(text)

    problem = paper_problem("rrr", position_limit=(-np.inf, np.inf))
    before = signal.getsignal(signal.SIGINT)
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(starts=400), press)
    assert solution.status is ad.Status.INTERRUPTED, solution.message
    assert not solution.success
    assert len(told) < 100  # of 400 guesses
    assert signal.getsignal(signal.SIGINT) is before
