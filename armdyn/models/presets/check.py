"""Check of a motion against a controller's conditions, by the differences that the controller takes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from armdyn.arguments import MOST_SAMPLES
from armdyn.arrays import Array
from armdyn.errors import TrajectoryError
from armdyn.files import attributes
from armdyn.models.presets.interface import REST_VELOCITY, UNITS, ControllerLimits, Interface
from armdyn.models.values.joint_limits import JointLimits
from armdyn.reprs import brief
from armdyn.trajectory import Samples, Trajectory
from armdyn.trajectory.interpolation import INTERPOLATIONS, KEPT, between_rows, interpolated
from armdyn.trajectory.planned import Planned
from armdyn.trajectory.samples import landed
from armdyn.trajectory.tables import check_times

Measured = tuple[Array, Array, Array, Array]
"""Times [s], shape (n,); values, limits, and values as parts of the limits [-], each of shape (n, nv)."""

REST = 3
"""Ticks of rest before and after a motion: as many as the third difference reaches back."""


@dataclass(frozen=True, eq=False)
class Commands:
    """Commands of a motion at a controller's ticks; before and after it the arm rests, or goes on with its velocity.

    Attributes:
        t: times of the ticks [s], shape (n,); the `REST` ticks before and after the motion have the times of its ends.
        q: joint positions [rad], shape (n, nv).
        v: joint velocities of the interpolation [rad/s], shape (n, nv).
        tau: joint torques [N m], shape (n, nv); None: unknown.
        ends: velocities [rad/s] and accelerations [rad/s²] at the start and the end, shape (2, 2, nv).
        interpolation: polynomials between the motion's points, a value of `INTERPOLATIONS`.
        sparse: whether points are further apart than ticks.
        rounding: smallest step of positions with a few digits after the point [rad]; 0: they have all of them.
        between: times, positions and velocities along the interpolation, see `between_rows`; None: of a motion that
            is commanded at the ticks alone.
        least: the shortest step between points [s], and where it begins [s].
        away: distance of the first point from the present state [rad], shape (nv,); None: unknown.
    """

    t: Array
    q: Array
    v: Array
    tau: Array | None
    ends: Array
    interpolation: str
    sparse: bool
    rounding: float
    between: tuple[Array, Array, Array] | None
    least: tuple[float, float]
    away: Array | None


def commands_of(motion: Trajectory | Samples | Planned, interface: Interface, present: Array | None = None) -> Commands:
    """Commands of a motion that `check_points` accepts.

    Args:
        motion: the motion.
        interface: command interface, with its rate.
        present: joint positions before the motion [rad], shape (nv,); None: unknown.

    Raises:
        TrajectoryError: there are too many ticks.
    """
    start, end, rate = float(motion.t[0]), float(motion.t[-1]), interface.rate
    if not (end - start) * rate <= MOST_SAMPLES:
        raise TrajectoryError(f"{end - start:.4g} s at {rate:g} Hz are more than {MOST_SAMPLES} ticks")
    ticks = start + np.arange(-REST, int(np.ceil((end - start) * rate - 1e-9)) + REST + 1) / rate
    at = np.clip(ticks, start, end)
    tau: Array | None
    if isinstance(motion, Trajectory):
        apart = np.append(True, ~motion.jumps)  # of the two sides of a jump of the torque the first
        t, given, tau = motion.t[apart], [motion.q[apart], motion.v[apart]], motion(at).tau
        for k in (0, -1):
            given[0][k], given[1][k] = landed(motion, k)  # as in all rows of the motion
    else:
        t, given = motion.t, [motion.q]
        given += [] if motion.v is None else [motion.v] if motion.a is None else [motion.v, motion.a]
        tau = None if motion.tau is None else _torques(motion, motion.tau, at)
    q, v, _ = interpolated(t, given, at)
    beyond = (ticks - at)[:, None]
    going = np.where(beyond < 0, *_going(motion))
    q, v = q + beyond * going, np.where(beyond != 0, going, v)
    if len(given) == 1:
        ends = _differences(t, motion.q)
    else:
        ends = given[1][[0, -1]], interpolated(t, given, np.array([start, end]))[2]
    steps = np.diff(t)
    shortest = int(np.argmin(steps))
    return Commands(
        at, q, v, tau, np.stack(ends), INTERPOLATIONS[len(given)],
        sparse=bool(np.max(steps) > 1.5 / rate), rounding=_rounding(motion.q),
        between=between_rows(t, given) if interface.splines or not isinstance(motion, Trajectory) else None,
        least=(float(steps[shortest]), float(t[shortest])),
        away=None if present is None else motion.q[0] - present,
    )  # fmt: skip


def _going(motion: Trajectory | Samples | Planned) -> Array:
    """Velocities that a motion was to start and to end with [rad/s], shape (2, nv), at which the commands go on.

    They are zero of other planners' motions: one that moves at its end is cut off.
    """
    if isinstance(motion, Samples):
        return motion.v[[0, -1]]
    asked = motion.ends[:, 1] if isinstance(motion, Trajectory) and motion.ends is not None else np.zeros(1)
    return np.nan_to_num(np.broadcast_to(asked, (2, motion.q.shape[1])))


def _torques(motion: Samples | Planned, tau: Array, at: Array) -> Array:
    """Torques at some times [N m], held from row to row or on lines, as the rows are meant."""
    if isinstance(motion, Planned) and motion.hold == "linear":
        return interpolated(motion.t, [tau], at)[0]
    return np.asarray(tau[np.searchsorted(motion.t, at, side="right") - 1])


def _rounding(q: Array) -> float:
    """Rounding of the positions: the largest decimal step, 1e-3 to 1e-8 rad, that divides all of them; 0: none."""
    moving = q[:, np.ptp(q, axis=0) > 0]
    for step in (10.0**-digits for digits in range(3, 9)):
        if moving.size and np.allclose(moving / step, np.round(moving / step), rtol=0, atol=1e-4):
            return step
    return 0.0


def _differences(t: Array, q: Array) -> tuple[Array, Array]:
    """Velocities and accelerations at both ends of a motion, by differences of its positions, each of shape (2, nv)."""
    h = np.diff(t)[:, None]
    velocities = np.diff(q, axis=0) / h
    if len(velocities) == 1:
        return velocities[[0, 0]], np.zeros((2, q.shape[1]))
    a = np.diff(velocities, axis=0)[[0, -1]] / ((h[1:] + h[:-1]) / 2)[[0, -1]]
    return velocities[[0, -1]] + np.array([[-1.0], [1.0]]) * a * h[[0, -1]] / 2, a


def check_points(motion: Trajectory | Samples | Planned) -> None:
    """Check times and shapes of a motion.

    Raises:
        TrajectoryError: there are fewer than two points, times do not increase, or arrays do not fit.
    """
    t, q = np.asarray(motion.t), np.asarray(motion.q)
    check_times(t, [q])
    for name in ("q", "v", "tau") if isinstance(motion, Trajectory) else ("q", "v", "a", "tau"):
        array = getattr(motion, name)
        if array is not None and (np.ndim(array) != 2 or np.shape(array) != (t.size, q.shape[-1])):
            raise TrajectoryError(f"{name} has shape {np.shape(array)}; expected ({t.size}, {q.shape[-1]}) as t and q")


TOLERANCE = 1e-6
"""Part of a limit by which a command may exceed it, as in planned motions; along a table it is `KEPT`."""

ALONG = ("position", "velocity")
"""Conditions that hold along the polynomials of a table, too."""

REST_ACCELERATION = 1e-2
"""Acceleration at an end that counts as zero [rad/s²], where no jerk limit bounds the change in one tick."""


@dataclass(frozen=True)
class ConditionCheck:
    """Check of one condition of a controller preset on one joint.

    Attributes:
        condition: name of the condition, a key of `interface.UNITS`.
        necessary: whether a violation stops the motion.
        joint: the joint's name.
        value: the value that is largest as a part of its limit [unit].
        limit: the limit at that time [unit].
        unit: unit of value and limit.
        time: time of the value [s].
        first: time of the first offence [s]; None: the condition is kept.
        first_value: the value at that time [unit]; None: the condition is kept.
        share: the value as a part of the limit [-]; of positions the distance from the middle of the range.
    """

    condition: str
    necessary: bool
    joint: str
    value: float
    limit: float
    unit: str
    time: float
    first: float | None
    first_value: float | None
    share: float

    @property
    def ok(self) -> bool:
        """Whether the condition is kept."""
        return self.first is None

    def __str__(self) -> str:
        text = (
            f"{self.condition} of {self.joint}: {self.value:.5g} of {self.limit:.5g} {self.unit} at {self.time:.4g} s"
        )
        if self.first is None:
            return text
        return f"{text}, first exceeded at {self.first:.4g} s by {self.first_shown} {self.unit}"

    @property
    def first_shown(self) -> str:
        """`first_value` with five digits, or enough to differ from the limit; empty if the condition is satisfied."""
        if self.first_value is None:
            return ""
        candidates = (f"{self.first_value:.{digits}g}" for digits in range(5, 10))
        return next((one for one in candidates if abs(float(one)) != abs(self.limit)), f"{self.first_value:.10g}")


@brief
@dataclass(frozen=True)
class ControllerCheck:
    """Check of a motion against a controller's conditions.

    Attributes:
        preset: name of the preset.
        interface: the commanded quantity.
        rate: commands per second [Hz].
        rows: every condition on every joint, the necessary ones first.
        interpolation: of the positions between the motion's points.
        notes: conditions that were not checked, and why.
    """

    preset: str
    interface: str
    rate: float
    rows: tuple[ConditionCheck, ...]
    interpolation: str
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the controller accepts the motion: every necessary condition is kept."""
        return all(row.ok for row in self.rows if row.necessary)

    @property
    def offences(self) -> tuple[ConditionCheck, ...]:
        """Violated conditions, the necessary ones first, then by time."""
        return tuple(sorted((row for row in self.rows if not row.ok), key=lambda row: (not row.necessary, row.first)))

    @property
    def worst(self) -> tuple[ConditionCheck, ...]:
        """Row of each condition's most critical joint: nearest to its limit, or exceeding it most."""
        conditions = dict.fromkeys(row.condition for row in self.rows)
        of = {name: [row for row in self.rows if row.condition == name] for name in conditions}
        return tuple(max(rows, key=lambda row: row.share) for rows in of.values())

    def facts(self) -> dict[str, object]:
        """The check for JSON."""
        own = attributes(self, "preset", "interface", "rate", "interpolation", "notes")
        return own | {"accepted": self.ok, "conditions": [asdict(row) for row in self.rows]}

    def __str__(self) -> str:
        refused = [row for row in self.offences if row.necessary]
        at = f"{self.preset}, {self.interface} interface at {self.rate:g} Hz"
        return f"{at}: " + (f"refused: {refused[0]}" if refused else "accepted")


