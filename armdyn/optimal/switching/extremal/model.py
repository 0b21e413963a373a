"""A march to first and to second order: what closes it, and the duration on the manifold of motions that it is on."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.switching.extremal.change import Segment
from armdyn.optimal.switching.extremal.march import March
from armdyn.optimal.switching.extremal.schedule import Schedule
from armdyn.optimal.switching.extremal.trust import TIGHT, Parabola, held_back, null_space

Array = NDArray[np.float64]

_DIFFERENCE = 1e-6
"""Of the duration, for a tangent of length 1: between what rounds off and what is cut off."""
_SHORT = 1e-2
"""Of the duration: segments shorter than that may vanish in one step; longer ones shrink by a tenth first."""
_ASIDE = 0.1
"""Of the duration: changes farther from each other do not meet within a step."""
_RANK = 1e-10
"""Of the largest singular value: rounding."""


@dataclass(frozen=True, eq=False)
class Linear:
    """A march to first order: the states that close its gaps, and what is asked of it, by its times.

    Attributes:
        march: what is linearised.
        reach: by the unknowns, what the states at the changes and at the end change by, shape (m + 1, 2 nv, width).
        gap: the same with the unknowns as they are, so that arcs join, shape (m + 1, 2 nv).
        jacobian: of the equations, in parts of `March.unit`, shape (equations, width): the goal, and what is held.
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
        schedule = march.schedule
        m, size = schedule.size, march.start.shape[1]
        whole, by = march.arcs
        jumps = march.end[march.last] - np.vstack([schedule.states, march.setting.end])
        reach, gap = np.zeros((m + 1, size, schedule.width)), np.zeros((m + 1, size))
        for a in range(m + 1):
            if a:
                reach[a], gap[a] = whole[a] @ reach[a - 1], whole[a] @ gap[a - 1]
            reach[a] += by[a]
            gap[a] += jumps[a]
        held = march.held_states
        rows = [reach[m] / march.unit[:, None], *(reach[k, j][None] / march.unit[j] for k, j, _ in held)]
        rows += [(by_state @ reach[k])[None] for k, by_state, _ in march.tangents]
        together = np.eye(schedule.width) - np.eye(schedule.width, k=-1)
        tied = [k for k, change in enumerate(schedule.changes) if change.tied and k]
        rows.append(together[tied] / schedule.duration)
        beyond = [(schedule.states[k, j] + gap[k, j] - value) / march.unit[j] for k, j, value in held]
        beyond += [value + by_state @ gap[k] for k, by_state, value in march.tangents]
        beyond += [(schedule.times[k] - schedule.times[k - 1]) / schedule.duration for k in tied]
        worst = float(np.max(np.abs(jumps / march.unit)))
        residual = np.concatenate([gap[m] / march.unit, beyond])
        return cls(march, reach, gap, np.vstack(rows), residual, worst)

    @property
    def infeasible(self) -> float:
        """The largest of gaps and equations, in parts of `March.unit`."""
        return max(self.open, float(np.max(np.abs(self.residual))))

    @cached_property
    def planes(self) -> "Planes":
        """What must not become negative."""
        schedule, lengths, (room, by_room) = self.march.schedule, lengths_of(self.march.schedule), self.march.room
        orders = schedule.orders(_ASIDE * schedule.duration)
        apart = np.zeros((len(orders), schedule.width))
        for row, (k, after) in zip(apart, orders, strict=True):
            row[k], row[after] = -1.0, 1.0
        now = np.concatenate([lengths @ schedule.unknowns, room, apart @ schedule.unknowns])
        return Planes(now, np.vstack([lengths, by_room, apart]), np.arange(now.size) < len(lengths), tuple(orders))

    @cached_property
    def tangents(self) -> Array:
        """Changes of the unknowns, orthonormal, that no equation feels, shape (k, width)."""
        return null_space(self.jacobian)

    @cached_property
    def _answer(self) -> tuple[float, Array, Array]:
        """Slope of the duration along the tangents beside what planes hold back; multipliers; those of tight planes."""
        gradient = np.zeros(self.jacobian.shape[1])
        gradient[self.march.schedule.size] = 1.0
        tight = self.planes.rows[self.planes.now <= TIGHT]
        pull, slope = held_back(self.tangents @ gradient, tight @ self.tangents.T)
        multipliers = np.linalg.lstsq(self.jacobian.T, pull @ tight - gradient, rcond=_RANK)[0]
        return slope, np.asarray(multipliers, float), pull

    @property
    def slope(self) -> float:
        """Of the duration along the tangents, beside what free torques on limits and empty segments hold back."""
        return self._answer[0]

    @property
    def multipliers(self) -> Array:
        """Of the equations, shape (equations,)."""
        return self._answer[1]

    @property
    def ties(self) -> list[tuple[int, int]]:
        """Changes at one time whose order holds the motion back: in the other order it may be shorter."""
        planes = self.planes
        tight = np.flatnonzero(planes.now <= TIGHT)
        first = planes.now.size - len(planes.orders)
        return [
            planes.orders[k - first] for k, pull in zip(tight, self._answer[2], strict=True) if k >= first and pull > 0
        ]

    @cached_property
    def costates(self) -> tuple[Array, Array]:
        """P at the steps' starts and ends, each of shape (steps, 2 nv), of the multipliers."""
        march, size = self.march, self.march.start.shape[1]
        p = self.multipliers[:size] / march.unit
        jumps = np.zeros((march.schedule.size, size))
        held = len(march.held_states)
        for (k, j, _), multiplier in zip(march.held_states, self.multipliers[size:][:held], strict=True):
            jumps[k, j] += multiplier / march.unit[j]
        for (k, by_state, _), multiplier in zip(march.tangents, self.multipliers[size + held :], strict=False):
            jumps[k] += multiplier * by_state
        start, end = np.empty_like(march.start), np.empty_like(march.end)
        for k in range(march.arc.size - 1, -1, -1):
            end[k] = p
            p = start[k] = march.through[k].T @ p
            if k and march.arc[k] != march.arc[k - 1]:
                p = p + jumps[march.arc[k] - 1]
        return start, end

    @property
    def drift(self) -> float:
        """By how much H drifts at most on an arc on which no torque is free: the integrator's error.

        Where one is free it drifts, too, as long as its switching function is not zero.
        """
        march = self.march
        hamiltonian = np.sum(self.costates[1] * march.rate, axis=1)
        full = ~np.any(march.torques.felt, axis=1)
        arcs = (hamiltonian[full & (march.arc == arc)] for arc in np.unique(march.arc[full]))
        return max((float(np.ptp(own)) for own in arcs), default=0.0)

    def bend(self, tangents: Array) -> Array:
        """The Lagrangian's second derivatives along tangents, shape (k, k).

        Differences of its gradient by times and states together: arcs are short, so that nothing grows in them that
        would have to cancel, as it does where states follow from times.

        Args:
            tangents: of the unknowns, shape (k, width).
        """
        march = self.march
        states = np.einsum("asz,kz->kas", self.reach[:-1], tangents)
        out = np.empty((len(tangents), len(tangents)))
        small = _DIFFERENCE * march.schedule.duration
        here = _gradient(march, self.costates)
        for j, (by, moved) in enumerate(zip(tangents, states, strict=True)):
            there = _gradient(march.beside(small * by, small * moved), self.costates)
            by_unknowns, by_state = ((b - a) / small for a, b in zip(here, there, strict=True))
            out[j] = tangents @ by_unknowns + np.einsum("kas,as->k", states, by_state)
        return (out + out.T) / 2


