"""Rows of a curve's program, linear in its unknowns: torques, time derivatives, distances."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy.sparse as sp

from armdyn.arrays import Array, Flags, Index
from armdyn.dynamics.numeric import inverse_dynamics, inverse_dynamics_derivatives
from armdyn.locks import cached_property
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.collision import CollisionModel
from armdyn.optimal.constraints.constraint import RequiredDistances
from armdyn.optimal.curves.curve import Basis, Curve, CurveLeg
from armdyn.optimal.curves.layout import CurveLayout
from armdyn.optimal.problem.policy.policy import Policy


def with_values(pattern: sp.csr_matrix, values: Array) -> sp.csr_matrix:
    """Matrix of the same sparsity with other values; scipy's constructor would check the pattern again."""
    out = copy(pattern)
    out.data = values
    return out


@dataclass(frozen=True, eq=False)
class Sides:
    """Rows low <= g <= high at an iterate, perhaps linear in control points over a power of a duration.

    Attributes:
        jacobian: ∂g/∂(unknowns), shape (rows, unknowns); with a power, the last entry of every row is that of its T.
        values: g, shape (rows,).
        bounds: low and high, each of shape (rows,).
        power: k of rows g = c(points) / T^k; 0: any other form.
        duration: index of each row's T, shape (rows,), with a power.
    """

    jacobian: sp.csr_matrix
    values: Array
    bounds: tuple[Array, Array]
    power: int = 0
    duration: Index | None = None

    @property
    def missed(self) -> float:
        """Sum of the rows' violations."""
        low, high = self.bounds
        return float(np.sum(np.maximum(np.maximum(self.values - high, low - self.values), 0)))

    @property
    def equal(self) -> Flags:
        """Whether each row is an equation, shape (rows,)."""
        return np.asarray(self.bounds[0] == self.bounds[1])

    def only(self, which: Flags) -> Self:
        """The selected rows."""
        if np.all(which):
            return self
        low, high = (side[which] for side in self.bounds)
        duration = None if self.duration is None else self.duration[which]
        return replace(
            self, jacobian=self.jacobian[which], values=self.values[which], bounds=(low, high), duration=duration
        )

    def below(self, x: Array) -> tuple[tuple[sp.csr_matrix, ...], Array, Index]:
        """One-sided rows of a step, upper sides first, and the index of each one's row.

        c / T^k <= b becomes c <= b T^k, linear in T for k = 1, else convex: the tangent of T^k is exact or
        conservative.
        """
        (low, high), jacobian = self.bounds, self.jacobian
        top = np.concatenate([high - self.values, self.values - low])
        rows = tuple(with_values(jacobian, sign * jacobian.data) for sign in (1, -1))
        if self.power:
            # From -k c / T^(k + 1), which the Jacobian has, to -k b / T.
            changes = np.where(np.isinf(top), 0.0, top).reshape(2, -1) * (-self.power / x[self.duration])
            for each, change in zip(rows, changes, strict=True):
                each.data[each.indptr[1:] - 1] += change
        return rows, top, np.tile(np.arange(self.values.size), 2)


@dataclass(frozen=True, eq=False)
class DerivativeRows:
    """Control points of a time derivative over its scales, c(points) / T^order, of all curves of one layout.

    Attributes:
        order: order of the derivative.
        linear: ∂c/∂(unknowns), shape (rows, unknowns); the last entry of every row is a zero at its T.
        duration: index of T of each row, shape (rows,).
        bounds: low and high, each of shape (rows,).
    """

    order: int
    linear: sp.csr_matrix
    duration: Index
    bounds: tuple[Array, Array]

    @classmethod
    def of(
        cls, bases: Sequence[Basis], shape: CurveLayout, order: int, scales: Array, bounds: tuple[Array, Array]
    ) -> Self:
        """Rows of all legs, by control point and joint.

        Args:
            bases: bases of the legs.
            shape: layout of the program.
            order: order of the derivative.
            scales: scale of every joint, shape (joints,).
            bounds: low and high, each of shape (rows,).
        """
        columns, values = [], []
        for k, basis in enumerate(bases):
            factors = basis.differences(order)[:, None] / scales[:, None]
            window = np.arange(len(factors))[:, None] + np.arange(order + 1)
            points = shape.points(k)[window].transpose(0, 2, 1)
            columns.append(np.insert(points, order + 1, shape.duration(k), axis=2).reshape(-1, order + 2))
            values.append(np.insert(factors, order + 1, 0.0, axis=2).reshape(-1, order + 2))
        entries, index = np.concatenate(values), np.concatenate(columns)
        starts = np.arange(len(index) + 1) * (order + 2)
        linear = sp.csr_matrix((entries.ravel(), index.ravel(), starts), (len(index), shape.size))
        return cls(order, linear, index[:, -1], bounds)

    def at(self, x: Array, lead: Array | None = None) -> Sides:
        """Linearise the rows at unknowns x, shape (unknowns,); lead: as in `TorqueParts`."""
        k, linear, T = self.order, self.linear, x[self.duration]
        c = linear @ x
        entries = linear.data.reshape(c.size, -1) / T[:, None] ** k
        entries[:, -1] = -k * c / T ** (k + 1)
        jacobian = _with_lead(with_values(linear, entries.ravel()), lead)
        return Sides(jacobian, c / T**k, self.bounds, k, self.duration)


