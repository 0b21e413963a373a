"""Switching structure: the active limit of every joint over time, and the states at the changes."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.arcs.arc import VELOCITY, Arc, Mode, merged
from armdyn.optimal.switching.extremal.change import Change, Segment, SingularControl
from armdyn.trajectory import Trajectory

StructureKey = tuple[tuple[Mode, ...], tuple[tuple[int, Mode, bool], ...]]


@dataclass(frozen=True, eq=False)
class SwitchingStructure:
    """Modes of all joints over time.

    Attributes:
        first: modes at the start, one per joint.
        changes: changes in the order of their times.
        times: times of the changes [s], shape (m,), increasing.
        states: initial states (q, v) of the arcs after the changes, shape (m, 2 nv).
        duration: duration of the motion [s].
    """

    first: tuple[Mode, ...]
    changes: tuple[Change, ...]
    times: Array
    states: Array
    duration: float

    @classmethod
    def of(cls, arcs: Sequence[Arc], motion: Trajectory) -> Self:
        """Make a structure from arcs, with states from a motion.

        Args:
            arcs: arcs without singular torques.
            motion: motion of about the arcs' total duration.
        """
        changes: list[Change] = []
        times: list[float] = []
        t = 0.0
        for here, after in pairwise(arcs):
            t += here.duration
            events = [Change(i, mode, touch=True) for i, mode in here.touches]
            events += [Change(i, b) for i, (a, b) in enumerate(zip(here.modes, after.modes, strict=True)) if a is not b]
            changes += events
            times += [t] * len(events)
        duration = t + arcs[-1].duration
        at = motion(np.array(times) * (motion.duration / duration))
        return cls(arcs[0].modes, tuple(changes), np.array(times), np.hstack([at.q, at.v]), duration)

    @property
    def key(self) -> StructureKey:
        """Modes at the start and all changes in order, without their times."""
        return self.first, tuple((each.joint, each.mode, each.touch) for each in self.changes)

    @property
    def size(self) -> int:
        """m, the number of changes."""
        return len(self.changes)

    @property
    def controls(self) -> dict[int, SingularControl]:
        """Singular controls of free torques, by the index of the change at their beginning."""
        return {k: change.control for k, change in enumerate(self.changes) if change.control}

    @property
    def unknowns(self) -> Array:
        """Times of the changes, the duration [s], and the singular controls of free torques, shape (width,)."""
        return np.concatenate([self.times, [self.duration], *(control.values for control in self.controls.values())])

    @property
    def width(self) -> int:
        """Number of unknowns: m + 1 plus the singular controls' coefficients."""
        return self.size + 1 + sum(control.size for control in self.controls.values())

    @property
    def places(self) -> dict[int, slice]:
        """Columns of the singular controls in the unknowns, by the index of the change at their beginning."""
        sizes = [control.size for control in self.controls.values()]
        ends = self.size + 1 + np.cumsum([0, *sizes])
        return {k: slice(a, b) for k, (a, b) in zip(self.controls, pairwise(ends.tolist()), strict=True)}

    def modes(self) -> list[tuple[Mode, ...]]:
        """Modes of all joints on each of the m + 1 arcs."""
        now, out = list(self.first), [self.first]
        for change in self.changes:
            if not change.touch:
                now[change.joint] = change.mode
            out.append(tuple(now))
        return out

    def moved(self, by: Array, states: Array, in_order: bool = True) -> Self:
        """The structure with other times, singular controls and states.

        Args:
            by: step of the unknowns, shape (width,).
            states: states at the changes, shape (m, 2 nv).
            in_order: whether to sort the changes by their times.
        """
        m, changes, places = self.size, list(self.changes), self.places
        times = self.times + by[:m]
        for k, control in self.controls.items():
            changes[k] = replace(changes[k], control=control.with_values(control.values + by[places[k]]))
        order = np.argsort(times, kind="stable") if in_order else np.arange(m)
        moved = tuple(changes[k] for k in order)
        return type(self)(self.first, moved, times[order], states[order], self.duration + float(by[m]))

    def segments(self) -> Iterator[Segment]:
        """Every joint's segments between changes."""
        for joint in range(len(self.first)):
            own = [k for k, change in enumerate(self.changes) if change.joint == joint and not change.touch]
            if own:
                yield from (Segment(a, b) for a, b in pairwise([-1, *own, self.size]))

    def span(self, segment: Segment) -> tuple[float, float]:
        """Start and end of a segment [s]."""
        edges = [*self.times.tolist(), self.duration, 0.0]  # the start is at −1
        return edges[segment.begin], edges[segment.end]

    def within(self, begin: float, end: float) -> list[int]:
        """Indices of the changes between two times [s], both included."""
        return np.flatnonzero((self.times >= begin) & (self.times <= end)).tolist()

    def mode_of(self, segment: Segment) -> Mode:
        """Mode of a joint during a segment."""
        if segment.begin < 0:
            return self.first[self.changes[segment.end].joint]
        return self.changes[segment.begin].mode

    def end_of(self, begin: int) -> int:
        """Index of the change at the end of the segment that starts at change `begin`; m: the goal."""
        return next(segment.end for segment in self.segments() if segment.begin == begin)

    def with_changes(self, more: Iterable[tuple[float, Change, Array]]) -> Self:
        """Insert changes, each with its time and state."""
        every = sorted(
            [*zip(self.times, self.changes, self.states, strict=True), *more], key=lambda each: float(each[0])
        )
        times, changes, states = zip(*every, strict=True)
        return replace(self, changes=changes, times=np.array(times, float), states=np.array(states))

    def without(self, segments: Iterable[Segment]) -> Self:
        """Remove segments of zero length: their changes become simultaneous."""
        first, removed = list(self.first), set[int]()
        for segment in segments:
            if segment.begin in removed or segment.end in removed:
                continue
            if segment.begin < 0 and self.changes[segment.end].mode is Mode.FREE:
                continue  # a singular control begins with a change
            if segment.begin < 0:
                change = self.changes[segment.end]
                first[change.joint] = change.mode
            removed.add(segment.end if segment.begin < 0 else segment.begin)
        now, kept = list(first), list[int]()
        for k, change in enumerate(self.changes):
            if k in removed or (not change.touch and now[change.joint] is change.mode):
                continue
            if not change.touch:
                now[change.joint] = change.mode
            kept.append(k)
        return replace(self, first=tuple(first))._only(kept)

    @property
    def idle_touches(self) -> list[int]:
        """Indices of touches of a limit that the joint is already on: the motion does not depend on their times."""
        modes = self.modes()
        return [k for k, each in enumerate(self.changes) if each.touch and modes[k][each.joint] is each.mode]

    def without_changes(self, removed: Iterable[int]) -> Self:
        """Remove touches at given indices."""
        left = set(range(self.size)).difference(removed)
        return self._only(sorted(left))

    def _only(self, kept: Sequence[int]) -> Self:
        changes = tuple(self.changes[k] for k in kept)
        return replace(self, changes=changes, times=self.times[list(kept)], states=self.states[list(kept)])

    def arcs(self, brief: float) -> list[Arc]:
        """Arcs with these durations; the later of simultaneous changes determine the modes.

        Args:
            brief: part of the duration up to which an arc on a velocity limit is a touch.
        """
        edges = [0.0, *self.times.tolist(), self.duration]
        out: list[Arc] = []
        for k, (modes, (t0, t1)) in enumerate(zip(self.modes(), pairwise(edges), strict=True)):
            touches: tuple[tuple[int, Mode], ...] = ()
            if k < self.size and self.changes[k].touch:
                touches = ((self.changes[k].joint, self.changes[k].mode),)
            if t1 - t0 <= brief * self.duration:
                met = [
                    (i, mode)
                    for i, mode in enumerate(modes)
                    if mode in VELOCITY and out and mode is not out[-1].modes[i]
                ]
                touches += tuple(each for each in met if each not in (*touches, *(out[-1].touches if out else ())))
            if t1 - t0 > (brief if touches else 1e-12) * self.duration or (touches and not out):
                out.append(Arc(t1 - t0, modes, touches))
            elif touches:
                out[-1] = replace(out[-1], touches=out[-1].touches + touches)
        return merged(out)
