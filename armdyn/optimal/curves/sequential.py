"""The fastest curve near a guess by sequential convexification: linearised rows, a trust region, exact penalties.

One loop serves all curves: until it converges, or from a moving state until a deadline. Torques are eliminated: they
are functions of control points and durations, and their limits are rows of the quadratic program. Distances come from
coal on the real geometry, with their gradients. After J. Schulman et al., "Motion planning with sequential convex
optimization and convex collision checking", IJRR 33(9), 2014; the merit function and the trust region are those of
Nocedal and Wright, Numerical Optimization, 2006, algorithms 4.1 and 18.4 and section 18.5.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.curves.convex_step import QpSolution, solve_step
from armdyn.optimal.curves.curve_program import CurveProgram, Iterate, Prices
from armdyn.optimal.problem.policy.curves import SequentialPolicy
from armdyn.optimal.problem.status import Status

Bounds = tuple[Array, Array]
"""Lower and upper bounds of torques, as parts of half the range, each of shape (points, joints)."""
Tighten = Callable[[Iterate, bool], Bounds | None]
"""Maps an iterate, and whether its last step was well predicted, to new bounds of the torques; None: they stay."""


class Stopping(Protocol):
    """Stopping condition, polled before every step."""

    def __bool__(self) -> bool:
        """Whether to stop now."""


@dataclass(frozen=True)
class SequenceSettings:
    """Settings of a sequence of steps.

    Attributes:
        enough: relative change of the merit at convergence.
        warm: whether the initial curve is nearly the solution: the first radius is smaller, and no step is accepted
            without a test.
        tighten: new torque bounds, called after every step, and without a better one.
        steps: limit of steps; None: the policy's.
    """

    enough: float
    warm: bool = False
    tighten: Tighten | None = None
    steps: int | None = None


@dataclass(frozen=True, eq=False)
class Sequence:
    """Outcome of a sequence of steps.

    Attributes:
        status: how it ended.
        word: likewise, in words.
        iterations: number of quadratic programs.
        at: the last curve.
        base: where the last quadratic program was linearised.
        step: its solution; None: there was none.
    """

    status: Status
    word: str
    iterations: int
    at: Iterate
    base: Iterate
    step: QpSolution | None


class Sequential:
    """Sequential convexification of one program.

    Attributes:
        program: the program.
        bounds: bounds of the torques, which `SequenceSettings.tighten` may replace.
        policy: tuned numbers.
        stop: stopping condition.
    """

    def __init__(self, program: CurveProgram, bounds: Bounds, whole: float, policy: SequentialPolicy, stop: Stopping):
        """Scale the prices; whole: duration of the guess [s]."""
        self.program, self.bounds, self.policy, self.stop = program, bounds, policy, stop
        self._prices = Prices(whole * policy.price, whole * policy.distance)
        self._radius = self._largest = policy.trust
        self._enough, self._iterations = 0.0, 0

    def solve(self, x: Array, settings: SequenceSettings) -> Sequence:
        """Iterate from unknowns, shape (unknowns,)."""
        policy, first = self.policy, self.policy.trust / 3 if settings.warm else self.policy.trust
        self._radius, self._enough, self._iterations = first, settings.enough, 0
        at, step, changes, little = self.program.at(x), None, 0, False
        base, status, word = at, Status.ITERATION_LIMIT, "iteration limit"
        for k in range(settings.steps or policy.steps):
            if self.stop:
                status, word = Status.INTERRUPTED, "interrupted"
                break
            eager = little or (not settings.warm and k < policy.eager)
            base, (taken, step, region) = at, self._step(at, eager)
            ended = near = taken is None
            if taken is not None:
                at, (ended, near) = taken, self._judged(at, taken, step, region)
            elif not self._kept(at):  # a slow arm gains more by violated rows than their price
                self._prices, self._radius, self._largest = self._prices.times(policy.rise), first, policy.trust
                changes = 0
                continue
            bounds = None if settings.tighten is None else settings.tighten(at, near)
            little = taken is None and bounds is not None  # a step that gains little may still mend torques
            if bounds is not None:
                self.bounds, self._radius = bounds, first if taken is None else self._radius
                changes += not self._kept(at)
                damped = policy.trust * 0.5 ** max(changes - policy.undamped, 0)
                self._largest = max(damped, 10 * policy.least_trust)
            elif ended and self._kept(at):
                status, word = Status.SOLVED, "no step is better" if taken is None else "converged"
                break
        return Sequence(status, word, self._iterations, at, base, step)

    def merit(self, at: Iterate) -> float:
        """Cost plus the priced violations [s]."""
        return at.cost + sum(at.penalties(self.bounds, self._prices))

    def _step(self, at: Iterate, eager: bool) -> tuple[Iterate | None, QpSolution, Array]:
        """An accepted step (None: none is better), its quadratic program and its region; sets the next radius."""
        policy, merit = self.policy, self.merit(at)
        program = self.program.step_program(at, self.bounds, self._prices)
        self._radius = min(self._radius, self._largest)
        while True:
            region = self.program.region(at.x, self._radius, policy.stretch)
            step = solve_step(self.program.within(program, at.x, region), policy.accuracy)
            self._iterations += 1
            promised = merit - (at.cost + step.cost)
            if step.found and promised < self._enough * merit and not eager:
                return None, step, region
            if step.found:
                taken = self.program.at(self.program.after(at.x, step.step))
                gained = merit - self.merit(taken)
                if eager or gained > 0:
                    if gained < policy.poor * promised and not eager:
                        self._radius /= 2
                    elif gained > policy.good * promised:
                        self._radius *= 2
                    return taken, step, region
            self._radius /= 2
            if self._radius < policy.least_trust or self.stop:
                return None, step, region

    def _judged(self, at: Iterate, taken: Iterate, step: QpSolution, region: Array) -> tuple[bool, bool]:
        """Whether a step ends the iteration, and whether it was predicted well enough to judge its torques.

        With rows linear along the step, it ends at the optimum. A convex program's optimum is convex in its bounds:
        moving the region's lowers it by no more than their multipliers predict.
        """
        merit, promised = self.merit(taken), at.cost + step.cost
        held = self.program.free & (2 * np.abs(taken.x - at.x) > region)  # not by the unknown's own bounds
        reached = region[held] @ np.abs(step.bounds[held]) <= self._enough * merit
        settled = abs(taken.cost - at.cost) < self._enough * merit
        off = abs(promised - merit)
        ended = settled or (reached and off < self._enough * merit)
        return bool(ended), bool(off < self.policy.tightened * merit and (reached or settled))

    def _kept(self, at: Iterate) -> bool:
        """Whether the rows are satisfied but for little."""
        torque, distance, other = at.penalties(self.bounds, Prices(1.0, 1.0))
        left = self.policy.left
        return max(torque, other) <= left and distance <= left / 10
