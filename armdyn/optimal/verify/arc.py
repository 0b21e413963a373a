"""Arcs: the active limit of every joint over an interval of time, and how they are read off a mesh's motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.optimal.problem.policy.refinement import ArcsPolicy
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory


class Mode(StrEnum):
    """Determination of a joint's torque on an arc: by a limit that is active, or freely."""

    UPPER = "torque upper"
    LOWER = "torque lower"
    VELOCITY_UPPER = "velocity upper"
    VELOCITY_LOWER = "velocity lower"
    POSITION_UPPER = "position upper"
    POSITION_LOWER = "position lower"
    FREE = "free"
    """No active limit: a singular torque, or a smooth one if effort has a weight."""
    PASSIVE = "passive"
    """A joint without a motor: its torque is zero throughout."""


BANG = (Mode.UPPER, Mode.LOWER)
OPPOSITE = {Mode.UPPER: Mode.LOWER, Mode.LOWER: Mode.UPPER}
VELOCITY = (Mode.VELOCITY_UPPER, Mode.VELOCITY_LOWER)
POSITION = (Mode.POSITION_UPPER, Mode.POSITION_LOWER)


def runs_of(places: Index) -> list[Index]:
    """Split increasing integers into runs of consecutive ones; empty if there are none."""
    return np.split(places, np.flatnonzero(np.diff(places) > 1) + 1) if places.size else []


@brief
@dataclass(frozen=True)
class Arc:
    """A part of a motion without a change of any joint's mode.

    Attributes:
        duration: [s].
        modes: one per joint.
        touches: joints that touch a position or velocity limit at the arc's end only: (joint, mode) pairs.
    """

    duration: float
    modes: tuple[Mode, ...]
    touches: tuple[tuple[int, Mode], ...] = ()

    @property
    def singular(self) -> bool:
        """Whether some joint has no active limit."""
        return Mode.FREE in self.modes


@dataclass(frozen=True)
class Event:
    """Change of a joint's mode, or a touch of a limit, at one time."""

    time: float
    joint: int
    mode: Mode
    touch: bool = False


def arcs_between(first: Sequence[Mode], events: Sequence[Event], duration: float) -> list[Arc]:
    """Arcs from the modes at the start and the changes between them.

    Args:
        first: modes at the start, one per joint.
        events: in any order, with times within the motion [s].
        duration: of the whole motion [s].
    """
    ordered = sorted(events, key=lambda event: event.time)
    modes, arcs = list(first), []
    times = [0.0, *(event.time for event in ordered), duration]
    for k, (t0, t1) in enumerate(pairwise(times)):
        event = ordered[k] if k < len(ordered) else None
        touches = ((event.joint, event.mode),) if event and event.touch else ()
        if t1 > t0 or touches:
            arcs.append(Arc(t1 - t0, tuple(modes), touches))
        if event and not event.touch:
            modes[event.joint] = event.mode
    return merged(arcs)


def merged(arcs: Sequence[Arc]) -> list[Arc]:
    """Merge neighbouring arcs of the same modes."""
    out: list[Arc] = []
    for arc in arcs:
        if out and out[-1].modes == arc.modes and not out[-1].touches:
            out[-1] = Arc(out[-1].duration + arc.duration, arc.modes, arc.touches)
        else:
            out.append(arc)
    return out


Run = tuple[Mode, int, int]
"""A mode, the first interval on which a joint is in it, and one past the last."""

_TOWARD = {Mode.VELOCITY_UPPER: Mode.UPPER, Mode.VELOCITY_LOWER: Mode.LOWER}
"""Torque mode that brings a joint to a velocity limit; the opposite one leaves the limit."""


