"""Repeatability of a replay by other integrators: segment defects, open-loop growth, replay under feedback.

Without feedback an error of the state grows along the motion, on a heavy arm with light wrists by 10¹⁰ and more. Two
integrators then disagree on the end state, and a replay that lands only shows that the torques were computed by the
same integrator. Reproducible are the segments between samples, and a replay under feedback.
"""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import joint_inertia
from armdyn.errors import TrajectoryError
from armdyn.models.robots.robot import Robot
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.verify.certificate import GOAL_TOLERANCE, Certificate
from armdyn.optimal.verify.limit_violations import worst_violation
from armdyn.optimal.verify.rollout import RTOL, Segments, ticked
from armdyn.trajectory import Trajectory

ACCURACY = RTOL
"""Error [rad or m, and per second] of states by integrators of this relative tolerance, restarted at every sample: ten
times the observed difference of scipy's DOP853 and Radau on segments of the library's arms."""
OPEN_LOOP_GROWTH = 0.1 * GOAL_TOLERANCE / ACCURACY
"""Largest growth of a motion that is checked by its open-loop replay: beyond 1e4, `ACCURACY` times the growth exceeds a
tenth of the replay's tolerance."""
FEEDBACK_BANDWIDTH = 40.0
"""Bandwidth of the feedback [rad/s], 6 Hz: the position loops of industrial arms have 5 to 15 Hz; the library's arms
diverge open loop at 5 to 12 1/s."""
FEEDBACK_TICK = 0.6 / FEEDBACK_BANDWIDTH
"""Longest time for which a correction is held [s]: 15 ms. At 1 over the bandwidth the sampled loop would become
unstable, and arms' controllers run at 100 Hz and more."""

_NEAR = 10 * GOAL_TOLERANCE
"""Largest distance of a state from the motion [rad or m, and per second] under feedback: the first order in the defects
is then exact to its square, 1e-10, times the dynamics' second derivatives."""
_LEFT = "a replay under feedback leaves the motion, and open loop it is unstable"


def repeated(problem: MinimumTimeProblem, motion: Trajectory, certificate: Certificate) -> Certificate:
    """Check a motion by integrating its torques with an integrator of another family.

    Open loop up to `OPEN_LOOP_GROWTH`: the goal errors are the worse of both integrators', plus growth times
    `ACCURACY`. Beyond: those of a replay under feedback, `under_feedback`, which must satisfy the limits, too.

    Args:
        problem: goal and limits.
        motion: states and torques.
        certificate: certificate of the motion's replay by `replay_torques`, or of the motion if it is a replay itself.
    """
    robot, n = problem.robot, problem.robot.nv
    segments = Segments.of(robot, motion)
    judged = replace(certificate, growth=segments.growth, segment_error=segments.largest + ACCURACY)
    error = problem.goal_error_of(motion)
    if segments.growth <= OPEN_LOOP_GROWTH:
        missed = np.abs(error + segments.end()) + segments.growth * ACCURACY
        return replace(
            judged,
            goal_error=max(certificate.goal_error, float(np.max(missed[:n]))),
            goal_velocity_error=max(certificate.goal_velocity_error, float(np.max(missed[n:]))),
        )
    judged = replace(judged, replay="segments")
    followed = under_feedback(robot, problem.limits, motion, segments)
    if followed is None:
        return replace(judged, goal_error=np.inf, goal_velocity_error=np.inf, remark=_LEFT)
    replay, correction = followed
    exceeded = worst_violation(robot, problem.limits, replay)
    if exceeded is None or exceeded.value <= certificate.limit_violation:
        exceeded = certificate.exceeded
    missed = np.abs(problem.goal_error_of(replay)) + ACCURACY
    return replace(
        judged,
        goal_error=float(np.max(missed[:n])),
        goal_velocity_error=float(np.max(missed[n:])),
        limit_violation=exceeded.value if exceeded else certificate.limit_violation,
        exceeded=exceeded,
        correction=float(np.max(correction)),
        correction_share=float(np.max(correction / problem.limits.actuators.scale)),
    )


def under_feedback(
    robot: Robot, limits: JointLimits, motion: Trajectory, segments: Segments
) -> tuple[Trajectory, Array] | None:
    """Replay a motion under computed torque, which is held from tick to tick.

    tau = tau_k(t) − M(q_k) (2 ω (v − v_k) + ω² (q − q_k)) within the torque limits; q_k and v_k are the motion's own
    states at its samples, and at further ticks between samples more than `FEEDBACK_TICK` apart; ω is
    `FEEDBACK_BANDWIDTH`. The states are the motion's own plus the effect of the segments' defects to first order,
    which is exact to rounding for small defects.

    Args:
        robot: the arm.
        limits: limits of the torques.
        motion: states and torques.
        segments: of the motion.

    Returns:
        The replay: states and torques, corrections included, at the ticks, each torque that at the start of its tick;
        and the largest torque that feedback adds to each joint [N m or N], shape (nv,), for the deviations and for
        further ones by `ACCURACY`. None if the replay leaves the motion, because of saturated torques or a large defect
        of a segment.
    """
    try:
        ticks = ticked(robot, motion, FEEDBACK_TICK)
    except TrajectoryError:  # the states overflow between two samples
        return None
    if ticks is not motion:
        segments = Segments.of(robot, ticks)
    n, inertia = robot.nv, joint_inertia(robot)(ticks.q[:-1])
    lower, upper = limits.actuators.range(ticks.q[:-1], ticks.v[:-1])
    lowest = np.minimum(lower - np.minimum(ticks.tau[:-1], ticks.tau[1:]), 0)
    highest = np.maximum(upper - np.maximum(ticks.tau[:-1], ticks.tau[1:]), 0)
    stiffness, damping = FEEDBACK_BANDWIDTH**2, 2 * FEEDBACK_BANDWIDTH
    gains = -np.concatenate([stiffness * inertia, damping * inertia], axis=2)
    delta, correction = np.zeros((ticks.t.size, 2 * n)), np.zeros((ticks.t.size, n))
    for k, state in enumerate(delta[:-1]):
        correction[k] = np.minimum(np.maximum(gains[k] @ state, lowest[k]), highest[k])
        delta[k + 1] = segments.state_transition[k] @ state + segments.forced[k] @ correction[k] + segments.defect[k]
        if not np.max(np.abs(delta[k + 1])) <= _NEAR:
            return None
    unseen = ACCURACY * np.sum(np.abs(gains), axis=2)
    largest = np.max(np.abs(correction[:-1]) + unseen, axis=0)
    x = np.concatenate([ticks.q, ticks.v], axis=1) + delta
    return replace(ticks, q=x[:, :n], v=x[:, n:], tau=ticks.tau + correction), largest
