"""Singular arcs: where a switching function hovers about zero, a torque of a smooth course takes the place of stays."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.arcs.arc import Mode, stretches
from armdyn.optimal.switching.extremal.change import Change, Segment
from armdyn.optimal.switching.extremal.descent import Extremal
from armdyn.optimal.switching.extremal.limits import state_at
from armdyn.optimal.switching.extremal.march import Setting
from armdyn.optimal.switching.extremal.schedule import Schedule
from armdyn.optimal.switching.extremal.torques.course import Course
from armdyn.optimal.switching.signs import Wrong

Array = NDArray[np.float64]

_APART = 0.05
"""Of the duration: stretches of one joint that are nearer together belong together."""
_FEW, _MANY = 3, 11
"""Coefficients of a course that are fitted to what was there, and at most."""
_MORE = 2
"""Coefficients that come at a time, while the switching function is not zero yet."""
_INSIDE = 0.95
"""Of the way to a limit that such a course may go at first."""
_ON_LIMIT = 0.9
"""Of the way to a limit: a torque of a mesh or of stays that has gone so far is meant to be on it."""
_REACHED = 1e-4
"""Of a torque's range: so near a limit it has reached it."""
_FROM = 0.2
"""Of that by which H must rise off a limit for a stay there: where the stay begins and ends."""
_BEND = 0.05
"""Of a segment: half a stay where the switching function bends."""
_SHORT = 0.05
"""Of a segment: a course that would be shorter beside a stay is left to the stay."""
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
    after = schedule.modes()[inside[-1] + 1][worst.joint]
    more = [(begin, Change(worst.joint, Mode.FREE, course=_course(extremal, worst.joint, (begin, end), _FEW)))]
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
        if change.course and len(change.course.smooth) < _MANY and idle_fall(extremal, k) > least:
            leaping = leaping_within(schedule, change.joint, *schedule.span(Segment(k, schedule.end_of(k))))
            changes[k] = replace(change, course=change.course.longer(_MORE, leaping))
    return replace(schedule, changes=tuple(changes)) if tuple(changes) != schedule.changes else None


def with_stays(extremal: Extremal, least: float) -> Schedule | None:
    """The schedule with stays on limits where free torques are held on them, or meet a jump; None: none is.

    Args:
        extremal: with free torques.
        least: by how much H must rise off a limit.
    """
    schedule, now = extremal.schedule, extremal.schedule
    for k, change in reversed(list(enumerate(schedule.changes))):
        if not change.course:
            continue
        along = _Along.of(extremal, k)
        stays = along.kinked(extremal, least) or along.held(max(least, idle_fall(extremal, k)))
        if stays:
            pieces = _pieces(extremal, k, stays)
            now = now.without_changes([k]).with_changes((t, one, state_at(extremal.march, t)) for t, one in pieces)
    return None if now is schedule else now.without(())


@dataclass(frozen=True, eq=False)
class _Along:
    """A free torque at the starts and ends of its steps in turn.

    Attributes:
        joint: its number.
        t: [s], shape (samples,).
        fall: its switching function times its range: by how much H falls from limit to limit, likewise.
        room: what it is from its upper and its lower limit, as parts of its range, shape (2, samples).
    """

    joint: int
    t: Array
    fall: Array
    room: Array

    @classmethod
    def of(cls, extremal: Extremal, k: int) -> Self:
        """The one that a change begins."""
        march, joint = extremal.march, extremal.schedule.changes[k].joint
        limits = march.setting.problem.limits
        own = np.flatnonzero((march.arc > k) & (march.arc <= extremal.schedule.end_of(k)))
        low, high = limits.actuators.lower[joint], limits.actuators.upper[joint]
        switching = np.column_stack([each[own, joint] for each in np.split(extremal.switching, 2)]).ravel()
        tau = np.column_stack([each[own, joint] for each in march.torques.tau]).ravel()
        t = np.column_stack([march.times[own], march.times[own + 1]]).ravel()
        return cls(joint, t, switching * (high - low), np.array([high - tau, tau - low]) / (high - low))

    def held(self, least: float) -> list[tuple[float, float, Mode]]:
        """Where it is to stay on a limit that it has reached: begin, end [s], and which.

        Args:
            least: by how much H rises off the limit at most.
        """
        out: list[tuple[float, float, Mode]] = []
        for mode, sign, room in ((Mode.UPPER, -1, self.room[0]), (Mode.LOWER, 1, self.room[1])):
            runs = stretches(np.flatnonzero(sign * self.fall > _FROM * least))
            held = [r for r in runs if np.max(sign * self.fall[r]) > least and np.min(room[r]) <= _REACHED]
            out += [(float(self.t[run[0]]), float(self.t[run[-1]]), mode) for run in held]
        return sorted(out)

    def kinked(self, extremal: Extremal, least: float) -> list[tuple[float, float, Mode]]:
        """Where another joint meets a limit of the state, whose pull bends the switching function; likewise.

        No torque takes the bend away: the arc ends before it, or begins after it.
        """
        begin, end = self.t[0], self.t[-1]
        half = _BEND * (end - begin)
        out: list[tuple[float, float, Mode]] = []
        for k in sorted({k for k, _, _ in extremal.march.held_states}):
            time = float(extremal.schedule.times[k])
            fall = self.fall[np.argmin(np.abs(self.t - time))]
            if begin < time < end and abs(fall) > least:
                mode = Mode.LOWER if fall > 0 else Mode.UPPER
                out.append((max(begin, time - half), min(end, time + half), mode))
        return out