def controller_check(
    preset: str, limits: ControllerLimits, interface: Interface, joints: Sequence[str], commands: Commands
) -> ControllerCheck:
    """Check commands against the conditions of an interface.

    Args:
        preset: name of the preset.
        limits: limits of the controller.
        interface: command interface, with its rate and conditions.
        joints: names of the joints, in the motion's order.
        commands: with one column per joint.

    Raises:
        TrajectoryError: the motion has no torques and the interface takes them.
    """
    about_torque = [name for name in interface.conditions if name.startswith("torque") and commands.tau is None]
    if interface.name == "torque" and about_torque:
        raise TrajectoryError(f"the motion has no torques, but the torque interface of {preset} takes them")
    unlimited = [name for name in ALONG if name in interface.conditions and not limits.known(name)]
    unknown = [name for name in ("start",) if name in interface.conditions and commands.away is None]
    reasons = (("the motion has no torques", about_torque), ("no robot says its limits", unlimited),
               ("the present state is not known", unknown))  # fmt: skip
    notes = [f"not checked, {why}: {', '.join(names)}" for why, names in reasons if names]
    if commands.interpolation == "linear" and commands.sparse:
        notes.append("the points have positions only: the controller moves straight from one to the next")
    noise = 4 * commands.rounding * interface.rate**3  # of +1, -3, +3, -1, each half a step off
    if "jerk" in interface.conditions and not commands.sparse and noise > 0.1 * np.min(np.asarray(limits.jerk)):
        notes.append(f"positions are rounded to {commands.rounding:g} rad, which alone is {noise:.2g} rad/s³ of jerk")
    checked = [name for name in interface.conditions if name not in (*about_torque, *unlimited, *unknown)]
    rows = list[ConditionCheck]()
    parts: list[tuple[Measured, float]]
    for condition in checked:
        parts = [(_measured(condition, limits, interface, commands), TOLERANCE)]
        if commands.between is not None and condition in ALONG:
            along = _bounded(condition, limits, *commands.between), KEPT
            if interface.splines:  # in no step with its ticks
                parts = [along]
            elif commands.sparse or np.any(along[0][3] > 1 + KEPT):  # of points a tick apart the commands are shown
                parts.append(along)
        rows += _judged(condition, condition in interface.necessary, joints, parts)
    return ControllerCheck(preset, interface.name, interface.rate, tuple(rows), commands.interpolation, tuple(notes))


