"""Curves from a moving state to rest at a goal: their program, its steps until a deadline, and checks at fine samples.

The start state is satisfied exactly: the first control point is its position, the second one is offset along its
velocity, in proportion to the duration. The last two control points are the goal.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.dynamics.numeric import joint_inertia
from armdyn.locks import cached_property
from armdyn.optimal.constraints.clearance import ClearanceConstraint
from armdyn.optimal.constraints.constraint import ConstraintReport
from armdyn.optimal.curves.curve import Basis, Curve, CurveLeg, graded
from armdyn.optimal.curves.curve_program import CurveCost, CurveProgram, Iterate, quadratic_form
from armdyn.optimal.curves.excess import next_margin, torque_excess
from armdyn.optimal.curves.layout import POINTS, CurveLayout, TorqueMargin, finite
from armdyn.optimal.curves.linear_rows import DerivativeRows, TorqueRows, clearance_rows
from armdyn.optimal.curves.sequential import Bounds, Sequential
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.verify.certificate import LIMIT_TOLERANCE
from armdyn.trajectory import Trajectory
from armdyn.trajectory.interpolation import cubic_accelerations

Guess = tuple[CurveLeg, TorqueMargin]
"""Initial curve, and torque margins."""


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
        """Whether a motion provably satisfies all distances; if not, the constraint is tightened for the next steps."""
        self.report = self.constraint.check(problem, motion, np.empty(0))
        self.constraint = self.constraint.tightened(problem, self.report)
        return not self.report.reasons


@dataclass(frozen=True, eq=False)
class SampledCurve:
    """A curve at its samples, and its excesses over limits.

    Attributes:
        t: times [s], shape (samples,).
        q: positions [rad or m], shape (samples, nv).
        v: velocities [rad/s or m/s], likewise.
        a: accelerations [rad/s² or m/s²], likewise.
        tau: torques by inverse dynamics [N m or N], likewise.
        over: excess of torques around each point, as parts of half the ranges; negative: slack.
        other: largest excess over limits of velocity, position and acceleration, as a part of them.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    over: TorqueMargin
    other: float


