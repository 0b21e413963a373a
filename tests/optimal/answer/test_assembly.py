"""Choice of the returned optimum, its success, and its message."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.answer.assembly import assembled, failed
from armdyn.optimal.answer.solution import minimum_time_summary
from armdyn.optimal.constraints.constraint import ConstraintReport, ConstraintReports
from armdyn.optimal.mesh.direct import Attempt
from armdyn.optimal.mesh.search import SearchResult
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.status import Stop, Violation
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import Certificate
from armdyn.optimal.verify.costates import Share
from armdyn.optimal.verify.optimum import Optimum
from problems import paper_problem, solved

FAST = Violation("velocity limit", "joint2", 0.05, 5.6e-4)


@pytest.fixture(scope="module")
def task():
    return Task.of(paper_problem("rr"))


def optimum(task, goal=1e-9, exceeded=None, reasons=(), cost=1.0, worst=None):
    certificate = Certificate(goal, goal, exceeded.value if exceeded else 0.0, exceeded=exceeded)
    checked = ConstraintReports((ConstraintReport("jerk limits", "", None, reasons, worst),))
    motion = replace(solved("rr").trajectory)
    return Optimum(motion, certificate, cost, 40, reports=checked)


def answer(task, *optima, bound=None):
    return assembled(task, list(optima), SearchResult(()), 1.0, bound)


def test_a_limit_that_is_exceeded_is_no_success_and_is_named(task):
    solution = answer(task, optimum(task, exceeded=FAST))
    assert not solution.success and solution.status is ad.Status.LIMIT_EXCEEDED
    assert solution.worst_violation is FAST and solution.moves
    assert "velocity limit of joint 'joint2' exceeded by 0.00056 of it at t = 0.05 s" in solution.message
    assert answer(task, optimum(task, exceeded=replace(FAST, value=9e-7))).success  # the certificate's tolerance


def test_who_keeps_the_limits_comes_before_who_is_faster(task):
    slower = optimum(task, cost=2.0)
    found = answer(task, optimum(task, exceeded=FAST), slower)
    assert found.success and found.certificate.exceeded is None


def test_a_condition_that_is_missed_is_the_worst_violation(task):
    worst = Violation("jerk limit", "joint1", 0.1, 0.4)
    solution = answer(task, optimum(task, reasons=("too jerky",), worst=worst))
    assert solution.status is ad.Status.CONDITION_MISSED and solution.worst_violation is worst
    assert "too jerky" in solution.message and "best so far" not in solution.message


@pytest.mark.parametrize("wrong", [{"goal": 0.3}, {"goal": np.inf}, {"exceeded": replace(FAST, value=0.27)}])
@pytest.mark.parametrize("late", [False, True])
def test_a_failed_motion_has_no_duration(task, wrong, late):
    stopped = replace(task, stop=Stop(deadline=0.0 if late else np.inf))
    solution = answer(stopped, optimum(stopped, **wrong))
    assert not solution.success and not solution.moves
    assert "best so far" not in solution.message and f"{solution.duration:.4g}" not in solution.message
    assert minimum_time_summary(solution)["duration"] is None


def test_the_best_so_far_is_named_where_it_is_a_motion(task):
    late = replace(task, stop=Stop(deadline=0.0))
    assert late.stop  # it was polled, and ended the solve
    solution = answer(late, optimum(late, exceeded=FAST))
    assert solution.status is ad.Status.TIME_LIMIT and "best so far" in solution.message
    assert minimum_time_summary(solution)["duration"] == solution.duration


def test_without_a_motion_there_is_no_worst_to_name(task):
    solution = failed(
        task, SearchResult((), failed=(Attempt.unbegun(Stop(deadline=0.0), spline(task.problem, []), 40),)), 1.0
    )
    assert solution.status is ad.Status.TIME_LIMIT and not solution.moves
    assert solution.message == "no motion was found: time limit reached"


def test_ctrl_c_before_a_motion_is_no_shortcoming(task):
    begun = replace(task, stop=Stop(interrupted=True))
    over = replace(Attempt.unbegun(Stop(), spline(task.problem, []), 40), status=ad.Status.ITERATION_LIMIT)
    solution = failed(begun, SearchResult((), failed=(over,)), 1.0)
    assert solution.status is ad.Status.INTERRUPTED
    assert solution.message == "no motion was found: interrupted" and solution.what_to_do == ()


def test_a_bound_becomes_a_gap_and_may_certify(task):
    plain = answer(task, optimum(task))
    assert plain.lower_bound is plain.gap is None and not plain.gap_proven and not plain.certified
    assert "not proven optimal; no costates" in plain.message
    near = answer(task, optimum(task), bound=plain.duration / 1.0005)
    assert near.gap == pytest.approx(5e-4) and near.gap_proven and near.certified and not near.what_to_do
    assert near.message.endswith("; proven within 0.05 % of the fastest")
    far = answer(task, optimum(task), bound=plain.duration / 1.02)
    assert far.usable and far.gap_proven and not far.certified
    assert "up to 2 % above the lower bound" in far.message


def test_a_bound_on_time_says_nothing_where_effort_is_paid_for(task):
    weighted = Task.of(task.problem.variant(effort_weight=1.0))
    assert answer(weighted, optimum(weighted), bound=1e-3).lower_bound is None


def test_a_motion_that_ends_beside_the_goal_is_not_usable(task):
    near, beside = optimum(task, goal=9e-4), optimum(task, goal=5e-3)
    assert task.problem.landing == 1e-3  # a millimetre at the tip
    assert answer(task, near).usable and not answer(task, beside).usable
    assert answer(task, beside).status is ad.Status.REPLAY_MISSED


def test_deciding_limits_are_by_multipliers_or_arcs(task):
    shares = (Share("velocity limit", "joint2", 0.996),)
    assert answer(task, replace(optimum(task), decides=shares)).decides == shares
    assert answer(task, optimum(task)).decides == ()
    arcs = solved("rr")
    assert answer(task, replace(optimum(task), costates=arcs.costates)).decides == arcs.decides


def test_success_is_a_usable_motion_of_a_solve_that_was_not_stopped(task):
    stopped = replace(task, stop=Stop(interrupted=True))
    solution = answer(stopped, optimum(stopped))
    assert solution.status is ad.Status.INTERRUPTED and solution.usable and not solution.success


def test_the_adjoint_equations_are_checked_on_the_answer(task):
    right = solved("rr")
    candidate = replace(right.certificate, adjoint_error=None)
    arcs = replace(optimum(task), trajectory=right.trajectory, certificate=candidate, phases=right.phases)
    assert answer(task, arcs).certificate.adjoint_error == pytest.approx(right.certificate.adjoint_error, abs=1e-12)
    assert answer(task, arcs).certified
    # Costates that the candidate's |H| and signs were not read from.
    costate = right.phases.costate.copy()
    costate[3] *= 1.01
    wrong = answer(task, replace(arcs, phases=replace(right.phases, costate=costate)))
    assert wrong.usable and not wrong.certified and "adjoint equations" in wrong.message
    # It is not required of other motions than extremals.
    stray = replace(arcs, certificate=replace(candidate, hamiltonian_spread=1.0))
    assert answer(task, stray).certificate.adjoint_error is None


def test_a_certified_motion_as_fast_comes_before_one_that_is_not_certified(task):
    right = solved("rr")
    certified = replace(optimum(task, cost=right.duration), certificate=right.certificate, phases=right.phases)
    stray = replace(right.certificate, hamiltonian_spread=1.0)
    doubtful = replace(optimum(task, cost=right.duration * (1 - 5e-7)), certificate=stray)
    assert answer(task, doubtful, certified).certified
    faster = replace(doubtful, cost=right.duration * (1 - 5e-6))
    assert not answer(task, faster, certified).certified
