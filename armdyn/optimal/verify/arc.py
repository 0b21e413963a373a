"""Arcs: the active limit of every joint over an interval of time; algebra of their sequences."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from armdyn.arrays import Index
from armdyn.reprs import brief


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