def check_table(
    limits: JointLimits, joints: Sequence[str], t: Array, derivatives: Sequence[Array]
) -> tuple[ConditionCheck, ...]:
    """Check a table by an arm's position and velocity limits along the polynomials of a controller, to `KEPT`.

    The one judge of a table: of presets, of `check_motion`, and of exported rows.

    Args:
        limits: of the arm.
        joints: their names.
        t: times of the rows [s], shape (n,), increasing.
        derivatives: positions, and perhaps velocities and accelerations, as of `interpolated`.
    """
    between, own = between_rows(t, derivatives), ControllerLimits().fitted(limits)
    rows = [_judged(name, True, joints, [(_bounded(name, own, *between), KEPT)]) for name in ALONG]
    return tuple(itertools.chain(*rows))


def _judged(
    condition: str, necessary: bool, joints: Sequence[str], parts: Sequence[tuple[Measured, float]]
) -> Iterator[ConditionCheck]:
    """Check one condition on every joint that has a limit, each part of its values with the tolerated excess."""
    for i, joint in enumerate(("all joints",) if condition == "time_step" else joints):
        if not np.any(np.isfinite(parts[0][0][2][:, i])):
            continue
        found, worst = list[tuple[float, float]](), []
        for (times, values, bounds, shares), tolerance in parts:
            k, over = int(np.argmax(shares[:, i])), np.flatnonzero(shares[:, i] > 1 + tolerance)
            worst.append((shares[k, i], values[k, i], bounds[k, i], times[k]))
            found += [(float(times[first]), float(values[first, i])) for first in over[:1]]
        share, value, limit, time = map(float, max(worst))
        first, first_value = min(found, default=(None, None))
        unit = UNITS[condition]
        yield ConditionCheck(condition, necessary, joint, value, limit, unit, time, first, first_value, share)


