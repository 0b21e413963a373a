"""The fastest curve near a guess by sequential convexification: linearised rows, a trust region, exact penalties.

Torques are eliminated: they are functions of control points and durations, and their limits are rows of the quadratic
program. Distances come from coal on the real geometry, with their gradients. After J. Schulman et al., "Motion planning
with sequential convex optimization and convex collision checking", IJRR 33(9), 2014; the merit function and the
trust region are those of Nocedal and Wright, Numerical Optimization, 2006, algorithm 18.4 and section 18.5.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.flat.clearance_rows import ClearanceRows, Linearised
from armdyn.optimal.flat.convex_step import ConvexStep, QpSolution, SoftRows, solve_step
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.program import CurveLayout, build
from armdyn.optimal.path_constraints.rows import Rows
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.program.assembly import Program
from armdyn.optimal.solve.solver import NlpData, NlpResult
from armdyn.optimal.task.policy.sequential import SequentialPolicy

Array = NDArray[np.float64]
Index = NDArray[np.int_]


@built_once(maxsize=16)
def built(
    dynamics: Dynamics, shape: CurveLayout, rows: tuple[Rows, ...], compile_mode: bool | None
) -> tuple[Program, ca.Function]:
    """The program of curves, and its cost with the gradient as a function of unknowns and parameters."""
    program = build(dynamics, shape, rows, compile_mode)
    x, p, f = (program.functions[name] for name in "xpf")
    return program, ca.Function("cost", [x, p], [f, ca.gradient(f, x)])


@dataclass(frozen=True, eq=False)
class CurveProgram:
    """A program of curves in numbers, and the distances that its curve keeps.

    Attributes:
        program: its functions.
        cost: (x, p) -> cost and its gradient by the unknowns.
        numbers: unknowns to start from, parameters, bounds.
        shape: where its unknowns and equations stand.
        guess: the curve that the unknowns are of.
        speeds: scales of the joints' velocities [rad/s or m/s], shape (joints,).
        clearance: distances to be kept; None: none.
    """

    program: Program
    cost: ca.Function
    numbers: NlpData
    shape: CurveLayout
    guess: Curve
    speeds: Array
    clearance: ClearanceRows | None = None

    @cached_property
    def torques(self) -> Index:
        """Where the torques stand, shape (points of all legs, joints)."""
        return np.concatenate([self.shape.torques(leg) for leg in self.shape.legs])

    @cached_property
    def torque_equations(self) -> Index:
        """Where their equations stand, of the same shape."""
        return np.concatenate([self.shape.torque_rows(leg) for leg in self.shape.legs])

    @cached_property
    def durations(self) -> Index:
        """Where the durations stand, shape (legs,)."""
        return np.array([self.shape.duration(leg) for leg in self.shape.legs])

    @cached_property
    def free(self) -> Index:
        """Unknowns that are neither torques nor fixed."""
        lower, upper = self.numbers.x_bounds
        free = lower < upper
        free[self.torques] = False
        return np.flatnonzero(free)

    @cached_property
    def powers(self) -> Array:
        """By which power of its leg's duration each equation falls, shape (equations,); 0: by none."""
        out = np.zeros(self.numbers.g_bounds[0].size)
        for leg in self.shape.legs:
            for order in self.shape.orders:
                out[self.shape.rates(leg, order)] = order
        return out

    @cached_property
    def leg_durations(self) -> Index:
        """Where the duration stands whose power each equation falls by, shape (equations,); -1: none."""
        out = np.full(self.powers.size, -1)
        for leg in self.shape.legs:
            for order in self.shape.orders:
                out[self.shape.rates(leg, order)] = self.shape.duration(leg)
        return out


@dataclass(frozen=True, eq=False)
class _Iterate:
    """An iterate: a curve whose torques are those that it takes, and all rows linearised there.

    Attributes:
        x: unknowns.
        g: values of the equations; those of the torques are zero.
        jacobian: of the equations by the free unknowns, torques eliminated, shape (equations, free).
        near: distances; None: none are asked for.
        penalties: price of what is violated: torques, distances, other rows [s].
    """

    x: Array
    g: Array
    jacobian: sp.csr_matrix
    near: Linearised | None
    penalties: tuple[float, float, float]


