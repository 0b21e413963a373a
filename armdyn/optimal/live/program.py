"""The quadratic program of one step: unknowns are the control points and the duration, torques are linearised.

The start state is kept exactly: the first control point is its position, the second one lies on the line of its
velocity, at a distance that grows with the duration. The last two control points are the goal.
"""

from dataclasses import dataclass
from typing import NamedTuple

import _armdyn_curves as curves
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from armdyn.arrays import Array
from armdyn.dynamics.numeric import InverseDerivatives
from armdyn.locks import cached_property
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.flat.clearance_rows import ClearanceRows, Linearised
from armdyn.optimal.flat.convex_step import compressed
from armdyn.optimal.flat.curve import Curve, CurveLeg
from armdyn.optimal.flat.program import CurveLayout
from armdyn.optimal.flat.torque_rows import linear_torques
from armdyn.optimal.live.mesh import Places
from armdyn.optimal.task.policy.live import LivePolicy

_IN_FLIGHT = 1e-5
"""Part of the velocity limits that is kept: programs are solved to a tenth of it."""
_OPEN = 1e-9
"""Room that a control point at, or beyond, a position limit has in its direction [rad or m]."""
_MOST_ITERATIONS = 60
"""Of the interior-point method; it takes 6 to 20."""


@dataclass(frozen=True, eq=False)
class Ends:
    """Start state and goal of a motion.

    Attributes:
        q: positions at the start [rad or m], shape (nv,).
        v: velocities there [rad/s or m/s], shape (nv,).
        goal: positions at the end, where the arm rests.
    """

    q: Array
    v: Array
    goal: Array


@dataclass(frozen=True, eq=False)
class TorqueMargins:
    """Parts of half the torques' ranges that are taken off their limits, each of shape (places, nv)."""

    upper: Array
    lower: Array


@dataclass(frozen=True, eq=False)
class Iterate:
    """A curve with its torques, linearised.

    Attributes:
        points: control points [rad or m], shape (basis.size, nv).
        duration: [s].
        v: velocities at the places [rad/s or m/s], shape (places, nv).
        tau: torques there [N m or N], likewise.
        by_points: their derivatives by the control points of their windows, shape (places, nv, WINDOW, nv).
        by_duration: by the duration, shape (places, nv); the second control point moves with it.
        q: positions at the places.
        near: distances; None: none are asked for.
    """

    points: Array
    duration: float
    q: Array
    v: Array
    tau: Array
    by_points: Array
    by_duration: Array
    near: Linearised | None = None


@dataclass(frozen=True)
class Pace:
    """How far a step may go, and what it costs to miss torque limits.

    Attributes:
        reach: part of the greatest step.
        price: of a torque beyond its limit by half its range [s].
    """

    reach: float
    price: float


@dataclass(frozen=True, eq=False)
class ProgramStep:
    """Step of a quadratic program.

    Attributes:
        points: change of the control points [rad or m], shape (basis.size, nv).
        longer: change of the duration [s].
        promised: merit by the linearised rows [s].
        part: size of the step as a part of the greatest one.
    """

    points: Array
    longer: float
    promised: float
    part: float


class _SparseRows(NamedTuple):
    """Compressed rows, their upper sides, and slacks with their prices."""

    start: NDArray[np.int32]
    column: NDArray[np.int32]
    value: Array
    top: Array
    slack: NDArray[np.int32]
    price: Array


