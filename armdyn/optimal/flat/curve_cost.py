"""Cost of a curve: durations, and small squares that make the fastest curve unique and calm."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from armdyn.arrays import Array, Index
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.equations import POINTS
from armdyn.optimal.flat.nlp_data import CurveSpec, travel_scales
from armdyn.optimal.flat.program import CurveLayout
from armdyn.optimal.flat.torque_rows import TorqueParts
from armdyn.optimal.task.task import Task


@dataclass(frozen=True, eq=False)
class CurveCost:
    """Cost in seconds, quadratic except for products of durations and efforts.

    Attributes:
        durations: indices of the durations, shape (legs,).
        duration: index of the duration of each point's leg, shape (points,).
        tie: price of squared torques, shape (points,) [s].
        effort: price of squared torques per duration, shape (points, joints) [-].
        steps: price of squared differences of the torques of neighbouring points of a leg, shape (points - 1,) [s].
        moving: price of squared velocities: matrix of shape (unknowns, unknowns) [s].
    """

    durations: Index
    duration: Index
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
        np.add.at(out, self.duration, np.sum(self.effort * at.tau**2, axis=1) / 2)
        return np.asarray(out)

    def squares(self, x: Array, at: TorqueParts) -> tuple[sp.csr_matrix, Array]:
        """Rows and weights whose weighted squares are the Gauss-Newton Hessian of the cost."""
        n, prices = at.tau.shape[1], self._prices(x).ravel()
        if not np.any(self.steps):
            return (at.jacobian, prices) if np.any(prices) else (at.jacobian[:0], prices[:0])
        steps = at.jacobian[n:] - at.jacobian[:-n]
        return sp.vstack([at.jacobian, steps], format="csr"), np.append(prices, np.repeat(self.steps, n))

    def _prices(self, x: Array) -> Array:
        return np.asarray(self.tie[:, None] + x[self.duration][:, None] * self.effort)


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
        duration=np.repeat([shape.duration(k) for k in shape.legs], sizes),
        tie=parts * np.repeat(spec.smooth * times / n, sizes),
        effort=parts[:, None] * squares,
        steps=steps,
        moving=moving,
    )
