"""Limits of position and velocity that a march exceeds, touches of the former and arcs on the latter."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.arcs.arc import VELOCITY, Mode, stretches
from armdyn.optimal.switching.extremal.change import Change
from armdyn.optimal.switching.extremal.march import March
from armdyn.optimal.switching.extremal.schedule import Schedule

Array = NDArray[np.float64]

BEYOND = 1e-6
"""Largest excess that does not count as overlooked: of a position limit [rad or m], of a velocity limit as a part of
it."""


def excess(march: March) -> float:
    """Largest excess at the steps' ends: of position limits [rad or m], of velocity limits as a part of them."""
    n = march.setting.problem.robot.nv
    over = np.max(np.abs(march.end[:, n:]) / march.setting.problem.limits.velocity) - 1
    return max(beyond_position(march), float(over))


def beyond_position(march: March) -> float:
    """By how much limits of position are exceeded at most, at the steps' ends [rad or m]."""
    n, limits = march.setting.problem.robot.nv, march.setting.problem.limits
    q = march.end[:, :n]
    return float(max(np.max(q - limits.position_upper), np.max(limits.position_lower - q)))


def with_limits(march: March) -> Schedule | None:
    """The schedule with touches of the position limits that a march exceeds; None: it exceeds no limit.

    Where it is exceeded beside a touch of the same limit the joint does not leave: the touch becomes a contact. A joint
    that exceeds its velocity limit is held on it for that time.
    """
    schedule, gone, more = march.schedule, set[int](), list[tuple[float, Change, Array]]()
    for over in _overlooked(march):
        if over.mode in VELOCITY:
            gone.update(over.changes(schedule))
            for time, change in ((over.begin, Change(over.joint, over.mode)), (over.end, over.after(schedule))):
                more.append((time, change, _at_speed(march, time, over.joint, over.bound)))
            continue
        near = [k for k in over.touched(schedule) if k not in gone]
        times = [over.worst, *(float(schedule.times[k]) for k in near)]
        begin, end, i = min(times), max(times), over.joint
        gone.update(near)
        if end > begin:
            after = _mode_after(schedule, i, end)
            more.append((begin, Change(i, over.mode), _on(march, begin, i, over.bound)))
            more.append((end, Change(i, after), _on(march, end, i, over.bound)))
        else:
            more.append((begin, Change(i, over.mode, touch=True), _on(march, begin, i, over.bound)))
    return schedule.without_changes(gone).with_changes(more).without(()) if more else None


@dataclass(frozen=True)
class _Overlooked:
    """A stretch beyond a limit of position or velocity.

    Attributes:
        joint: its number.
        mode: the limit.
        bound: its value [rad or m], of a velocity [rad/s or m/s].
        begin: a step before it [s].
        end: a step after it [s].
        worst: when it is farthest beyond [s].
    """

    joint: int
    mode: Mode
    bound: float
    begin: float
    end: float
    worst: float

    def touched(self, schedule: Schedule) -> list[int]:
        """Touches of the same limit in that time, by their numbers."""
        return [
            k
            for k, (change, time) in enumerate(zip(schedule.changes, schedule.times, strict=True))
            if change.touch
            and (change.joint, change.mode) == (self.joint, self.mode)
            and self.begin <= time <= self.end
        ]

    def changes(self, schedule: Schedule) -> list[int]:
        """Changes of the joint's mode in that time, by their numbers."""
        return [
            k
            for k, (change, time) in enumerate(zip(schedule.changes, schedule.times, strict=True))
            if change.joint == self.joint and not change.touch and self.begin <= time <= self.end
        ]

    def after(self, schedule: Schedule) -> Change:
        """The change to what the joint is in when that time is over."""
        found = Change(self.joint, schedule.first[self.joint])
        for change, time in zip(schedule.changes, schedule.times, strict=True):
            if change.joint == self.joint and not change.touch and time <= self.end:
                found = change
        return found


def _overlooked(march: March) -> Iterator[_Overlooked]:
    """Where a march is beyond limits of position and velocity, joint by joint."""
    limits, t, n = march.setting.problem.limits, march.times, len(march.schedule.first)
    for i in range(n):
        q, upper, lower = march.end[:, i], float(limits.position_upper[i]), float(limits.position_lower[i])
        v, fastest = march.end[:, n + i], float(limits.velocity[i])
        sides = (
            (Mode.POSITION_UPPER, upper, q - upper),
            (Mode.POSITION_LOWER, lower, lower - q),
            (Mode.VELOCITY_UPPER, fastest, v / fastest - 1),
            (Mode.VELOCITY_LOWER, -fastest, -v / fastest - 1),
        )
        for mode, bound, beyond in sides:
            for run in stretches(np.flatnonzero(beyond > BEYOND)):
                worst = float(t[1 + run[np.argmax(beyond[run])]])
                yield _Overlooked(i, mode, bound, float(t[run[0]]), float(t[min(run[-1] + 2, t.size - 1)]), worst)


def _mode_after(schedule: Schedule, joint: int, time: float) -> Mode:
    """What a joint is in at a time [s]."""
    return schedule.modes()[int(np.searchsorted(schedule.times, time, side="right"))][joint]


def _on(march: March, time: float, joint: int, bound: float) -> Array:
    """The state at a time [s], with a joint at rest on its limit."""
    state = state_at(march, time)
    state[joint], state[state.size // 2 + joint] = bound, 0.0
    return state


def _at_speed(march: March, time: float, joint: int, bound: float) -> Array:
    """The state at a time [s], with a joint on its velocity limit."""
    state = state_at(march, time)
    state[state.size // 2 + joint] = bound
    return state


def state_at(march: March, time: float) -> Array:
    """(q, v) at a time [s], between steps about: Hermite's cubic, and a line."""
    k = int(np.clip(np.searchsorted(march.times, time, side="right") - 1, 0, march.h.size - 1))
    h, n = march.h[k], march.start.shape[1] // 2
    s = float(np.clip((time - march.times[k]) / h, 0, 1)) if h > 0 else 0.0
    a, b = march.start[k], march.end[k]
    q = a[:n] + s**2 * (3 - 2 * s) * (b[:n] - a[:n]) + h * s * (1 - s) * ((1 - s) * a[n:] - s * b[n:])
    return np.concatenate([q, (1 - s) * a[n:] + s * b[n:]])
