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


def arcs_of(problem: MinimumTimeProblem, motion: Trajectory, numbers: ArcsPolicy) -> tuple[Arc, ...]:
    """The arcs of a mesh's motion, to the mesh's resolution.

    Args:
        problem: the problem with its limits.
        motion: motion with constant torques between its knots, a sample before and one after each.
        numbers: tolerances within which a limit is active, and up to which times off all limits are a switch, not an
            arc.
    """
    apart = np.diff(motion.t) > 1e-12 * motion.duration
    knots = np.append(motion.t[:-1][apart], motion.t[-1])
    middle, at_knots, limits = motion((knots[:-1] + knots[1:]) / 2), motion(knots), problem.limits
    level = (middle.tau - limits.actuators.center) / limits.actuators.scale
    first: list[Mode] = []
    events: list[Event] = []
    for i in range(problem.robot.nv):
        # Constant torque cannot hold a limit exactly: an interval is on it if both its ends are near it.
        slow = np.minimum(np.abs(at_knots.v[:-1, i]), np.abs(at_knots.v[1:, i]))
        bounds = np.array([limits.position_lower[i], limits.position_upper[i]])
        margin = np.min(np.abs(at_knots.q[:, i, None] - bounds), axis=1)
        touching = margin < numbers.touching * max(float(np.ptp(at_knots.q[:, i])), 0.1)
        contact = touching[:-1] | touching[1:]  # one end marks where contact begins or ends
        above = bounds[1] - middle.q[:, i] < middle.q[:, i] - bounds[0]
        fast = slow > limits.velocity[i] * (1 - numbers.near)
        sides = level[:, i] > 1 - numbers.near, level[:, i] < numbers.near - 1
        active = (*sides, fast & (middle.v[:, i] > 0), fast, contact & above, contact)
        modes = [Mode(name) for name in np.select(active, (*BANG, *VELOCITY, *POSITION), Mode.FREE)]
        if limits.passive[i]:
            modes = [Mode.PASSIVE] * len(modes)
        modes = _without_brief(modes, knots, numbers.brief * motion.duration)
        mode, switches = _switches(modes, level[:, i], knots, i, numbers.brief * motion.duration)
        first.append(mode)
        events += switches
        inner = np.flatnonzero(touching[1:-1]) + 1
        on_limit = [k for k in inner if modes[k] not in POSITION and modes[k - 1] not in POSITION]
        for run in runs_of(np.array(on_limit, int)):
            k = int(run[len(run) // 2])
            side = Mode.POSITION_UPPER if at_knots.q[k, i] > np.mean(bounds) else Mode.POSITION_LOWER
            events.append(Event(float(knots[k]), i, side, touch=True))
    return tuple(arcs_between(first, events, motion.duration))


def _runs(modes: Sequence[Mode]) -> list[tuple[Mode, int, int]]:
    """Maximal runs of one mode: (mode, first interval, one past the last)."""
    edges = [0, *(k for k in range(1, len(modes)) if modes[k] is not modes[k - 1]), len(modes)]
    return [(modes[a], a, b) for a, b in pairwise(edges)]


def _without_brief(modes: Sequence[Mode], knots: Array, brief: float) -> list[Mode]:
    """Turn brief contacts into touches, with a switching torque."""
    out = list(modes)
    for mode, start, stop in _runs(modes):
        if mode in POSITION or mode in VELOCITY:
            out[start:stop] = [Mode.FREE if knots[stop] - knots[start] <= brief else mode] * (stop - start)
    return out


def _switches(modes: Sequence[Mode], level: Array, knots: Array, joint: int, brief: float) -> tuple[Mode, list[Event]]:
    """First mode of one joint, and its changes; between limits of the torque by the mean torque of the blur there."""
    runs = _runs(modes)
    settled = [(m, a, b) for m, a, b in runs if m is not Mode.FREE or knots[b] - knots[a] > brief] or runs
    events: list[Event] = []
    for (before, _, start), (after, stop, _) in pairwise(settled):
        if before is after:
            continue
        part = 0.5
        if stop > start and before in BANG and after in BANG:
            upper = float(np.mean((level[start:stop] + 1) / 2))  # part of the time on the upper limit
            part = upper if before is Mode.UPPER else 1 - upper
        events.append(Event(float(knots[start] + part * (knots[stop] - knots[start])), joint, after))
    return settled[0][0], events
