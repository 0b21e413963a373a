"""Plausibility checks of a log: units, order of the joints, torques rather than currents, dead channels."""

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import linear_sum_assignment

from armdyn.arrays import Array
from armdyn.errors import LogError
from armdyn.identification.equations import What, mean_regressor, rigid_torques
from armdyn.identification.log import Log, Signals
from armdyn.models.robots.robot import Robot
from armdyn.models.values.spec import Payload

MOVED = 0.02
"""Least travel of a joint for a check of its velocities and torques [rad or m]."""
_BEYOND = 0.1
"""Excess over a position limit that no encoder's offset explains [rad or m]."""
_ALIKE, _UNLIKE = 0.9, 0.5
"""Correlations of equal channels, and of different ones."""
_SCALES = 0.2, 5.0
"""Measured torque as a multiple of the model's: outside it is in another unit. A guessed inertia changes the torque of
the joint with most load by less."""
_STATES = 300
"""Number of states at which a payload's torques are compared with the measured ones."""


def check_log(robot: Robot, log: Log, signals: Signals, what: What) -> None:
    """Raise unless a log fits the arm.

    Args:
        robot: the arm.
        log: its columns in the robot's order.
        signals: of the log.
        what: the unknowns of the identification.

    Raises:
        LogError: names the joint and the likely cause.
    """
    for j, joint in enumerate(robot.joint_names):
        if np.ptp(log.tau[:, j]) == 0 and not robot.limits.passive[j]:
            raise LogError(
                f"{log.name}: the torque of {joint} is constant, {log.tau[0, j]:g}: its channel is dead", joint
            )
    if not np.any(np.ptp(log.q, axis=0) > MOVED):
        raise LogError(f"{log.name}: no joint moves by more than {MOVED:g} rad or m: nothing can be identified")
    _check_positions(robot, log)
    if log.v is not None:
        _check_velocities(robot, log, log.v)
    _check_torques(robot, log, signals, what)


def _check_positions(robot: Robot, log: Log) -> None:
    limits = robot.limits
    for j, joint in enumerate(robot.joint_names):
        low, high = float(log.q[:, j].min()), float(log.q[:, j].max())
        bounds = float(limits.position_lower[j]), float(limits.position_upper[j])
        most = max(abs(low), abs(high))
        endless = not np.all(np.isfinite(bounds))
        if (endless and most < 8 * np.pi) or (bounds[0] - _BEYOND <= low and high <= bounds[1] + _BEYOND):
            continue
        message = f"{log.name}: {joint} is logged from {low:.4g} to {high:.4g}"
        if not robot.slides[j] and most > 2 * np.pi:
            right = f"np.deg2rad(q), or in a table columns named 'q{j + 1} [deg]'"
            raise LogError(f"{message}: these are degrees; positions are radians: {right}", joint)
        unit = "m" if robot.slides[j] else "rad"
        raise LogError(
            f"{message} {unit}, outside its limits [{bounds[0]:.4g}, {bounds[1]:.4g}] {unit}: the joints are in "
            f"another order than {', '.join(robot.joint_names)}, or their zeros differ",
            joint,
        )


def _check_velocities(robot: Robot, log: Log, v: Array) -> None:
    # Means over a twentieth of a second: differences of encoder steps are noise.
    every = max(1, int(0.05 / np.median(np.diff(log.t))))
    way = np.diff(log.q[::every], axis=0)
    summed = np.diff(cumulative_trapezoid(v, log.t, axis=0, initial=0)[::every], axis=0)
    alike = _correlations(summed, way)
    for j, joint in enumerate(robot.joint_names):
        if np.ptp(log.q[:, j]) < MOVED:
            continue
        if np.ptp(v[:, j]) == 0:
            raise LogError(
                f"{log.name}: the velocity of {joint} is constant, but the joint moves: its channel is dead", joint
            )
        other = int(np.argmax(like := alike[j]))
        if like[j] < (_ALIKE if like[other] > _ALIKE else _UNLIKE):
            why = "it is not the derivative of q"
            if like[other] > _ALIKE:
                why = f"it is that of {robot.joint_names[other]}: q and v have different orders of joints"
            raise LogError(f"{log.name}: the velocity of {joint} does not fit its positions: {why}", joint)
        scale = float(summed[:, j] @ way[:, j] / (way[:, j] @ way[:, j]))
        if not 0.5 < scale < 2:
            why = ": degrees per second, where positions are radians" if 40 < scale < 80 else ""
            raise LogError(f"{log.name}: the velocity of {joint} is {scale:.3g} times the derivative of q{why}", joint)


