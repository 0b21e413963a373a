"""Program of curves for sequential convexification: its cost and torques by hand, other equations by CasADi."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from armdyn.arrays import Array, Index
from armdyn.locks import cached_property
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.equations import POINTS
from armdyn.optimal.flat.linear_rows import (
    ClearanceRows,
    DerivativeRows,
    Sides,
    TorqueParts,
    TorqueRows,
    clearance_rows,
)
from armdyn.optimal.flat.nlp_data import (
    CurveSpec,
    assemble_curve,
    curve_layout,
    finite,
    rate_limits,
    rows_of,
    travel_scales,
)
from armdyn.optimal.flat.program import CurveLayout, build
from armdyn.optimal.program.assembly import Program
from armdyn.optimal.solve.registry import in_time
from armdyn.optimal.solve.solver import NlpData
from armdyn.optimal.task.task import Task


@dataclass(frozen=True, eq=False)
class CurveCost:
    """Cost in seconds, quadratic except for products of durations and efforts.

    Attributes:
        durations: indices of the durations, shape (legs,).
        duration_of_point: index of the duration of each point's leg, shape (points,).
        tie: price of squared torques, shape (points,) [s].
        effort: price of squared torques per duration, shape (points, joints) [-].
        steps: price of squared differences of the torques of neighbouring points of a leg, shape (points - 1,) [s].
        moving: price of squared velocities: matrix of shape (unknowns, unknowns) [s].
    """

    durations: Index
    duration_of_point: Index
    tie: Array
    effort: Array
    steps: Array
    moving: sp.csr_matrix

    def value(self, x: Array, tau: Array) -> float:
        """Cost of unknowns, shape (unknowns,), with their torques, shape (points, joints)."""
        squares = self._prices(x) * tau**2
        steps = self.steps[:, None] * np.diff(tau, axis=0) ** 2
        return float(np.sum(x[self.durations]) + (np.sum(squares) + np.sum(steps) + x @ (self.moving @ x)) / 2)

    def gradient(self, x: Array, at: TorqueParts) -> Array:
        """Gradient in the unknowns, with dependent torques, shape (unknowns,)."""
        gradient = self._prices(x) * at.tau
        steps = self.steps[:, None] * np.diff(at.tau, axis=0)
        gradient[1:] += steps
        gradient[:-1] -= steps
        out = self.moving @ x + at.jacobian.T @ gradient.ravel()
        out[self.durations] += 1
        np.add.at(out, self.duration_of_point, np.sum(self.effort * at.tau**2, axis=1) / 2)
        return np.asarray(out)

    def squares(self, x: Array, at: TorqueParts) -> tuple[sp.csr_matrix, Array]:
        """Rows and weights whose weighted squares are the Gauss-Newton Hessian of the cost."""
        n, prices = at.tau.shape[1], self._prices(x).ravel()
        if not np.any(self.steps):
            return (at.jacobian, prices) if np.any(prices) else (at.jacobian[:0], prices[:0])
        steps = at.jacobian[n:] - at.jacobian[:-n]
        return sp.vstack([at.jacobian, steps], format="csr"), np.append(prices, np.repeat(self.steps, n))

    def _prices(self, x: Array) -> Array:
        return np.asarray(self.tie[:, None] + x[self.duration_of_point][:, None] * self.effort)


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
    return CurveCost(
        durations=np.array([shape.duration(k) for k in shape.legs]),
        duration_of_point=np.repeat([shape.duration(k) for k in shape.legs], sizes),
        tie=parts * np.repeat(spec.smooth * times / n, sizes),
        effort=parts[:, None] * squares,
        steps=steps,
        moving=moving,
    )


@dataclass(frozen=True, eq=False)
class CurveProgram:
    """Numbers of a curve program, and the required distances.

    Attributes:
        numbers: initial unknowns, parameters, bounds.
        shape: layout of the unknowns and equations.
        guess: curve of the initial unknowns.
        torque_rows: torques and their derivatives.
        cost: the cost.
        smooth: price of squared accelerations, to make steps unique, shape (unknowns, unknowns) [s].
        derivative_rows: control points of the limited derivatives, velocities first.
        program: functions of `others`; None: no such equations.
        clearance: required distances; None: no distances.
    """

    numbers: NlpData
    shape: CurveLayout
    guess: Curve
    torque_rows: TorqueRows
    cost: CurveCost
    smooth: sp.csr_matrix
    derivative_rows: tuple[DerivativeRows, ...]
    program: Program | None = None
    clearance: ClearanceRows | None = None

    @cached_property
    def torques(self) -> Index:
        """Indices of the torques, shape (points of all legs, joints)."""
        return np.concatenate([self.shape.torques(leg) for leg in self.shape.legs])

    @cached_property
    def place(self) -> NDArray[np.int32]:
        """Order of elimination of the unknowns: control points, then durations; -1: fixed, or a torque."""
        lower, upper = self.numbers.x_bounds
        free = lower < upper
        free[self.torques] = False
        last = free & np.isin(np.arange(free.size), self.cost.durations)
        order = np.concatenate([np.flatnonzero(free & ~last), np.flatnonzero(last)])
        place = np.full(free.size, -1, dtype=np.int32)
        place[order] = np.arange(order.size)
        return place

    @cached_property
    def others(self) -> Index:
        """Indices of equations other than those of torques and derivatives."""
        return other_equations(self.shape, self.numbers.g_bounds[0].size)

    def rates(self, order: int) -> Index:
        """Indices of the equations of a derivative's control points."""
        return np.concatenate([self.shape.rates(leg, order).ravel() for leg in self.shape.legs])

    def sides(self, x: Array, load: sp.csr_matrix) -> tuple[Sides, ...]:
        """Linearise the control points of the derivatives, velocities first, and the other equations, if there are any.

        Args:
            x: unknowns, including the torques.
            load: ∂(torques)/∂(unknowns), shape (torques, unknowns): torques are eliminated.
        """
        derivatives = tuple(rows.at(x, self._bounds(self.rates(rows.order))) for rows in self.derivative_rows)
        if self.program is None:
            return derivatives
        g, matrix = self.program.jacobian(x, self.numbers.p)
        whole = sp.csc_matrix((matrix.nonzeros(), matrix.row(), matrix.colind()), shape=matrix.shape)
        rows, torques = whole.tocsr()[self.others], self.torques.ravel()
        jacobian = (rows + rows[:, torques] @ load).tocsr()
        return *derivatives, Sides(jacobian, np.array(g).ravel()[self.others], self._bounds(self.others))

    def _bounds(self, rows: Index) -> tuple[Array, Array]:
        low, high = (side[rows] for side in self.numbers.g_bounds)
        return low, high


