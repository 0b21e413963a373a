"""Which optimum is the answer, whether it is one, and what is said of it."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.answer.assembly import assembled, failed
from armdyn.optimal.answer.summary import minimum_time_summary
from armdyn.optimal.conditions.condition import Kept
from armdyn.optimal.conditions.demands import Checked
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.proof.certificate import Certificate
from armdyn.optimal.refine.optimum import Optimum
from armdyn.optimal.search.candidates import Found
from armdyn.optimal.search.starts import spline
from armdyn.optimal.solve.attempt import Attempt
from armdyn.optimal.task.task import Task
from problems import paper_problem

FAST = Violation("velocity limit", "joint2", 0.05, 5.6e-4)


@pytest.fixture(scope="module")
def task():
    return Task.of(paper_problem("rr"))


def optimum(task, goal=1e-9, exceeded=None, reasons=(), cost=1.0, worst=None):
    certificate = Certificate(goal, goal, exceeded.value if exceeded else 0.0, exceeded=exceeded)
    checked = Checked((Kept("jerk limits", "", None, reasons, worst),))
    return Optimum(spline(task.problem, []), certificate, cost, 40, checked=checked)


def answer(task, *optima):
    return assembled(task, list(optima), Found(()), 1.0)


def test_a_limit_that_is_exceeded_is_no_success_and_is_named(task):
    solution = answer(task, optimum(task, exceeded=FAST))
    assert not solution.success and solution.status is ad.Status.LIMIT_EXCEEDED
    assert solution.worst_violation is FAST and solution.moves
    assert "velocity limit of joint 'joint2' exceeded by 0.00056 of it at t = 0.05 s" in solution.message
    assert answer(task, optimum(task, exceeded=replace(FAST, value=9e-7))).success  # the certificate's tolerance


def test_who_keeps_the_limits_comes_before_who_is_faster(task):
    slower = optimum(task, cost=2.0)
    assert answer(task, optimum(task, exceeded=FAST), slower).certificate is slower.certificate


def test_a_condition_that_is_missed_is_the_worst_violation(task):
    worst = Violation("jerk limit", "joint1", 0.1, 0.4)
    solution = answer(task, optimum(task, reasons=("too jerky",), worst=worst))
    assert solution.status is ad.Status.CONDITION_MISSED and solution.worst_violation is worst
    assert "too jerky" in solution.message and "best so far" not in solution.message


@pytest.mark.parametrize("wrong", [{"goal": 0.3}, {"goal": np.inf}, {"exceeded": replace(FAST, value=0.27)}])
@pytest.mark.parametrize("late", [False, True])
def test_what_is_no_motion_has_no_duration(task, wrong, late):
    stopped = replace(task, stop=Stop(deadline=0.0 if late else np.inf))
    solution = answer(stopped, optimum(stopped, **wrong))
    assert not solution.success and not solution.moves
    assert "best so far" not in solution.message and f"{solution.duration:.4g}" not in solution.message
    assert minimum_time_summary(solution)["duration"] is None


def test_the_best_so_far_is_named_where_it_is_a_motion(task):
    late = replace(task, stop=Stop(deadline=0.0))
    solution = answer(late, optimum(late, exceeded=FAST))
    assert solution.status is ad.Status.TIME_LIMIT and "best so far" in solution.message
    assert minimum_time_summary(solution)["duration"] == solution.duration


def test_without_a_motion_there_is_no_worst_to_name(task):
    solution = failed(task, Found((), failed=(Attempt.unbegun(Stop(deadline=0.0), spline(task.problem, []), 40),)), 1.0)
    assert solution.status is ad.Status.TIME_LIMIT and not solution.moves
    assert solution.message == "no motion was found: time limit reached"
