"""Program of curves: rows linear in its unknowns, linearised at an iterate, and the quadratic program of a step there.

Torques are eliminated: they are functions of control points and durations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from armdyn.arrays import Array, Flags, Index
from armdyn.locks import cached_property
from armdyn.optimal.curves.convex_step import ConvexStep, SoftRows
from armdyn.optimal.curves.linear_rows import ClearanceRows, DerivativeRows, Linearised, Sides, TorqueParts, TorqueRows
from armdyn.optimal.curves.program import CurveLayout
from armdyn.optimal.mesh.assembly import Program


@dataclass(frozen=True, eq=False)
class TorquePrices:
    """Cost of torques in seconds, quadratic except for products of durations and efforts.

    Attributes:
        duration_of_point: index of the duration of each point's leg, shape (points,).
        tie: price of squared torques, shape (points,) [s].
        effort: price of squared torques per duration, shape (points, joints) [-].
        steps: price of squared differences of the torques of neighbouring points of a leg, shape (points - 1,) [s].
    """

    duration_of_point: Index
    tie: Array
    effort: Array
    steps: Array

    def value(self, x: Array, tau: Array) -> float:
        """Cost of unknowns, shape (unknowns,), with their torques, shape (points, joints)."""
        steps = self.steps[:, None] * np.diff(tau, axis=0) ** 2
        return float(np.sum(self._prices(x) * tau**2) + np.sum(steps)) / 2

    def gradient(self, x: Array, at: TorqueParts) -> Array:
        """Total derivative of the cost by the unknowns, on which the torques depend, shape (unknowns,)."""
        by_torque = self._prices(x) * at.tau
        steps = self.steps[:, None] * np.diff(at.tau, axis=0)
        by_torque[1:] += steps
        by_torque[:-1] -= steps
        out = at.jacobian.T @ by_torque.ravel()
        np.add.at(out, self.duration_of_point, np.sum(self.effort * at.tau**2, axis=1) / 2)
        return np.asarray(out)

    def squares(self, x: Array, at: TorqueParts) -> tuple[sp.csr_matrix, Array]:
        """Rows and weights whose weighted squares are the Gauss-Newton Hessian of the cost."""
        n, prices = at.tau.shape[1], self._prices(x).ravel()
        if not np.any(self.steps):
            return at.jacobian, prices
        steps = at.jacobian[n:] - at.jacobian[:-n]
        return sp.vstack([at.jacobian, steps], format="csr"), np.append(prices, np.repeat(self.steps, n))

    def _prices(self, x: Array) -> Array:
        return np.asarray(self.tie[:, None] + x[self.duration_of_point][:, None] * self.effort)


@dataclass(frozen=True, eq=False)
class CurveCost:
    """Cost in seconds: durations, control points, torques.

    Attributes:
        durations: indices of the durations, shape (legs,).
        moving: price of squared velocities or accelerations: matrix of shape (unknowns, unknowns) [s].
        torques: prices of torques; None: torques are free.
    """

    durations: Index
    moving: sp.csr_matrix
    torques: TorquePrices | None = None

    def value(self, x: Array, tau: Array) -> float:
        """Cost of unknowns, shape (unknowns,), with their torques, shape (points, joints)."""
        cost = float(np.sum(x[self.durations]) + x @ (self.moving @ x) / 2)
        return cost if self.torques is None else cost + self.torques.value(x, tau)

    def gradient(self, x: Array, at: TorqueParts) -> Array:
        """Total derivative of the cost by the unknowns, on which the torques depend, shape (unknowns,)."""
        out = self.moving @ x
        if at.lead is not None:
            out[self.durations] += at.lead @ out
        out[self.durations] += 1
        return np.asarray(out if self.torques is None else out + self.torques.gradient(x, at))

    @cached_property
    def no_squares(self) -> tuple[sp.csr_matrix, Array]:
        """No rows, and no weights."""
        return sp.csr_matrix((0, self.moving.shape[1])), np.empty(0)


def quadratic_form(shape: CurveLayout, squares: Sequence[Array], scales: Array) -> sp.csr_matrix:
    """Matrix of a quadratic form of the control points in terms of the unknowns, shape (unknowns, unknowns).

    Args:
        shape: layout of the program.
        squares: matrix of each leg, shape (control points, control points).
        scales: scales of the joints, shape (joints,).
    """
    rows, columns, values = [], [], []
    for k, own in enumerate(squares):
        i, j = np.nonzero(own)
        rows.append(shape.points(k)[i].ravel())
        columns.append(shape.points(k)[j].ravel())
        values.append((own[i, j][:, None] / scales**2).ravel())
    every = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sp.csr_matrix(every, (shape.size, shape.size))


@dataclass(frozen=True, eq=False)
class OtherRows:
    """Equations by CasADi, in which torques are unknowns.

    Attributes:
        program: functions of the nonlinear program.
        parameters: parameters of the program.
        which: indices of the equations.
        bounds: low and high, each of shape (equations,).
    """

    program: Program
    parameters: Array
    which: Index
    bounds: tuple[Array, Array]

    def at(self, x: Array, torques: Index, load: sp.csr_matrix) -> Sides:
        """Linearise the equations.

        Args:
            x: unknowns, including the torques.
            torques: indices of the torques.
            load: ∂(torques)/∂(unknowns), shape (torques, unknowns): torques are eliminated.
        """
        g, matrix = self.program.jacobian(x, self.parameters)
        whole = sp.csc_matrix((matrix.nonzeros(), matrix.row(), matrix.colind()), shape=matrix.shape)
        rows = whole.tocsr()[self.which]
        jacobian = (rows + rows[:, torques.ravel()] @ load).tocsr()
        return Sides(jacobian, np.array(g).ravel()[self.which], self.bounds)


@dataclass(frozen=True)
class Prices:
    """Prices of violations.

    Attributes:
        row: price of a torque beyond its limit by half its range, the largest at every point, and of another row beyond
            its bound by its scale [s].
        distance: price of a distance below the required one, the largest at every pose [s/m].
    """

    row: float
    distance: float

    def times(self, factor: float) -> Self:
        """The prices, raised by a factor."""
        return replace(self, row=factor * self.row, distance=factor * self.distance)


@dataclass(frozen=True, eq=False)
class Iterate:
    """A curve at which all rows are linearised.

    Attributes:
        x: unknowns.
        cost: cost without penalties [s].
        torques: torques of the curve.
        sides: rows of the derivatives' control points, velocities first, and of other equations.
        distances: linearised distances; None: no distances.
    """

    x: Array
    cost: float
    torques: TorqueParts
    sides: tuple[Sides, ...]
    distances: Linearised | None

    def penalties(self, limits: tuple[Array, Array], prices: Prices) -> tuple[float, float, float]:
        """Priced violations of torques, distances and other rows [s].

        Args:
            limits: lower and upper torque limits, as parts of half the ranges, each of shape (points, joints).
            prices: prices of violations.
        """
        low, high = limits
        over = np.max(np.maximum(self.torques.tau - high, low - self.torques.tau), axis=1, initial=0)
        missing = 0.0 if self.distances is None else float(np.sum(self.distances.missing))
        missed = sum(each.missed for each in self.sides)
        return prices.row * float(np.sum(over)), prices.distance * missing, prices.row * missed


@dataclass(frozen=True, eq=False)
class CurveProgram:
    """Program of all curves of one layout.

    Attributes:
        shape: layout of the unknowns.
        torque_rows: torques and their derivatives.
        derivative_rows: control points of the limited derivatives, velocities first.
        cost: the cost.
        bounds: lower and upper bounds of the unknowns, each of shape (unknowns,).
        free: whether each unknown may change in a step, shape (unknowns,).
        torques: indices of the unknowns that are the torques of `torque_rows`, shape (points of all legs, joints), or
            empty: these are no unknowns.
        others: other equations; None: no others.
        clearance: required distances; None: no distances.
        lead: derivatives of fixed unknowns in the duration, shape (unknowns,); None: zero.
    """

    shape: CurveLayout
    torque_rows: TorqueRows
    derivative_rows: tuple[DerivativeRows, ...]
    cost: CurveCost
    bounds: tuple[Array, Array]
    free: Flags
    torques: Index
    others: OtherRows | None = None
    clearance: ClearanceRows | None = None
    lead: Array | None = None

    @cached_property
    def place(self) -> NDArray[np.int32]:
        """Order of elimination of the unknowns: control points, then durations; -1: fixed, or a torque."""
        last = self.free & np.isin(np.arange(self.free.size), self.cost.durations)
        order = np.concatenate([np.flatnonzero(self.free & ~last), np.flatnonzero(last)])
        place = np.full(self.free.size, -1, dtype=np.int32)
        place[order] = np.arange(order.size)
        return place

    def at(self, x: Array) -> Iterate:
        """Linearise all rows at unknowns, whose torques are computed."""
        torques = self.torque_rows.at(x, self.lead)
        sides = [rows.at(x, self.lead) for rows in self.derivative_rows]
        if self.torques.size:
            x = x.copy()
            x[self.torques] = torques.tau
            if self.others is not None:
                sides.append(self.others.at(x, self.torques, torques.jacobian))
        distances = None if self.clearance is None else self.clearance.at(self.shape, x)
        return Iterate(x, self.cost.value(x, torques.tau), torques, tuple(sides), distances)

    def after(self, x: Array, step: Array) -> Array:
        """Unknowns after a step, within their bounds; each of shape (unknowns,)."""
        moved = np.where(self.free, np.clip(x + step, *self.bounds), x)
        if self.lead is not None:
            (duration,) = self.cost.durations
            moved += self.lead * (moved[duration] - x[duration])
        return moved

    def step_program(self, at: Iterate, limits: tuple[Array, Array], prices: Prices) -> ConvexStep:
        """The quadratic program at an iterate, without the bounds of the step.

        Args:
            at: the iterate.
            limits: torque limits, as in `Iterate.penalties`.
            prices: prices of violations; velocity limits must be satisfied, whatever the price.
        """
        (low, high), tau, (velocities, *others) = limits, at.torques.tau, at.sides
        points, given = np.repeat(np.arange(len(tau)), tau.shape[1]), velocities.equal
        if np.any(given):
            others.insert(0, velocities.only(given))
        soft = [SoftRows.between(at.torques.jacobian, (low - tau).ravel(), (high - tau).ravel(), points, prices.row)]
        soft += [SoftRows(*sides.below(at.x), prices.row) for sides in others]
        if at.distances is not None:
            own = at.distances
            soft.append(SoftRows((-own.jacobian,), own.spare, own.samples, prices.distance))
        nothing, cost = np.zeros(at.x.size), self.cost
        return ConvexStep(
            place=self.place,
            gradient=cost.gradient(at.x, at.torques),
            curvature=cost.moving,
            squares=cost.no_squares if cost.torques is None else cost.torques.squares(at.x, at.torques),
            bounds=(nothing, nothing),
            hard=velocities.only(~given).below(at.x)[:2],
            soft=tuple(soft),
        )

    def region(self, x: Array, trust: float, stretch: float) -> Array:
        """Largest changes of the unknowns in a trust region, shape (unknowns,).

        Args:
            x: unknowns at the iterate.
            trust: radius of the region [rad or m].
            stretch: largest change of a duration, as a part of it, over the radius [1/rad or 1/m].
        """
        region, own = np.full(x.size, trust), self.cost.durations
        region[own] = stretch * trust * x[own]
        return region

    def within(self, step: ConvexStep, x: Array, region: Array) -> ConvexStep:
        """A quadratic program whose step from unknowns x is within a region."""
        low, high = self.bounds
        lower, upper = np.maximum(-region, np.minimum(low - x, 0)), np.minimum(region, np.maximum(high - x, 0))
        return replace(step, bounds=(lower, upper))
