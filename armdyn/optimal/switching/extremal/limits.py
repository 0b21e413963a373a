"""Limits of position that a march exceeds, and touches of them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.arcs.arc import Mode, stretches
from armdyn.optimal.switching.extremal.march import March
from armdyn.optimal.switching.extremal.schedule import Change, Schedule

Array = NDArray[np.float64]

BEYOND = 1e-6
"""What a position limit may be exceeded by before it counts as overlooked [rad or m]."""


def excess(march: March) -> float:
    """By how much limits of position are exceeded at most, at the steps' ends [rad or m]."""
    n, limits = march.setting.problem.robot.nv, march.setting.problem.limits
    q = march.end[:, :n]
    return float(max(np.max(q - limits.position_upper), np.max(limits.position_lower - q)))


def with_limits(march: March) -> Schedule | None:
    """The schedule with touches of the position limits that a march exceeds; None: it exceeds none.

    Where it is exceeded beside a touch of the same limit the joint does not leave: the touch becomes a contact.
    """
    schedule, gone, more = march.schedule, set[int](), list[tuple[float, Change, Array]]()
    for over in _overlooked(march):
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
    return schedule.without_changes(gone).with_changes(more) if more else None


@dataclass(frozen=True)
class _Overlooked:
    """A stretch beyond a limit of position.

    Attributes:
        joint: its number.
        mode: the limit.
        bound: its value [rad or m].
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


def _overlooked(march: March) -> Iterator[_Overlooked]:
    """Where a march is beyond limits of position, joint by joint."""
    limits, t = march.setting.problem.limits, march.times
    for i in range(len(march.schedule.first)):
        q, upper, lower = march.end[:, i], float(limits.position_upper[i]), float(limits.position_lower[i])
        sides = (Mode.POSITION_UPPER, upper, q - upper), (Mode.POSITION_LOWER, lower, lower - q)
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


def state_at(march: March, time: float) -> Array:
    """(q, v) at a time [s], between steps about: Hermite's cubic, and a line."""
    k = int(np.clip(np.searchsorted(march.times, time, side="right") - 1, 0, march.h.size - 1))
    h, n = march.h[k], march.start.shape[1] // 2
    s = float(np.clip((time - march.times[k]) / h, 0, 1)) if h > 0 else 0.0
    a, b = march.start[k], march.end[k]
    q = a[:n] + s**2 * (3 - 2 * s) * (b[:n] - a[:n]) + h * s * (1 - s) * ((1 - s) * a[n:] - s * b[n:])
    return np.concatenate([q, (1 - s) * a[n:] + s * b[n:]])