def other_equations(shape: CurveLayout, count: int) -> Index:
    """Indices of the equations that limit neither torques nor time derivatives, out of `count` equations."""
    own = [shape.torque_rows(leg).ravel() for leg in shape.legs]
    own += [shape.rates(leg, order).ravel() for leg in shape.legs for order in shape.orders]
    return np.setdiff1d(np.arange(count), np.concatenate(own))


def curve_program(task: Task, guess: Curve, spec: CurveSpec) -> CurveProgram:
    """Program for sequential convexification.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        spec: requirements of the curve.
    """
    problem = task.problem
    shape, rows = curve_layout(problem, guess, spec.constraints), rows_of(problem, spec.constraints)
    required = spec.constraints.required_distances(problem)
    data, program = assemble_curve(task, guess, spec, shape), None
    if other_equations(shape, data.g_bounds[0].size).size:
        program = in_time(task, lambda scheme: build(task.dynamics, shape, rows, scheme.compile))
    limits = rate_limits(problem, spec.constraints)
    bases = [leg.basis for leg in guess.legs]
    points = [(basis, basis.gauss(POINTS)[0].ravel()) for basis in bases]
    return CurveProgram(
        numbers=data,
        shape=shape,
        guess=guess,
        torque_rows=TorqueRows(problem.robot, problem.limits.actuators.half_range, points, shape),
        cost=curve_cost(task, guess, spec, shape),
        smooth=_smoothing(task, guess, spec, shape),
        derivative_rows=tuple(DerivativeRows.of(bases, shape, k, finite(limits[k])) for k in shape.orders),
        program=program,
        clearance=None if required is None else clearance_rows(required, guess, task.policy.sequential),
    )


def _smoothing(task: Task, guess: Curve, spec: CurveSpec, shape: CurveLayout) -> sp.csr_matrix:
    """Weights of squared accelerations over velocity limits, in the unknowns; zero if torques have a cost."""
    if spec.smooth or spec.travel:
        return sp.csr_matrix((shape.size, shape.size))
    numbers, times = task.policy.sequential, np.array([leg.duration for leg in guess.legs])
    prices = numbers.smooth * np.ones(times.size)
    if shape.joined:  # of accelerations in time: those of short legs are large
        prices = numbers.smooth_short * (np.max(times) / times) ** 3
    squared = [price * leg.basis.squared(2, POINTS) for price, leg in zip(prices, guess.legs, strict=True)]
    return quadratic_form(shape, squared, task.problem.limits.velocity)