def _check_torques(robot: Robot, log: Log, signals: Signals, what: What) -> None:
    model = rigid_torques(robot, signals.q, signals.v, signals.a)
    rest, expected = (_without_friction(robot, signals.v, one) for one in (signals.tau, model))
    order = np.arange(robot.nv)
    like = _correlations(signals.tau, model)
    own, columns = np.diag(like), linear_sum_assignment(-like)[1]
    moved = np.flatnonzero((columns != order) & (like[order, columns] > _ALIKE) & (own < _UNLIKE))
    if moved.size and not np.all(own < -_UNLIKE):
        order, joint = columns, robot.joint_names[moved[0]]
        error: LogError | None = LogError(
            f"{log.name}: the torque of {joint} is that of {robot.joint_names[columns[moved[0]]]}: the torques' "
            f"joints are in another order than {', '.join(robot.joint_names)}",
            joint,
        )
    else:
        error = _scale_error(robot, log, rest, expected)
    if error is not None and not (what == "payload" and _payload_explains(robot, signals, rest, expected[:, order])):
        raise error


def _scale_error(robot: Robot, log: Log, rest: Array, expected: Array) -> LogError | None:
    """The error of torques in another unit or of another sign, judged by the joint with most load; None: of neither.

    Args:
        robot: the arm.
        log: for its name.
        rest: measured torques without friction [N m or N], shape (n, nv).
        expected: the model's, likewise.
    """
    strongest = int(np.argmax(np.std(expected, axis=0)))
    own = expected[:, strongest]
    scale, joint = float(rest[:, strongest] @ own / (own @ own)), robot.joint_names[strongest]
    message = f"{log.name}: the torque of {joint} is {scale:.3g} times that of the arm's weight and inertia"
    if _correlations(rest[:, [strongest]], own[:, None]) < -_UNLIKE:
        return LogError(f"{message}: its sign is opposite", joint)
    if not _SCALES[0] < scale < _SCALES[1]:
        return LogError(f"{message}: these are currents, or torques at the motor, not at the joint [N m]", joint)
    return None


def _without_friction(robot: Robot, velocity: Array, torque: Array) -> Array:
    """Torques, shape (n, nv, …), after a fit of each joint's friction and offset is subtracted, likewise."""
    rest = np.empty_like(torque)
    for j, v in enumerate(velocity.T):
        friction = np.column_stack([np.ones_like(v), v, np.tanh(v / robot.friction.width)])
        rest[:, j] = torque[:, j] - friction @ np.linalg.lstsq(friction, torque[:, j], rcond=1e-9)[0]
    return rest


def _payload_explains(robot: Robot, signals: Signals, rest: Array, expected: Array) -> bool:
    """Whether a payload at the tip explains the torques better than multiples of the model's torques do.

    Args:
        robot: the arm.
        signals: of the log.
        rest: measured torques without friction [N m or N], shape (n, nv).
        expected: the model's, likewise, in the order of the joints that the log seems to have.
    """
    at = slice(None, None, max(1, len(rest) // _STATES))
    q, v, a = signals.q[at], signals.v[at], signals.a[at]
    size = np.std(rest, axis=0)
    scales = np.sum(rest * expected, axis=0) / np.sum(expected**2, axis=0)
    scaled = (rest - scales * expected)[at] / size
    body = 10 * (robot.frame_of(Payload(mass=0)).parentJoint - 1)
    columns = _without_friction(robot, v, mean_regressor(robot, q, v, a, 1)[:, :, body : body + 10])
    carried = _without_friction(robot, v, signals.tau[at] - rigid_torques(robot, q, v, a)) / size
    matrix = (columns / size[:, None]).reshape(-1, 10)
    carried = carried.ravel() - matrix @ np.linalg.lstsq(matrix, carried.ravel(), rcond=1e-9)[0]
    return bool(np.linalg.norm(carried) < np.linalg.norm(scaled))


def _correlations(one: Array, other: Array) -> Array:
    """Of each column of one with each of the other, shape (k, m); 0 of a constant one."""
    one, other = (values - np.mean(values, axis=0) for values in (one, other))
    sizes = np.outer(np.linalg.norm(one, axis=0), np.linalg.norm(other, axis=0))
    return np.asarray(one.T @ other / np.maximum(sizes, 1e-300))
