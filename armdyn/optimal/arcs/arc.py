"""The structure of a motion: which limit every joint is on, and from when to when."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_NEAR = 2e-3
"""How close to a limit, as a part of it, a coarse solution counts as on it: IPOPT's barrier leaves 1e-4."""
_NEAR_SPEED = 2e-2
"""The same for speeds: a constant torque holds a speed only in the mean over its interval."""
_TOUCHING = 1e-4
"""How close to a limit, as a part of the joint's whole way, a position touches it."""
_IN_CONTACT = 5e-3
"""The same for one that is held: a constant torque lets it off a little within every interval."""
SWITCH = 2
"""So many intervals off all limits in a row are a switch; more are an arc of their own."""


class Mode(StrEnum):
    """What determines a joint's torque on an arc."""

    UPPER = "torque upper"
    LOWER = "torque lower"
    VELOCITY_UPPER = "velocity upper"
    VELOCITY_LOWER = "velocity lower"
    POSITION_UPPER = "position upper"
    POSITION_LOWER = "position lower"
    FREE = "free"
    """On no limit: singular, or smooth if effort has a weight."""


BANG = (Mode.UPPER, Mode.LOWER)
VELOCITY = (Mode.VELOCITY_UPPER, Mode.VELOCITY_LOWER)
POSITION = (Mode.POSITION_UPPER, Mode.POSITION_LOWER)


def outward(mode: Mode) -> float:
    """The sign of the limit that a mode holds a state on."""
    return 1.0 if mode in (Mode.VELOCITY_UPPER, Mode.POSITION_UPPER) else -1.0


_TOWARD = {Mode.VELOCITY_UPPER: Mode.UPPER, Mode.VELOCITY_LOWER: Mode.LOWER}
"""The torque that brings a joint to a velocity limit; away from it, the other."""
_OPPOSITE = {Mode.UPPER: Mode.LOWER, Mode.LOWER: Mode.UPPER}


@dataclass(frozen=True)
class Arc:
    """A part of a motion on which no joint changes its mode.

    Attributes:
        duration: [s].
        modes: one per joint.
        touches: joints that touch a position or velocity limit at its end, and do not stay: (joint, mode) pairs.
    """

    duration: float
    modes: tuple[Mode, ...]
    touches: tuple[tuple[int, Mode], ...] = ()

    @property
    def singular(self) -> bool:
        """Some joint is on no limit."""
        return Mode.FREE in self.modes


@dataclass(frozen=True)
class Event:
    """A joint changes its mode, or touches a limit."""

    time: float
    joint: int
    mode: Mode
    touch: bool = False


