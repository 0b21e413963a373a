"""A schedule carried through by the integrator, and how it answers to its times."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.arcs.arc import POSITION, VELOCITY, Mode, outward
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.switching.flow import STEPS, Flow
from armdyn.optimal.switching.schedule import Schedule

Array = NDArray[np.float64]

_DIFFERENCE = 1e-5
"""Of the duration, for a tangent of length 1: between what rounds off and what is cut off."""
MOST_ARCS = STEPS // 3
"""Of a schedule that is marched: fewer than three steps each see nothing of what happens between."""


@dataclass(frozen=True, eq=False)
class Setting:
    """What is marched.

    Attributes:
        problem: its limits, start and goal.
        flow: of its arm.
        body: the ten dynamic parameters of the last body.
    """

    problem: MinimumTimeProblem
    flow: Flow
    body: Array

    def torques(self, modes: Sequence[tuple[Mode, ...]]) -> tuple[Array, Array]:
        """Torques [N m], 0 of joints that are held, and 1 for these, both of shape (arcs, nv)."""
        limits = self.problem.limits
        upper = np.array([[mode is Mode.UPPER for mode in each] for each in modes])
        lower = np.array([[mode is Mode.LOWER for mode in each] for each in modes])
        tau = np.where(upper, limits.effort_upper, np.where(lower, limits.effort_lower, 0.0))
        return tau, np.where(upper | lower, 0.0, 1.0)


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
        tau: torques of the arcs [N m], shape (m + 1, nv).
        held: 1 for joints that are held, shape (m + 1, nv).
    """

    setting: Setting
    schedule: Schedule
    arc: NDArray[np.int_]
    h: Array
    start: Array
    end: Array
    through: Array
    rate: Array
    tau: Array
    held: Array

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
        lengths = np.diff(np.concatenate([[0.0], schedule.unknowns]))
        arc = _dealt(lengths) if arc is None else arc
        h = (lengths / np.bincount(arc))[arc]
        tau, held = setting.torques(schedule.modes())
        begins = np.concatenate([[True], arc[1:] != arc[:-1]])
        states = np.vstack([setting.problem.x_start, schedule.states])
        own = np.where(begins[:, None], states[arc], 0.0)
        if joined is not None and np.any(joined):
            first = np.flatnonzero(begins)[1:]
            begins = begins.copy()
            begins[first[joined]] = False
        body = np.tile(setting.body[:, None], STEPS)
        ends, slopes, rates = setting.flow.march(
            np.zeros(2 * n), own.T, begins.astype(float), h, tau[arc].T, held[arc].T, body
        )
        end = np.array(ends).T
        through = np.array(slopes).T.reshape(STEPS, 2 * n, 2 * n).transpose(0, 2, 1)
        start = np.where(begins[:, None], own, np.vstack([states[:1], end[:-1]]))
        if joined is not None and np.any(joined):
            at = np.flatnonzero(np.diff(arc)) + 1
            schedule = schedule.moved(np.zeros(schedule.size + 1), start[at])
        return cls(setting, schedule, arc, h, start, end, through, np.array(rates).T, tau, held)

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
        n, arc = self.setting.problem.robot.nv, np.tile(self.arc, 2)
        body = np.tile(self.setting.body[:, None], 2 * STEPS)
        q = np.vstack([self.start, self.end])[:, :n]
        return np.array(self.setting.flow.switching(q.T, np.vstack(costates).T, self.held[arc].T, body)).T

    @cached_property
    def whole(self) -> Array:
        """∂end/∂start of the arcs, shape (m + 1, 2 nv, 2 nv)."""
        out = np.tile(np.eye(self.start.shape[1]), (self.schedule.size + 1, 1, 1))
        for k, a in enumerate(self.arc):
            out[a] = self.through[k] @ out[a]
        return out

    def beside(self, by: Array, states: Array) -> Self:
        """The same arcs, in the same steps, with other unknowns and states.

        Args:
            by: what the unknowns change by [s], shape (m + 1,).
            states: what the changes' states change by, shape (m, 2 nv).
        """
        here = self.schedule
        there = replace(
            here, times=here.times + by[:-1], states=here.states + states, duration=here.duration + float(by[-1])
        )
        return type(self).of(self.setting, there, arc=self.arc)

    @cached_property
    def linear(self) -> "Linear":
        """How it answers to its times, to first order."""
        return Linear.of(self)


