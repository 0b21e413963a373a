"""Costates against the adjoint equations: right ones are found right, wrong ones wrong."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import armdyn as ad
from armdyn.dynamics.numeric import forward_dynamics, forward_dynamics_derivatives
from armdyn.optimal.verify.certificate import OPTIMALITY_TOLERANCE
from armdyn.optimal.verify.costates import adjoint_error
from armdyn.optimal.verify.rollout import dense, transitions
from problems import cart, luus_problem, paper_problem, solve, solved

NEAR = 1e-6
"""Accuracy of the costates of arcs on torque limits: 1e-7 measured, by integrators of 1e-7."""


def error(solution, **changes):
    """`adjoint_error` of a solution whose phases are changed."""
    return adjoint_error(solution.problem.robot, solution.trajectory, replace(solution.phases, **changes))


def moved(solution, row, column, by):
    """Costates of which one is wrong by enough to change H."""
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
        ad.MinimumTimeProblem(cart().with_friction(0.5, 0.3, 0.1), q_start=[0.0], q_goal=[2.0]),
        paper_problem("rr"),
        pytest.param(luus_problem(), marks=pytest.mark.slow),
    ],
    ids=["cart", "cart, dry friction", "rr", "luus"],
)
def test_the_costates_of_arcs_keep_the_adjoint_equations(problem):
    solution = solve(problem, compile=None if problem.robot.nv > 1 else False)  # its solve takes less time
    assert error(solution) == pytest.approx(solution.certificate.adjoint_error, abs=1e-12)
    assert error(solution) < NEAR


@pytest.mark.parametrize("row", [0, 5, -1])
@pytest.mark.parametrize("column", range(4))
def test_one_wrong_costate_is_caught(row, column):
    solution = solved("rr")
    off = 10 * OPTIMALITY_TOLERANCE
    # The nearest solution of the equations may come to meet it, by a part of it.
    assert 0.3 * off < error(solution, costate=moved(solution, row, column, off)) <= 1.01 * off


def test_costates_of_another_motion_are_caught():
    solution = solved("rr")
    assert error(solution, costate=solution.phases.costate[::-1]) > 0.1
    heavier = paper_problem("rr", 0.12).robot
    assert adjoint_error(heavier, solution.trajectory, solution.phases) > 10 * OPTIMALITY_TOLERANCE


def test_a_replay_that_broke_off_says_nothing():
    solution = solved("rr")
    motion = solution.trajectory
    half = motion.t.size // 2
    short = ad.Trajectory(motion.t[:half], motion.q[:half], motion.v[:half], motion.tau[:half])
    assert adjoint_error(solution.problem.robot, short, solution.phases) == np.inf


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_transitions_are_those_of_differences(friction):
    """A segment's matrix, column by column, against central differences of an adaptive integrator's end states."""
    solution = solved("rr")
    robot = solution.problem.robot.with_friction(damping=friction, friction=friction, width=0.5)
    replay = ad.replay_torques(robot, solution.trajectory)
    acceleration, n, k = forward_dynamics(robot), robot.nv, 3
    h, x = replay.t[k + 1] - replay.t[k], np.concatenate([replay.q[k], replay.v[k]])
    first, last = replay.tau[k], replay.tau_end[k]
    found = transitions(robot, np.array([h]), x[None], np.array([[first, last]]), np.ones(2 * n))

    def rate(time, x):
        return np.concatenate([x[n:], acceleration(x[:n], x[n:], first + time / h * (last - first))])

    def end(x):
        return solve_ivp(rate, (0, h), x, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]

    step = 1e-4  # differences: the integrator's 1e-12 over it, and its square times third derivatives
    slope = np.column_stack([(end(x + d) - end(x - d)) / (2 * step) for d in step * np.eye(2 * n)])
    np.testing.assert_allclose(found[0], slope, atol=1e-6 * np.abs(slope).max())


@pytest.mark.slow
def test_transitions_are_those_of_an_adaptive_integrator():
    """Through the turn of a joint with dry friction, too, where the rates change within a hundredth of the motion."""
    solution = solved("rr")
    robot = solution.problem.robot.with_friction(damping=0.05, friction=0.1, width=1e-2)
    motion, n = ad.replay_torques(robot, dense(solution.trajectory, 400)), robot.nv
    last, size = int(np.searchsorted(motion.t, solution.phases.t[1])), np.repeat([10.0, 1e3], n)
    x, tau = np.concatenate([motion.q, motion.v], axis=1), np.stack([motion.tau[:-1], motion.tau_end], axis=1)
    found = transitions(robot, np.diff(motion.t)[:last], x[:last], tau[:last], size)
    derivatives, acceleration = forward_dynamics_derivatives(robot), forward_dynamics(robot)
    whole, expected, state = np.eye(2 * n), np.eye(2 * n), x[0]
    for k in range(last):
        h = motion.t[k + 1] - motion.t[k]

        def rate(time, flat, k=k, h=h):
            at, moved = flat[: 2 * n], flat[2 * n :].reshape(2 * n, -1)
            torque = tau[k, 0] + time / h * (tau[k, 1] - tau[k, 0])
            _, by_q, by_v, _ = (each[0] for each in derivatives(at[None, :n], at[None, n:], torque[None]))
            down = np.concatenate([moved[n:], by_q @ moved[:n] + by_v @ moved[n:]])
            return np.concatenate([at[n:], acceleration(at[:n], at[n:], torque), down.ravel()])

        start = np.concatenate([state, expected.ravel()])
        end = solve_ivp(rate, (0, h), start, "DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
        state, expected, whole = end[: 2 * n], end[2 * n :].reshape(2 * n, -1), found[k] @ whole
    scale = size / size[:, None]
    np.testing.assert_allclose(whole * scale, expected * scale, atol=1e-7)  # of some tens of segments
    tau[0] = np.nan  # no number of steps converges
    assert transitions(robot, np.diff(motion.t)[:1], x[:1], tau[:1], size) is None
