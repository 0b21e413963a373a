"""Check of a motion against a controller's conditions, by the differences that the controller takes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from armdyn.arguments import MOST_SAMPLES
from armdyn.arrays import Array
from armdyn.errors import TrajectoryError
from armdyn.files import attributes
from armdyn.models.presets.interface import REST_VELOCITY, UNITS, ControllerLimits, Interface
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory
from armdyn.trajectory.interpolation import INTERPOLATIONS, interpolated
from armdyn.trajectory.planned import Planned

REST = 3
"""Ticks of rest before and after a motion: as many as the third difference reaches back."""


@dataclass(frozen=True, eq=False)
class Commands:
    """Commands of a motion at a controller's ticks; the arm rests before it and after it.

    Attributes:
        t: times of the ticks [s], shape (n,); the `REST` ticks before and after the motion have the times of its ends.
        q: joint positions [rad], shape (n, nv).
        v: joint velocities of the interpolation [rad/s], shape (n, nv).
        tau: joint torques [N m], shape (n, nv); None: unknown.
        ends: velocities [rad/s] and accelerations [rad/s²] at the start and the end, shape (2, 2, nv).
        interpolation: polynomials between the motion's points, a value of `INTERPOLATIONS`.
        sparse: whether points are further apart than ticks.
        rounding: smallest step of positions with a few digits after the point [rad]; 0: they have all of them.
    """

    t: Array
    q: Array
    v: Array
    tau: Array | None
    ends: Array
    interpolation: str
    sparse: bool
    rounding: float


def commands_of(motion: Trajectory | Planned, rate: float) -> Commands:
    """Commands at a rate [Hz] of a motion that `check_points` accepts.

    Raises:
        TrajectoryError: there are too many ticks.
    """
    start, end = float(motion.t[0]), float(motion.t[-1])
    if not (end - start) * rate <= MOST_SAMPLES:
        raise TrajectoryError(f"{end - start:.4g} s at {rate:g} Hz are more than {MOST_SAMPLES} ticks")
    ticks = start + np.arange(-REST, int(np.ceil((end - start) * rate - 1e-9)) + REST + 1) / rate
    at = np.clip(ticks, start, end)
    tau: Array | None
    if isinstance(motion, Trajectory):
        apart = np.append(True, ~motion.jumps)  # of the two sides of a jump of the torque the first
        t, given, tau = motion.t[apart], [motion.q[apart], motion.v[apart]], motion(at).tau
    else:
        t, given = motion.t, [motion.q]
        given += [] if motion.v is None else [motion.v] if motion.a is None else [motion.v, motion.a]
        tau = None if motion.tau is None else interpolated(t, [motion.tau], at)[0]
    q, v, _ = interpolated(t, given, at)
    v[(ticks < start) | (ticks > end)] = 0
    ends = _differences(t, motion.q) if len(given) == 1 else interpolated(t, given, np.array([start, end]))[1:]
    sparse = bool(np.max(np.diff(t)) > 1.5 / rate)
    return Commands(at, q, v, tau, np.stack(ends), INTERPOLATIONS[len(given)], sparse, _rounding(motion.q))


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


def check_points(motion: Trajectory | Planned) -> None:
    """Check times and shapes of a motion.

    Raises:
        TrajectoryError: there are fewer than two points, times do not increase, or arrays do not fit.
    """
    t, q = np.asarray(motion.t), np.asarray(motion.q)
    if t.ndim != 1 or t.size < 2:
        raise TrajectoryError(f"a motion has two points or more; t has shape {t.shape}")
    if np.any(late := np.diff(t) <= 0):
        k = int(np.argmax(late))
        raise TrajectoryError(f"times must increase: t[{k + 1}] is {t[k + 1]:.9g} s after t[{k}] of {t[k]:.9g} s")
    for name in ("q", "v", "tau") if isinstance(motion, Trajectory) else ("q", "v", "a", "tau"):
        array = getattr(motion, name)
        if array is not None and (np.ndim(array) != 2 or np.shape(array) != (t.size, q.shape[-1])):
            raise TrajectoryError(f"{name} has shape {np.shape(array)}; expected ({t.size}, {q.shape[-1]}) as t and q")


TOLERANCE = 1e-6
"""Part of a limit by which a value may exceed it, as in planned motions."""

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
        rows: dict[str, ConditionCheck] = {}
        for row in self.rows:
            if row.condition not in rows or row.share > rows[row.condition].share:
                rows[row.condition] = row
        return tuple(rows.values())

    def facts(self) -> dict[str, object]:
        """The check for JSON."""
        own = attributes(self, "preset", "interface", "rate", "interpolation", "notes")
        return own | {"accepted": self.ok, "conditions": [asdict(row) for row in self.rows]}

    def __str__(self) -> str:
        refused = [row for row in self.offences if row.necessary]
        at = f"{self.preset}, {self.interface} interface at {self.rate:g} Hz"
        return f"{at}: " + (f"refused: {refused[0]}" if refused else "accepted")


def controller_check(
    preset: str, limits: ControllerLimits, interface: Interface, joints: Sequence[str], motion: Trajectory | Planned
) -> ControllerCheck:
    """Check a motion against the conditions of an interface.

    Args:
        preset: name of the preset.
        limits: limits of the controller.
        interface: command interface, with its rate and conditions.
        joints: names of the joints, in the motion's order.
        motion: with one column per joint.

    Raises:
        TrajectoryError: the motion cannot be sampled, or has no torques and the interface takes them.
    """
    commands = commands_of(motion, interface.rate)
    about_torque = [name for name in interface.conditions if name.startswith("torque") and commands.tau is None]
    if interface.name == "torque" and about_torque:
        raise TrajectoryError(f"the motion has no torques, but the torque interface of {preset} takes them")
    notes = [f"not checked, the motion has no torques: {', '.join(about_torque)}"] if about_torque else []
    if commands.interpolation == "linear" and commands.sparse:
        notes.append("the points have positions only: the controller moves straight from one to the next")
    noise = 4 * commands.rounding * interface.rate**3  # of +1, -3, +3, -1, each half a step off
    if "jerk" in interface.conditions and not commands.sparse and noise > 0.1 * np.min(np.asarray(limits.jerk)):
        notes.append(f"positions are rounded to {commands.rounding:g} rad, which alone is {noise:.2g} rad/s³ of jerk")
    rows = [
        row
        for condition in interface.conditions
        if condition not in about_torque
        for row in _rows(condition, limits, interface, joints, commands)
    ]
    return ControllerCheck(preset, interface.name, interface.rate, tuple(rows), commands.interpolation, tuple(notes))


def _rows(
    condition: str, limits: ControllerLimits, interface: Interface, joints: Sequence[str], commands: Commands
) -> Iterator[ConditionCheck]:
    """Check one condition on every joint that has a limit."""
    times, values, bounds, shares = _measured(condition, limits, interface, commands)
    for i, joint in enumerate(joints):
        if not np.any(np.isfinite(bounds[:, i])):
            continue
        k = int(np.argmax(shares[:, i]))
        over = shares[:, i] > 1 + TOLERANCE
        first = int(np.argmax(over)) if np.any(over) else None
        yield ConditionCheck(
            condition=condition,
            necessary=condition in interface.necessary,
            joint=joint,
            value=float(values[k, i]),
            limit=float(bounds[k, i]),
            unit=UNITS[condition],
            time=float(times[k]),
            first=None if first is None else float(times[first]),
            first_value=None if first is None else float(values[first, i]),
            share=float(shares[k, i]),
        )


def _measured(
    condition: str, limits: ControllerLimits, interface: Interface, commands: Commands
) -> tuple[Array, Array, Array, Array]:
    """Times [s], shape (n,); values, limits, and values as parts of the limits [-], each of shape (n, nv)."""
    t, q, rate = commands.t, commands.q, interface.rate
    if condition == "position":
        return _positions(t, q, np.asarray(limits.position_lower), np.asarray(limits.position_upper))
    if condition.startswith("zero_"):
        return _ends(condition, limits, rate, commands)
    if condition.startswith("torque"):
        assert commands.tau is not None  # noqa: S101  # `controller_check` leaves such conditions out
        order, values = int(condition == "torque_rate"), commands.tau
    else:
        order, values = ("position", "velocity", "acceleration", "jerk").index(condition), q
        if interface.name == "velocity":
            order, values = order - 1, commands.v
    values = np.diff(values, n=order, axis=0) * rate**order  # backward: the last of its ticks is its own
    t, last = t[order:], q[max(order - 1, 0) : -1 if order else None]
    bounds = np.broadcast_to(np.asarray(getattr(limits, condition)), values.shape)
    if condition == "velocity" and limits.taper is not None:
        lower, upper = limits.taper.at(last)  # the position of the last command: libfranka's control_loop.cpp
        bounds = np.maximum(np.minimum(bounds, np.where(values < 0, -lower, upper)), REST_VELOCITY)
    return t, values, bounds, np.abs(values) / np.maximum(bounds, 1e-9)


def _positions(t: Array, q: Array, lower: Array, upper: Array) -> tuple[Array, Array, Array, Array]:
    """Check of positions: a share is 0 in the middle of the range, and 1 at its ends."""
    above, below = q - upper, lower - q
    half = (upper - lower) / 2
    shares = np.maximum(0, 1 + np.maximum(above, below) / np.where(np.isfinite(half), half, 1.0))
    return t, q, np.where(above > below, upper, lower), shares


def _ends(
    condition: str, limits: ControllerLimits, rate: float, commands: Commands
) -> tuple[Array, Array, Array, Array]:
    """Check of velocity or acceleration at both ends: at most the allowed change in one tick."""
    order = int(condition == "zero_acceleration")
    values = commands.ends[order]
    change = (limits.acceleration, limits.jerk)[order]
    least = (REST_VELOCITY, REST_ACCELERATION)[order]
    bounds = np.broadcast_to(least if change is None else np.asarray(change) / rate, values.shape)
    from_to = np.array([commands.t[0], commands.t[-1]])
    return from_to, values, bounds, np.abs(values) / bounds
