"""A march to first and to second order: what closes it, and the duration on the manifold of motions that it is on."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.switching.extremal.flow import STEPS
from armdyn.optimal.switching.extremal.march import March
from armdyn.optimal.switching.extremal.schedule import Schedule, Segment

Array = NDArray[np.float64]

_DIFFERENCE = 1e-6
"""Of the duration, for a tangent of length 1: between what rounds off and what is cut off."""
_SHORT = 1e-2
"""Of the duration: segments shorter than that may vanish in one step; longer ones shrink by a tenth first."""
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
        beyond = [(schedule.states[k, j] + gap[k, j] - value) / march.unit[j] for k, j, value in held]
        worst = float(np.max(np.abs(jumps / march.unit)))
        residual = np.concatenate([gap[m] / march.unit, beyond])
        return cls(march, reach, gap, np.vstack(rows), residual, worst)

    @property
    def infeasible(self) -> float:
        """The largest of gaps and equations, in parts of `March.unit`."""
        return max(self.open, float(np.max(np.abs(self.residual))))

    @cached_property
    def multipliers(self) -> Array:
        """Of the equations, for a duration that answers least to the unknowns, shape (equations,)."""
        gradient = np.zeros(self.jacobian.shape[1])
        gradient[self.march.schedule.size] = 1.0
        return np.asarray(np.linalg.lstsq(self.jacobian.T, -gradient, rcond=_RANK)[0], float)

    @cached_property
    def costates(self) -> tuple[Array, Array]:
        """P at the steps' starts and ends, each of shape (STEPS, 2 nv), of the multipliers."""
        march, size = self.march, self.march.start.shape[1]
        p = self.multipliers[:size] / march.unit
        jumps = np.zeros((march.schedule.size, size))
        for (k, j, _), multiplier in zip(march.held_states, self.multipliers[size:], strict=True):
            jumps[k, j] += multiplier / march.unit[j]
        start, end = np.empty((STEPS, size)), np.empty((STEPS, size))
        for k in range(STEPS - 1, -1, -1):
            end[k] = p
            p = start[k] = march.through[k].T @ p
            if k and march.arc[k] != march.arc[k - 1]:
                p = p + jumps[march.arc[k] - 1]
        return start, end

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
class Step:
    """Along the tangent.

    Attributes:
        by: what the unknowns change by.
        promised: what the duration falls by, by the model [s].
        bound: the model's trust ends it.
        slope: ∂t_f by the unknowns along the tangent, at most; infinite where a segment is in the way.
    """

    by: Array
    promised: float
    bound: bool
    slope: float


@dataclass(frozen=True, eq=False)
class Model:
    """The duration to second order, on the tangent.

    Attributes:
        linear: the motion.
        tangents: of the unknowns, orthonormal, shape (k, width).
        bend: second derivatives along them, shape (k, k).
    """

    linear: Linear
    tangents: Array
    bend: Array

    @classmethod
    def of(cls, linear: Linear) -> Self:
        """At a motion."""
        tangents = _null_space(linear.jacobian)
        return cls(linear, tangents, linear.bend(tangents))

    def step(self, radius: float) -> Step:
        """The best step within a radius [s] that leaves no segment negative."""
        march = self.linear.march
        schedule, (room, by_room) = march.schedule, march.room
        lengths = lengths_of(schedule)
        segments, now = len(lengths), np.concatenate([lengths @ schedule.unknowns, room])
        rows = np.vstack([lengths, by_room])
        short = np.arange(now.size) < segments
        short &= now >= _SHORT * schedule.duration
        least, along = np.where(short, 0.1 * now, 0.0), rows @ self.tangents.T
        held: list[int] = []
        cut: Step | None = None
        while True:
            step = self._within(along[held], (least - now)[held], radius)
            if any(k < segments for k in held):
                step = replace(step, slope=np.inf)
            after = now + rows @ step.by
            beyond = [k for k in np.flatnonzero(after < least - 1e-12).tolist() if k not in held]
            if beyond:
                share = max(0.0, min((now[k] - least[k]) / (now[k] - after[k]) for k in beyond))
                shorter = self._along(share * (self.tangents @ step.by), True, np.inf)
                cut = shorter if cut is None or shorter.promised > cut.promised else cut
            if not beyond or len(held) >= len(self.tangents):
                break
            held.append(min(beyond, key=lambda k: after[k] - least[k]))
        return cut if cut is not None and (beyond or cut.promised > step.promised) else step

    def _along(self, y: Array, bound: bool, slope: float) -> Step:
        """A step of given parts of the tangents."""
        promised = -float(self.tangents[:, self.linear.march.schedule.size] @ y + y @ self.bend @ y / 2)
        return Step(y @ self.tangents, promised, bound, slope)

    def _within(self, rows: Array, right: Array, radius: float) -> Step:
        """The best step within a radius that some rows on the tangent allow."""
        slope = self.tangents[:, self.linear.march.schedule.size]
        base = np.linalg.lstsq(rows, right, rcond=_RANK)[0] if len(rows) else np.zeros_like(slope)
        size = float(np.linalg.norm(base))
        bound = size > 0.8 * radius
        if bound:
            base *= 0.8 * radius / size
        free = _null_space(rows) if len(rows) else np.eye(slope.size)
        steepest, y = 0.0, np.asarray(base, float)
        if len(free):
            values, axes = np.linalg.eigh(free @ self.bend @ free.T)
            down: Array = -axes.T @ (free @ (slope + self.bend @ base))
            steepest = float(np.max(np.abs(down)))
            own, rim = _in_ball(values, down, math.sqrt(max(radius**2 - float(base @ base), 1e-30)))
            y, bound = base + (axes @ own) @ free, bound or rim
        return self._along(y, bound, steepest)


def _null_space(rows: Array) -> Array:
    """Orthonormal directions that rows do not feel, shape (k, columns)."""
    values, directions = np.linalg.svd(rows)[1:]
    return np.asarray(directions[int(np.sum(values > _RANK * values[0])) :])


def _in_ball(values: Array, down: Array, radius: float) -> tuple[Array, bool]:
    """The least of ½ Σ λ y² − down·y within a ball, and whether its rim is reached (Moré and Sorensen 1983)."""
    low = max(0.0, -float(values[0]) * (1 + 1e-9) + 1e-12) if values[0] <= 0 else 0.0
    y: Array = down / (values + low)
    if np.linalg.norm(y) <= radius:
        return y, False
    high = low + float(np.linalg.norm(down)) / radius + float(np.max(np.abs(values)))
    for _ in range(60):
        shift = (low + high) / 2
        y = down / (values + shift)
        low, high = (shift, high) if np.linalg.norm(y) > radius else (low, shift)
    return down / (values + high), True