@dataclass(frozen=True, eq=False)
class Linear:
    """A march to first order: the states that close its gaps, and what is asked of it, by its times.

    Attributes:
        march: what is linearised.
        reach: by the unknowns, what the states at the changes and at the end change by, shape (m + 1, 2 nv, m + 1).
        gap: the same with the unknowns as they are, so that arcs join, shape (m + 1, 2 nv).
        jacobian: of the equations, in parts of `March.unit`, shape (equations, m + 1): the goal, and what is held.
        residual: likewise, gaps closed, shape (equations,).
        open: the largest gap, likewise.
    """

    march: March
    reach: Array
    gap: Array
    jacobian: Array
    residual: Array
    open: float

    @classmethod
    def of(cls, march: March) -> Self:
        """Linearise."""
        schedule, problem = march.schedule, march.setting.problem
        m, size = schedule.size, march.start.shape[1]
        through, rate = march.whole, march.rate[march.last]
        ends = march.end[march.last]
        jumps = ends - np.vstack([schedule.states, problem.x_goal])
        reach, gap = np.zeros((m + 1, size, m + 1)), np.zeros((m + 1, size))
        for a in range(m + 1):
            if a:
                reach[a], gap[a] = through[a] @ reach[a - 1], through[a] @ gap[a - 1]
                reach[a, :, a - 1] -= rate[a]
            reach[a, :, a] += rate[a]
            gap[a] += jumps[a]
        held = march.held_states
        rows = [reach[m] / march.unit[:, None], *(reach[k, j][None] / march.unit[j] for k, j, _ in held)]
        beyond = [(schedule.states[k, j] + gap[k, j] - value) / march.unit[j] for k, j, value in held]
        worst = float(np.max(np.abs(jumps / march.unit)))
        residual = np.concatenate([gap[m] / march.unit, beyond])
        return cls(march, reach, gap, np.vstack(rows), residual, worst)

    @property
    def infeasible(self) -> float:
        """The largest of gaps and equations, in parts of `March.unit`."""
        return max(self.open, float(np.max(np.abs(self.residual))))

    def costates(self, multipliers: Array) -> tuple[Array, Array]:
        """p at the steps' starts and ends, each of shape (STEPS, 2 nv), of the equations' multipliers."""
        march, size = self.march, self.march.start.shape[1]
        p = multipliers[:size] / march.unit
        jumps = np.zeros((march.schedule.size, size))
        for (k, j, _), multiplier in zip(march.held_states, multipliers[size:], strict=True):
            jumps[k, j] += multiplier / march.unit[j]
        start, end = np.empty((STEPS, size)), np.empty((STEPS, size))
        for k in range(STEPS - 1, -1, -1):
            end[k] = p
            p = start[k] = march.through[k].T @ p
            if k and march.arc[k] != march.arc[k - 1]:
                p = p + jumps[march.arc[k] - 1]
        return start, end

    def bend(self, tangents: Array, costates: tuple[Array, Array]) -> Array:
        """The Lagrangian's second derivatives along tangents, shape (k, k).

        Central differences of its gradient by times and states together: arcs are short, so that nothing grows in them
        that would have to cancel, as it does where states follow from times.

        Args:
            tangents: of the unknowns, shape (k, m + 1).
            costates: see there.
        """
        march = self.march
        lengths = np.diff(tangents, prepend=0.0, axis=1)
        states = np.einsum("asz,kz->kas", self.reach[:-1], tangents)
        out = np.empty((len(tangents), len(tangents)))
        small = _DIFFERENCE * march.schedule.duration
        for j, (by, moved) in enumerate(zip(tangents, states, strict=True)):
            sides = [_gradient(march.beside(sign * small * by, sign * small * moved), costates) for sign in (1, -1)]
            by_length, by_state = ((a - b) / (2 * small) for a, b in zip(*sides, strict=True))
            out[j] = lengths @ by_length + np.einsum("kas,as->k", states, by_state)
        return (out + out.T) / 2


def _gradient(march: March, costates: tuple[Array, Array]) -> tuple[Array, Array]:
    """The Lagrangian's by the arcs' lengths, shape (m + 1,), and by the changes' states, shape (m, 2 nv), less constants."""
    p = costates[1][march.last]
    return np.einsum("as,as->a", p, march.rate[march.last]), np.einsum("aij,ai->aj", march.whole, p)[1:]


def _dealt(lengths: Array) -> NDArray[np.int_]:
    """Which arc each step is in: some for every arc, and most for the longest."""
    counts, parts = np.full(lengths.size, 2), np.maximum(lengths, 0.0)
    for _ in range(STEPS - counts.sum()):
        counts[np.argmax(parts / counts)] += 1
    return np.repeat(np.arange(lengths.size), counts)
