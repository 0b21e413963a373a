"""A rollout to first and second order: its closing correction, and the duration on the manifold of closed motions."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.locks import cached_property
from armdyn.optimal.switching.extremal.change import Segment
from armdyn.optimal.switching.extremal.rollout import Rollout, ShootingProblem
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.extremal.trust_region import RANK, TIGHT, QuadraticForm, held_back, null_space


@dataclass(frozen=True, eq=False)
class LinearRollout:
    """Rollout to first order in its times: corrections that close its gaps, its conditions and costates.

    Attributes:
        rollout: the linearised rollout.
        reach: derivatives of the states at the changes and at the end in the unknowns, shape (m + 1, 2 nv, width).
        gap: changes of these states that close the gaps at fixed unknowns, shape (m + 1, 2 nv).
        jacobian: Jacobian of the equations (goal and active state limits), in parts of `Rollout.unit`, shape
            (equations, width).
        residual: residual of the equations with closed gaps, likewise, shape (equations,).
        open: largest gap, likewise.
    """

    rollout: Rollout
    reach: Array
    gap: Array
    jacobian: Array
    residual: Array
    open: float

    @classmethod
    def of(cls, rollout: Rollout) -> Self:
        """Linearise."""
        structure = rollout.structure
        m, size = structure.size, rollout.start.shape[1]
        whole, by = rollout.arcs
        jumps = rollout.end[rollout.last] - np.vstack([structure.states, rollout.shooting.end])
        reach, gap = np.zeros((m + 1, size, structure.width)), np.zeros((m + 1, size))
        for a in range(m + 1):
            if a:
                reach[a], gap[a] = whole[a] @ reach[a - 1], whole[a] @ gap[a - 1]
            reach[a] += by[a]
            gap[a] += jumps[a]
        held = rollout.held_states
        rows = [reach[m] / rollout.unit[:, None], *(reach[k, j][None] / rollout.unit[j] for k, j, _ in held)]
        beyond = [(structure.states[k, j] + gap[k, j] - value) / rollout.unit[j] for k, j, value in held]
        worst = float(np.max(np.abs(jumps / rollout.unit)))
        residual = np.concatenate([gap[m] / rollout.unit, beyond])
        return cls(rollout, reach, gap, np.vstack(rows), residual, worst)

    @property
    def shooting(self) -> ShootingProblem:
        """The shooting problem: limits, dynamics, tuned numbers."""
        return self.rollout.shooting

    @property
    def structure(self) -> SwitchingStructure:
        """Structure of the rollout."""
        return self.rollout.structure

    @property
    def infeasible(self) -> float:
        """Largest gap or residual of an equation, in parts of `Rollout.unit`."""
        return max(self.open, float(np.max(np.abs(self.residual))))

    @cached_property
    def planes(self) -> "Planes":
        """Quantities that must stay nonnegative: segments' lengths, free torques' distances from their limits."""
        structure, (slack, slack_jacobian) = self.structure, self.rollout.slack
        lengths = lengths_of(structure)
        now = np.concatenate([lengths @ structure.unknowns, slack])
        return Planes(now, np.vstack([lengths, slack_jacobian]), np.arange(now.size) < len(lengths))

    @cached_property
    def tangents(self) -> Array:
        """Orthonormal changes of the unknowns in the null space of the equations, shape (k, width)."""
        return null_space(self.jacobian)

    @cached_property
    def _response(self) -> tuple[float, Array]:
        """Norm of the reduced gradient without the active planes' part; multipliers of all equations."""
        gradient = np.zeros(self.jacobian.shape[1])
        gradient[self.structure.size] = 1.0
        tight = self.planes.rows[self.planes.now <= TIGHT]
        multiplier, gradient_norm = held_back(self.tangents @ gradient, tight @ self.tangents.T)
        multipliers = np.linalg.lstsq(self.jacobian.T, multiplier @ tight - gradient, rcond=RANK)[0]
        return gradient_norm, np.asarray(multipliers, float)

    @property
    def gradient_norm(self) -> float:
        """Norm of the duration's reduced gradient, without components blocked by active limits and empty segments."""
        return self._response[0]

    @property
    def multipliers(self) -> Array:
        """Multipliers of the equations, shape (equations,)."""
        return self._response[1]

    @cached_property
    def costates(self) -> tuple[Array, Array]:
        """Costates at the starts and ends of the steps, from the multipliers; each of shape (steps, 2 nv)."""
        rollout, size = self.rollout, self.rollout.start.shape[1]
        p = self.multipliers[:size] / rollout.unit
        jumps = np.zeros((rollout.structure.size, size))
        for (k, j, _), multiplier in zip(rollout.held_states, self.multipliers[size:], strict=True):
            jumps[k, j] += multiplier / rollout.unit[j]
        start, end = np.empty_like(rollout.start), np.empty_like(rollout.end)
        for k in range(rollout.arc.size - 1, -1, -1):
            end[k] = p
            p = start[k] = rollout.state_transition[k].T @ p
            if k and rollout.arc[k] != rollout.arc[k - 1]:
                p = p + jumps[rollout.arc[k] - 1]
        return start, end

    @cached_property
    def switching(self) -> Array:
        """The switching functions at the starts and ends of the steps, shape (2 steps, nv)."""
        return self.rollout.switching(self.costates)

    @property
    def drift(self) -> float:
        """Largest drift of H on an arc without free torques: the integrator's error.

        With a free torque H also drifts while the torque's switching function is not zero.
        """
        rollout = self.rollout
        hamiltonian = np.sum(self.costates[1] * rollout.rate, axis=1)
        full = ~np.any(rollout.torques.free_mask, axis=1)
        arcs = (hamiltonian[full & (rollout.arc == arc)] for arc in np.unique(rollout.arc[full]))
        return max((float(np.ptp(own)) for own in arcs), default=0.0)

    def hessian(self, tangents: Array) -> Array:
        """Hessian of the Lagrangian along tangents, by finite differences of its gradient, shape (k, k).

        The gradient is taken in times and states together: arcs are short, so that no large terms cancel, as they would
        with states as functions of the times.

        Args:
            tangents: tangents in the unknowns, shape (k, width).
        """
        rollout = self.rollout
        states = np.einsum("asz,kz->kas", self.reach[:-1], tangents)
        out = np.empty((len(tangents), len(tangents)))
        small = rollout.shooting.policy.descent.difference * rollout.structure.duration
        here = _gradient(rollout, self.costates)
        for j, (by, moved) in enumerate(zip(tangents, states, strict=True)):
            there = _gradient(rollout.perturbed(small * by, small * moved), self.costates)
            by_unknowns, by_state = ((b - a) / small for a, b in zip(here, there, strict=True))
            out[j] = tangents @ by_unknowns + np.einsum("kas,as->k", states, by_state)
        return (out + out.T) / 2

    @cached_property
    def quadratic(self) -> QuadraticForm:
        """Second-order model of the duration along the tangents."""
        return QuadraticForm(self.tangents[:, self.structure.size], self.hessian(self.tangents))

    def step(self, radius: float) -> "Step":
        """Best step within a radius [s] that keeps all segments' lengths nonnegative."""
        planes, rollout = self.planes, self.rollout
        short = rollout.shooting.policy.descent.short * rollout.structure.duration
        long = planes.lengths & (planes.now >= short)
        slack = np.where(long, 0.9 * planes.now, planes.now)
        y, rim = self.quadratic.within(planes.rows @ self.tangents.T, slack, radius)
        return Step(y @ self.tangents, -self.quadratic.at(y), rim)