def _with_lead(jacobian: sp.csr_matrix, lead: Array | None) -> sp.csr_matrix:
    """Add to the last entry of every row, that of its T, the change by the unknowns that move with T."""
    if lead is not None:
        jacobian.data[jacobian.indptr[1:] - 1] += jacobian @ lead
    return jacobian


@dataclass(frozen=True, eq=False)
class TorqueParts:
    """Torques of one curve as parts of half their ranges.

    Attributes:
        rows: rows that evaluated the torques.
        T: durations [s], shape (points of all legs, 1).
        q: positions at the points [rad or m], shape (points of all legs, joints).
        v: velocities [rad/s or m/s], likewise.
        a: accelerations [rad/s² or m/s²], likewise.
        tau: torques, likewise.
        lead: derivatives of the unknowns in the duration, shape (unknowns,); None: zero.
    """

    rows: "TorqueRows"
    T: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    lead: Array | None

    @cached_property
    def jacobian(self) -> sp.csr_matrix:
        """∂(torques)/∂(unknowns), shape (points * joints, unknowns)."""
        return self.rows.jacobian(self)


class TorqueRows:
    """Torques of all curves of one layout on the same bases.

    Attributes:
        torque: inverse dynamics.
    """

    def __init__(self, robot: Robot, half_range: Array, legs: Sequence[tuple[Basis, Array]], shape: CurveLayout):
        """Evaluate the splines at the points.

        Args:
            robot: the arm.
            half_range: scales of the torques [N m or N], shape (joints,).
            legs: basis of each leg, and its points as parts of its duration.
            shape: layout of the program.
        """
        self.half_range, n = half_range, robot.nv
        self.torque, self._derivatives = inverse_dynamics(robot), inverse_dynamics_derivatives(robot)
        self._local, self._points = np.concatenate([basis.local(s) for basis, s in legs]), shape.windows(legs)
        self._duration = np.repeat([shape.duration(k) for k in shape.legs], [s.size for _, s in legs])
        columns = np.hstack([self._points.reshape(self._duration.size, -1), self._duration[:, None]])
        index = np.repeat(columns, n, axis=0).astype(np.int32)
        starts = np.arange(len(index) + 1, dtype=np.int32) * index.shape[1]
        self._pattern = sp.csr_matrix((np.zeros(index.size), index.ravel(), starts), (len(index), shape.size))

    def at(self, x: Array, lead: Array | None = None) -> TorqueParts:
        """Torques at unknowns x, whose torque entries are ignored; lead: as in `TorqueParts`."""
        T = x[self._duration][:, None]
        q, dq, ddq = (self._local @ x[self._points]).transpose(1, 0, 2)
        v, a = dq / T, ddq / T**2
        return TorqueParts(self, T, q, v, a, self.torque(q, v, a) / self.half_range, lead)

    def jacobian(self, at: TorqueParts) -> sp.csr_matrix:
        """Linearise torques; see `TorqueParts`."""
        tau, by_q, by_v, inertia = self._derivatives(at.q, at.v, at.a)
        n, wide = tau.shape[1], at.T[..., None]
        local = self._local.transpose(0, 2, 1) / wide ** np.arange(3)
        by_points = local @ np.stack([by_q, by_v, inertia], axis=1).reshape(len(tau), 3, n * n)
        by_duration = -(by_v @ at.v[..., None] + 2 * inertia @ at.a[..., None]) / wide
        columns = [by_points.reshape(len(tau), -1, n, n).transpose(0, 2, 1, 3).reshape(len(tau), n, -1), by_duration]
        values = np.concatenate(columns, axis=2) / self.half_range[:, None]
        return _with_lead(with_values(self._pattern, values.ravel()), at.lead)


