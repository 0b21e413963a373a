"""Singular arcs: where a switching function hovers about zero, a torque of a smooth course takes the place of stays."""

from dataclasses import replace

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from armdyn.optimal.arcs.arc import Mode
from armdyn.optimal.switching.extremal.descent import Extremal
from armdyn.optimal.switching.extremal.schedule import Change, Schedule
from armdyn.optimal.switching.signs import Wrong, state_at

Array = NDArray[np.float64]

_APART = 0.05
"""Of the duration: stretches of one joint that are nearer together belong together."""
_FEW, _MANY = 5, 11
"""Coefficients of a course at first, and at most: two more where the switching function is not zero yet."""
_FITTED = 3
"""Of them, those that are fitted to the stays."""
_INSIDE = 0.95
"""Of the way to a limit that such a course may go at first."""
_REACHED = 1e-4
"""Of a torque's range: so near a limit it has reached it."""
_STAY = 0.1
"""Of a course that ends on a limit: the stay there that is put in its place at first."""
_SAMPLES = 200
"""Of the stays."""


def with_singular(extremal: Extremal, wrong: list[Wrong]) -> Schedule | None:
    """The schedule with a free torque where the worst joint's switching function hovers; None: it hovers nowhere.

    Args:
        extremal: whose torques are all on limits, or free where no other would be.
        wrong: its stretches on the wrong limit, the worst first.
    """
    schedule, worst = extremal.schedule, wrong[0]
    begin, end = _stretch(wrong, _APART * schedule.duration)
    own = [k for k, change in enumerate(schedule.changes) if change.joint == worst.joint]
    near = 1e-3 * schedule.duration
    inside = [k for k in own if begin - near <= schedule.times[k] <= end + near]
    if not inside or any(schedule.changes[k].touch or schedule.changes[k].mode is Mode.FREE for k in inside):
        return None
    begin = max(min(begin, *schedule.times[inside]), near)
    end = max(end, *schedule.times[inside])
    modes = schedule.modes()
    if any(
        Mode.FREE in each and a < end and b > begin
        for each, a, b in zip(modes, [0.0, *schedule.times], [*schedule.times, schedule.duration], strict=True)
    ):
        return None  # one at a time
    after = modes[inside[-1] + 1][worst.joint]
    more = [(begin, Change(worst.joint, Mode.FREE, course=_course(extremal, worst.joint, begin, end)))]
    if end < schedule.duration - near:
        more.append((end, Change(worst.joint, after)))
    left = schedule.without_changes(inside)
    return left.with_changes((time, change, state_at(extremal.march, time)) for time, change in more)


def with_longer_course(extremal: Extremal, least: float) -> Schedule | None:
    """The schedule with more freedom where a free torque's switching function is not zero; None: each is, or has all.

    Args:
        extremal: with free torques.
        least: by how much H may fall.
    """
    schedule = extremal.schedule
    changes = list(schedule.changes)
    for k, change in enumerate(schedule.changes):
        if change.course and len(change.course) < _MANY and idle_fall(extremal, k) > least:
            changes[k] = replace(change, course=(*change.course, 0.0, 0.0))
    return replace(schedule, changes=tuple(changes)) if tuple(changes) != schedule.changes else None


def with_stays(extremal: Extremal) -> Schedule | None:
    """The schedule with a stay on the limit that a free torque reaches at an end of its course; None: none does."""
    schedule, march = extremal.schedule, extremal.march
    limits, now = march.setting.problem.limits, schedule
    for k, change in reversed(list(enumerate(schedule.changes))):
        if not change.course:
            continue
        joint, end = change.joint, schedule.end_of(k)
        own = np.flatnonzero((march.arc > k) & (march.arc <= end))
        begin, stop = float(march.times[own[0]]), float(march.times[own[-1] + 1])
        edges = march.torques.tau[0][own[0], joint], march.torques.tau[1][own[-1], joint]
        low, high = limits.effort_lower[joint], limits.effort_upper[joint]
        near = _REACHED * (high - low)
        met = [Mode.UPPER if u >= high - near else Mode.LOWER if u <= low + near else None for u in edges]
        modes = schedule.modes()
        around = modes[k][joint], modes[end + 1][joint] if end < schedule.size else None
        stays = [mode if mode is not beside else None for mode, beside in zip(met, around, strict=True)]
        if not any(stays):
            continue
        inner = (
            begin + (_STAY * (stop - begin) if stays[0] else 0.0),
            stop - (_STAY * (stop - begin) if stays[1] else 0.0),
        )
        more = [(inner[0], Change(joint, Mode.FREE, course=_course(extremal, joint, *inner)))]
        if stays[0]:
            more.append((begin, Change(joint, stays[0])))
        if stays[1]:
            more.append((inner[1], Change(joint, stays[1])))
        now = now.without_changes([k]).with_changes((t, one, state_at(march, t)) for t, one in more)
    return None if now is schedule else now


def idle_fall(extremal: Extremal, k: int) -> float:
    """By how much H would fall at worst if the free torque that a change begins went to a limit."""
    schedule, march = extremal.schedule, extremal.march
    joint, limits = schedule.changes[k].joint, march.setting.problem.limits
    own = (march.arc > k) & (march.arc <= schedule.end_of(k))
    falls = [0.0]
    for switching, tau in zip(np.split(extremal.switching, 2), march.torques.tau, strict=True):
        s, u = switching[own, joint], tau[own, joint]
        falls += [
            *(np.maximum(s, 0) * (u - limits.effort_lower[joint])),
            *(np.maximum(-s, 0) * (limits.effort_upper[joint] - u)),
        ]
    return float(max(falls))


def _stretch(wrong: list[Wrong], apart: float) -> tuple[float, float]:
    """The worst stretch and those of its joint that join it [s]."""
    own = sorted((one.begin, one.end) for one in wrong if one.joint == wrong[0].joint)
    begin, end = wrong[0].begin, wrong[0].end
    for _ in own:
        near = [one for one in own if one[0] <= end + apart and one[1] >= begin - apart]
        begin, end = min(begin, *(a for a, _ in near)), max(end, *(b for _, b in near))
    return begin, end


def _course(extremal: Extremal, joint: int, begin: float, end: float) -> tuple[float, ...]:
    """What comes nearest to the stays between two times [s]."""
    march = extremal.march
    t = np.linspace(begin, end, _SAMPLES + 2)[1:-1]
    tau = march.torques.tau[0][np.clip(np.searchsorted(march.times, t, side="right") - 1, 0, march.h.size - 1), joint]
    x, limits = 2 * (t - begin) / (end - begin) - 1, march.setting.problem.limits
    fitted = legendre.legfit(x, tau / march.setting.course[joint], _FITTED - 1)
    middle = (limits.effort_upper[joint] + limits.effort_lower[joint]) / 2 / march.setting.course[joint]
    half = limits.effort_upper[joint] / march.setting.course[joint] - middle
    fitted[0] -= middle
    fitted *= min(1.0, _INSIDE * half / float(np.max(np.abs(legendre.legval(x, fitted)))))
    fitted[0] += middle
    return (*fitted.tolist(), *([0.0] * (_FEW - _FITTED)))
