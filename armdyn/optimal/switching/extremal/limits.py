"""Limits of position that a march exceeds, and touches of them."""

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
    limits, schedule = march.setting.problem.limits, march.schedule
    gone, more = set[int](), list[tuple[float, Change, Array]]()
    for i in range(len(schedule.first)):
        q = march.end[:, i]
        for mode, beyond, bound in (
            (Mode.POSITION_UPPER, q - limits.position_upper[i], limits.position_upper[i]),
            (Mode.POSITION_LOWER, limits.position_lower[i] - q, limits.position_lower[i]),
        ):
            for run in stretches(np.flatnonzero(beyond > BEYOND)):
                begin, end = march.times[run[0]], march.times[min(run[-1] + 2, march.times.size - 1)]
                near = [
                    k
                    for k, change in enumerate(schedule.changes)
                    if change.touch and change.joint == i and change.mode is mode
                    and begin <= schedule.times[k] <= end and k not in gone
                ]  # fmt: skip
                worst = float(march.times[1 + run[np.argmax(beyond[run])]])
                times = [worst, *(float(schedule.times[k]) for k in near)]
                gone.update(near)
                if near and max(times) > min(times):
                    after = _mode_after(schedule, i, max(times))
                    more.append((min(times), Change(i, mode), _on(march, min(times), i, bound)))
                    more.append((max(times), Change(i, after), _on(march, max(times), i, bound)))
                else:
                    more.append((worst, Change(i, mode, touch=True), _on(march, worst, i, bound)))
    return schedule.without_changes(gone).with_changes(more) if more else None


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