def detect(problem: MinimumTimeProblem, trajectory: Trajectory, mesh: Array, numbers: ArcsPolicy) -> list[Arc]:
    """The arcs of a collocation solution with constant torques between its knots.

    Args:
        problem: the problem with its limits.
        trajectory: the solution.
        mesh: knots as parts of the duration.
        numbers: tolerances within which a limit is active, and up to which times off all limits are a switch, not an
            arc.
    """
    duration, limits, intervals = trajectory.duration, problem.limits, mesh.size - 1
    knots = duration * mesh
    middle = trajectory((knots[:-1] + knots[1:]) / 2)
    at_knots = trajectory(knots)
    centre = limits.actuators.center
    level = (middle.tau - centre) / limits.actuators.scale
    first: list[Mode] = []
    events: list[Event] = []
    for i in range(problem.robot.nv):
        # Constant torque cannot hold a limit exactly: an interval is on it if both its ends are near it.
        slow = np.minimum(np.abs(at_knots.v[:-1, i]), np.abs(at_knots.v[1:, i]))
        bounds = np.array([limits.position_lower[i], limits.position_upper[i]])
        margin = np.min(np.abs(at_knots.q[:, i, None] - bounds), axis=1)
        scale = max(float(np.ptp(at_knots.q[:, i])), 0.1)
        touching = margin < numbers.touching * scale
        contact = touching[:-1] | touching[1:]  # one end marks where contact begins or ends
        above = bounds[1] - middle.q[:, i] < middle.q[:, i] - bounds[0]
        fast = slow > limits.velocity[i] * (1 - numbers.near)
        sides = level[:, i] > 1 - numbers.near, level[:, i] < numbers.near - 1
        active = (*sides, fast & (middle.v[:, i] > 0), fast, contact & above, contact)
        modes = [Mode(name) for name in np.select(active, (*BANG, *VELOCITY, *POSITION), Mode.FREE)]
        if limits.passive[i]:
            modes = [Mode.PASSIVE] * intervals
        modes = _without_brief(modes, mesh, numbers.brief)
        runs = _runs(_without_bounces(modes))
        switching = [mode is Mode.FREE and mesh[b] - mesh[a] <= numbers.brief for mode, a, b in runs]
        first.append(_first_mode(runs, level[:, i], switching[0]))
        events += _switches(runs, level[:, i], knots, i, switching)
        inner = np.flatnonzero(touching[1:-1]) + 1
        on_limit = [k for k in inner if modes[k] not in POSITION and modes[k - 1] not in POSITION]
        for run in runs_of(np.array(on_limit, int)):
            k = int(run[len(run) // 2])
            side = Mode.POSITION_UPPER if at_knots.q[k, i] > np.mean(bounds) else Mode.POSITION_LOWER
            events.append(Event(float(knots[k]), i, side, touch=True))
    return arcs_between(first, events, duration)


def arcs_of(problem: MinimumTimeProblem, motion: Trajectory, numbers: ArcsPolicy) -> tuple[Arc, ...]:
    """The arcs of a resolved mesh's motion, to the mesh's resolution.

    Args:
        problem: the problem with its limits.
        motion: motion with constant torques between its knots, a sample before and one after each.
        numbers: tolerances within which a limit is active.
    """
    apart = np.diff(motion.t) > 1e-12 * motion.duration
    knots = np.append(motion.t[:-1][apart], motion.t[-1]) / motion.duration
    return tuple(detect(problem, motion, knots, numbers))


def _without_bounces(modes: Sequence[Mode]) -> list[Mode]:
    """Merge two contacts with one limit and the free torque between them: a small bounce costs no time."""
    out, runs = list(modes), _runs(modes)
    for (before, *_), (mode, start, stop), (after, *_) in zip(runs, runs[1:], runs[2:], strict=False):
        if mode is Mode.FREE and before is after and before in POSITION:
            out[start:stop] = [before] * (stop - start)
    return out


def _runs(modes: Sequence[Mode]) -> list[Run]:
    """Maximal runs of one mode: (mode, first interval, one past the last)."""
    edges = [0, *(k for k in range(1, len(modes)) if modes[k] is not modes[k - 1]), len(modes)]
    return [(modes[a], a, b) for a, b in pairwise(edges)]


def _without_brief(modes: Sequence[Mode], mesh: Array, brief: float) -> list[Mode]:
    """Turn brief contacts into touches, with a switching torque."""
    out = list(modes)
    for mode, start, stop in _runs(modes):
        if mode in POSITION or mode in VELOCITY:
            out[start:stop] = [Mode.FREE if mesh[stop] - mesh[start] <= brief else mode] * (stop - start)
    return out


def _first_mode(runs: Sequence[Run], level: Array, switching: bool) -> Mode:
    if not switching:
        return runs[0][0]
    after = runs[1][0] if len(runs) > 1 else Mode.FREE
    if after in VELOCITY:
        return _TOWARD[after]
    # The switch lies within the first intervals: it must come from the opposite limit.
    return OPPOSITE.get(after, Mode.UPPER if level[0] > 0 else Mode.LOWER)


def _switches(runs: Sequence[Run], level: Array, knots: Array, joint: int, switching: Sequence[bool]) -> list[Event]:
    """Switching times of one joint, by the mean torque of the intervals around each."""
    events: list[Event] = []
    sign = {Mode.UPPER: 1.0, Mode.LOWER: -1.0}
    mode = _first_mode(runs, level, switching[0])
    for r, (here, start, stop) in enumerate(runs):
        t0, t1 = float(knots[start]), float(knots[stop])
        if not switching[r]:
            if here is not mode:
                if not events or events[-1].time < t0 or events[-1].mode is not here:
                    events.append(Event(t0, joint, here))
                mode = here
            continue
        away = OPPOSITE[_TOWARD[mode]] if mode in VELOCITY else OPPOSITE.get(mode, Mode.FREE)
        after = runs[r + 1][0] if r + 1 < len(runs) else away
        part = float(np.mean((level[start:stop] + 1) / 2))  # of the time on the upper limit
        if after is mode:  # back to the same mode: a short arc on the other limit
            if mode not in sign:
                continue
            there = (1 - part) if mode is Mode.UPPER else part
            half = there * (t1 - t0) / 2
            if there > 0.02:
                centre = (t0 + t1) / 2
                events += [Event(centre - half, joint, OPPOSITE[mode]), Event(centre + half, joint, mode)]
            continue
        if mode in sign and after in sign:
            share = part if mode is Mode.UPPER else 1 - part
            events.append(Event(t0 + share * (t1 - t0), joint, after))
        else:
            between = _TOWARD.get(after, away)
            if between in BANG and between is not mode and between is not after:
                events.append(Event(t0 + 0.25 * (t1 - t0), joint, between))
            events.append(Event((t0 + t1) / 2, joint, after))
        mode = after
    return events