def _gradient(rollout: Rollout, costates: tuple[Array, Array]) -> tuple[Array, Array]:
    """Gradient of the Lagrangian in the unknowns, shape (width,), and in the changes' states, shape (m, 2 nv)."""
    p, (whole, by) = costates[1][rollout.last], rollout.arcs
    return np.einsum("as,asz->z", p, by), np.einsum("aij,ai->aj", whole, p)[1:]


def lengths_of(structure: SwitchingStructure) -> Array:
    """Jacobian of the segments' lengths in the unknowns, shape (segments, width)."""
    segments: list[Segment] = list(structure.segments())
    out = np.zeros((len(segments), structure.width))
    for row, segment in zip(out, segments, strict=True):
        row[segment.end] += 1
        if segment.begin >= 0:
            row[segment.begin] -= 1
    return out


@dataclass(frozen=True, eq=False)
class Planes:
    """Quantities that must stay nonnegative, linearised.

    Attributes:
        now: lengths of segments [s], and distances of free torques from their limits [`torque_unit`]; shape (n,).
        rows: derivatives in the unknowns, shape (n, width).
        lengths: whether a quantity is a length, shape (n,).
    """

    now: Array
    rows: Array
    lengths: Flags


@dataclass(frozen=True, eq=False)
class Step:
    """Step along the tangent space.

    Attributes:
        by: step of the unknowns.
        promised: decrease of the duration predicted by the model [s].
        bound: whether the trust region limits the step.
    """

    by: Array
    promised: float
    bound: bool
