"""Accelerations and jerks along a replayed motion, and reports on their limits."""

import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.numeric import forward_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.optimal.path_constraints.constraint import ConstraintReport
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.task.policy.landing import PathConstraintPolicy
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_POWERS = {2: "²", 3: "³"}
_POINTS = (1 - np.cos(np.pi * np.arange(5) / 4)) / 2
"""Chebyshev's points of a sample, its ends among them."""
_PLACES = np.linspace(0, 1, 17)
"""Of a sample, at which the polynomial is looked at: 16 parts of the 1e-3 that a sample is of the motion."""
_COEFFICIENTS = np.linalg.inv(np.vander(_POINTS, increasing=True))
_VALUES = np.vander(_PLACES, 5, increasing=True) @ _COEFFICIENTS
_SLOPES = (np.vander(_PLACES, 4, increasing=True) * np.arange(1, 5)) @ _COEFFICIENTS[1:]


def pieces(motion: Trajectory, dense: int = 5) -> tuple[Array, NDArray[np.bool_]]:
    """Times evenly within samples [s], shape (samples between jumps of the torque, dense); which samples those are."""
    steps = np.diff(motion.t)
    flows = ~motion.jumps
    return (motion.t[:-1, None] + steps[:, None] * np.linspace(0, 1, dense))[flows], flows


def accelerations(robot: Robot, motion: Trajectory) -> tuple[Array, Array, Array]:
    """Accelerations and jerks along a replay, between its samples, too.

    Within a sample the torque is linear and the acceleration smooth: it is the polynomial through its values at five
    Chebyshev points, by `pin.aba`. At a sample the jerk has a value on either side.

    Args:
        robot: that moves.
        motion: its replay.

    Returns:
        Times [s], shape (pieces, places), accelerations [rad/s² or m/s²] and jerks [rad/s³ or m/s³] there, each
        of shape (pieces, places, nv).
    """
    function, n = forward_dynamics(robot), robot.nv
    flows = ~motion.jumps
    start, steps = motion.t[:-1][flows], np.diff(motion.t)[flows]
    t = start[:, None] + steps[:, None] * _POINTS
    at = motion(t)
    # At its end a sample's torque is its own, not that after the jump.
    tau = motion.tau[:-1][flows][:, None] + _POINTS[:, None] * np.diff(motion.tau, axis=0)[flows][:, None]
    states = zip(at.q.reshape(-1, n), at.v.reshape(-1, n), tau.reshape(-1, n), strict=True)
    a = np.array([function(*state) for state in states]).reshape(*t.shape, n)
    jerks = _SLOPES @ a / steps[:, None, None]
    return start[:, None] + steps[:, None] * _PLACES, _VALUES @ a, jerks


def kept_by_joints(robot: Robot, what: str, order: int, t: Array, values: Array, limits: Array) -> ConstraintReport:
    """How a derivative of the positions keeps its limits.

    Args:
        robot: whose joints are limited.
        what: is limited: "acceleration".
        order: of the derivative.
        t: when it was looked at [s], of any shape.
        values: what was seen then, of the same shape and (nv,).
        limits: of its size, shape (nv,).
    """
    seen = np.abs(values).reshape(-1, robot.nv)
    k, i = np.unravel_index(np.argmax(seen / limits), seen.shape)
    share, joint, when = float(seen[k, i] / limits[i]), robot.joint_names[i], float(t.ravel()[k])
    unit = f"{'m' if robot.slides[i] else 'rad'}/s{_POWERS[order]}"
    said = f"{seen[k, i]:.5g} of {limits[i]:.5g} {unit} at most, by {joint!r} at t = {when:.4g} s"
    name = f"{what} limits"
    if share <= 1 + PathConstraintPolicy.rate_tolerance:
        return ConstraintReport(name, said, share, order=order)
    reason = f"joint {joint!r} exceeds its {what} limit by {100 * (share - 1):.2g} % at t = {when:.4g} s"
    return ConstraintReport(
        name, said, share, (reason,), Violation(f"{what} limit", joint, when, share - 1), order=order
    )


def tightened_part(part: float, kept: ConstraintReport) -> float:
    """Part of a limit that a program is asked to keep, so that the replay of its next solution keeps the whole.

    Args:
        part: asked for so far.
        kept: how the replay keeps the limit.
    """
    spare = PathConstraintPolicy.rate_spare if kept.reasons else 0.0
    fitting = float(np.clip((1 - spare) * part / max(float(kept.share or 1), 1e-6), PathConstraintPolicy.least_part, 1))
    return fitting if kept.reasons or fitting > part else part
