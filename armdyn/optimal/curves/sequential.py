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
from armdyn.optimal.curves.convex_step import QpSolution, solve_step
from armdyn.optimal.curves.curve_program import CurveProgram, Iterate, Prices
from armdyn.optimal.mesh.ipopt import NlpData, NlpResult
from armdyn.optimal.problem.policy.curves import SequentialPolicy
from armdyn.optimal.problem.status import Status, Stop

Tighten = Callable[[Array, Array], tuple[Array, Array] | None]
"""Maps unknowns and their curve's torques, as parts of half the range, shape (points, joints), to lower and upper
bounds of the torques; None: unchanged bounds."""


@dataclass(frozen=True)
class SequenceSettings:
    """Settings of a sequence of steps.

    Attributes:
        trust: initial radius of the trust region [rad or m].
        enough: relative change of the merit at convergence.
        best_duration: duration to beat [s]: a sequence that is not near it after a few steps ends.
        eager: whether the policy's number of first steps are accepted without a test.
        tighten: new torque bounds, called after a well-predicted step, or without a better one.
    """

    trust: float
    enough: float
    best_duration: float = np.inf
    eager: bool = True
    tighten: Tighten | None = None


class Sequential:
    """Sequential convexification of one program.

    Attributes:
        program: the program.
        data: initial unknowns, and bounds; those of the torques are the first ones.
        policy: tuned numbers, with prices for the guess's duration.
        stop: of the solve.
    """

    def __init__(self, program: CurveProgram, data: NlpData, whole: float, policy: SequentialPolicy, stop: Stop):
        """Scale the prices; whole: duration of the guess [s]."""
        self._whole, self._radius = whole, 0.0
        dear = max(1.0, self._whole / policy.usual_duration)
        self.program, self.data, self.stop = program, data, stop
        self.policy = replace(policy, distance=dear * policy.distance)
        lower, upper = data.x_bounds
        self._limits = lower[program.torques], upper[program.torques]

    def solve(self, settings: SequenceSettings) -> NlpResult:
        """Iterate from the program's unknowns."""
        policy, iterations, trust = self.policy, 0, settings.trust
        eager = policy.eager if settings.eager else 0
        at = self.program.at(self.data.x)
        merit, step, base = self._merit(at), None, at
        k, last = -1, policy.patience - 1
        while k < last:
            k += 1
            if self.stop:
                status, word = Status.INTERRUPTED, "interrupted"
                break
            base, (taken, step, trust, tried) = at, self._step(at, merit, trust, eager=k < eager)
            iterations += tried
            missed = self._penalties(at)[2] > policy.other * policy.other_left
            missed = missed and policy.other < policy.most_other * self._whole
            if taken is None and missed:  # a slow arm gains more by violated rows than their price
                policy = self.policy = replace(policy, other=10 * policy.other)
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
                self._limits = bounds
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
        self, at: Iterate, merit: float, trust: float, eager: bool
    ) -> tuple[Iterate | None, QpSolution, float, int]:
        """An accepted step (None: none is better), its quadratic program, the next radius and the iterations."""
        policy, iterations = self.policy, 0
        program = self.program.step_program(at, self._limits, self._prices(at), hard_velocities=True)
        while True:
            self._radius = trust
            step = solve_step(
                self.program.within(program, at.x, trust, (policy.faster, policy.slower)), policy.accuracy
            )
            iterations += 1
            if step.found and merit - (at.cost + step.cost) < policy.predicted * merit:
                return None, step, trust, iterations
            if step.found:
                moved = np.clip(at.x + step.step, *self.program.bounds)
                next_ = self.program.at(np.where(self.program.free, moved, at.x))
                gained, promised = merit - self._merit(next_), merit - (at.cost + step.cost)
                near, far = self._penalties(at)[1], self._penalties(next_)[1]
                if eager and not (far - near > policy.jump and far > 2 * near):
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

    def _prices(self, at: Iterate) -> Prices:
        policy = self.policy
        return Prices(policy.torque, policy.distance, (policy.other,) * len(at.sides))

    def _penalties(self, at: Iterate) -> tuple[float, float, float]:
        return at.penalties(self._limits, self._prices(at))

    def _merit(self, at: Iterate) -> float:
        return at.cost + sum(self._penalties(at))

    def _duration(self, at: Iterate) -> float:
        return float(np.sum(at.x[self.program.cost.durations]))

    def _reached(self, at: Iterate, taken: Iterate, step: QpSolution, merit: float) -> bool:
        """Whether the last step ended within its trust region, or the region's bounds cost almost nothing.

        A convex program's optimum is convex in its bounds: moving them lowers it by no more than their multipliers
        predict.
        """
        free, least = self.program.free, self.policy.unrestricted * self._radius
        change = np.abs(taken.x - at.x)
        if np.max(change[free]) < least:
            return True
        held = free & (change > least)
        return bool(self._radius * np.sum(np.abs(step.bounds[held])) < self.policy.predicted * merit)

    def _kept(self, at: Iterate) -> bool:
        torque, distance, other = self._penalties(at)
        policy = self.policy
        left = torque <= policy.torque * policy.torque_left, distance <= policy.distance * policy.distance_left
        return all(left) and other <= policy.other * policy.other_left

    def _outcome(
        self, at: Iterate, last: tuple[Iterate, QpSolution | None], status: Status, word: str, iterations: int
    ) -> NlpResult:
        lam_x, lam_g, (base, step) = np.zeros(at.x.size), np.zeros(self.data.g_bounds[0].size), last
        if step is not None:
            self._multipliers(step, lam_x, lam_g)
            timed = at.sides[0].duration  # rows c <= b T are divided by the T that they are linearised at
            lam_g[self.program.shape.rates_of_all(1)] *= at.x[timed] / base.x[timed]
        return NlpResult(status, word, iterations, at.x, lam_x / self._whole, lam_g / self._whole)

    def _multipliers(self, step: QpSolution, lam_x: Array, lam_g: Array) -> None:
        """Multipliers of torque limits and velocity limits, with IPOPT's signs."""
        torques, rates = self.program.torques.ravel(), self.program.shape.rates_of_all(1)
        least, most = (side[rates] for side in self.data.g_bounds)
        for out, own, found in (
            (lam_x, torques, step.multipliers[1]),
            (lam_g, rates[least < most], step.multipliers[0]),
        ):
            upper, lower = np.split(found, 2)
            out[own] += upper - lower