def _pieces(extremal: Extremal, k: int, stays: list[tuple[float, float, Mode]]) -> list[tuple[float, Change]]:
    """A segment of a free torque in pieces: stays on limits, and courses between them; with their times."""
    schedule, joint = extremal.schedule, extremal.schedule.changes[k].joint
    now, stop = schedule.span(Segment(k, schedule.end_of(k)))
    few = min(len(schedule.courses[k].smooth), _MANY - _MORE)
    shortest, out = _SHORT * (stop - now), list[tuple[float, Change]]()
    for begin, end, mode in [*stays, (stop, stop, Mode.FREE)]:
        if begin - now > shortest:
            out.append((now, Change(joint, Mode.FREE, course=_course(extremal, joint, (now, begin), few))))
        else:
            begin = now
        if end > begin:
            out.append((begin, Change(joint, mode)))
        now = max(now, end)
    return out


def idle_fall(extremal: Extremal, k: int) -> float:
    """By how much H would fall at worst if the free torque that a change begins went to a limit."""
    schedule, march = extremal.schedule, extremal.march
    joint, limits = schedule.changes[k].joint, march.setting.problem.limits
    own = (march.arc > k) & (march.arc <= schedule.end_of(k))
    falls = [0.0]
    for switching, tau in zip(np.split(extremal.switching, 2), march.torques.tau, strict=True):
        s, u = switching[own, joint], tau[own, joint]
        falls += [
            *(np.maximum(s, 0) * (u - limits.actuators.lower[joint])),
            *(np.maximum(-s, 0) * (limits.actuators.upper[joint] - u)),
        ]
    return float(max(falls))


def leaping_within(schedule: Schedule, joint: int, begin: float, end: float) -> frozenset[int]:
    """Other joints that change between two times [s]."""
    return frozenset(
        change.joint
        for change, time in zip(schedule.changes, schedule.times, strict=True)
        if begin < time < end and change.joint != joint and not change.touch
    )


def _stretch(wrong: list[Wrong], apart: float) -> tuple[float, float]:
    """The worst stretch and those of its joint that join it [s]."""
    own = sorted((one.begin, one.end) for one in wrong if one.joint == wrong[0].joint)
    begin, end = wrong[0].begin, wrong[0].end
    for _ in own:
        near = [one for one in own if one[0] <= end + apart and one[1] >= begin - apart]
        begin, end = min(begin, *(a for a, _ in near)), max(end, *(b for _, b in near))
    return begin, end


def _course(extremal: Extremal, joint: int, ends: tuple[float, float], few: int) -> Course:
    """What comes nearest to a joint's torque between two times [s], with some freedom more.

    Args:
        extremal: its torques.
        joint: its number.
        ends: the two times.
        few: coefficients of the fit.
    """
    march = extremal.march
    t = np.linspace(*ends, _SAMPLES + 2)[1:-1]
    own = np.clip(np.searchsorted(march.times, t, side="right") - 1, 0, march.h.size - 1)
    part = ((t - march.times[own]) / np.where(march.h[own] > 0, march.h[own], 1.0))[:, None]
    first, last = (tau[own] for tau in march.torques.tau)
    leaping = leaping_within(extremal.schedule, joint, *ends)
    return course_near(march.setting, joint, first + part * (last - first), leaping, few).longer(_MORE, leaping)


def course_near(setting: Setting, joint: int, tau: Array, leaping: frozenset[int], few: int = _FEW) -> Course:
    """A short course near a joint's torque, within its limits.

    Args:
        setting: what is marched.
        joint: its number.
        tau: of all joints at even places of the segment [N m], shape (samples, nv).
        leaping: others that change within it.
        few: coefficients of its polynomial.
    """
    limits, unit = setting.problem.limits, setting.course[joint]
    s = np.linspace(0, 1, len(tau) + 2)[1:-1]
    middle, half = limits.actuators.center, limits.actuators.scale
    signs: Array = np.sign(tau - middle) * (np.abs(tau - middle) > _ON_LIMIT * half)
    course = Course((0.0,) * few, tuple((other, (0.0,)) for other in sorted(leaping)))
    terms = course.terms(s, signs)
    fitted = np.linalg.lstsq(terms, (tau[:, joint] - middle[joint]) / unit, rcond=None)[0]
    fitted *= min(1.0, _INSIDE * half[joint] / unit / max(float(np.max(np.abs(terms @ fitted))), 1e-300))
    fitted[0] += middle[joint] / unit
    return course.with_values(fitted)
