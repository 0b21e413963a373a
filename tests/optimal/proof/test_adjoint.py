"""Costates against the adjoint equations: right ones are found right, wrong ones wrong."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import armdyn as ad
from armdyn.dynamics.numeric import forward_dynamics
from armdyn.optimal.landing.rollout import dense
from armdyn.optimal.proof.adjoint import Along, adjoint_error
from armdyn.optimal.proof.certificate import ADJOINT_TOLERANCE
from armdyn.optimal.task.policy.refinement import AdjointPolicy
from problems import cart, luus_problem, paper_problem, solve, solved

FINELY = AdjointPolicy()
NEAR = 1e-6
"""Of what the costates of arcs on torque limits come to: 1e-7 measured, by integrators of 1e-7."""


def error(solution, **changes):
    """`adjoint_error` of a solution whose phases are changed."""
    return adjoint_error(solution.problem.robot, solution.trajectory, replace(solution.phases, **changes), FINELY)


def moved(solution, row, column, by):
    """Costates of which one is wrong by so much as H feels it."""
    size = np.abs(np.hstack([solution.trajectory.v, accelerations(solution)])).max(axis=0)
    costate = solution.phases.costate.copy()
    costate[row, column] += by / size[column]
    return costate


def accelerations(solution):
    motion, acceleration = solution.trajectory, forward_dynamics(solution.problem.robot)
    return np.array([acceleration(*sample) for sample in zip(motion.q, motion.v, motion.tau, strict=True)])


def on_the_rail(**changes):
    return ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], **changes)


@pytest.mark.parametrize(
    "problem",
    [
        on_the_rail(),
        on_the_rail(velocity_limit=0.8),
        ad.MinimumTimeProblem(cart().with_friction(0.5, 0.3, 1e-3), q_start=[0.0], q_goal=[2.0]),
        paper_problem("r", velocity_limit=10.0),
        paper_problem("rr"),
        luus_problem(),
        luus_problem().variant(velocity_limit=1.0),
    ],
    ids=["cart", "cart, speed limit", "cart, dry friction", "r, speed limit", "rr", "luus", "luus, speed limit"],
)
def test_the_costates_of_arcs_keep_the_adjoint_equations(problem):
    solution = solve(problem)
    assert error(solution) == pytest.approx(solution.certificate.adjoint_error, abs=1e-12)
    assert error(solution) < NEAR


@pytest.mark.parametrize("arm", ["r", "rr"])
def test_where_effort_is_paid_for_too(arm):
    solution = solve(paper_problem(arm, effort_weight=1.0, effort_limit=50.0))
    # Torques of the replay are lines between samples, to 1e-6 of what they stand for.
    assert error(solution) < 0.1 * ADJOINT_TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize(
    "limits",
    [{}, {"position_limit": (-np.inf, np.inf)}, {"effort_weight": 1.0, "effort_limit": 30.0}],
    ids=["end stops held", "none", "an end stop touched"],
)
def test_three_links_keep_them_with_pulls_of_end_stops(limits):
    solution = solve(paper_problem("rrr", **limits))
    assert solution.certificate.extremal
    assert error(solution) < 0.5 * ADJOINT_TOLERANCE  # 2e-5 measured at the most


@pytest.mark.parametrize("row", [0, 5, -1])
@pytest.mark.parametrize("column", range(4))
def test_one_wrong_costate_is_caught(row, column):
    solution = solved("rr")
    off = 10 * ADJOINT_TOLERANCE
    # The nearest solution of the equations may come to meet it, by a part of it.
    assert 0.3 * off < error(solution, costate=moved(solution, row, column, off)) <= 1.01 * off


def test_costates_of_another_motion_are_caught():
    solution = solved("rr")
    assert error(solution, costate=solution.phases.costate[::-1]) > 0.1
    heavier = paper_problem("rr", 0.12).robot
    assert adjoint_error(heavier, solution.trajectory, solution.phases, FINELY) > 10 * ADJOINT_TOLERANCE


def test_without_the_pull_of_a_held_limit_the_costates_are_wrong():
    solution = solve(on_the_rail(velocity_limit=0.8))
    phases = solution.phases
    assert (
        error(solution, state_multiplier=0 * phases.state_multiplier, knot_multiplier=0 * phases.knot_multiplier) > 0.1
    )


def test_a_pull_where_no_arc_names_a_limit_does_not_count():
    solution = solved("rr")
    loose = {
        "state_multiplier": solution.phases.state_multiplier + 1.0,
        "knot_multiplier": solution.phases.knot_multiplier + 1.0,
    }
    assert error(solution, **loose) == error(solution)


def test_a_replay_that_broke_off_says_nothing():
    solution = solved("rr")
    motion = solution.trajectory
    half = motion.t.size // 2
    short = ad.Trajectory(motion.t[:half], motion.q[:half], motion.v[:half], motion.tau[:half])
    assert adjoint_error(solution.problem.robot, short, solution.phases, FINELY) == np.inf


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_the_rates_are_those_of_differences(friction):
    """The equations' matrix, column by column, against central differences of forward dynamics along the motion."""
    solution = solved("rr")
    robot = solution.problem.robot.with_friction(damping=friction, friction=friction, width=0.5)
    replay = ad.replay_torques(robot, solution.trajectory)
    along, acceleration, n = Along.of(robot, replay, FINELY), forward_dynamics(robot), robot.nv
    at = np.array([replay.t[3] + 0.4 * (replay.t[4] - replay.t[3])])
    q, v, tau = (each[0] for each in along.states(at))
    step = 1e-6  # differences: rounding 1e-16/1e-6 of accelerations of 1e3, their third derivatives 1e-12

    def rate(x):
        return np.concatenate([x[n:], acceleration(x[:n], x[n:], tau)])

    x = np.concatenate([q, v])
    slope = np.column_stack([(rate(x + d) - rate(x - d)) / (2 * step) for d in step * np.eye(2 * n)])
    np.testing.assert_allclose(along.jacobians(at)[0], -slope.T, rtol=1e-5, atol=1e-5 * np.abs(slope).max())