class Sequential:
    """Sequential convexification of one program."""

    def __init__(self, problem: CurveProgram, policy: SequentialPolicy, stop: Stop):
        self.problem, self.policy, self.stop = problem, policy, stop
        self._whole = problem.guess.duration

    def solve(self, trust: float, enough: float, beaten: float = np.inf, eager: int | None = None) -> NlpResult:
        """Iterate from the program's unknowns.

        Args:
            trust: first radius of the trust region [rad or m].
            enough: relative change of the merit at which the sequence ends.
            eager: first steps that are taken whatever they do; None: the policy's.
            beaten: a duration [s]; a sequence that is not near it after a few steps ends.
        """
        policy, iterations, first = self.policy, 0, trust
        eager = policy.eager if eager is None else eager
        at = self._point(self.problem.numbers.x)
        merit, step, status, word = self._merit(at), None, Status.ITERATION_LIMIT, "iteration limit"
        for k in range(policy.steps):
            if self.stop:
                status, word = Status.INTERRUPTED, "interrupted"
                break
            taken, step, trust, tried = self._step(at, merit, trust, eager=k < eager)
            iterations += tried
            missed = (
                at.penalties[2] > policy.distance * policy.distance_left and policy.other < policy.dearest * self._whole
            )
            if taken is None and missed:  # a slow arm gains more by missing rows than their price
                policy = self.policy = replace(policy, other=10 * policy.other)
                at = self._point(at.x)
                merit, trust = self._merit(at), first
                continue
            if taken is None:
                status, word = (
                    (Status.SOLVED, "no step is better") if self._kept(at) else (Status.FAILED, "no step is better")
                )
                break
            before, merit, at = merit, self._merit(taken), taken
            if abs(before - merit) < enough * merit and self._kept(at):
                status, word = Status.SOLVED, "converged"
                break
            if k >= eager and self._duration(at) > policy.hopeless * beaten:
                word = "another way is faster"
                break
        return self._outcome(at, step, status, word, iterations)

    def _step(
        self, at: _Iterate, merit: float, trust: float, eager: bool
    ) -> tuple[_Iterate | None, QpSolution, float, int]:
        """A step that is taken (None: none is better), its quadratic program, the next radius and the iterations."""
        policy, iterations = self.policy, 0
        rows = self._rows(at)
        while True:
            step = solve_step(self._convex(at, rows, trust))
            iterations += 1
            if step.found:
                x = at.x.copy()
                x[self.problem.free] += step.step
                x[self.problem.free] = np.clip(x, *self.problem.numbers.x_bounds)[self.problem.free]
                next_ = self._point(x)
                gained, promised = merit - self._merit(next_), merit - self._promised(at, step)
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
        """An iterate from unknowns whose torques may be any."""
        problem, p = self.problem, self.problem.numbers.p
        x = x.copy()
        g, matrix = problem.program.jacobian(x, p)
        values = np.array(g).ravel()
        t, rows, free = problem.torques.ravel(), problem.torque_equations.ravel(), problem.free
        x[t] += values[rows]
        jacobian = sp.csc_matrix((matrix.nonzeros(), matrix.row(), matrix.colind()), shape=matrix.shape)
        by_free, by_torque = jacobian[:, free].tocsr(), jacobian[:, t].tocsr()
        load = by_free[rows]
        others = np.ones(values.size, dtype=bool)
        others[rows] = False
        # The torques' own equations have minus one for the torque: nothing is left of them.
        own = sp.diags(others.astype(float))
        values = np.where(others, values + by_torque @ values[rows], 0.0)
        reduced = own @ (by_free + by_torque @ load)
        place = sp.csr_matrix((np.ones(rows.size), (rows, np.arange(rows.size))), shape=(values.size, rows.size))
        near = None if problem.clearance is None else problem.clearance.at(problem.guess, problem.shape, x)
        return _Iterate(x, values, (reduced + place @ load).tocsr(), near, self._penalties(x, values, near))

    def _penalties(self, x: Array, g: Array, near: Linearised | None) -> tuple[float, float, float]:
        policy, problem = self.policy, self.problem
        (low, high), (least, most) = problem.numbers.x_bounds, problem.numbers.g_bounds
        tau, own = x[problem.torques], problem.torques
        over = np.max(np.maximum(tau - high[own], low[own] - tau), axis=1, initial=0)
        beside = np.maximum(np.maximum(g - most, least - g), 0)
        beside[problem.torque_equations.ravel()] = 0
        missing = 0.0 if near is None else float(np.sum(near.missing))
        return policy.torque * float(np.sum(over)), policy.distance * missing, policy.other * float(np.sum(beside))

    def _merit(self, at: _Iterate) -> float:
        return self._value(at.x) + sum(at.penalties)

    def _value(self, x: Array) -> float:
        """Cost of the unknowns, in seconds as the guess measures them."""
        return float(self.problem.cost(x, self.problem.numbers.p)[0]) * self._whole

    def _promised(self, at: _Iterate, step: QpSolution) -> float:
        return self._value(at.x) + step.cost

    def _duration(self, at: _Iterate) -> float:
        return float(np.sum(at.x[self.problem.durations]))

    def _kept(self, at: _Iterate) -> bool:
        torque, distance, other = at.penalties
        policy = self.policy
        return (
            torque <= policy.torque * policy.torque_left and distance + other <= policy.distance * policy.distance_left
        )

    def _rows(self, at: _Iterate) -> tuple[tuple[sp.csr_matrix, Array], tuple[SoftRows, ...], SoftRows]:
        """Hard rows of the quadratic program, soft inequalities, soft equations."""
        problem, policy = self.problem, self.policy
        low, high = (side[problem.torques] for side in problem.numbers.x_bounds)
        load = at.jacobian[problem.torque_equations.ravel()]
        tau = at.x[problem.torques]
        points = np.repeat(np.arange(len(tau)), tau.shape[1])
        torque = _both(load, (low - tau).ravel(), (high - tau).ravel(), points, policy.torque)
        least, most = problem.numbers.g_bounds
        power = problem.powers
        velocity = np.flatnonzero((power == 1) & (least < most))
        rest = np.setdiff1d(np.flatnonzero(np.isfinite(least) | np.isfinite(most)), velocity)
        rest = np.setdiff1d(rest, problem.torque_equations.ravel())
        equal, rest = rest[least[rest] == most[rest]], rest[least[rest] < most[rest]]
        hard = self._sides(at, velocity)
        jacobian, upper = self._sides(at, rest)
        soft = [torque, SoftRows(jacobian, upper, np.arange(upper.size), policy.other)]
        if at.near is not None:
            by_free = at.near.jacobian[:, problem.free]
            soft.append(SoftRows(-by_free, at.near.spare, at.near.samples, policy.distance))
        equations = SoftRows(at.jacobian[equal], (most - at.g)[equal], np.arange(equal.size), policy.other)
        return hard, tuple(soft), equations

    def _sides(self, at: _Iterate, rows: Index) -> tuple[sp.csr_matrix, Array]:
        """Upper and lower sides of equations.

        A rate is r = c(points) / T^k, and r <= b is c <= b T^k, linear in T where k is 1 and convex else: the tangent
        of T^k is used, which is exact or on the safe side.
        """
        problem = self.problem
        bounds, power = problem.numbers.g_bounds, problem.powers[rows]
        by, g = at.jacobian[rows], at.g[rows]
        where = problem.leg_durations[rows]
        column = np.searchsorted(problem.free, np.where(where < 0, problem.free[0], where))
        duration = np.where(where < 0, 1.0, at.x[np.maximum(where, 0)])
        blocks, tops = [], []
        for sign, bound in ((1.0, bounds[1][rows]), (-1.0, bounds[0][rows])):
            kept = np.isfinite(bound)
            # From -k g / T, which the Jacobian has, to -k b / T.
            change = np.where(where < 0, 0.0, power * (g - np.where(kept, bound, 0)) / duration)
            more = sp.csr_matrix((change, (np.arange(rows.size), column)), shape=by.shape)
            blocks.append((sign * (by + more))[kept])
            tops.append((sign * (bound - g))[kept])
        return sp.vstack(blocks, format="csr"), np.concatenate(tops)

    def _convex(
        self, at: _Iterate, rows: tuple[tuple[sp.csr_matrix, Array], tuple[SoftRows, ...], SoftRows], trust: float
    ) -> ConvexStep:
        problem, policy, free = self.problem, self.policy, self.problem.free
        low, high = problem.numbers.x_bounds
        radius = np.full(at.x.size, trust)
        radius[problem.durations] = policy.slower * at.x[problem.durations]
        lower = np.maximum(-radius, np.minimum(low - at.x, 0))
        lower[problem.durations] = np.maximum(lower[problem.durations], -policy.faster * at.x[problem.durations])
        upper = np.minimum(radius, np.maximum(high - at.x, 0))
        slope = np.array(self.problem.cost(at.x, problem.numbers.p)[1]).ravel() * self._whole
        by_torque = at.jacobian[problem.torque_equations.ravel()].T @ slope[problem.torques.ravel()]
        smooth = self._smoothing
        return ConvexStep(
            gradient=slope[free] + by_torque + (smooth @ at.x)[free],
            curvature=smooth[free][:, free],
            lower=lower[free],
            upper=upper[free],
            hard=rows[0],
            soft=rows[1],
            equal=rows[2],
            last=np.searchsorted(free, problem.durations),
        )

    @cached_property
    def _smoothing(self) -> sp.csr_matrix:
        """Weight of the squared second derivatives over their scales, which makes the step unique."""
        problem, size = self.problem, self.problem.shape.size
        velocity, times = problem.speeds, np.array([leg.duration for leg in problem.guess.legs])
        smooth = self.policy.smooth * np.ones(times.size)
        if problem.shape.joined:  # of accelerations in time: those of short legs are large
            smooth = self.policy.smooth_short * (np.max(times) / times) ** 3
        out = sp.csr_matrix((size, size))
        for k, leg in enumerate(problem.guess.legs):
            s, weights = leg.basis.gauss(2)
            second = leg.basis.local(s.ravel(), derivatives=2)[:, 2]
            window = leg.basis.interval_of(s.ravel())[:, None] + np.arange(second.shape[1])
            points = problem.shape.points(k)[window]
            weight = (smooth[k] * weights.ravel()[:, None] / velocity**2).ravel()
            rows = np.broadcast_to(np.arange(weight.size).reshape(len(points), 1, -1), points.shape)
            values = np.broadcast_to(second[:, :, None], points.shape)
            matrix = sp.csr_matrix((values.ravel(), (rows.ravel(), points.ravel())), (weight.size, size))
            out = out + matrix.T @ sp.diags(weight) @ matrix
        return out.tocsr()

    def _outcome(self, at: _Iterate, step: QpSolution | None, status: Status, word: str, iterations: int) -> NlpResult:
        lam_x, lam_g = np.zeros(at.x.size), np.zeros(at.g.size)
        if step is not None:
            self._multipliers(step, lam_x, lam_g)
        return NlpResult(status, word, iterations, at.x, lam_x / self._whole, lam_g / self._whole)

    def _multipliers(self, step: QpSolution, lam_x: Array, lam_g: Array) -> None:
        """Multipliers of torque limits and velocity limits, with IPOPT's signs."""
        problem = self.problem
        low, high = (side[problem.torques].ravel() for side in problem.numbers.x_bounds)
        upper, lower = np.split(step.multipliers[1], [np.count_nonzero(np.isfinite(high))])
        t = problem.torques.ravel()
        lam_x[t[np.isfinite(high)]] += upper
        lam_x[t[np.isfinite(low)]] -= lower
        least, most = problem.numbers.g_bounds
        velocity = np.flatnonzero((problem.powers == 1) & (least < most))
        above = velocity[np.isfinite(most[velocity])]
        below = velocity[np.isfinite(least[velocity])]
        upper, lower = np.split(step.multipliers[0], [above.size])
        lam_g[above] += upper
        lam_g[below] -= lower


def _both(jacobian: sp.csr_matrix, lower: Array, upper: Array, groups: Index, price: float) -> SoftRows:
    """Both sides of `lower <= jacobian @ step <= upper`."""
    above, below = np.isfinite(upper), np.isfinite(lower)
    return SoftRows(
        sp.vstack([jacobian[above], -jacobian[below]], format="csr"),
        np.concatenate([upper[above], -lower[below]]),
        np.concatenate([groups[above], groups[below]]),
        price,
    )
