"""Options, the solution of an extremal, limits outside its equations, and the comparison."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal import Status
from armdyn.optimal.problem.status import Stop
from armdyn.paper import IndirectOptions, compare_with_direct, solve_indirect
from armdyn.paper.indirect.bang_bang import with_samples
from armdyn.paper.indirect.boundary import BoundaryExtremal, BoundaryProblem
from armdyn.paper.indirect.canonical import canonical_system
from armdyn.paper.indirect.shooting import shoot
from armdyn.paper.indirect.solution import ExtremalSamples, checked, from_arcs, from_extremal
from paper.indirect.carts import cart_bang_bang, cart_guess
from problems import cart

OPTIONS = IndirectOptions()


def cart_problem(**limits):
    return ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], **limits)


def line(problem, status=Status.SOLVED, shift=0.0):
    """From 0 to 2 m in 4 s, at 0.75 m/s in the middle; or that shifted."""
    t = np.linspace(0, 4, 41)
    s = t / 4
    y = np.column_stack([shift + 2 * (3 * s**2 - 2 * s**3), 3 * s * (1 - s), -1 + 0 * t, 2 * s - 1])
    samples = ExtremalSamples(t, y, np.zeros((41, 1)), 0.1 * s, 4.5, status, "converged", 1e-7)
    return checked(problem, OPTIONS, samples, direct=None)


def extremal(problem, y, duration=4.0):
    """A boundary problem of w = 1 without limits, and an extremal of it."""
    none, s = np.array([np.inf]), np.linspace(0, 1, y.shape[1])
    guess = BoundaryExtremal(s, np.ones((4, s.size)), 3.0)
    system = canonical_system(problem.robot)
    boundary = BoundaryProblem(system, problem.x_start, problem.x_goal, 1.0, -none, none, guess, Stop())
    return boundary, BoundaryExtremal(s, y, duration, Status.SOLVED, "converged", 1e-8)


@pytest.mark.parametrize(
    "wrong",
    [{"method": "euler"}, {"intervals": 0}, {"max_nodes": 0}, {"starts": 0}, {"continuations": 0}, {"tolerance": 0.0},
     {"time_limit": -1.0}],
)  # fmt: skip
def test_options_that_make_no_sense_are_refused(wrong):
    with pytest.raises(ProblemError, match=next(iter(wrong))):
        IndirectOptions(**wrong)


def test_a_motion_within_all_limits_is_a_solution():
    found = line(cart_problem())
    assert found.success and found.status is Status.SOLVED
    assert found.message == "4 s; converged"
    assert (found.duration, found.cost, found.residual) == (4.0, 4.5, 1e-7)
    assert found.hamiltonian_spread == 0.1
    assert found.costates.shape == (41, 2) and found.costates[0].tolist() == [-1, -1]


@pytest.mark.parametrize(
    ("limits", "shift", "said"),
    [
        ({"velocity_limit": 0.7}, 0.0, "'slide' leaves its velocity limit by 0.071 of it at t = 2 s"),
        ({"position_limit": (-1.0, 2.1)}, 0.2, "'slide' leaves its position limit by 0.032 of it at t = 4 s"),
        ({"position_limit": (-0.1, 3.0)}, -0.3, "'slide' leaves its position limit by 0.065 of it at t = 0 s"),
    ],
)
def test_a_limit_that_is_left_is_reported(limits, shift, said):
    problem = cart_problem(**limits)
    found = line(problem, shift=shift)
    assert not found.success and found.status is Status.INFEASIBLE
    assert said in found.message and "torque limits only" in found.message
    assert line(problem, Status.FAILED, shift).message == "4 s; converged"  # a failure's message has no more


def test_torque_cost_and_h_of_an_extremal():
    problem = cart_problem(effort_weight=1.0)
    s = np.linspace(0, 1, 11)
    y = np.array([2 * s, 0.5 + 0 * s, -1 + 0 * s, 2 * s - 1])
    boundary, found = extremal(problem, y)
    solution = from_extremal(problem, boundary, found, OPTIONS, None)
    np.testing.assert_allclose(solution.trajectory.tau[:, 0], 1 - 2 * s, atol=1e-15)  # −S/w
    # H = 1 + ½ τ² + ρ_q v + ρ_v τ; J = 4 + ½ ∫ τ² dt, of which the integral over four seconds is 4/3.
    np.testing.assert_allclose(solution.hamiltonian, 1 - (1 - 2 * s) ** 2 / 2 - 0.5, atol=1e-12)
    assert solution.cost == pytest.approx(4 + 2 / 3, rel=1e-12)  # a cubic spline has a parabola's integral


@pytest.mark.parametrize(("value", "duration"), [(np.nan, 4.0), (1.0, -1.0), (1.0, np.nan)])
def test_a_failed_solution_shows_the_guess(value, duration):
    problem = cart_problem(effort_weight=1.0)
    boundary, found = extremal(problem, np.full((4, 7), value), duration)
    solution = from_extremal(problem, boundary, replace(found, status=Status.FAILED), OPTIONS, None)
    assert not solution.success
    assert solution.duration == 3.0 and np.all(solution.trajectory.q == 1)


def test_a_jump_of_the_torque_is_two_samples():
    shooting = cart_bang_bang()
    found = with_samples(shooting, shoot(shooting, cart_guess()))
    solution = from_arcs(cart_problem(), shooting, found, OPTIONS, None)
    assert solution.success and solution.arcs == found.arcs
    t, tau = solution.trajectory.t, solution.trajectory.tau[:, 0]
    assert np.all(np.diff(t) > 0)
    k = int(np.flatnonzero(np.diff(tau))[0])
    assert np.flatnonzero(np.diff(tau)).size == 1 and t[k + 1] == np.nextafter(t[k], np.inf)
    assert solution.cost == solution.duration == pytest.approx(2 * np.sqrt(2), rel=1e-10)
    assert solution.hamiltonian_spread < 1e-9


def test_a_comparison_needs_a_direct_answer():
    with pytest.raises(ProblemError, match="direct="):
        compare_with_direct(line(cart_problem()))


def test_an_answer_differs_from_itself_by_nothing():
    found = solve_indirect(cart_problem())
    beside = compare_with_direct(found)
    same = compare_with_direct(found, found.direct)
    assert beside == same
    assert beside.duration == abs(found.duration / found.direct.duration - 1)