def _bounded(condition: str, limits: ControllerLimits, t: Array, q: Array, v: Array) -> Measured:
    """Positions or velocities; the share of a position is 0 in the middle of its range, and 1 at the ends."""
    if condition == "position":
        lower, upper = np.asarray(limits.position_lower), np.asarray(limits.position_upper)
        above, below, half = q - upper, lower - q, (upper - lower) / 2
        shares = np.maximum(0, 1 + np.maximum(above, below) / np.where(np.isfinite(half), half, 1.0))
        return t, q, np.where(above > below, upper, lower), shares
    bounds: Array = np.broadcast_to(np.asarray(limits.velocity), v.shape)
    if limits.taper is not None:
        lower, upper = limits.taper.at(q)
        bounds = np.maximum(np.minimum(bounds, np.where(v < 0, -lower, upper)), REST_VELOCITY)
    return t, v, bounds, np.abs(v) / np.maximum(bounds, 1e-9)


def _measured(condition: str, limits: ControllerLimits, interface: Interface, commands: Commands) -> Measured:
    """Values of a condition at the ticks, or at the ends, with their limits."""
    t, q, rate = commands.t, commands.q, interface.rate
    if condition == "position":
        return _bounded(condition, limits, t, q, q)
    if condition.startswith("torque"):
        assert commands.tau is not None  # noqa: S101  # `controller_check` leaves such conditions out
        order, values = int(condition == "torque_rate"), commands.tau
    elif condition in ("velocity", "acceleration", "jerk"):
        order, values = ("position", "velocity", "acceleration", "jerk").index(condition), q
        if interface.name == "velocity":
            order, values = order - 1, commands.v
    else:
        return _once(condition, limits, rate, commands)
    values = np.diff(values, n=order, axis=0) * rate**order  # backward: the last of its ticks is its own
    if condition == "velocity":  # the position of the last command: libfranka's control_loop.cpp
        return _bounded(condition, limits, t[order:], q[max(order - 1, 0) : -1 if order else None], values)
    bounds = np.broadcast_to(np.asarray(getattr(limits, condition)), values.shape)
    return t[order:], values, bounds, np.abs(values) / np.maximum(bounds, 1e-9)


def _once(condition: str, limits: ControllerLimits, rate: float, commands: Commands) -> Measured:
    """A condition that holds at one time, or at both ends: rest there is the allowed change in one tick."""
    (begin, end), (velocities, accelerations), (step, at) = commands.t[[0, -1]], commands.ends, commands.least
    rest = [
        least if change is None else np.asarray(change) / rate
        for change, least in ((limits.acceleration, REST_VELOCITY), (limits.jerk, REST_ACCELERATION))
    ]
    found: dict[str, tuple[Any, Any, Any]] = {
        "zero_velocity": ([begin, end], velocities, rest[0]),
        "zero_acceleration": ([begin, end], accelerations, rest[1]),
        "end_velocity": ([end], velocities[1:], limits.end_velocity),
        "time_step": ([at], step, limits.time_step),
        "start": ([begin], commands.away, limits.start),
    }
    times, values, limit = found[condition]
    values = np.reshape(values, (len(times), -1))
    bounds = np.broadcast_to(np.asarray(limit), values.shape)
    return np.array(times), values, bounds, bounds / values if condition == "time_step" else np.abs(values) / bounds