@dataclass(frozen=True, eq=False)
class LiveProblem:
    """Problem of one call, with the program of its curves.

    Attributes:
        problem: arm, limits, start state and goal.
        numbers: tuned numbers.
        basis: B-splines of the curves.
        program: program of the curves, whose second control point moves with the duration.
        inertia: inertia as a function of positions; see `joint_inertia`.
        distances: required distances; None: no distances.
    """

    problem: MinimumTimeProblem
    numbers: Policy
    basis: Basis
    program: CurveProgram
    inertia: Callable[[Array], Array]
    distances: Distances | None = None

    @classmethod
    def of(cls, problem: MinimumTimeProblem, numbers: Policy) -> Self:
        """Build the program of a problem's arm and limits."""
        basis = Basis(graded(numbers.live.intervals, numbers.live.shortest))
        return cls(problem, numbers, basis, _curve_program(problem, numbers, basis), joint_inertia(problem.robot))

    def for_problem(self, problem: MinimumTimeProblem) -> Self:
        """Reuse the program for a problem with the same limits but another start state, goal, or payload."""
        program, inertia, robot = self.program, self.inertia, problem.robot
        if robot is not self.problem.robot:
            rows = _torque_rows(problem, self.basis, program.shape)
            program, inertia = replace(program, torque_rows=rows), joint_inertia(robot)
        lead, constraint = np.zeros(self.program.shape.size), ClearanceConstraint.from_problem(problem)
        # For the velocity at the start, control point 1 is q_start + v_start T / factor.
        lead[self.points[1]] = np.asarray(problem.v_start) / self.basis.factors(1)[0]
        distances = None if constraint is None else Distances(constraint)
        program = replace(program, lead=lead)
        return replace(self, problem=problem, program=program, inertia=inertia, distances=distances)

    @cached_property
    def samples(self) -> tuple[Array, Array, Index]:
        """Places of all samples, B-splines there, and the samples of each interval, both ends included.

        Shapes (samples,), (3, samples, basis.size) with two derivatives, and (intervals, checks + 1).
        """
        count, breaks = self.numbers.curves.checks, self.basis.breaks
        inner = breaks[:-1, None] + np.diff(breaks)[:, None] * np.linspace(0, 1, count, endpoint=False)
        s = np.append(inner.ravel(), 1.0)
        values = np.array([self.basis.values(s, order) for order in range(3)])
        return s, values, np.arange(self.basis.intervals)[:, None] * count + np.arange(count + 1)

    @cached_property
    def half(self) -> Array:
        """Half the torque ranges [N m or N], shape (nv,)."""
        return self.problem.limits.actuators.half_range

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
        return CurveLeg(self.basis, x[self.points], float(x[self.program.cost.durations[0]]))

    def unknowns(self, leg: CurveLeg) -> Array:
        """Unknowns of a curve, moved into the position limits and to the start state and the goal."""
        limits, (start, goal) = self.problem.limits, self.problem.poses
        own, x = self.points, np.array(self.program.lead)
        points = np.clip(leg.points, limits.position_lower, limits.position_upper)
        points[0], points[1], points[-2:] = start, start + x[own[1]] * leg.duration, goal
        x[own], x[self.program.cost.durations] = points, leg.duration
        return x

    def bounds(self, at: Iterate, margins: TorqueMargin) -> Bounds:
        """Torque limits less the reserve and margins, in the states of an iterate, as parts of half the ranges."""
        ranges = self.problem.limits.actuators.range(at.torques.q, at.torques.v)
        lower, upper = (np.broadcast_to(side, at.torques.q.shape) for side in ranges)
        kept = self.numbers.live.reserve
        return lower / self.half + kept + margins.lower, upper / self.half - kept - margins.upper

    def check(self, leg: CurveLeg) -> SampledCurve:
        """Check a curve at its samples."""
        (s, values, of), limits, duration = self.samples, self.problem.limits, leg.duration
        derivatives = values @ leg.points
        q, v, a = derivatives[0], derivatives[1] / duration, derivatives[2] / duration**2
        tau = self.program.torque_rows.torque(q, v, a)
        halves = torque_excess(limits.actuators, q[of], v[of], tau[of], 4)  # a place's are up to halfway to the next
        upper, lower = (np.concatenate([each[:1], each, each[-1:]]) for each in halves)
        over = TorqueMargin(np.maximum(upper[::2], upper[1::2]), np.maximum(lower[::2], lower[1::2]))
        bounded = np.where(np.isinf(limits.position_upper), 1.0, limits.position_upper - limits.position_lower)
        other = max(
            float(np.max(np.abs(v) / limits.velocity)) - 1,
            float(np.max(np.maximum(q - limits.position_upper, limits.position_lower - q) / bounded)),
            acceleration_excess(duration * s, q, v, self.problem.rates[0]),
        )
        return SampledCurve(duration * s, q, v, a, tau, over, other)

    def motion_of(self, sampled: SampledCurve, name: str) -> Trajectory:
        """The samples as a motion."""
        robot = self.problem.robot
        q, v, tau = sampled.q, sampled.v, sampled.tau
        return Trajectory(sampled.t, q, v, tau, robot.joint_names, robot.marked(name), robot.model_hash)

    def within_limits(self, sampled: SampledCurve) -> bool:
        """Whether a curve satisfies all limits and distances."""
        torque = max(np.max(sampled.over.upper), np.max(sampled.over.lower))
        kept = torque <= -self.numbers.live.least_reserve and sampled.other <= LIMIT_TOLERANCE
        kept = kept and self.between_samples(sampled) <= LIMIT_TOLERANCE
        return bool(kept) and self.clear(self.motion_of(sampled, "checked"))

    def between_samples(self, sampled: SampledCurve) -> float:
        """Largest excess of a torque between samples, as a part of half its range.

        The returned motion is cubic between samples. Its accelerations are linear, so that both ends of each cubic are
        checked; torques differ from the curve's by the inertia times the difference of accelerations.
        """
        accelerations = np.concatenate(cubic_accelerations(sampled.t, sampled.q, sampled.v))
        q, v, a, tau, M = (
            np.concatenate([each[:-1], each[1:]])
            for each in (sampled.q, sampled.v, sampled.a, sampled.tau, self.inertia(sampled.q))
        )
        tau += np.einsum("kij,kj->ki", M, accelerations - a)
        return float(np.max(self.problem.limits.actuators.excess(tau, q, v) / self.half))

    def clear(self, motion: Trajectory) -> bool:
        """Whether a motion provably satisfies all distances."""
        return self.distances is None or self.distances.kept(self.problem, motion)


def acceleration_excess(t: Array, q: Array, v: Array, limits: Array) -> float:
    """Largest excess over limits of acceleration, as a part of them, of the cubics between samples.

    Args:
        t: times of the samples [s], shape (samples,).
        q: positions [rad or m], shape (samples, nv).
        v: velocities [rad/s or m/s], likewise.
        limits: limits of acceleration [rad/s² or m/s²], shape (nv,); inf: none.
    """
    if np.all(np.isinf(limits)):
        return -1.0
    return float(np.max(np.abs(cubic_accelerations(t, q, v)) / limits)) - 1


