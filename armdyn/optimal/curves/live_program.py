"""Problem of one call, and the program of curves from its start state to rest at its goal.

The start state is satisfied exactly: the first control point is its position, the second one is offset along its
velocity, in proportion to the duration. The last two control points are the goal.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy.sparse as sp

from armdyn.arrays import Array, Index
from armdyn.dynamics.numeric import joint_inertia
from armdyn.locks import cached_property
from armdyn.models.values.actuator_limits import ActuatorLimits
from armdyn.optimal.constraints.clearance import ClearanceConstraint
from armdyn.optimal.constraints.constraint import ConstraintReport
from armdyn.optimal.curves.basis import Basis, graded
from armdyn.optimal.curves.convex_step import solve_step, with_values
from armdyn.optimal.curves.curve import Curve, CurveLeg
from armdyn.optimal.curves.curve_program import CurveCost, CurveProgram, Iterate, Prices, quadratic_form
from armdyn.optimal.curves.equations import POINTS
from armdyn.optimal.curves.excess import torque_excess
from armdyn.optimal.curves.linear_rows import DerivativeRows, TorqueRows, clearance_rows
from armdyn.optimal.curves.nlp_data import TorqueMargin, finite
from armdyn.optimal.curves.program import CurveLayout
from armdyn.optimal.problem.policy.live import LivePolicy
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory

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
    def samples(self) -> Array:
        """Samples of all intervals, each once, shape (samples,)."""
        breaks, parts = self.basis.breaks, np.linspace(0, 1, self.checks, endpoint=False)
        return np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * parts).ravel(), 1.0)

    @cached_property
    def of_samples(self) -> Array:
        """B-splines at the samples with two derivatives, shape (3, samples, basis.size)."""
        return np.array([self.basis.values(self.samples, order) for order in range(3)])

    @cached_property
    def in_intervals(self) -> Index:
        """Indices of the samples of each interval, shape (intervals, checks + 1): a break is in two intervals."""
        return np.arange(self.basis.intervals)[:, None] * self.checks + np.arange(self.checks + 1)

    def torque_excess(self, limits: ActuatorLimits, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        """Largest excess of torques over upper and lower limits around each place, up to halfway to the next ones.

        Args:
            limits: the limits.
            q: positions at the samples [rad or m], shape (samples, nv).
            v: velocities [rad/s or m/s], likewise.
            tau: torques [N m or N], likewise.

        Returns:
            Excesses as parts of half the ranges, negative: slack, each of shape (places, nv).
        """
        q, v, tau = (each[self.in_intervals] for each in (q, v, tau))
        halves = torque_excess(limits, q, v, tau, 2 * _PER_INTERVAL)
        upper, lower = (np.concatenate([each[:1], each, each[-1:]]) for each in halves)
        return np.maximum(upper[::2], upper[1::2]), np.maximum(lower[::2], lower[1::2])


_IN_FLIGHT = 1e-5
"""Reserve of the velocity limits, as a part of them: programs are solved to a tenth of it."""


@dataclass(frozen=True, eq=False)
class ProgramStep:
    """Step of a quadratic program.

    Attributes:
        leg: curve that the step leads to.
        promised: predicted merit [s].
        part: size of the step as a part of the greatest one.
    """

    leg: CurveLeg
    promised: float
    part: float


@dataclass(eq=False)
class Distances:
    """Clearance constraint of a live motion.

    Attributes:
        constraint: clearance constraint, with the places at which curves violated it.
        report: report on the last checked motion.
    """

    constraint: ClearanceConstraint
    report: ConstraintReport | None = None

    def kept(self, problem: MinimumTimeProblem, motion: Trajectory) -> bool:
        """Whether a motion provably satisfies all distances; if not, the constraint is tightened for the next step."""
        self.report = self.constraint.check(problem, motion, np.empty(0))
        self.constraint = self.constraint.tightened(problem, self.report)
        return not self.report.reasons


@dataclass(frozen=True, eq=False)
class LiveProblem:
    """Problem of one call, with the program of its curves.

    Attributes:
        problem: arm, limits, start state and goal.
        numbers: tuned numbers.
        mesh: mesh of the curves.
        program: program of the curves, whose second control point moves with the duration.
        inertia: inertia as a function of positions; see `joint_inertia`.
        distances: required distances; None: no distances.
    """

    problem: MinimumTimeProblem
    numbers: Policy
    mesh: Places
    program: CurveProgram
    inertia: Callable[[Array], Array]
    distances: Distances | None = None

    @classmethod
    def of(cls, problem: MinimumTimeProblem, numbers: Policy) -> Self:
        """Build the program of a problem's arm and limits."""
        policy = numbers.live
        mesh = Places(Basis(graded(policy.intervals, policy.shortest)), policy.checks)
        program = _curve_program(problem, policy, mesh)
        return cls(problem, numbers, mesh, program, joint_inertia(problem.robot))

    def for_problem(self, problem: MinimumTimeProblem) -> Self:
        """The same limits with another start state and goal, and perhaps another payload."""
        program, inertia, robot = self.program, self.inertia, problem.robot
        if robot is not self.problem.robot:
            rows = _torque_rows(problem, self.mesh, program.shape)
            program, inertia = replace(program, torque_rows=rows), joint_inertia(robot)
        lead, constraint = np.zeros(self.program.shape.size), ClearanceConstraint.from_problem(problem)
        lead[self.points[1]] = np.asarray(problem.v_start) / self.mesh.basis.factors(1)[0]
        distances = None if constraint is None else Distances(constraint)
        program = replace(program, lead=lead)
        return replace(self, problem=problem, program=program, inertia=inertia, distances=distances)

    @cached_property
    def half(self) -> Array:
        """Half the torque ranges [N m or N], shape (nv,)."""
        return self.problem.limits.actuators.half_range

    @property
    def acceleration(self) -> Array:
        """Acceleration limits [rad/s² or m/s²], shape (nv,); inf: none."""
        return acceleration_limits(self.problem)

    @property
    def v(self) -> Array:
        """Velocities at the start [rad/s or m/s], shape (nv,)."""
        return np.asarray(self.problem.v_start)

    @cached_property
    def points(self) -> Index:
        """Indices of the control points, shape (basis.size, nv)."""
        return self.program.shape.points(0)

    def leg(self, x: Array) -> CurveLeg:
        """The curve of unknowns, shape (unknowns,)."""
        return CurveLeg(self.mesh.basis, x[self.points], float(x[self.program.cost.durations[0]]))

    def at(self, leg: CurveLeg) -> Iterate:
        """Linearise a curve, moved into the position limits and to the start state and the goal."""
        program, limits, (start, goal) = self.program, self.problem.limits, self.problem.poses
        own, x = self.points, np.array(program.lead)
        points = np.clip(leg.points, limits.position_lower, limits.position_upper)
        points[0], points[1], points[-2:] = start, start + x[own[1]] * leg.duration, goal
        x[own], x[program.cost.durations] = points, leg.duration
        if self.distances is not None:
            required = self.distances.constraint.required_distances(self.problem)
            near = clearance_rows(required, Curve((self.leg(x),)), self.numbers.sequential)
            program = replace(program, clearance=near)
        return program.at(x)

    def merit(self, at: Iterate, margins: TorqueMargin, price: float) -> float:
        """Cost plus the priced violations [s]; price: price of a torque [s]."""
        return at.cost + sum(at.penalties(self.torque_limits(at, margins), self._prices(at, price)))

    def torque_limits(self, at: Iterate, margins: TorqueMargin) -> tuple[Array, Array]:
        """Torque limits at the places, in the states of the iterate, as parts of half the ranges."""
        lower, upper = self.problem.limits.actuators.range(at.torques.q, at.torques.v)
        return lower / self.half + margins.lower, upper / self.half - margins.upper

    def step(self, at: Iterate, margins: TorqueMargin, reach: float, price: float) -> ProgramStep | None:
        """Solve the quadratic program of a step; None: not solved.

        Args:
            at: the linearised curve.
            margins: torque margins.
            reach: size of the trust region as a part of the greatest step.
            price: price of a torque beyond its limit by half its range [s].
        """
        policy, program = self.numbers.sequential, self.program
        step = program.step_program(at, self.torque_limits(at, margins), self._prices(at, price))
        curvature = with_values(step.curvature, (1 + self.numbers.live.proximal / reach) * step.curvature.data)
        durations = reach * policy.faster, reach * policy.slower
        step = program.within(replace(step, curvature=curvature), at.x, reach * policy.trust, durations)
        found = solve_step(step, self.numbers.live.accuracy)
        if not found.found:
            return None
        change, before = self.leg(found.step), self.leg(at.x)
        greatest = before.duration * (policy.faster if change.duration < 0 else policy.slower)
        part = max(float(np.max(np.abs(change.points))) / policy.trust, abs(change.duration) / greatest)
        return ProgramStep(self.leg(at.x + found.step), at.cost + found.cost, part)

    def clear(self, motion: Trajectory) -> bool:
        """Whether a motion provably satisfies all distances."""
        return self.distances is None or self.distances.kept(self.problem, motion)

    def _prices(self, at: Iterate, torque: float) -> Prices:
        """Prices of violations: those of derivatives by the duration at the iterate."""
        numbers, (T,) = self.numbers, at.x[self.program.cost.durations]
        rates = tuple(numbers.live.rate * T**sides.power for sides in at.sides)
        return Prices(torque, numbers.sequential.distance, rates)


