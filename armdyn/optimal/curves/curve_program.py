"""Program of curves for sequential convexification: its cost, and its rows linearised at an iterate.

Torques are eliminated: they are functions of control points and durations.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from armdyn.arrays import Array, Flags, Index
from armdyn.locks import cached_property
from armdyn.optimal.curves.curve import Curve
from armdyn.optimal.curves.layout import POINTS, CurveLayout, CurveSpec, finite, rate_limits
from armdyn.optimal.curves.linear_rows import (
    ClearanceRows,
    DerivativeRows,
    Linearised,
    Sides,
    TorqueParts,
    TorqueRows,
    clearance_rows,
)
from armdyn.optimal.curves.nlp_data import travel_scales
from armdyn.optimal.curves.program import build, rows_of
from armdyn.optimal.mesh.ipopt import NlpData
from armdyn.optimal.problem.task import Task


@dataclass(frozen=True, eq=False)
class CurveCost:
    """Cost in seconds: durations, control points, torques; quadratic except for products of durations and efforts.

    By default torques have no price.

    Attributes:
        durations: indices of the durations, shape (legs,).
        moving: price of squared velocities or accelerations: matrix of shape (unknowns, unknowns) [s].
        of_point: index of the duration of each point's leg, shape (points,).
        tie: price of squared torques, shape (points,) [s].
        effort: price of squared torques per duration, shape (points, joints) [-].
        steps: price of squared differences of the torques of neighbouring points of a leg, shape (points - 1,) [s].
    """

    durations: Index
    moving: sp.csr_matrix
    of_point: Index = field(default_factory=lambda: np.empty(0, dtype=int))
    tie: Array = field(default_factory=lambda: np.empty(0))
    effort: Array = field(default_factory=lambda: np.empty((0, 1)))
    steps: Array = field(default_factory=lambda: np.empty(0))

    @cached_property
    def priced(self) -> bool:
        """Whether torques have a price."""
        return any(np.any(each) for each in (self.tie, self.effort, self.steps))

    def value(self, x: Array, tau: Array) -> float:
        """Cost of unknowns, shape (unknowns,), with their torques, shape (points, joints)."""
        squares = x @ (self.moving @ x)
        if self.priced:
            squares += np.sum(self._prices(x) * tau**2) + np.sum(self.steps[:, None] * np.diff(tau, axis=0) ** 2)
        return float(np.sum(x[self.durations]) + squares / 2)

    def gradient(self, x: Array, at: TorqueParts) -> Array:
        """Total derivative of the cost by the unknowns, on which the torques depend, shape (unknowns,)."""
        out = np.asarray(self.moving @ x)
        if at.lead is not None:
            out[self.durations] += at.lead @ out
        out[self.durations] += 1
        if not self.priced:
            return out
        by_torque = self._prices(x) * at.tau
        steps = self.steps[:, None] * np.diff(at.tau, axis=0)
        by_torque[1:] += steps
        by_torque[:-1] -= steps
        out += at.jacobian.T @ by_torque.ravel()
        np.add.at(out, self.of_point, np.sum(self.effort * at.tau**2, axis=1) / 2)
        return out

    def squares(self, x: Array, at: TorqueParts) -> tuple[sp.csr_matrix, Array]:
        """Rows and weights whose weighted squares are the Gauss-Newton Hessian of the torques' cost."""
        n, prices = at.tau.shape[1], self._prices(x).ravel()
        if not self.priced:
            return sp.csr_matrix((0, x.size)), np.empty(0)
        if not np.any(self.steps):
            return at.jacobian, prices
        steps = at.jacobian[n:] - at.jacobian[:-n]
        return sp.vstack([at.jacobian, steps], format="csr"), np.append(prices, np.repeat(self.steps, n))

    def _prices(self, x: Array) -> Array:
        return np.asarray(self.tie[:, None] + x[self.of_point][:, None] * self.effort)


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


OtherRows = Callable[[Array, sp.csr_matrix], Sides]
"""Linearises further equations at unknowns, including the torques, with ∂(torques)/∂(unknowns): torques are eliminated.
"""


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

    def violations(self, limits: tuple[Array, Array]) -> Array:
        """Violations of torques (the largest at every point), distances (likewise) and other rows, each summed.

        Args:
            limits: lower and upper torque limits, as parts of half the ranges, each of shape (points, joints).

        Returns:
            Shape (3,) [-, m, -].
        """
        low, high = limits
        over = np.max(np.maximum(self.torques.tau - high, low - self.torques.tau), axis=1, initial=0)
        missing = 0.0 if self.distances is None else np.sum(self.distances.missing)
        return np.array([np.sum(over), missing, sum(each.missed for each in self.sides)])


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
                sides.append(self.others(x, torques.jacobian))
        distances = None if self.clearance is None else self.clearance.at(self.shape, x)
        return Iterate(x, self.cost.value(x, torques.tau), torques, tuple(sides), distances)

    def after(self, x: Array, step: Array) -> Array:
        """Unknowns after a step, within their bounds; each of shape (unknowns,)."""
        moved = np.where(self.free, np.clip(x + step, *self.bounds), x)
        if self.lead is not None:
            (duration,) = self.cost.durations
            moved += self.lead * (moved[duration] - x[duration])
        return moved