def _curve_program(problem: MinimumTimeProblem, numbers: Policy, basis: Basis) -> CurveProgram:
    """Program of curves on a basis, within a problem's limits."""
    policy, limits, n = numbers.live, problem.limits, problem.robot.nv
    shape = CurveLayout(n, (basis.intervals,))
    points, duration = shape.points(0), shape.duration(0)
    lower, upper, free = np.full(shape.size, -np.inf), np.full(shape.size, np.inf), np.zeros(shape.size, dtype=bool)
    lower[points], upper[points] = limits.position_lower, limits.position_upper
    free[points[2:-2]] = free[duration] = True

    def rates(order: int, limit: Array) -> DerivativeRows:
        most = np.tile(np.where(np.isinf(limit), np.inf, 1.0), basis.size - order)
        if order == 1:  # the first and the last velocity are given
            most[:n] = most[-n:] = np.inf
        return DerivativeRows.of([basis], shape, order, finite(limit), (-most, most))

    rows, acceleration = [rates(1, limits.velocity * (1 - numbers.curves.velocity_error))], problem.rates[0]
    if np.any(np.isfinite(acceleration)):
        rows.append(rates(2, acceleration * (1 - policy.least_reserve)))
    squares = numbers.sequential.smooth * basis.squared(2, POINTS)
    return CurveProgram(
        shape=shape,
        torque_rows=_torque_rows(problem, basis, shape),
        derivative_rows=tuple(rows),
        cost=CurveCost(np.array([duration]), quadratic_form(shape, [squares], finite(limits.velocity))),
        bounds=(lower, upper),
        free=free,
        torques=np.empty((0, n), dtype=int),
    )


def _torque_rows(problem: MinimumTimeProblem, basis: Basis, shape: CurveLayout) -> TorqueRows:
    """Rows of the torques at breaks and their middles."""
    middles = (basis.breaks[:-1] + basis.breaks[1:]) / 2
    places = np.append(np.column_stack([basis.breaks[:-1], middles]).ravel(), 1.0)
    return TorqueRows(problem.robot, problem.limits.actuators.half_range, [(basis, places)], shape)


class Deadline:
    """Deadline by `time.perf_counter` [s], which leaves time for another step as long as the longest one so far."""

    def __init__(self, until: float):
        self._until, self._last, self._longest = until, time.perf_counter(), 0.0

    def __bool__(self) -> bool:
        """Whether no further step is to be begun."""
        now = time.perf_counter()
        self._last, self._longest = now, max(self._longest, now - self._last)
        return now + self._longest > self._until


class Improvement:
    """The fastest curve within all limits so far, and margins of the torques.

    Attributes:
        best: the fastest curve; None: none is within its limits.
        sampled: its samples.
        leg: the last curve.
        margins: its torque margins.
        rounds: number of changes of the margins.
        within: whether the last curve is within its limits.
    """

    def __init__(self, live: LiveProblem, guess: Guess):
        self.live, (self.leg, self.margins) = live, guess
        self.best: CurveLeg | None = None
        self.sampled: SampledCurve | None = None
        self.rounds, self.within = 0, False

    def __call__(self, at: Iterate, near: bool) -> Bounds | None:
        """Check a curve; bounds of its torques for the next step, or None if it is within its limits."""
        live, before, self.leg = self.live, self.leg.duration, self.live.leg(at.x)
        sampled = live.check(self.leg)
        self.within = live.within_limits(sampled)
        if self.within and (self.best is None or self.leg.duration < self.best.duration):
            self.best, self.sampled = self.leg, sampled
        if self.within and near:
            return None
        self.rounds += 1
        kept, numbers = live.numbers.live.reserve, live.numbers.curves
        over = TorqueMargin(sampled.over.upper + kept, sampled.over.lower + kept)
        (lower, upper), tau = live.bounds(at, TorqueMargin()), at.torques.tau
        changes = abs(self.leg.duration - before) > live.numbers.live.enough * before
        reduces = changes and 2 * self.rounds <= numbers.rounds
        self.margins = next_margin(self.margins, over, (tau - upper, lower - tau), reduces, numbers)
        return live.bounds(at, self.margins)


def improve(live: LiveProblem, guesses: Sequence[Guess], until: float) -> tuple[Improvement, Status, int]:
    """Improve guesses; return the fastest motion found within its limits, how the steps ended, and their number.

    Steps end when the curve is within its limits and becomes no shorter; if it then violates a distance, which is
    required there from then on, further steps follow.

    Args:
        live: the problem with its program.
        guesses: initial curves, of which the one of least merit is used.
        until: deadline of the last step's end, by `time.perf_counter` [s].
    """
    numbers, whole = live.numbers, max(leg.duration for leg, _ in guesses)
    stop, steps, improved = Deadline(until - numbers.live.hand_over), 0, None
    while True:
        loops = []
        for guess in guesses:
            x, program = live.unknowns(guess[0]), live.program
            if live.distances is not None:
                required = live.distances.constraint.required_distances(live.problem)
                program = replace(program, clearance=clearance_rows(required, Curve((live.leg(x),)), numbers))
            at = program.at(x)
            loop = Sequential(program, live.bounds(at, guess[1]), whole, numbers.sequential, stop)
            loops.append((loop.merit(at), loop, x, guess))
        _, loop, x, guess = min(loops, key=lambda one: one[0])
        improved = improved or Improvement(live, guess)
        left = numbers.sequential.steps - steps
        found = loop.solve(x, numbers.live.enough, steps > 0, improved, left)
        steps += found.iterations
        ended = improved.sampled is not None or live.distances is None or not found.iterations
        if ended or stop or steps >= numbers.sequential.steps:
            return improved, found.status, steps
        guesses = [(improved.leg, improved.margins)]
