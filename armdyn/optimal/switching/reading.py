"""From arcs of a mesh to schedules: short stretches off all limits are stays, long ones may be singular arcs."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.arcs.arc import Arc, Mode, stretches
from armdyn.optimal.switching.extremal.march import Setting
from armdyn.optimal.switching.extremal.schedule import Change, Schedule, Segment, banged, shares_of
from armdyn.optimal.switching.singular import course_near, leaping_within
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_LONG = 0.05
"""Of the duration: a stretch off all limits that is shorter is read as stays alone."""
_FIRST = 1e-3
"""Of the duration: a stay at the start, before the first course."""
_SAMPLES = 100
"""Of the torques along a stretch."""


def schedules_of(setting: Setting, arcs: Sequence[Arc], motion: Trajectory) -> Iterator[Schedule]:
    """Schedules to begin with: all torques full, then long stretches off all limits as singular arcs, if there are any.

    Args:
        setting: what will be marched.
        arcs: of a mesh.
        motion: its states and torques.
    """
    shares = shares_of(setting.problem, arcs, motion)
    yield Schedule.of(banged(arcs, shares), motion)
    left = _long_stretches(arcs)
    if np.any(left):
        yield _with_courses(setting, Schedule.of(banged(arcs, shares, left), motion), motion)


def _long_stretches(arcs: Sequence[Arc]) -> NDArray[np.bool_]:
    """Which joints are in which arcs on a long stretch off all limits, shape (arcs, nv)."""
    free = np.array([[mode is Mode.FREE for mode in arc.modes] for arc in arcs])
    lengths = np.array([arc.duration for arc in arcs])
    for i in range(free.shape[1]):
        for run in stretches(np.flatnonzero(free[:, i])):
            free[run, i] = lengths[run].sum() > _LONG * lengths.sum()
    return free


def _with_courses(setting: Setting, schedule: Schedule, motion: Trajectory) -> Schedule:
    """The schedule with courses for its free torques, each begun by a change."""
    starting = [i for i, mode in enumerate(schedule.first) if mode is Mode.FREE]
    if starting:
        begin = _FIRST * schedule.duration
        at = motion(np.array([begin * motion.duration / schedule.duration]))
        first = [_nearest(setting, i, at.tau[0]) if i in starting else mode for i, mode in enumerate(schedule.first)]
        state = np.concatenate([at.q[0], at.v[0]])
        schedule = replace(schedule, first=tuple(first))
        schedule = schedule.with_changes((begin, Change(i, Mode.FREE), state) for i in starting)
    changes = list(schedule.changes)
    for k, change in enumerate(changes):
        if change.mode is not Mode.FREE:
            continue
        begin, end = schedule.span(Segment(k, schedule.end_of(k)))
        t = np.linspace(begin, end, _SAMPLES + 2)[1:-1] * (motion.duration / schedule.duration)
        leaping = leaping_within(schedule, change.joint, begin, end)
        changes[k] = replace(change, course=course_near(setting, change.joint, motion(t).tau, leaping))
    return replace(schedule, changes=tuple(changes))


def _nearest(setting: Setting, joint: int, tau: Array) -> Mode:
    """The limit that a joint's torque is nearer to."""
    limits = setting.problem.limits
    return Mode.UPPER if tau[joint] > limits.actuators.center[joint] else Mode.LOWER
