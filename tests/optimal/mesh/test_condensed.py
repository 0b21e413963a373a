from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.mesh.condensed import guess_jobs, solve_quickly
from armdyn.optimal.mesh.direct import solve_on_mesh
from armdyn.optimal.mesh.starts import Guesses, spline
from armdyn.optimal.problem.options import Scheme, SolverSettings
from armdyn.optimal.problem.status import Stop
from armdyn.optimal.problem.task import Task
from problems import luus_problem, paper_problem

TIGHT = SolverSettings(1e-9, 500, barrier=1e-2)
CONSTANT = Scheme("constant")


def solve_condensed(task, guess, intervals, settings):
    """Without limits between the knots, as in the search."""
    (job,) = guess_jobs(task, Guesses.of(guess), [(intervals, settings)])
    return job(task)


def solve(solver, problem, guess=None, intervals=20, options=TIGHT, stop=None):
    return solver(task(problem, stop), guess or spline(problem, []), intervals, options)


def task(problem, stop=None):
    return replace(Task.of(problem, stop=stop), scheme=CONSTANT)


@pytest.mark.parametrize("weight", [0.0, 0.01])
@pytest.mark.parametrize("arm", ["r", "rr", "rrr"])
def test_same_solution_as_with_all_unknowns(arm, weight):
    problem = paper_problem(arm, effort_weight=weight)
    full = solve(solve_on_mesh, problem)
    condensed = solve(solve_condensed, problem, guess=full.trajectory)
    assert full.status is condensed.status is ad.Status.SOLVED
    # Both to IPOPT's 1e-9 in the scaled problem; states and torques follow by the square root at the optimum.
    assert condensed.trajectory.duration == pytest.approx(full.trajectory.duration, rel=1e-6)
    np.testing.assert_array_equal(
        condensed.trajectory.t.shape, full.trajectory.t.shape
    )  # knots, middles, and the jumps of constant torques
    np.testing.assert_allclose(condensed.trajectory.q, full.trajectory.q, atol=2e-5)
    np.testing.assert_allclose(condensed.trajectory.v, full.trajectory.v, atol=2e-3)


def test_payload_is_a_parameter():
    light, heavy = (paper_problem("rr", mass) for mass in (0.0212, 0.2))
    durations = [solve(solve_condensed, problem, intervals=40).trajectory.duration for problem in (light, heavy)]
    # The straight guess's optima; reference.json's best are 0.17824 and 0.23883.
    assert durations[0] == pytest.approx(0.1790, abs=2.5e-3)
    assert durations[1] == pytest.approx(0.2394, abs=2.5e-3)


def test_limits_between_knots_are_kept_in_the_end():
    problem = paper_problem("rr", velocity_limit=12.0)
    fastest = [
        np.max(np.abs(solve(solver, problem, intervals=10).trajectory.v)) for solver in (solve_condensed, solve_quickly)
    ]
    assert fastest[0] > 12.01  # in the middle of an interval: else this test says nothing
    assert fastest[1] <= 12 * (1 + 1e-7)  # IPOPT relaxes bounds by 1e-8 of the scaled problem


def test_quick_solution_goes_on_from_the_condensed_one():
    problem = luus_problem()
    quick, condensed = solve(solve_quickly, problem), solve(solve_condensed, problem)
    assert quick.trajectory.duration == condensed.trajectory.duration
    assert quick.iterations == condensed.iterations


def test_refused_if_it_cannot_be_condensed():
    plain = paper_problem("rr")
    assert task(plain).policy.program.condensed
    assert not task(paper_problem("rr", acceleration_limit=100.0)).policy.program.condensed
    assert not task(paper_problem("rr", via=([0.0, 0.5],))).policy.program.condensed


def test_failure_names_the_worst_equation_and_the_blocking_limit():
    problem = paper_problem("rr")
    early = solve(solve_condensed, problem, options=replace(TIGHT, max_iterations=3))
    assert early.status is ad.Status.ITERATION_LIMIT
    violation = early.worst_violation
    assert violation.constraint.endswith("defect") and violation.joint in problem.robot.joint_names
    assert 0 <= violation.time <= early.trajectory.duration and violation.value > TIGHT.tolerance
    assert solve(solve_condensed, problem, stop=Stop(interrupted=True)).status is ad.Status.INTERRUPTED
    assert solve(solve_condensed, problem, stop=Stop(deadline=0.0)).status is ad.Status.TIME_LIMIT