def test_stretches_are_followed_as_an_adaptive_integrator_does():
    """Through the turn of a joint with dry friction, too, where the rates change within a hundredth of the motion."""
    solution = solved("rr")
    robot = solution.problem.robot.with_friction(damping=0.05, friction=0.1, width=1e-2)
    along = Along.of(robot, ad.replay_torques(robot, dense(solution.trajectory, 400)), FINELY)
    own, ends = along.size.size, solution.phases.t[[0, 1]]
    carried = along.carried(ends, 1e-9)

    def rate(time, flat):
        return (along.jacobians(np.array([time]))[0] @ flat.reshape(own, own)).ravel()

    expected = solve_ivp(rate, ends[::-1], np.eye(own).ravel(), "DOP853", rtol=1e-10, atol=1e-14, max_step=1e-4)
    np.testing.assert_allclose(
        carried[0] * along.size[:, None] / along.size,
        expected.y[:, -1].reshape(own, own) * along.size[:, None] / along.size,
        atol=1e-8,
    )  # ten times what was asked for
    assert along.carried(ends, 0.0) is None  # what cannot be had ends


def test_states_between_samples_are_those_of_a_finer_replay():
    solution = solved("rr")
    robot, motion = solution.problem.robot, solution.trajectory
    coarse, fine = (ad.replay_torques(robot, dense(motion, count)) for count in (100, 1600))
    along = Along.of(robot, coarse, FINELY)
    inner = np.flatnonzero(~np.isclose(fine.t[:, None], coarse.t, rtol=0, atol=1e-9).any(axis=1))[::40]
    assert inner.size > 20
    for k in inner:
        q, v, tau = (each[0] for each in along.states(fine.t[k : k + 1]))
        # Quintics over a hundredth of the motion: (1/100)⁶ of its higher derivatives.
        np.testing.assert_allclose(q, fine.q[k], atol=1e-8)
        np.testing.assert_allclose(v, fine.v[k], atol=1e-5)
        np.testing.assert_array_equal(tau, fine.tau[k])
