"""Program of one step of replanning: mesh, unknowns, rows and cost.

The start state is satisfied exactly: the first control point is its position, the second one is offset along its
velocity, in proportion to the duration. The last two control points are the goal.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from armdyn.arrays import Array, Index
from armdyn.locks import cached_property
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.flat.basis import Basis
from armdyn.optimal.flat.convex_step import ConvexStep, SoftRows, solve_step, with_values
from armdyn.optimal.flat.curve import Curve, CurveLeg
from armdyn.optimal.flat.curve_program import quadratic_form
from armdyn.optimal.flat.linear_rows import ClearanceRows, DerivativeRows, Linearised, Sides, TorqueParts, TorqueRows
from armdyn.optimal.flat.nlp_data import TorqueMargin, finite
from armdyn.optimal.flat.program import CurveLayout
from armdyn.optimal.task.policy.live import LivePolicy

_PER_INTERVAL = 2
"""Number of places of an interval at which torques are limited: its start and its middle."""


@dataclass(frozen=True, eq=False)
class Places:
    """Places of a curve and its B-splines there.

    Attributes:
        basis: spline basis of the curve.
        checks: samples per interval, without its end; a multiple of 4.
    """

    basis: Basis
    checks: int

    @cached_property
    def places(self) -> Array:
        """Breaks and their middles, at which torques are limited, as parts of the duration, shape (places,)."""
        breaks = self.basis.breaks
        inner = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(_PER_INTERVAL) / _PER_INTERVAL
        return np.append(inner.ravel(), 1.0)

    @cached_property
    def weights(self) -> Array:
        """Parts of the duration nearest to each of the places, shape (places,)."""
        lengths = np.gradient(self.places)
        return np.asarray(lengths / np.sum(lengths))

    @cached_property
    def fine(self) -> Array:
        """Samples of each interval, shape (intervals, checks + 1): a break is in two intervals."""
        breaks = self.basis.breaks
        return breaks[:-1, None] + np.diff(breaks)[:, None] * np.linspace(0, 1, self.checks + 1)

    @cached_property
    def samples(self) -> Array:
        """Samples, each once, shape (samples,)."""
        return np.append(self.fine[:, :-1].ravel(), 1.0)

    @cached_property
    def of_samples(self) -> Array:
        """B-splines at the samples with two derivatives, shape (3, samples, basis.size)."""
        return np.array([self.basis.values(self.samples, order) for order in range(3)])

    @cached_property
    def around(self) -> Index:
        """Samples around each place, up to halfway to the next places, shape (places, checks / 2 + 1)."""
        half = self.checks // (2 * _PER_INTERVAL)
        middle = np.arange(self.places.size)[:, None] * (self.checks // _PER_INTERVAL)
        return np.asarray(np.clip(middle + np.arange(-half, half + 1), 0, self.samples.size - 1))

    def per_interval(self, values: Array) -> Array:
        """Values at the samples, shape (samples, nv), interval by interval, shape (intervals, checks + 1, nv)."""
        index = np.arange(self.basis.intervals)[:, None] * self.checks + np.arange(self.checks + 1)
        return np.asarray(values[index])

    def once(self, values: Array) -> Array:
        """Reverse `per_interval`; for a break the larger of its two values."""
        out = np.concatenate([values[:, :-1].reshape(-1, values.shape[-1]), values[-1:, -1]])
        out[self.checks : -1 : self.checks] = np.maximum(out[self.checks : -1 : self.checks], values[:-1, -1])
        return out


_IN_FLIGHT = 1e-5
"""Reserve of the velocity limits, as a part of them: programs are solved to a tenth of it."""
_OPEN = 1e-9
"""Freedom of a control point at, or beyond, a position limit in that direction [rad or m]."""


@dataclass(frozen=True, eq=False)
class Ends:
    """Start state and goal of a motion.

    Attributes:
        q: positions at the start [rad or m], shape (nv,).
        v: velocities at the start [rad/s or m/s], shape (nv,).
        goal: positions at the goal, at rest [rad or m], shape (nv,).
    """

    q: Array
    v: Array
    goal: Array


@dataclass(frozen=True, eq=False)
class Iterate:
    """A curve at which torques, rates and distances are linearised.

    Attributes:
        x: unknowns of the layout; the torques among them are 0 and unused.
        points: control points [rad or m], shape (basis.size, nv).
        duration: duration [s].
        cost: duration plus the weighted squared accelerations [s].
        torques: torques at the places, linear in the unknowns.
        rates: control points of velocities, and of accelerations if these are limited.
        distances: linearised distances; None: no distances are required.
    """

    x: Array
    points: Array
    duration: float
    cost: float
    torques: TorqueParts
    rates: tuple[Sides, ...]
    distances: Linearised | None = None


@dataclass(frozen=True)
class StepControl:
    """Size of the trust region, and the price of excess torques.

    Attributes:
        reach: size of the trust region as a part of the greatest step.
        price: price of a torque beyond its limit by half its range [s].
    """

    reach: float
    price: float


@dataclass(frozen=True, eq=False)
class ProgramStep:
    """Step of a quadratic program.

    Attributes:
        points: change of the control points [rad or m], shape (basis.size, nv).
        longer: change of the duration [s].
        promised: predicted merit [s].
        part: size of the step as a part of the greatest one.
    """

    points: Array
    longer: float
    promised: float
    part: float


class StepProgram:
    """Quadratic programs of one structure, independent of the payload.

    Attributes:
        mesh: mesh of the curve.
        limits: limits of torques, velocities and positions.
        acceleration: acceleration limits [rad/s² or m/s²], shape (nv,), inf: none.
        layout: layout of the unknowns.
    """

    def __init__(self, mesh: Places, limits: JointLimits, acceleration: Array, policy: LivePolicy):
        self.mesh, self.limits, self.acceleration, self.policy = mesh, limits, acceleration, policy
        self.half, nv = limits.actuators.half_range, limits.velocity.size
        self.layout = CurveLayout(nv, (mesh.basis.intervals,))
        self._points, self._last = self.layout.points(0), self.layout.duration(0)
        rows = self._rates(1, limits.velocity * (1 - _IN_FLIGHT))
        inner = slice(nv, -nv)  # the first and the last velocity are given
        self._rows = [replace(rows, linear=rows.linear[inner], duration=rows.duration[inner])]
        if np.any(np.isfinite(acceleration)):
            self._rows.append(self._rates(2, acceleration * (1 - policy.acceleration_reserve)))
        self._bounds = [np.where(np.isinf(limit), np.inf, 1.0) for limit in (limits.velocity, acceleration)]
        second = mesh.basis.values(mesh.places, 2)
        squares = policy.smooth * (second.T * mesh.weights) @ second
        self._smoothing = quadratic_form(self.layout, [squares], finite(limits.velocity))
        self._nothing = sp.csr_matrix((0, self.layout.size)), np.empty(0)
        free = self._points[2:-2].ravel()
        self._place = np.full(self.layout.size, -1, dtype=np.int32)
        self._place[free], self._place[self._last] = np.arange(free.size), free.size

    def _rates(self, order: int, limit: Array) -> DerivativeRows:
        return DerivativeRows.of([self.mesh.basis], self.layout, order, finite(limit))

    def with_ends(self, points: Array, duration: float, ends: Ends) -> Array:
        """Control points within position limits of a curve from the start state to rest at the goal."""
        out = np.clip(points, self.limits.position_lower, self.limits.position_upper)
        out[0], out[1] = ends.q, ends.q + self._first_difference(ends) * duration
        out[-2:] = ends.goal
        return out

    def curve(self, points: Array, duration: float) -> Curve:
        """The curve of control points."""
        return Curve((CurveLeg(self.mesh.basis, points, duration),))

    def linearise(
        self, points: Array, duration: float, ends: Ends, torques: TorqueRows, clear: ClearanceRows | None
    ) -> Iterate:
        """Linearise a curve.

        Args:
            points: control points from `with_ends`.
            duration: duration [s].
            ends: start state and goal.
            torques: linearisation of the torques at the places of the mesh.
            clear: required distances; None: no distances.
        """
        x = np.zeros(self.layout.size)
        x[self._points], x[self._last] = points, duration
        rates, lead = [], np.zeros(x.size)
        lead[self._points[1]] = self._first_difference(ends)  # the second control point moves with the duration
        for rows, bound in zip(self._rows, self._bounds, strict=False):
            most = np.tile(bound, rows.duration.size // bound.size)
            sides = rows.at(x, (-most, most))
            sides.jacobian.data[sides.jacobian.indptr[1:] - 1] += sides.jacobian @ lead
            rates.append(sides)
        distances = None if clear is None else clear.at(self.layout, x)
        cost = duration + float(x @ (self._smoothing @ x)) / 2
        return Iterate(x, points, duration, cost, torques.at(x, lead), tuple(rates), distances)

    def merit(self, at: Iterate, margins: TorqueMargin, price: float) -> float:
        """Cost plus the priced violations [s]; price: price of a torque [s]."""
        policy = self.policy
        torque = np.maximum(np.max(np.maximum(*self.violations(at, margins)), axis=1), 0)
        rates = sum(price * sides.missed for price, sides in self._priced(at))
        missing = 0.0 if at.distances is None else float(np.sum(at.distances.missing))
        return at.cost + price * float(np.sum(torque)) + rates + policy.distance * missing

    def violations(self, at: Iterate, margins: TorqueMargin) -> tuple[Array, Array]:
        """Excess over the upper and the lower torque limits less margins, as parts of half the ranges."""
        lower, upper = self._torque_limits(at, margins)
        return at.torques.tau - upper, lower - at.torques.tau

    def step(self, at: Iterate, margins: TorqueMargin, ends: Ends, control: StepControl) -> ProgramStep | None:
        """Solve the quadratic program of a step; None: not solved.

        Args:
            at: the linearised curve.
            margins: torque margins.
            ends: start state and goal.
            control: size of the step, and price of torques.
        """
        policy, T, reach, x = self.policy, at.duration, control.reach, at.x
        over, under = self.violations(at, margins)
        places = np.repeat(np.arange(len(over)), over.shape[1])
        soft = [SoftRows.between(at.torques.jacobian, under.ravel(), -over.ravel(), places, control.price)]
        for price, sides in self._priced(at):
            soft.append(SoftRows(*sides.below(x), price))
        if at.distances is not None:
            soft.append(SoftRows((-at.distances.jacobian,), at.distances.spare, at.distances.samples, policy.distance))
        gradient = self._smoothing @ x
        gradient[self._last] = 1.0 + gradient[self._points[1]] @ self._first_difference(ends)
        found = solve_step(
            ConvexStep(
                place=self._place,
                gradient=gradient,
                curvature=with_values(self._smoothing, (1 + policy.proximal / reach) * self._smoothing.data),
                squares=self._nothing,
                bounds=self._step_bounds(at, reach),
                hard=((), np.empty(0)),
                soft=tuple(soft),
            ),
            policy.accuracy,
        )
        if not found.found:
            return None
        points, longer = found.step[self._points], float(found.step[self._last])
        greatest = T * (policy.faster if longer < 0 else policy.slower)
        part = max(float(np.max(np.abs(points))) / policy.trust, abs(longer) / greatest)
        return ProgramStep(points, longer, at.cost + found.cost, part)

    def _step_bounds(self, at: Iterate, reach: float) -> tuple[Array, Array]:
        """Bounds of a step: trust region, and position limits of the control points."""
        policy, limits, own, last = self.policy, self.limits, self._points, self._last
        high = np.full(at.x.size, reach * policy.trust)
        low = -high
        low[own] = np.maximum(low[own], np.minimum(limits.position_lower - at.points, -_OPEN))
        high[own] = np.minimum(high[own], np.maximum(limits.position_upper - at.points, _OPEN))
        low[last], high[last] = -reach * policy.faster * at.duration, reach * policy.slower * at.duration
        return low, high

    def _first_difference(self, ends: Ends) -> Array:
        """Distance of the second control point from the first over the duration [rad/s or m/s], shape (nv,)."""
        return np.asarray(ends.v / self.mesh.basis.factors(1)[0])

    def _torque_limits(self, at: Iterate, margins: TorqueMargin) -> tuple[Array, Array]:
        """Torque limits at the places, in the states of the iterate, as parts of half the ranges."""
        lower, upper = self.limits.actuators.range(at.torques.q, at.torques.v)
        return lower / self.half + margins.lower, upper / self.half - margins.upper

    def _priced(self, at: Iterate) -> list[tuple[float, Sides]]:
        """Rows of each derivative's control points, with the price of their excess [s]."""
        return [(self.policy.rate * at.duration ** (k + 1), sides) for k, sides in enumerate(at.rates)]
