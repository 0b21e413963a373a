"""The fastest curve near a guess by sequential convexification: linearised rows, a trust region, exact penalties.

Torques are eliminated: they are functions of control points and durations, and their limits are rows of the quadratic
program. Distances come from coal on the real geometry, with their gradients. After J. Schulman et al., "Motion planning
with sequential convex optimization and convex collision checking", IJRR 33(9), 2014; the merit function and the
trust region are those of Nocedal and Wright, Numerical Optimization, 2006, algorithm 18.4 and section 18.5.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.flat.convex_step import ConvexStep, QpSolution, SoftRows, solve_step
from armdyn.optimal.flat.curve_program import CurveProgram
from armdyn.optimal.flat.linear_rows import Linearised, Sides, TorqueParts
from armdyn.optimal.problem.status import Status, Stop
from armdyn.optimal.solve.solver import NlpResult
from armdyn.optimal.task.policy.curves import SequentialPolicy

Tighten = Callable[[Array, Array], tuple[Array, Array] | None]
"""Maps unknowns and their curve's torques, as parts of half the range, shape (points, joints), to lower and upper
bounds of the torques; None: unchanged bounds."""


@dataclass(frozen=True, eq=False)
class _Iterate:
    """An iterate: a curve with its torques, and all rows linearised at it.

    Attributes:
        x: unknowns.
        cost: cost without penalties [s].
        torques: torques of the curve.
        sides: rows of the derivatives' control points, velocities first, and of other equations.
        distances: linearised distances; None: no distances.
        penalties: priced violations: torques, distances, other rows [s].
    """

    x: Array
    cost: float
    torques: TorqueParts
    sides: tuple[Sides, ...]
    distances: Linearised | None
    penalties: tuple[float, float, float]


@dataclass(frozen=True)
class SequenceSettings:
    """Settings of a sequence of steps.

    Attributes:
        trust: initial radius of the trust region [rad or m].
        enough: relative change of the merit at convergence.
        best_duration: duration to beat [s]: a sequence that is not near it after a few steps ends.
        eager: whether the policy's number of first steps are accepted without a test.
        tighten: new torque bounds, called after a well-predicted step, or without a better one.
        most: limit of steps, which the policy may extend; None: the policy's.
    """

    trust: float
    enough: float
    best_duration: float = np.inf
    eager: bool = True
    tighten: Tighten | None = None
    most: int | None = None


class Sequential:
    """Sequential convexification of one program."""

    def __init__(self, problem: CurveProgram, policy: SequentialPolicy, stop: Stop):
        self._whole, self._radius = problem.guess.duration, 0.0
        dear = max(1.0, self._whole / policy.usual_duration)
        self.problem, self.policy, self.stop = problem, replace(policy, distance=dear * policy.distance), stop

    def solve(self, settings: SequenceSettings) -> NlpResult:
        """Iterate from the program's unknowns."""
        policy, iterations, trust = self.policy, 0, settings.trust
        eager = policy.eager if settings.eager else 0
        at = self._point(self.problem.numbers.x)
        merit, step, base = self._merit(at), None, at
        k, last = -1, policy.patience - 1
        while k < last and (settings.most is None or k < settings.most - 1):
            k += 1
            if self.stop:
                status, word = Status.INTERRUPTED, "interrupted"
                break
            base, (taken, step, trust, tried) = at, self._step(at, merit, trust, eager=k < eager)
            iterations += tried
            missed = (
                at.penalties[2] > policy.other * policy.other_left and policy.other < policy.most_other * self._whole
            )
            if taken is None and missed:  # a slow arm gains more by violated rows than their price
                policy = self.policy = replace(policy, other=10 * policy.other)
                at = self._point(at.x)
                merit, trust = self._merit(at), settings.trust
                continue
            ended, near, word = taken is None, taken is None and self._kept(at), "no step is better"
            if taken is not None:
                before, merit = merit, self._merit(taken)
                # With rows linear along the step, the step ends at the optimum.
                promised, reached = at.cost + step.cost, self._reached(at, taken, step, merit)
                off = abs(promised - merit)
                if k == last < policy.steps - 1 and before - promised < policy.near * merit:
                    last += 1
                at, settled, word = taken, abs(before - merit) < settings.enough * merit, "converged"
                ended = settled or (reached and off < policy.predicted * merit)
                near = off < policy.tightened * merit and (reached or settled)
            bounds = settings.tighten(at.x, at.torques.tau) if settings.tighten is not None and near else None
            if bounds is not None:
                at = self._bounded(at, bounds)
                merit, eager, last = self._merit(at), 0, max(last, k + policy.tightened_steps)
                trust = settings.trust if taken is None else trust
            elif ended and (taken is None or self._kept(at)):
                status = Status.SOLVED if self._kept(at) else Status.FAILED
                break
            elif k >= eager and self._duration(at) > policy.dropped * settings.best_duration:
                status, word = Status.ITERATION_LIMIT, "another path is faster"
                break
        else:
            status, word = Status.ITERATION_LIMIT, "iteration limit"
        return self._outcome(at, (base, step), status, word, iterations)

    def _step(
        self, at: _Iterate, merit: float, trust: float, eager: bool
    ) -> tuple[_Iterate | None, QpSolution, float, int]:
        """An accepted step (None: none is better), its quadratic program, the next radius and the iterations."""
        policy, iterations = self.policy, 0
        program = self._convex(at)
        while True:
            self._radius = trust
            step = solve_step(self._within(program, at, trust), policy.accuracy)
            iterations += 1
            if step.found and merit - (at.cost + step.cost) < policy.predicted * merit:
                return None, step, trust, iterations
            if step.found:
                moved, free = at.x + step.step, self.problem.place >= 0
                next_ = self._point(np.where(free, np.clip(moved, *self.problem.numbers.x_bounds), at.x))
                gained, promised = merit - self._merit(next_), merit - (at.cost + step.cost)
                farther = next_.penalties[1] - at.penalties[1]
                if eager and not (farther > policy.jump and next_.penalties[1] > 2 * at.penalties[1]):
                    return next_, step, trust, iterations
                if promised <= 0 or gained > policy.least_gain * promised:
                    if gained < policy.poor * promised:
                        trust /= 2
                    elif gained > policy.good * promised:
                        trust = min(2 * trust, policy.trust)
                    return (next_ if gained > 0 else None), step, trust, iterations
            trust /= policy.shrink
            if trust < policy.least_trust or self.stop:
                return None, step, trust, iterations

    def _point(self, x: Array) -> _Iterate:
        """An iterate from unknowns; its torques are recomputed."""
        problem = self.problem
        torques, x = problem.torque_rows.at(x), x.copy()
        x[problem.torques] = torques.tau
        sides = problem.sides(x, torques.jacobian)
        distances = None if problem.clearance is None else problem.clearance.at(problem.shape, x)
        cost = problem.cost.value(x, torques.tau)
        return _Iterate(x, cost, torques, sides, distances, self._penalties(x, sides, distances))

    def _bounded(self, at: _Iterate, bounds: tuple[Array, Array]) -> _Iterate:
        """The iterate with other bounds of the torques."""
        numbers, own = self.problem.numbers, self.problem.torques
        lower, upper = (side.copy() for side in numbers.x_bounds)
        lower[own], upper[own] = bounds
        self.problem = replace(self.problem, numbers=replace(numbers, x_bounds=(lower, upper)))
        return replace(at, penalties=self._penalties(at.x, at.sides, at.distances))

    def _penalties(
        self, x: Array, sides: tuple[Sides, ...], distances: Linearised | None
    ) -> tuple[float, float, float]:
        policy, own = self.policy, self.problem.torques
        low, high = (side[own] for side in self.problem.numbers.x_bounds)
        over = np.max(np.maximum(x[own] - high, low - x[own]), axis=1, initial=0)
        missed = sum(each.missed for each in sides)
        missing = 0.0 if distances is None else float(np.sum(distances.missing))
        return policy.torque * float(np.sum(over)), policy.distance * missing, policy.other * missed

    def _merit(self, at: _Iterate) -> float:
        return at.cost + sum(at.penalties)

    def _duration(self, at: _Iterate) -> float:
        return float(np.sum(at.x[self.problem.cost.durations]))

    def _reached(self, at: _Iterate, taken: _Iterate, step: QpSolution, merit: float) -> bool:
        """Whether the last step ended within its trust region, or the region's bounds cost almost nothing.

        A convex program's optimum is convex in its bounds: moving them lowers it by no more than their multipliers
        predict.
        """
        free, least = self.problem.place >= 0, self.policy.unrestricted * self._radius
        change = np.abs(taken.x - at.x)
        if np.max(change[free]) < least:
            return True
        held = free & (change > least)
        return bool(self._radius * np.sum(np.abs(step.bounds[held])) < self.policy.predicted * merit)

    def _kept(self, at: _Iterate) -> bool:
        torque, distance, other = at.penalties
        policy = self.policy
        left = torque <= policy.torque * policy.torque_left, distance <= policy.distance * policy.distance_left
        return all(left) and other <= policy.other * policy.other_left

    def _convex(self, at: _Iterate) -> ConvexStep:
        """The quadratic program at an iterate, without the bounds of the step."""
        problem, policy, tau = self.problem, self.policy, at.torques.tau
        low, high = (side[problem.torques] for side in problem.numbers.x_bounds)
        points = np.repeat(np.arange(len(tau)), tau.shape[1])
        soft = [SoftRows.between(at.torques.jacobian, (low - tau).ravel(), (high - tau).ravel(), points, policy.torque)]
        velocities, *others = at.sides
        if np.any(given := velocities.equal):
            others.insert(0, velocities.only(given))
        soft += [SoftRows(*sides.below(at.x), policy.other) for sides in others]
        if at.distances is not None:
            soft.append(SoftRows((-at.distances.jacobian,), at.distances.spare, at.distances.samples, policy.distance))
        nothing = np.zeros(at.x.size)
        return ConvexStep(
            place=problem.place,
            gradient=problem.cost.gradient(at.x, at.torques) + problem.smooth @ at.x,
            curvature=problem.smooth + problem.cost.moving,
            squares=problem.cost.squares(at.x, at.torques),
            bounds=(nothing, nothing),
            hard=velocities.only(~given).below(at.x)[:2],
            soft=tuple(soft),
        )

    def _within(self, program: ConvexStep, at: _Iterate, trust: float) -> ConvexStep:
        """A quadratic program whose step is within a trust region."""
        policy, durations = self.policy, self.problem.cost.durations
        low, high = self.problem.numbers.x_bounds
        upper, lower = np.full(at.x.size, trust), np.full(at.x.size, -trust)
        upper[durations], lower[durations] = policy.slower * at.x[durations], -policy.faster * at.x[durations]
        lower, upper = np.maximum(lower, np.minimum(low - at.x, 0)), np.minimum(upper, np.maximum(high - at.x, 0))
        return replace(program, bounds=(lower, upper))

    def _outcome(
        self, at: _Iterate, last: tuple[_Iterate, QpSolution | None], status: Status, word: str, iterations: int
    ) -> NlpResult:
        lam_x, lam_g, (base, step) = np.zeros(at.x.size), np.zeros(self.problem.numbers.g_bounds[0].size), last
        if step is not None:
            self._multipliers(step, lam_x, lam_g)
            timed = at.sides[0].duration  # rows c <= b T are divided by the T that they are linearised at
            lam_g[self.problem.rates(1)] *= at.x[timed] / base.x[timed]
        return NlpResult(status, word, iterations, at.x, lam_x / self._whole, lam_g / self._whole)

    def _multipliers(self, step: QpSolution, lam_x: Array, lam_g: Array) -> None:
        """Multipliers of torque limits and velocity limits, with IPOPT's signs."""
        torques, rates = self.problem.torques.ravel(), self.problem.rates(1)
        least, most = (side[rates] for side in self.problem.numbers.g_bounds)
        for out, own, found in (
            (lam_x, torques, step.multipliers[1]),
            (lam_g, rates[least < most], step.multipliers[0]),
        ):
            upper, lower = np.split(found, 2)
            out[own] += upper - lower
