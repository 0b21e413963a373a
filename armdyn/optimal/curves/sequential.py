"""The fastest curve near a guess by sequential convexification: linearised rows, a trust region, exact penalties.

One loop serves all curves: until it converges, or from a moving state until a deadline. Torques are eliminated: they
are functions of control points and durations, and their limits are rows of the quadratic program. Distances come from
coal on the real geometry, with their gradients. After J. Schulman et al., "Motion planning with sequential convex
optimization and convex collision checking", IJRR 33(9), 2014; the merit function and the trust region are those of
Nocedal and Wright, Numerical Optimization, 2006, algorithms 4.1 and 18.4 and section 18.5. A step's quadratic program
is solved by the interior-point method of `_curves/`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import _armdyn_curves as curves
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from armdyn.arrays import Array, Index
from armdyn.optimal.bound.linear_program import MOST
from armdyn.optimal.curves.curve_program import CurveProgram, Iterate
from armdyn.optimal.curves.linear_rows import Sides
from armdyn.optimal.problem.policy.curves import SequentialPolicy
from armdyn.optimal.problem.status import Status

Bounds = tuple[Array, Array]
"""Lower and upper bounds of torques, as parts of half the range, each of shape (points, joints)."""
Tighten = Callable[[Iterate, bool], Bounds | None]
"""Maps an iterate, and whether its last step was well predicted, to new bounds of the torques; None: they stay."""


@dataclass(frozen=True, eq=False)
class SoftRows:
    """Inequalities with priced violations: `jacobian @ step - upper <= slack[group]`, with slack >= 0.

    Attributes:
        jacobian: vertically stacked matrices, together of shape (rows, unknowns).
        upper: upper sides, shape (rows,); inf: no limit.
        groups: index of the slack of each row, shape (rows,).
        price: price of a unit of slack.
    """

    jacobian: tuple[sp.csr_matrix, ...]
    upper: Array
    groups: Index
    price: float


@dataclass(frozen=True, eq=False)
class ConvexStep:
    """Quadratic program in a step of the unknowns.

    Attributes:
        place: place of each unknown in the order of elimination, -1: fixed, shape (unknowns,). Rows on unknowns near
            each other only, or the last ones, are cheap.
        gradient: gradient of the cost, shape (unknowns,).
        curvature: Hessian of the cost, positive semidefinite, shape (unknowns, unknowns).
        squares: rows, and the weights of their halved squares in the cost.
        bounds: bounds of the step, each of shape (unknowns,); lower below upper unless fixed.
        hard: inequalities without a price: their Jacobian and upper sides, as in `SoftRows`.
        soft: inequalities with priced violations.
    """

    place: NDArray[np.int32]
    gradient: Array
    curvature: sp.csr_matrix
    squares: tuple[sp.csr_matrix, Array]
    bounds: tuple[Array, Array]
    hard: tuple[tuple[sp.csr_matrix, ...], Array]
    soft: tuple[SoftRows, ...]


@dataclass(frozen=True, eq=False)
class QpSolution:
    """Solution of a `ConvexStep`.

    Attributes:
        found: whether the program was solved.
        step: step of the unknowns, shape (unknowns,).
        cost: predicted change of the cost, including priced slacks.
        multipliers: multipliers of the hard rows, then of the soft ones.
        bounds: multipliers of the bounds of the step, shape (unknowns,): positive at the upper one.
    """

    found: bool
    step: Array
    cost: float
    multipliers: tuple[Array, ...]
    bounds: Array


def solve_step(problem: ConvexStep, accuracy: float) -> QpSolution:
    """Solve a quadratic program; releases Python's lock.

    Args:
        problem: the program.
        accuracy: largest relative residual, and gap between the primal and the dual cost over 1 and the cost.
    """
    (hard, top), soft, before = problem.hard, problem.soft, 0
    slacks, prices = [np.full(top.size, -1)], [np.empty(0)]
    for rows in soft:
        count = int(np.max(rows.groups, initial=-1)) + 1
        slacks.append(before + rows.groups)
        prices.append(np.full(count, rows.price))
        before += count
    found, _, cost, *numbers = curves.solve(
        place=problem.place,
        gradient=problem.gradient,
        curvature=compressed(problem.curvature),
        squares=compressed(problem.squares[0]),
        square_weight=problem.squares[1],
        lower=problem.bounds[0],
        upper=problem.bounds[1],
        rows=compressed(*hard, *(part for rows in soft for part in rows.jacobian)),
        top=np.concatenate([top, *(rows.upper for rows in soft)]),
        slack=np.concatenate(slacks).astype(np.int32),
        price=np.concatenate(prices),
        tolerance=accuracy,
        most=MOST,
    )
    step, multipliers, bounds = (np.frombuffer(each) for each in numbers)
    ends = np.cumsum([top.size, *(rows.upper.size for rows in soft)])[:-1]
    each = tuple(np.split(multipliers, ends))
    return QpSolution(found and bool(np.all(np.isfinite(step))), step, cost, each, bounds)


def compressed(*matrices: sp.csr_matrix) -> tuple[NDArray[np.int32], NDArray[np.int32], Array]:
    """Compressed rows of vertically stacked matrices, for the C++ module."""
    sizes = np.concatenate([[0], *(np.diff(matrix.indptr) for matrix in matrices)])
    columns, values = zip(*((matrix.indices, matrix.data) for matrix in matrices), strict=True)
    return np.cumsum(sizes, dtype=np.int32), np.concatenate(columns, dtype=np.int32), np.concatenate(values)


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
        bounds: bounds of the torques, which `tighten` of `solve` may replace.
        policy: tuned numbers.
        stop: stopping condition, true: stop now; polled before every step.
    """

    def __init__(self, program: CurveProgram, bounds: Bounds, whole: float, policy: SequentialPolicy, stop: object):
        """Scale the prices; whole: duration of the guess [s]."""
        self.program, self.bounds, self.policy, self.stop = program, bounds, policy, stop
        self._prices = whole * np.array([policy.price, policy.distance, policy.price])  # of `Iterate.violations`
        self._radius = self._largest = policy.trust
        self._enough, self._iterations = 0.0, 0

    def solve(
        self, x: Array, enough: float, warm: bool = False, tighten: Tighten | None = None, steps: int | None = None
    ) -> Sequence:
        """Iterate until the merit changes little.

        Args:
            x: initial unknowns, shape (unknowns,).
            enough: relative change of the merit at convergence.
            warm: whether the initial curve is nearly the solution: the first radius is smaller, and no step is
                accepted without a test.
            tighten: new torque bounds, called after every step, and without a better one.
            steps: limit of steps; None: the policy's.
        """
        policy, first = self.policy, self.policy.trust / 3 if warm else self.policy.trust
        self._radius, self._enough, self._iterations = first, enough, 0
        at, step, changes, little = self.program.at(x), None, 0, False
        base, status, word = at, Status.ITERATION_LIMIT, "iteration limit"
        for k in range(steps or policy.steps):
            if self.stop:
                status, word = Status.INTERRUPTED, "interrupted"
                break
            eager = little or (not warm and k < policy.eager)
            base, (taken, step, region) = at, self._step(at, eager)
            ended = near = taken is None
            if taken is not None:
                at, (ended, near) = taken, self._judged(at, taken, step, region)
            elif not self._kept(at):  # a slow arm gains more by violated rows than their price
                self._prices, self._radius, self._largest = policy.rise * self._prices, first, policy.trust
                changes = 0
                continue
            bounds = None if tighten is None else tighten(at, near)
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
        return at.cost + float(self._prices @ at.violations(self.bounds))

    def _step(self, at: Iterate, eager: bool) -> tuple[Iterate | None, QpSolution, Array]:
        """An accepted step (None: none is better), its quadratic program and its region; sets the next radius."""
        policy, merit = self.policy, self.merit(at)
        program, timed, (low, high) = self._convex(at), self.program.cost.durations, self.program.bounds
        self._radius = min(self._radius, self._largest)
        while True:
            region = np.full(at.x.size, self._radius)
            region[timed] = policy.stretch * self._radius * at.x[timed]
            bounds = np.maximum(-region, np.minimum(low - at.x, 0)), np.minimum(region, np.maximum(high - at.x, 0))
            step = solve_step(replace(program, bounds=bounds), policy.accuracy)
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

    def _convex(self, at: Iterate) -> ConvexStep:
        """The quadratic program at an iterate; velocity limits must be satisfied, other rows have a price."""
        (low, high), tau, (velocities, *others), cost = self.bounds, at.torques.tau, at.sides, self.program.cost
        (row, distance, _), given = self._prices, velocities.equal
        if np.any(given):
            others.insert(0, velocities.only(given))
        torques = Sides(at.torques.jacobian, tau.ravel(), (low.ravel(), high.ravel())).below(at.x)[:2]
        soft = [SoftRows(*torques, np.tile(np.repeat(np.arange(len(tau)), tau.shape[1]), 2), row)]
        soft += [SoftRows(*sides.below(at.x), row) for sides in others]
        if at.distances is not None:
            own = at.distances
            soft.append(SoftRows((-own.jacobian,), own.spare, own.samples, distance))
        nothing = np.zeros(at.x.size)
        return ConvexStep(
            place=self.program.place,
            gradient=cost.gradient(at.x, at.torques),
            curvature=cost.moving,
            squares=cost.squares(at.x, at.torques),
            bounds=(nothing, nothing),
            hard=velocities.only(~given).below(at.x)[:2],
            soft=tuple(soft),
        )

    def _judged(self, at: Iterate, taken: Iterate, step: QpSolution, region: Array) -> tuple[bool, bool]:
        """Whether a step ends the iteration, and whether it was predicted well enough to judge its torques.

        With rows linear along the step, it ends at the optimum, but for distances: at its end other points of the
        bodies are the nearest, in other directions, along which a further step may gain as much. A convex program's
        optimum is convex in its bounds: moving the region's lowers it by no more than their multipliers predict.
        """
        merit, promised = self.merit(taken), at.cost + step.cost
        held = self.program.free & (2 * np.abs(taken.x - at.x) > region)  # not by the unknown's own bounds
        reached = region[held] @ np.abs(step.bounds[held]) <= self._enough * merit
        settled = abs(taken.cost - at.cost) < self._enough * merit
        off = abs(promised - merit)
        ended = settled or (reached and off < self._enough * merit and taken.distances is None)
        return bool(ended), bool(off < self.policy.tightened * merit and (reached or settled))

    def _kept(self, at: Iterate) -> bool:
        """Whether the rows are satisfied but for little."""
        return bool(np.all(at.violations(self.bounds) <= self.policy.left * np.array([1, 0.1, 1])))
