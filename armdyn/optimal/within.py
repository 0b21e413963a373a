"""A mesh's solution keeps velocity limits at its knots; slowed down a little it keeps them between knots, too."""

from dataclasses import replace

import numpy as np

from armdyn.dynamics.numeric import forward_dynamics, inverse_dynamics
from armdyn.models.robot import Robot
from armdyn.optimal.aim import led_home
from armdyn.optimal.certificate import LIMIT_TOLERANCE, Certificate, certify, excess
from armdyn.optimal.monitor import Stop
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.optimal.rollout import replay_torques
from armdyn.trajectory import Trajectory

_ROUNDS = 3


def within_velocity_limits(
    problem: MinimumTimeProblem, motion: Trajectory, remark: str, stop: Stop
) -> tuple[Trajectory, Certificate] | None:
    """The same path at a slightly lower speed, so that no velocity limit is exceeded anywhere.

    Time scaled by s > 1 divides velocities by s, and all of a torque but what gravity takes by s²
    (Hollerbach, Dynamic scaling of manipulator trajectories, 1984): where the arm could be held still
    within its torque limits they stay within them.

    Args:
        problem: from rest to rest.
        motion: a mesh's solution, without arcs.
        remark: what there is to say against it already.
        stop: asked where it takes several rounds.

    Returns:
        The motion and its certificate; None if it would exceed another limit, or does not begin and end at rest.
    """
    n = problem.robot.nv
    if np.any(problem.x_start[n:]) or np.any(problem.x_goal[n:]):
        return None
    given, replay = motion, replay_torques(problem.robot, motion)
    for _ in range(_ROUNDS):
        motion = _slowed(problem.robot, motion, 1 + np.max(excess(problem, replay).velocity / problem.limits.velocity))
        replay = replay_torques(problem.robot, motion)
        certificate = certify(problem, replay, None, remark)
        if certificate.limit_violation <= LIMIT_TOLERANCE:
            return motion, certificate
    # Open loop an unstable arm does not follow: feedback makes it.
    motion, replay, _ = led_home(problem, given, stop)
    certificate = certify(problem, replay, None, remark)
    return (motion, certificate) if certificate.limit_violation <= LIMIT_TOLERANCE else None


def _slowed(robot: Robot, motion: Trajectory, factor: float) -> Trajectory:
    """The motion with its time scaled by a factor of about 1."""
    forward, inverse = forward_dynamics(robot), inverse_dynamics(robot)
    rows = zip(motion.q, motion.v, motion.tau, strict=True)
    tau = np.array([inverse(q, v / factor, forward(q, v, torque) / factor**2) for q, v, torque in rows])
    t = factor * motion.t
    for k in np.flatnonzero(np.diff(t) <= 0):  # the two samples of a jump are an ulp apart
        t[k] = np.nextafter(t[k + 1], 0)
    return replace(motion, t=t, v=motion.v / factor, tau=tau)