@dataclass(frozen=True, eq=False)
class Linearised:
    """Linearised distances of a curve: `spare + jacobian @ step` must not be negative.

    Attributes:
        spare: distances minus the required ones [m], shape (rows,).
        jacobian: derivatives with respect to the unknowns, shape (rows, unknowns).
        samples: index of each row's pose, shape (rows,).
        missing: largest shortfall at every pose [m], shape (poses,); 0 without any.
    """

    spare: Array
    jacobian: sp.csr_matrix
    samples: Index
    missing: Array


@dataclass(frozen=True, eq=False)
class ClearanceRows:
    """Distance rows of a scene's pairs at some poses of a curve.

    Attributes:
        model: collision model of the scene.
        required: required distances [m], shape (pairs,).
        legs: basis of each leg, and its poses as parts of its duration.
        within: largest distance of a pair with a row [m].
        most: largest number of rows per pose.
    """

    model: CollisionModel
    required: Array
    legs: tuple[tuple[Basis, Array], ...]
    within: float
    most: int

    @cached_property
    def _weights(self) -> Array:
        """Weights of the control points on which a pose depends, shape (poses, WINDOW)."""
        return np.concatenate([basis.local(s, 0)[:, 0] for basis, s in self.legs])

    def at(self, shape: CurveLayout, x: Array) -> Linearised:
        """Linearise all distances at the unknowns x, shape (shape.size,)."""
        of_pose = shape.windows(self.legs)
        near = self.model.near(np.einsum("pi,pin->pn", self._weights, x[of_pose]), self.within, self.most)
        spare, missing = near.distances - self.required[near.pairs], np.zeros(len(of_pose))
        np.maximum.at(missing, near.poses, -spare)
        columns, values = of_pose[near.poses], near.gradients[:, None] * self._weights[near.poses][..., None]
        starts = np.arange(spare.size + 1) * of_pose[0].size
        jacobian = sp.csr_matrix((values.ravel(), columns.ravel(), starts), shape=(spare.size, shape.size))
        return Linearised(spare, jacobian, near.poses, missing)


def clearance_rows(required: RequiredDistances, guess: Curve, numbers: Policy) -> ClearanceRows:
    """Rows at evenly spaced places of every leg, where distances were violated before, and where pairs pass closely."""
    policy, longest = numbers.sequential, max(leg.basis.intervals for leg in guess.legs)
    least = np.minimum(required.clearance + policy.clearance_added, required.most)
    legs = []
    for leg, more in zip(guess.legs, required.places, strict=True):
        even = np.linspace(0, 1, numbers.curves.intervals * leg.basis.intervals // longest + 2)
        passing = _passing(required.model, leg, even, least + policy.passing)
        near = np.concatenate([more, passing])
        around = (near[:, None] + even[1] / 3 * np.array([-1, 0, 1])).ravel()
        # Places nearer than a hundredth of a step are redundant.
        all_ = np.unique(np.round(np.concatenate([even, around]) / (0.01 * even[1]))) * 0.01 * even[1]
        legs.append((leg.basis, all_[(all_ > 0) & (all_ < 1 - 1e-9)]))
    return ClearanceRows(required.model, least, tuple(legs), policy.within, policy.pairs)


_FINER = 8
"""Parts of two steps that are sampled for the time of least distance, twice: 1/32 of a step is accurate enough."""


def _passing(model: CollisionModel, leg: CurveLeg, even: Array, near: Array) -> Array:
    """Parts of a leg's duration at the least distances of pairs that come nearer than `near` [m], shape (pairs,)."""
    distances = model.distances(leg.at(even)[0], float(np.max(near)))
    before, here, after = distances[:-2], distances[1:-1], distances[2:]
    steps, pairs = np.nonzero((here <= before) & (here <= after) & (here < near))
    out = []
    for step, pair in zip(steps + 1, pairs, strict=True):
        first, last = even[step - 1], even[step + 1]
        for _ in range(2):
            times = np.linspace(first, last, _FINER + 1)
            found = model.distances_of(np.array([pair]), leg.at(times)[0])
            k = int(np.clip(np.argmin(found), 1, _FINER - 1))
            first, last = times[k - 1], times[k + 1]
        out.append((first + last) / 2)
    return np.array(out)