def curve_cost(task: Task, guess: Curve, spec: CurveSpec, shape: CurveLayout) -> CurveCost:
    """The cost of `assemble_curve`'s nonlinear program, in seconds.

    Args:
        task: task with the effort weights.
        guess: curve whose legs' durations weigh the squares.
        spec: weights of the squares.
        shape: layout of the program.
    """
    n, sizes = shape.joints, [POINTS * count for count in shape.intervals]
    parts = np.concatenate([leg.basis.gauss(POINTS)[1].ravel() for leg in guess.legs])
    times = np.array([leg.duration for leg in guess.legs])
    squares = task.problem.effort_weights() * task.problem.limits.actuators.half_range**2
    steps = np.full(parts.size - 1, spec.steps * guess.duration / n)
    steps[np.cumsum(sizes)[:-1] - 1] = 0.0
    moving = sp.csr_matrix((shape.size, shape.size))
    if spec.travel:
        each = zip(spec.travel * times / n, guess.legs, strict=True)
        squared = [price * leg.basis.squared(1, POINTS) for price, leg in each]
        moving = quadratic_form(shape, squared, travel_scales(task, guess))
    elif not spec.smooth:  # squared accelerations over velocity limits determine joints with time to spare
        numbers, prices = task.policy.sequential, np.full(times.size, task.policy.sequential.smooth)
        if shape.joined:  # of accelerations in time: those of short legs are large
            prices = numbers.smooth_short * (np.max(times) / times) ** 3
        squared = [price * leg.basis.squared(2, POINTS) for price, leg in zip(prices, guess.legs, strict=True)]
        moving = quadratic_form(shape, squared, task.problem.limits.velocity)
    return CurveCost(
        durations=np.array([shape.duration(k) for k in shape.legs]),
        moving=moving,
        of_point=np.repeat([shape.duration(k) for k in shape.legs], sizes),
        tie=parts * np.repeat(spec.smooth * times / n, sizes),
        effort=parts[:, None] * squares,
        steps=steps,
    )


def curve_program(task: Task, guess: Curve, spec: CurveSpec, shape: CurveLayout, data: NlpData) -> CurveProgram:
    """Program for sequential convexification.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        spec: requirements of the curve.
        shape: layout of the program.
        data: the nonlinear program's parameters and bounds.
    """
    problem, bases = task.problem, [leg.basis for leg in guess.legs]
    limits, (lower, upper) = rate_limits(problem, spec.constraints), data.x_bounds
    torques = np.concatenate([shape.torques(leg) for leg in shape.legs])
    free = lower < upper
    free[torques] = False

    def bounds(rows: Index) -> tuple[Array, Array]:
        return data.g_bounds[0][rows], data.g_bounds[1][rows]

    required = spec.constraints.required_distances(problem)
    known = [shape.torque_rows(leg).ravel() for leg in shape.legs] + [shape.rates_of_all(k) for k in shape.orders]
    others: OtherRows | None = None
    if (which := np.setdiff1d(np.arange(data.g_bounds[0].size), np.concatenate(known))).size:
        rows = rows_of(problem, spec.constraints)
        equations = task.in_time(lambda scheme: build(task.dynamics, shape, rows, scheme.compile))

        def others(x: Array, load: sp.csr_matrix) -> Sides:
            g, matrix = equations.jacobian(x, data.p)
            whole = sp.csc_matrix((matrix.nonzeros(), matrix.row(), matrix.colind()), shape=matrix.shape)
            own = whole.tocsr()[which]
            return Sides((own + own[:, torques.ravel()] @ load).tocsr(), np.array(g).ravel()[which], bounds(which))

    points = [(basis, basis.gauss(POINTS)[0].ravel()) for basis in bases]
    return CurveProgram(
        shape=shape,
        torque_rows=TorqueRows(problem.robot, problem.limits.actuators.half_range, points, shape),
        derivative_rows=tuple(
            DerivativeRows.of(bases, shape, k, finite(limits[k]), bounds(shape.rates_of_all(k))) for k in shape.orders
        ),
        cost=curve_cost(task, guess, spec, shape),
        bounds=data.x_bounds,
        free=free,
        torques=torques,
        others=others,
        clearance=None if required is None else clearance_rows(required, guess, task.policy),
    )