def acceleration_limits(problem: MinimumTimeProblem) -> Array:
    """Acceleration limits [rad/s² or m/s²], shape (nv,); inf: none."""
    given = problem.acceleration_limit
    return np.full(problem.robot.nv, np.inf) if given is None else np.asarray(given)


def _curve_program(problem: MinimumTimeProblem, policy: LivePolicy, mesh: Places) -> CurveProgram:
    """Program of curves on a mesh, within a problem's limits."""
    limits, n = problem.limits, problem.robot.nv
    shape = CurveLayout(n, (mesh.basis.intervals,))
    points, duration = shape.points(0), shape.duration(0)
    lower, upper, free = np.full(shape.size, -np.inf), np.full(shape.size, np.inf), np.zeros(shape.size, dtype=bool)
    lower[points], upper[points] = limits.position_lower, limits.position_upper
    free[points[2:-2]] = free[duration] = True

    def rates(order: int, limit: Array) -> DerivativeRows:
        most = np.tile(np.where(np.isinf(limit), np.inf, 1.0), mesh.basis.size - order)
        if order == 1:  # the first and the last velocity are given
            most[:n] = most[-n:] = np.inf
        return DerivativeRows.of([mesh.basis], shape, order, finite(limit), (-most, most))

    rows, acceleration = [rates(1, limits.velocity * (1 - _IN_FLIGHT))], acceleration_limits(problem)
    if np.any(np.isfinite(acceleration)):
        rows.append(rates(2, acceleration * (1 - policy.acceleration_reserve)))
    squares = policy.smooth * mesh.basis.squared(2, POINTS)
    cost = CurveCost(np.array([duration]), quadratic_form(shape, [squares], finite(limits.velocity)))
    return CurveProgram(
        shape=shape,
        torque_rows=_torque_rows(problem, mesh, shape),
        derivative_rows=tuple(rows),
        cost=cost,
        smooth=sp.csr_matrix((shape.size, shape.size)),
        bounds=(lower, upper),
        free=free,
        torques=np.empty((0, n), dtype=int),
    )


def _torque_rows(problem: MinimumTimeProblem, mesh: Places, shape: CurveLayout) -> TorqueRows:
    return TorqueRows(problem.robot, problem.limits.actuators.half_range, [(mesh.basis, mesh.places)], shape)