def detect(problem: MinimumTimeProblem, trajectory: Trajectory, mesh: Array, switch: int = SWITCH) -> list[Arc]:
    """The arcs of a collocation solution with constant torques between its knots.

    Args:
        problem: its limits.
        trajectory: the solution.
        mesh: its knots as parts of the duration.
        switch: so many intervals off all limits in a row are a switch, and not an arc.
    """
    duration, limits, intervals = trajectory.duration, problem.limits, mesh.size - 1
    knots = duration * mesh
    middle = trajectory((knots[:-1] + knots[1:]) / 2)
    at_knots = trajectory(knots)
    centre = (limits.effort_upper + limits.effort_lower) / 2
    level = (middle.tau - centre) / (limits.effort_upper - centre)
    first: list[Mode] = []
    events: list[Event] = []
    for i in range(problem.robot.nv):
        # Constant torque cannot hold a limit exactly: both ends of an interval near it are enough.
        slow = np.minimum(np.abs(at_knots.v[:-1, i]), np.abs(at_knots.v[1:, i]))
        bounds = np.array([limits.position_lower[i], limits.position_upper[i]])
        room = np.min(np.abs(at_knots.q[:, i, None] - bounds), axis=1)
        scale = max(float(np.ptp(at_knots.q[:, i])), 0.1)
        touching = room < _TOUCHING * scale
        near = room < _IN_CONTACT * scale
        contact = touching[:-1] | touching[1:] | (near[:-1] & near[1:])  # one end tells where contact begins or ends
        modes = [
            _mode(level[k, i], slow[k], middle.v[k, i], limits.velocity[i], contact[k], middle.q[k, i], bounds)
            for k in range(intervals)
        ]
        runs = _runs(_without_lifting_off(modes))
        first.append(_first_mode(runs, level[:, i], switch))
        events += _switches(runs, level[:, i], knots, i, switch)
        inner = np.flatnonzero(touching[1:-1]) + 1
        on_limit = [k for k in inner if modes[k] not in POSITION and modes[k - 1] not in POSITION]
        for run in np.split(on_limit, np.flatnonzero(np.diff(on_limit) > 1) + 1):
            if len(run):
                k = int(run[len(run) // 2])
                side = Mode.POSITION_UPPER if at_knots.q[k, i] > np.mean(bounds) else Mode.POSITION_LOWER
                events.append(Event(float(knots[k]), i, side, touch=True))
    return arcs_between(first, events, duration)


def arcs_between(first: Sequence[Mode], events: Sequence[Event], duration: float) -> list[Arc]:
    """Arcs of given length from the modes at the start and what changes them.

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
        arcs.append(Arc(max(t1 - t0, 1e-3 * duration), tuple(modes), touches))
        if event and not event.touch:
            modes[event.joint] = event.mode
    total = sum(arc.duration for arc in arcs)
    return [Arc(arc.duration * duration / total, arc.modes, arc.touches) for arc in arcs]


def without_short(arcs: Sequence[Arc], shortest: float) -> list[Arc]:
    """The same structure when arcs shorter than `shortest` [s] are taken out.

    Between two switches of different joints the order is turned; an arc that a joint enters and
    leaves by the same mode, or that stands at an end, goes; on a limit of a state it
    becomes a touch.
    """
    out = list(arcs)
    k = next((k for k, arc in enumerate(out) if arc.duration < shortest), None)
    if k is None:
        return out
    if out[k].touches or len(out) == 1:
        return [*out[:k], *out[k + 1 :]] if len(out) > 1 else out
    if 0 < k < len(out) - 1:
        before, after = out[k - 1].modes, out[k + 1].modes
        turned = tuple(a if now != b else c for b, now, a, c in zip(before, out[k].modes, before, after, strict=True))
        if before != after and turned not in (before, after, out[k].modes):
            out[k] = Arc(10 * shortest, turned)
            return out
        on_limit = (*POSITION, *VELOCITY)
        met = tuple((i, m) for i, m in enumerate(out[k].modes) if m in on_limit and before[i] is after[i] is not m)
        out[k - 1] = replace(out[k - 1], touches=out[k - 1].touches + met)
    del out[k]
    return merged(out)


def merged(arcs: Sequence[Arc]) -> list[Arc]:
    """Neighbours of the same modes become one arc."""
    out: list[Arc] = []
    for arc in arcs:
        if out and out[-1].modes == arc.modes and not out[-1].touches:
            out[-1] = Arc(out[-1].duration + arc.duration, arc.modes, arc.touches)
        else:
            out.append(arc)
    return out


def _mode(level: float, speed: float, v: float, fastest: float, contact: bool, q: float, bounds: Array) -> Mode:
    if level > 1 - _NEAR:
        return Mode.UPPER
    if level < -1 + _NEAR:
        return Mode.LOWER
    if speed > fastest * (1 - _NEAR_SPEED):
        return Mode.VELOCITY_UPPER if v > 0 else Mode.VELOCITY_LOWER
    if contact:
        return Mode.POSITION_UPPER if q > np.mean(bounds) else Mode.POSITION_LOWER
    return Mode.FREE


def _without_lifting_off(modes: Sequence[Mode]) -> list[Mode]:
    """Between contacts with one limit a free torque is that contact: it costs nothing to bounce a little."""
    out, runs = list(modes), _runs(modes)
    for (before, *_), (mode, start, stop), (after, *_) in zip(runs, runs[1:], runs[2:], strict=False):
        if mode is Mode.FREE and before is after and before in POSITION:
            out[start:stop] = [before] * (stop - start)
    return out


def _runs(modes: Sequence[Mode]) -> list[tuple[Mode, int, int]]:
    """Maximal runs of one mode: (mode, first interval, one past the last)."""
    edges = [0, *(k for k in range(1, len(modes)) if modes[k] is not modes[k - 1]), len(modes)]
    return [(modes[a], a, b) for a, b in pairwise(edges)]


def _is_switch(run: tuple[Mode, int, int], switch: int) -> bool:
    mode, start, stop = run
    return mode is Mode.FREE and stop - start <= switch


def _first_mode(runs: Sequence[tuple[Mode, int, int]], level: Array, switch: int) -> Mode:
    if not _is_switch(runs[0], switch):
        return runs[0][0]
    after = runs[1][0] if len(runs) > 1 else Mode.FREE
    if after in VELOCITY:
        return _TOWARD[after]
    # The switch lies within the first intervals: it must come from the other side.
    return _OPPOSITE.get(after, Mode.UPPER if level[0] > 0 else Mode.LOWER)


def _switches(
    runs: Sequence[tuple[Mode, int, int]], level: Array, knots: Array, joint: int, switch: int
) -> list[Event]:
    """The switches of one joint, each where the mean torque of the intervals around it puts it."""
    events: list[Event] = []
    sign = {Mode.UPPER: 1.0, Mode.LOWER: -1.0}
    mode = _first_mode(runs, level, switch)
    for r, (here, start, stop) in enumerate(runs):
        t0, t1 = float(knots[start]), float(knots[stop])
        if not _is_switch(runs[r], switch):
            if here is not mode:
                if not events or events[-1].time < t0 or events[-1].mode is not here:
                    events.append(Event(t0, joint, here))
                mode = here
            continue
        away = _OPPOSITE[_TOWARD[mode]] if mode in VELOCITY else _OPPOSITE.get(mode, Mode.FREE)
        after = runs[r + 1][0] if r + 1 < len(runs) else away
        if r + 1 < len(runs) and _is_switch(runs[r + 1], switch):
            continue
        part = float(np.mean((level[start:stop] + 1) / 2))  # of the time on the upper limit
        if after is mode:  # there and back: a short arc on the other limit
            if mode not in sign:
                continue
            there = (1 - part) if mode is Mode.UPPER else part
            half = there * (t1 - t0) / 2
            if there > 0.02:
                centre = (t0 + t1) / 2
                events += [Event(centre - half, joint, _OPPOSITE[mode]), Event(centre + half, joint, mode)]
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