class StepProgram:
    """Quadratic programs of one structure; the payload does not matter to it.

    Attributes:
        mesh: of the curve.
        limits: of torques, velocities and positions.
        acceleration: limits [rad/s² or m/s²], shape (nv,), inf: none.
    """

    def __init__(self, mesh: Places, limits: JointLimits, acceleration: Array, policy: LivePolicy):
        self.mesh, self.limits, self.acceleration, self.policy = mesh, limits, acceleration, policy
        self.nv, self.count = limits.velocity.size, mesh.basis.size
        self.size = self.count * self.nv + 1
        self.half = limits.actuators.half_range
        self.layout = CurveLayout(self.nv, (mesh.basis.intervals,))
        self._velocity = np.where(np.isinf(limits.velocity), np.inf, limits.velocity * (1 - _IN_FLIGHT))
        self._scale = np.where(np.isinf(limits.velocity), 1.0, limits.velocity)
        self._lay_out()

    def ends(self, points: Array, duration: float, ends: Ends) -> Array:
        """Control points within position limits whose curve begins in the start state and ends at rest at the goal."""
        out = np.clip(points, self.limits.position_lower, self.limits.position_upper)
        out[0], out[1] = ends.q, ends.q + self._lead(ends) * duration
        out[-2:] = ends.goal
        return out

    def curve(self, points: Array, duration: float) -> Curve:
        """The curve of control points."""
        return Curve((CurveLeg(self.mesh.basis, points, duration),))

    def at(
        self, points: Array, duration: float, ends: Ends, torques: InverseDerivatives, clear: ClearanceRows | None
    ) -> Iterate:
        """Linearise a curve.

        Args:
            points: control points, as `ends` makes them.
            duration: [s].
            ends: of the curve.
            torques: inverse dynamics with derivatives.
            clear: distances that are asked for; None: none.
        """
        windows = points[self.mesh.window]
        q, v, tau, by_points, by_duration = linear_torques(torques, self.mesh.local, windows, duration)
        lead = self._lead(ends)
        for first in (0, 1):
            own = self.mesh.first == first
            by_duration[own] += by_points[own, :, 1 - first] @ lead
        near = None
        if clear is not None:
            x = np.append(np.append(points.ravel(), duration), np.zeros(self.layout.size - self.size))
            near = clear.at(self.layout, x)
        return Iterate(points, duration, q, v, tau, by_points, by_duration, near)

    def merit(self, at: Iterate, margins: TorqueMargins, price: float) -> float:
        """Duration, smoothness and prices of what is violated [s]; price: of a torque [s]."""
        policy = self.policy
        torque = np.maximum(np.max(np.maximum(*self.violations(at, margins)), axis=1), 0)
        rates = sum(float(np.sum(np.maximum(np.abs(c) / b - T, 0))) for c, b, T in self._rates(at))
        missing = 0.0 if at.near is None else float(np.sum(at.near.missing))
        smooth = self._smoothness(at)
        return float(at.duration + smooth + price * np.sum(torque) + policy.rate * rates + policy.distance * missing)

    def violations(self, at: Iterate, margins: TorqueMargins) -> tuple[Array, Array]:
        """Excess over the upper and the lower torque limits less margins, as parts of half the ranges."""
        lower, upper = self._torque_limits(at, margins)
        return (at.tau - upper) / self.half, (lower - at.tau) / self.half

    def step(self, at: Iterate, margins: TorqueMargins, ends: Ends, pace: Pace) -> ProgramStep | None:
        """The step of a quadratic program; None: it was not solved.

        Args:
            at: where it is linearised.
            margins: of the torques.
            ends: of the curve.
            pace: greatest step, and price of torques.
        """
        policy, T, reach = self.policy, at.duration, pace.reach
        lower, upper = self._torque_limits(at, margins)
        self._fill(at, ends)
        (velocity, bound, _), *others = self._rates(at)
        inner = velocity[self._inner] / bound
        tops = [(upper - at.tau) / self.half, (at.tau - lower) / self.half, T - inner, T + inner]
        for c, most, whole in others:
            tops += [whole - c / most, whole + c / most]
        price = self._price.copy()
        price[: self.mesh.places.size] = pace.price
        rows = _SparseRows(*self._pattern, np.concatenate([np.ravel(each) for each in tops]), self._slack, price)
        if at.near is not None:
            rows = self._with_distances(rows, at.near)
        gradient = np.append((self._smoothing @ at.points / self._scale**2).ravel(), 1.0)
        gradient[-1] += gradient[self.nv : 2 * self.nv] @ self._lead(ends)
        low, high = self._bounds(at, reach)
        start, column, value = self._curvature
        curvature = start, column, (1 + policy.proximal / reach) * value
        found, _, cost, step, _, _ = curves.solve(
            place=self._place, gradient=gradient, curvature=curvature, squares=self._nothing,
            square_weight=np.empty(0), lower=low, upper=high, rows=rows[:3], top=rows.top, slack=rows.slack,
            price=rows.price, tolerance=policy.accuracy, most=_MOST_ITERATIONS,
        )  # fmt: skip
        change: Array = np.frombuffer(step)
        if not found or not np.all(np.isfinite(change)):
            return None
        points, longer = change[:-1].reshape(at.points.shape), float(change[-1])
        greatest = T * (policy.faster if longer < 0 else policy.slower)
        part = max(float(np.max(np.abs(points))) / policy.trust, abs(longer) / greatest)
        return ProgramStep(points, longer, T + self._smoothness(at) + float(cost), part)

    def _bounds(self, at: Iterate, reach: float) -> tuple[Array, Array]:
        """Bounds of a step: its reach, and the position limits of control points."""
        policy, limits = self.policy, self.limits
        high = np.full(self.size, reach * policy.trust)
        low = -high
        down, up = (limits.position_lower - at.points).ravel(), (limits.position_upper - at.points).ravel()
        low[:-1] = np.maximum(low[:-1], np.minimum(down, -_OPEN))
        high[:-1] = np.minimum(high[:-1], np.maximum(up, _OPEN))
        low[-1], high[-1] = -reach * policy.faster * at.duration, reach * policy.slower * at.duration
        return low, high

    def _smoothness(self, at: Iterate) -> float:
        """Cost of the squared accelerations [s]."""
        return float(np.sum((self._smoothing @ at.points) * at.points / self._scale**2)) / 2

    def _lead(self, ends: Ends) -> Array:
        """Distance of the second control point from the first over the duration [rad/s or m/s], shape (nv,)."""
        return np.asarray(ends.v / self.mesh.basis.factors(1)[0])

    def _torque_limits(self, at: Iterate, margins: TorqueMargins) -> tuple[Array, Array]:
        """Least and largest torques at the places, in the states of the iterate."""
        lower, upper = self.limits.actuators.range(at.q, at.v)
        return lower + margins.lower * self.half, upper - margins.upper * self.half

    def _rates(self, at: Iterate) -> list[tuple[Array, Array, float]]:
        """Control points of derivatives by the part of the time, the limits, and the power of the duration."""
        basis, T = self.mesh.basis, at.duration
        first = basis.factors(1)[:, None] * np.diff(at.points, axis=0)
        out = [(first, self._velocity, T)]
        if np.any(np.isfinite(self.acceleration)):
            out.append((basis.factors(2)[:, None] * np.diff(first, axis=0), self.acceleration, T**2))
        return out

    def _fill(self, at: Iterate, ends: Ends) -> None:
        """Write the numbers of the rows into their pattern."""
        values, half = self._pattern[2], self.half[:, None]
        torque = np.concatenate(
            [(at.by_points.reshape(*at.tau.shape, -1)) / half, (at.by_duration / self.half)[..., None]], axis=-1
        )
        size = torque.size
        values[:size] = torque.ravel()
        values[size : 2 * size] = -values[:size]
        lead, (velocity, acceleration) = self._lead(ends), self._of_duration
        basis = self.mesh.basis
        # d = f (P[i+1] - P[i]) of velocities; where P[1] is in it, it moves with the duration.
        own = basis.factors(1)[1] * lead / self._velocity
        values[velocity[0, 0]], values[velocity[1, 0]] = -1 - own, -1 + own
        if acceleration.size:
            f1, f2 = basis.factors(1), basis.factors(2)
            values[acceleration] = -2 * at.duration
            for place, weight in ((0, -f2[0] * (f1[0] + f1[1])), (1, f2[1] * f1[1])):
                by_duration = weight * lead / self.acceleration
                values[acceleration[0, place]] += by_duration
                values[acceleration[1, place]] -= by_duration

    def _with_distances(self, rows: _SparseRows, near: Linearised) -> _SparseRows:
        """Rows with those of the distances, linearised: spare + J step >= 0."""
        matrix = near.jacobian[:, : self.size].tocsr()
        return _SparseRows(
            np.concatenate([rows.start, rows.start[-1] + matrix.indptr[1:]]).astype(np.int32),
            np.concatenate([rows.column, matrix.indices]).astype(np.int32),
            np.concatenate([rows.value, -matrix.data]),
            np.append(rows.top, near.spare),
            np.concatenate([rows.slack, rows.price.size + near.samples]).astype(np.int32),
            np.append(rows.price, np.full(near.missing.size, self.policy.distance)),
        )

    def _lay_out(self) -> None:
        """Columns of all rows, their slacks, the order of elimination and the smoothing."""
        nv, count, mesh = self.nv, self.count, self.mesh
        joints, last = np.arange(nv), self.size - 1
        window = (mesh.window[:, :, None] * nv + joints).reshape(len(mesh.window), -1)
        of_torque = np.hstack([window, np.full((len(window), 1), last)])
        columns = [np.repeat(of_torque[:, None], nv, axis=1)] * 2
        slack = [np.repeat(np.arange(len(window)), nv)] * 2
        prices, values = [np.zeros(len(window))], [np.zeros(columns[0].size)] * 2
        self._inner = np.arange(1, count - 2)  # the first and the last velocity are given
        kinds = [(1, self._inner, self._velocity)]
        if np.any(np.isfinite(self.acceleration)):
            kinds.append((2, np.arange(count - 2), self.acceleration))
        of_duration = []
        for order, index, bound in kinds:
            own = (index[:, None, None] + np.arange(order + 1)) * nv + joints[:, None]
            own = np.concatenate([own, np.full((*own.shape[:2], 1), last)], axis=2)
            factors = self._factors(order)[index][:, None] / bound[:, None]
            for sign in (1.0, -1.0):
                columns.append(own)
                number = np.concatenate([sign * factors, np.full((*own.shape[:2], 1), -1.0)], axis=2)
                where = sum(each.size for each in values) + np.arange(number.size).reshape(number.shape)[..., -1]
                of_duration.append(where)
                values.append(number.ravel())
            each = sum(price.size for price in prices) + np.arange(index.size * nv)
            slack += [each, each]
            prices.append(np.full(each.size, self.policy.rate))
        self._of_duration = (np.array(of_duration[:2]), np.array(of_duration[2:]))
        sizes = np.concatenate([np.full(each[..., 0].size, each.shape[-1]) for each in columns])
        start = np.append(0, np.cumsum(sizes)).astype(np.int32)
        column = np.concatenate([each.ravel() for each in columns]).astype(np.int32)
        self._pattern = (start, column, np.concatenate(values))
        self._slack, self._price = np.concatenate(slack).astype(np.int32), np.concatenate(prices)
        self._place = np.full(self.size, -1, dtype=np.int32)
        free = slice(2 * nv, (count - 2) * nv)
        self._place[free] = np.arange((count - 4) * nv)
        self._place[-1] = (count - 4) * nv
        matrix = sp.kron(sp.csr_matrix(self._smoothing), sp.diags(1 / self._scale**2), format="csr")
        curvature = sp.block_diag([matrix, sp.csr_matrix((1, 1))], format="csr")
        curvature.sort_indices()
        self._curvature = compressed(curvature)
        self._nothing = compressed(sp.csr_matrix((0, self.size)))

    def _factors(self, order: int) -> Array:
        """Factors from control points to those of a derivative, shape (count - order, order + 1)."""
        first = self.mesh.basis.factors(1)
        if order == 1:
            return np.stack([-first, first], axis=1)
        second = self.mesh.basis.factors(2)[:, None]
        return np.asarray(second * np.stack([first[:-1], -first[:-1] - first[1:], first[1:]], axis=1))

    @cached_property
    def _smoothing(self) -> Array:
        """Weight of the squared second derivatives, shape (basis.size, basis.size)."""
        second = np.zeros((self.mesh.places.size, self.count))
        np.put_along_axis(second, self.mesh.window, self.mesh.local[:, 2], axis=1)
        return np.asarray(self.policy.smooth * (second.T * self.mesh.weights) @ second)