def _gradient(march: March, costates: tuple[Array, Array]) -> tuple[Array, Array]:
    """The Lagrangian's by the unknowns, shape (width,), and by the changes' states, shape (m, 2 nv), less constants."""
    p, (whole, by) = costates[1][march.last], march.arcs
    return np.einsum("as,asz->z", p, by), np.einsum("aij,ai->aj", whole, p)[1:]


def lengths_of(schedule: Schedule) -> Array:
    """Of the segments by the unknowns, shape (segments, width)."""
    segments: list[Segment] = list(schedule.segments())
    out = np.zeros((len(segments), schedule.width))
    for row, segment in zip(out, segments, strict=True):
        row[segment.end] += 1
        if segment.begin >= 0:
            row[segment.begin] -= 1
    return out


@dataclass(frozen=True, eq=False)
class Planes:
    """Numbers that must not become negative.

    Attributes:
        now: lengths of segments [s], what free torques are from their limits, in parts of `Setting.course`, and times
            between changes [s]; shape (n,).
        rows: by the unknowns, shape (n, width).
        lengths: which are lengths, shape (n,).
        orders: the last of them are times between these changes, whose order matters [s].
    """

    now: Array
    rows: Array
    lengths: NDArray[np.bool_]
    orders: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, eq=False)
class Step:
    """Along the tangent.

    Attributes:
        by: what the unknowns change by.
        promised: what the duration falls by, by the model [s].
        bound: the model's trust ends it.
    """

    by: Array
    promised: float
    bound: bool


@dataclass(frozen=True, eq=False)
class Model:
    """The duration to second order, on the tangent.

    Attributes:
        linear: the motion.
        parabola: the duration along its tangents.
    """

    linear: Linear
    parabola: Parabola

    @classmethod
    def of(cls, linear: Linear) -> Self:
        """At a motion."""
        gradient = linear.tangents[:, linear.march.schedule.size]
        return cls(linear, Parabola(gradient, linear.bend(linear.tangents)))

    def step(self, radius: float) -> Step:
        """The best step within a radius [s] that leaves no segment negative."""
        planes, tangents = self.linear.planes, self.linear.tangents
        long = planes.lengths & (planes.now >= _SHORT * self.linear.march.schedule.duration)
        room = np.where(long, 0.9 * planes.now, planes.now)
        y, rim = self.parabola.within(planes.rows @ tangents.T, room, radius)
        return Step(y @ tangents, -self.parabola.at(y), rim)
