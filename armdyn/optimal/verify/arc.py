"""Arcs: the active limit of every joint over an interval of time; algebra of their sequences."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armdyn.arrays import Array, Index
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
HELD = (*BANG, Mode.PASSIVE)
"""Modes of constant torque."""
VELOCITY = (Mode.VELOCITY_UPPER, Mode.VELOCITY_LOWER)
POSITION = (Mode.POSITION_UPPER, Mode.POSITION_LOWER)
UPPER_LIMITS = (Mode.VELOCITY_UPPER, Mode.POSITION_UPPER)
TOWARDS = {
    Mode.POSITION_UPPER: Mode.UPPER,
    Mode.POSITION_LOWER: Mode.LOWER,
    Mode.VELOCITY_UPPER: Mode.UPPER,
    Mode.VELOCITY_LOWER: Mode.LOWER,
}
"""Torque mode that presses a joint against its limit."""


def runs_of(places: Index) -> list[Index]:
    """Split increasing integers into runs of consecutive ones; empty if there are none."""
    return np.split(places, np.flatnonzero(np.diff(places) > 1) + 1) if places.size else []


def outward(mode: Mode) -> float:
    """Sign of the limit of a mode: 1 for an upper, -1 for a lower one."""
    return 1.0 if mode in UPPER_LIMITS else -1.0


def bang_signs(modes: NDArray[np.str_]) -> Array:
    """1 for the upper torque limit, -1 for the lower one, else 0, of the shape of the modes."""
    return np.asarray(1.0 * (modes == Mode.UPPER) - (modes == Mode.LOWER))


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


def arcs_between(first: Sequence[Mode], events: Sequence[Event], duration: float, least: float = 1e-3) -> list[Arc]:
    """Arcs from the modes at the start and the changes between them.

    Args:
        first: modes at the start, one per joint.
        events: in any order, with times within the motion [s].
        duration: of the whole motion [s].
        least: part of the duration to which shorter arcs are lengthened, for a program with their durations; 0: those
            of no length are left out.
    """
    ordered = sorted(events, key=lambda event: event.time)
    modes, arcs = list(first), []
    times = [0.0, *(event.time for event in ordered), duration]
    for k, (t0, t1) in enumerate(pairwise(times)):
        event = ordered[k] if k < len(ordered) else None
        touches = ((event.joint, event.mode),) if event and event.touch else ()
        length = max(t1 - t0, least * duration)
        if length > 0 or touches:
            arcs.append(Arc(length, tuple(modes), touches))
        if event and not event.touch:
            modes[event.joint] = event.mode
    total = sum(arc.duration for arc in arcs)
    return merged([Arc(arc.duration * duration / total, arc.modes, arc.touches) for arc in arcs])


def without_short(arcs: Sequence[Arc], shortest: float) -> list[Arc]:
    """Remove arcs shorter than `shortest` [s] from a structure.

    Two switches of different joints exchange their order. An arc that a joint enters and leaves by the same mode, or at
    an end of the motion, is removed; on a limit of the state it becomes a touch.
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
    """Merge neighbouring arcs of the same modes."""
    out: list[Arc] = []
    for arc in arcs:
        if out and out[-1].modes == arc.modes and not out[-1].touches:
            out[-1] = Arc(out[-1].duration + arc.duration, arc.modes, arc.touches)
        else:
            out.append(arc)
    return out
