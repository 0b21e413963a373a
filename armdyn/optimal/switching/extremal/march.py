"""A schedule carried through by the integrator, and how it answers to its times."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from armdyn.optimal.arcs.arc import POSITION, VELOCITY, Mode, outward
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.switching.extremal.flow import STEPS, Flow
from armdyn.optimal.switching.extremal.schedule import Schedule

Array = NDArray[np.float64]

_CURVED = 24
"""Steps of an arc on which a torque is free, at least: two for a coefficient of the longest course."""
_KINDS = {Mode.UPPER: 1, Mode.LOWER: -1}

_SWAY = 0.2
"""Of the duration: a stay that is moved by so much counts as much as a free torque that goes through its range."""
MOST_ARCS = STEPS // 3
"""Of a schedule that is marched: fewer than three steps each see nothing of what happens between."""


@dataclass(frozen=True, eq=False)
class Setting:
    """What is marched.

    Attributes:
        problem: its limits, start and goal.
        flow: of its arm.
        body: the ten dynamic parameters of the last body.
        course: what a coefficient of 1 in a free torque's course is [N m], shape (nv,): as much as a change's time that
            is moved by a second.
        offset: how far beside the goal it is to end, in (q, v), shape (2 nv,).
    """

    problem: MinimumTimeProblem
    flow: Flow
    body: Array
    course: Array
    offset: Array | float = 0.0

    @classmethod
    def of(cls, problem: MinimumTimeProblem, flow: Flow, body: Array, duration: float) -> Self:
        """Of a problem, whose motion takes about so long [s]."""
        limits = problem.limits
        return cls(problem, flow, body, (limits.effort_upper - limits.effort_lower) / (_SWAY * duration))

    @property
    def end(self) -> Array:
        """(q, v) to end in, shape (2 nv,)."""
        return np.asarray(self.problem.x_goal + self.offset)


@dataclass(frozen=True, eq=False)
class _Torques:
    """Torques at both ends of all steps, and how a free one answers to the unknowns.

    Attributes:
        tau: at the starts and at the ends [N m], each of shape (STEPS, nv).
        held: 1 for joints that are held, shape (STEPS, nv).
        felt: 1 for the joint whose torque is free, likewise.
        by: ∂(free torque)/∂(unknowns) at the starts and at the ends, each of shape (STEPS, width).
    """

    tau: tuple[Array, Array]
    held: Array
    felt: Array
    by: tuple[Array, Array]

    @classmethod
    def of(cls, setting: Setting, schedule: Schedule, arc: NDArray[np.int_]) -> Self:
        """Of a schedule's steps.

        Args:
            setting: what is marched.
            schedule: in which one torque at most is free at a time.
            arc: which arc each step is in, shape (STEPS,).
        """
        modes, limits = schedule.modes(), setting.problem.limits
        kinds = np.array([[_KINDS.get(mode, 0) for mode in each] for each in modes])[arc]
        bang = np.where(kinds > 0, limits.effort_upper, np.where(kinds < 0, limits.effort_lower, 0.0))
        free = np.array([[mode is Mode.FREE for mode in each] for each in modes])[arc]
        held = np.array([[mode in POSITION or mode in VELOCITY for mode in each] for each in modes])[arc]
        tau, by = (bang.copy(), bang.copy()), (np.zeros((STEPS, schedule.width)), np.zeros((STEPS, schedule.width)))
        for k, place in schedule.places.items():
            joint = schedule.changes[k].joint
            unit, course = setting.course[joint], setting.course[joint] * np.array(schedule.changes[k].course)
            end = schedule.end_of(k)
            own = np.flatnonzero((arc > k) & (arc <= end))
            for side in (0, 1):
                s, by_z = _along(schedule, arc, own, side, (k, end))
                tau[side][own, joint] = legendre.legval(2 * s - 1, course)
                by[side][own] = (2 * legendre.legval(2 * s - 1, legendre.legder(course)))[:, None] * by_z
                by[side][own, place] += unit * legendre.legvander(2 * s - 1, course.size - 1)
        return cls(tau, held.astype(float), free.astype(float), by)


def _along(
    schedule: Schedule, arc: NDArray[np.int_], own: NDArray[np.int_], side: int, ends: tuple[int, int]
) -> tuple[Array, Array]:
    """Where steps start (side 0) or end (side 1) in a segment, from 0 to 1; and by the unknowns, shape (own, width).

    Args:
        schedule: the arcs.
        arc: which arc each step is in.
        own: the steps asked for.
        side: of them.
        ends: changes that begin and end the segment.
    """
    edges = np.concatenate([[0.0], schedule.times, [schedule.duration]])
    by_edges = np.zeros((edges.size, schedule.width))
    by_edges[1:, : edges.size - 1] = np.eye(edges.size - 1)
    counts = np.bincount(arc)
    part = ((np.arange(arc.size) - np.concatenate([[0], np.cumsum(counts)])[arc] + side) / counts[arc])[own]
    before = arc[own]
    t = (1 - part) * edges[before] + part * edges[before + 1]
    by_t = (1 - part)[:, None] * by_edges[before] + part[:, None] * by_edges[before + 1]
    (begin, end), (by_begin, by_end) = edges[np.array(ends) + 1], by_edges[np.array(ends) + 1]
    length = max(end - begin, 1e-12)
    s = (t - begin) / length
    return s, (by_t - by_begin - s[:, None] * (by_end - by_begin)) / length


@dataclass(frozen=True, eq=False)
class March:
    """The arcs of a schedule, each from its own start, in steps.

    Attributes:
        setting: what is marched.
        schedule: the arcs.
        arc: which arc a step is in, shape (STEPS,); every arc has some.
        h: lengths of the steps [s], shape (STEPS,).
        start: states at the steps' starts, shape (STEPS, 2 nv).
        end: at their ends, likewise.
        through: ∂end/∂start, shape (STEPS, 2 nv, 2 nv).
        rate: ẋ at the ends, shape (STEPS, 2 nv).
        answer: ∂end/∂(free torque) at the steps' starts and ends, shape (STEPS, 2 nv, 2).
        torques: what moves it.
    """

    setting: Setting
    schedule: Schedule
    arc: NDArray[np.int_]
    h: Array
    start: Array
    end: Array
    through: Array
    rate: Array
    answer: Array
    torques: _Torques

    @classmethod
    def of(
        cls,
        setting: Setting,
        schedule: Schedule,
        joined: NDArray[np.bool_] | None = None,
        arc: NDArray[np.int_] | None = None,
    ) -> Self:
        """March a schedule.

        Args:
            setting: what is marched.
            schedule: of MOST_ARCS at most.
            joined: changes whose states are not theirs, but where the arc before ends, shape (m,); None: none.
            arc: which arc each step is in, shape (STEPS,); None: the longest have most.
        """
        n = setting.problem.robot.nv
        lengths = np.diff(np.concatenate([[0.0], schedule.times, [schedule.duration]]))
        curved = np.array([Mode.FREE in modes for modes in schedule.modes()])
        arc = _dealt(lengths, curved) if arc is None else arc
        h = (lengths / np.bincount(arc))[arc]
        torques = _Torques.of(setting, schedule, arc)
        begins = np.concatenate([[True], arc[1:] != arc[:-1]])
        states = np.vstack([setting.problem.x_start, schedule.states])
        own = np.where(begins[:, None], states[arc], 0.0)
        if joined is not None and np.any(joined):
            first = np.flatnonzero(begins)[1:]
            begins = begins.copy()
            begins[first[joined]] = False
        body = np.tile(setting.body[:, None], STEPS)
        ends, slopes, answers, rates = setting.flow.march(
            np.zeros(2 * n), own.T, begins.astype(float), h, torques.tau[0].T, torques.tau[1].T, torques.felt.T,
            torques.held.T, body,
        )  # fmt: skip
        end = np.array(ends).T
        through = np.array(slopes).T.reshape(STEPS, 2 * n, 2 * n).transpose(0, 2, 1)
        start = np.where(begins[:, None], own, np.vstack([states[:1], end[:-1]]))
        if joined is not None and np.any(joined):
            at = np.flatnonzero(np.diff(arc)) + 1
            schedule = replace(schedule, states=start[at])
        answer = np.array(answers).T.reshape(STEPS, 2, 2 * n).transpose(0, 2, 1)
        return cls(setting, schedule, arc, h, start, end, through, np.array(rates).T, answer, torques)

    @property
    def finite(self) -> bool:
        """Whether no number has left what numbers can hold."""
        return bool(np.all(np.isfinite(self.end)) and np.all(np.isfinite(self.through)))

    @cached_property
    def last(self) -> NDArray[np.int_]:
        """The last step of every arc, shape (m + 1,)."""
        return np.append(np.flatnonzero(np.diff(self.arc)), STEPS - 1)

    @cached_property
    def times(self) -> Array:
        """Where steps start and end [s], shape (STEPS + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.h)])

    @cached_property
    def held_states(self) -> list[tuple[int, int, float]]:
        """What limits of the state ask for: number of the change, place in (q, v), and the value there."""
        n, limits = self.setting.problem.robot.nv, self.setting.problem.limits
        out: list[tuple[int, int, float]] = []
        for k, change in enumerate(self.schedule.changes):
            i, mode = change.joint, change.mode
            if mode in POSITION:
                bound = limits.position_upper if mode is Mode.POSITION_UPPER else limits.position_lower
                out += [(k, i, float(bound[i])), (k, n + i, 0.0)]
            elif mode in VELOCITY:
                out.append((k, n + i, outward(mode) * float(limits.velocity[i])))
        return out

    @cached_property
    def unit(self) -> Array:
        """What counts as one in (q, v): a radian, and the largest speed, shape (2 nv,)."""
        n = self.setting.problem.robot.nv
        return np.repeat([1.0, max(1e-3, float(np.max(np.abs(self.end[:, n:]))))], n)

    def switching(self, costates: tuple[Array, Array]) -> Array:
        """The switching functions at the starts and the ends of all steps, shape (2 STEPS, nv).

        Args:
            costates: p there, each of shape (STEPS, 2 nv).
        """
        n, held = self.setting.problem.robot.nv, np.tile(self.torques.held, (2, 1))
        body = np.tile(self.setting.body[:, None], 2 * STEPS)
        q = np.vstack([self.start, self.end])[:, :n]
        return np.array(self.setting.flow.switching(q.T, np.vstack(costates).T, held.T, body)).T

    @cached_property
    def arcs(self) -> tuple[Array, Array]:
        """∂end/∂start of the arcs, shape (m + 1, 2 nv, 2 nv), and ∂end/∂(unknowns), shape (m + 1, 2 nv, width)."""
        schedule, size = self.schedule, self.start.shape[1]
        whole, by = (
            np.tile(np.eye(size), (schedule.size + 1, 1, 1)),
            np.zeros((schedule.size + 1, size, schedule.width)),
        )
        for a, (first, last) in enumerate(zip([0, *(self.last[:-1] + 1)], self.last, strict=True)):
            for through in self.through[first : last + 1]:
                whole[a] = through @ whole[a]
            if np.any(self.torques.felt[first]):
                self._add_curved(by[a], a, range(first, last + 1))
                continue
            by[a, :, a] += self.rate[last]  # torques are constant: a longer arc goes on as it ended
            if a:
                by[a, :, a - 1] -= self.rate[last]
        return whole, by

    def _add_curved(self, by: Array, arc: int, steps: range) -> None:
        """∂end/∂(unknowns) of an arc on which a torque is free, put into an array of zeros, shape (2 nv, width)."""
        torques = self.torques
        length = np.zeros(by.shape[1])
        length[arc] = 1 / len(steps)
        if arc:
            length[arc - 1] = -1 / len(steps)
        for k in steps:
            rise = float(np.sum((torques.tau[1][k] - torques.tau[0][k]) * torques.felt[k]))
            stretched = self.rate[k] - (rise / self.h[k] if self.h[k] else 0.0) * self.answer[k, :, 1]
            by[:] = self.through[k] @ by + stretched[:, None] * length
            by += self.answer[k, :, :1] * torques.by[0][k] + self.answer[k, :, 1:] * torques.by[1][k]

    @cached_property
    def room(self) -> tuple[Array, Array]:
        """What free torques are from both limits, in parts of `Setting.course`, and by the unknowns, (rows, width)."""
        torques, limits = self.torques, self.setting.problem.limits
        free = torques.felt > 0
        unit = np.where(self.setting.course > 0, self.setting.course, 1.0)  # without a motor nothing is free
        own = np.any(free, axis=1)
        values, rows = [np.empty(0)], [np.empty((0, self.schedule.width))]
        for tau, by in zip(torques.tau, torques.by, strict=True):
            for sign, bound in ((-1.0, limits.effort_upper), (1.0, -limits.effort_lower)):
                values.append((np.sum(np.where(free, (bound + sign * tau) / unit, 0.0), axis=1))[own])
                rows.append((sign * by / np.sum(np.where(free, unit, 0.0), axis=1, keepdims=True).clip(1e-300))[own])
        return np.concatenate(values), np.concatenate(rows)

    def beside(self, by: Array, states: Array) -> Self:
        """The same arcs, in the same steps, with other unknowns and states.

        Args:
            by: what the unknowns change by, shape (width,).
            states: what the changes' states change by, shape (m, 2 nv).
        """
        there = self.schedule.moved(by, self.schedule.states + states, in_order=False)
        return type(self).of(self.setting, there, arc=self.arc)


def _dealt(lengths: Array, curved: NDArray[np.bool_]) -> NDArray[np.int_]:
    """Which arc each step is in: some for every arc, more where a torque is free, and most for the longest."""
    own = max(2, min(_CURVED, (STEPS - 2 * lengths.size) // max(int(curved.sum()), 1)))
    counts, parts = np.where(curved, own, 2), np.maximum(lengths, 0.0)
    for _ in range(STEPS - counts.sum()):
        counts[np.argmax(parts / counts)] += 1
    return np.repeat(np.arange(lengths.size), counts)
