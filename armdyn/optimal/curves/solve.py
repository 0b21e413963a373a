"""The fastest curve near a guess: by sequential convexification, or with other path constraints by IPOPT.

Sequential convexification has cost and torques by hand, other equations by CasADi.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from armdyn.arrays import Array, Flags, Index
from armdyn.codegen.background import arrived
from armdyn.locks import forget
from armdyn.optimal.constraints.rows import StageRows
from armdyn.optimal.curves.curve import Basis, Curve, graded
from armdyn.optimal.curves.curve_program import CurveCost, CurveProgram, OtherRows, TorquePrices, quadratic_form
from armdyn.optimal.curves.equations import POINTS
from armdyn.optimal.curves.linear_rows import DerivativeRows, TorqueRows, clearance_rows
from armdyn.optimal.curves.nlp_data import (
    CurveSpec,
    assemble_curve,
    curve_layout,
    finite,
    rate_limits,
    rows_of,
    travel_scales,
)
from armdyn.optimal.curves.program import CurveLayout, build
from armdyn.optimal.curves.sequential import Sequence, SequenceSettings, Sequential, Tighten
from armdyn.optimal.mesh.assembly import Program
from armdyn.optimal.mesh.ipopt import Ipopt, NlpData, NlpResult, ipopt_for
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.options import Acceptable, SolverSettings
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.task import Task

_SHORT = 0.01
"""Ways below which unknowns have units of their own [rad or m]; longer motions converge without."""


@dataclass(frozen=True, eq=False)
class Solved:
    """Result from one guess.

    Attributes:
        curve: the last curve, converged or not.
        result: the solver's status and multipliers.
        shape: layout of the program.
        rows: rows of the path constraints.
        guessed: duration of the guess, the program's unit of time [s].
        limits: whether each equation, in the order of `result.lam_g`, is a limit, not an equality.
        in_steps: whether sequential convexification found it.
    """

    curve: Curve
    result: NlpResult
    shape: CurveLayout
    rows: tuple[StageRows, ...]
    guessed: float
    limits: Flags
    in_steps: bool = False

    @property
    def converged(self) -> bool:
        """Whether the solver converged to a local optimum."""
        return self.result.status is Status.SOLVED


def solve_curve(
    task: Task,
    guess: Curve,
    spec: CurveSpec,
    warm_start: Solved | None = None,
    tighten: Tighten | None = None,
    by_steps: bool = False,
) -> Solved:
    """Solve the program of curves from one guess.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        spec: requirements of the curve.
        warm_start: result of a similar specification, for a warm start with its multipliers.
        tighten: see `SequenceSettings`, for programs solved by steps.
        by_steps: do not fall back on IPOPT if steps do not converge.
    """
    shape, rows = curve_layout(task.problem, guess, spec.constraints), rows_of(task.problem, spec.constraints)
    avoids = task.problem.has_regions or spec.constraints.required_distances(task.problem) is not None
    if avoids or (solved_by_steps(task, shape, rows) and (warm_start is None or warm_start.in_steps)):
        numbers, warm = task.policy.sequential, warm_start is not None or (avoids and spec.least > 0)
        enough = numbers.enough if avoids and not spec.least else numbers.free_enough
        found = solve_in_steps(task, guess, spec, SequenceSettings(enough, warm, None if avoids else tighten))
        if avoids or found.converged or task.stop or by_steps:
            return found
        # With many torques at their limits throughout, first derivatives converge slowly.
    same = warm_start is not None and not warm_start.in_steps and (warm_start.shape, warm_start.rows) == (shape, rows)
    warm_start = warm_start if same else None
    solver = _solver(task, shape, rows, warm=warm_start is not None)
    units = units_of(task.problem, guess, shape, rows)
    nlp_data = assemble_curve(task, guess, spec, shape, units)
    result = solver.solve(nlp_data, task.stop, None if warm_start is None else warm_start.result)
    result = replace(result, x=result.x * shape.units(*units))
    return Solved(shape.curve(guess, result.x), result, shape, rows, guess.duration, np.less(*nlp_data.g_bounds))


def units_of(
    problem: MinimumTimeProblem, guess: Curve, shape: CurveLayout, rows: tuple[StageRows, ...]
) -> tuple[float, float]:
    """Units of control points [rad or m] and durations [s]: powers of two, so that no digit is lost; 1 with rows.

    IPOPT does not converge where its unknowns are far below one.
    """
    if rows or shape.rated:
        return 1.0, 1.0
    way = float(np.max(np.abs(np.diff(problem.poses, axis=0))))
    units = np.exp2(np.floor(np.log2([way, guess.duration]))) if 0 < way < _SHORT else np.ones(2)
    return float(units[0]), float(units[1])


def solve_in_steps(task: Task, guess: Curve, spec: CurveSpec, steps: SequenceSettings) -> Solved:
    """Solve a program of curves by sequential convexification.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        spec: requirements of the curve.
        steps: settings of the sequence.
    """
    shape, rows = curve_layout(task.problem, guess, spec.constraints), rows_of(task.problem, spec.constraints)
    data = assemble_curve(task, guess, spec, shape)
    program = curve_program(task, guess, spec, shape, data)
    lower, upper = (side[program.torques] for side in data.x_bounds)
    found = Sequential(program, (lower, upper), guess.duration, task.policy.sequential, task.stop).solve(data.x, steps)
    result, limits = _with_multipliers(found, program, data, guess.duration), np.less(*data.g_bounds)
    return Solved(shape.curve(guess, result.x), result, shape, rows, guess.duration, limits, in_steps=True)


def _with_multipliers(found: Sequence, program: CurveProgram, data: NlpData, whole: float) -> NlpResult:
    """The outcome of a sequence, with multipliers of torque and velocity limits in IPOPT's signs and units.

    Args:
        found: the outcome.
        program: its program.
        data: the nonlinear program of the same unknowns.
        whole: duration of the guess [s].
    """
    x, lam_x, lam_g = found.at.x, np.zeros(found.at.x.size), np.zeros(data.g_bounds[0].size)
    if found.step is not None:
        rates = program.shape.rates_of_all(1)
        limited = rates[data.g_bounds[0][rates] < data.g_bounds[1][rates]]
        velocities, torques, *_ = found.step.multipliers
        for out, own, both in ((lam_x, program.torques.ravel(), torques), (lam_g, limited, velocities)):
            upper, lower = np.split(both, 2)
            out[own] += upper - lower
        timed = found.at.sides[0].duration  # rows c <= b T are divided by the T that they are linearised at
        lam_g[rates] *= x[timed] / found.base.x[timed]
    return NlpResult(found.status, found.word, found.iterations, x, lam_x / whole, lam_g / whole)


def curve_cost(task: Task, guess: Curve, spec: CurveSpec, shape: CurveLayout) -> CurveCost:
    """The cost of `assemble_curve`'s nonlinear program, in seconds.

    Args:
        task: task with the effort weights.
        guess: curve whose legs' durations weigh the squares.
        spec: weights of the squares.
        shape: layout of the program.
    """
    n, sizes = shape.joints, [POINTS * count for count in shape.intervals]
    parts = np.concatenate([leg.basis.gauss(POINTS)[1].ravel() for leg in guess.legs])
    times = np.array([leg.duration for leg in guess.legs])
    squares = task.problem.effort_weights() * task.problem.limits.actuators.half_range**2
    steps = np.full(parts.size - 1, spec.steps * guess.duration / n)
    steps[np.cumsum(sizes)[:-1] - 1] = 0.0
    moving = sp.csr_matrix((shape.size, shape.size))
    if spec.travel:
        each = zip(spec.travel * times / n, guess.legs, strict=True)
        squared = [price * leg.basis.squared(1, POINTS) for price, leg in each]
        moving = quadratic_form(shape, squared, travel_scales(task, guess))
    elif not spec.smooth:  # squared accelerations over velocity limits determine joints with time to spare
        numbers, prices = task.policy.sequential, np.full(times.size, task.policy.sequential.smooth)
        if shape.joined:  # of accelerations in time: those of short legs are large
            prices = numbers.smooth_short * (np.max(times) / times) ** 3
        squared = [price * leg.basis.squared(2, POINTS) for price, leg in zip(prices, guess.legs, strict=True)]
        moving = quadratic_form(shape, squared, task.problem.limits.velocity)
    torques = TorquePrices(
        duration_of_point=np.repeat([shape.duration(k) for k in shape.legs], sizes),
        tie=parts * np.repeat(spec.smooth * times / n, sizes),
        effort=parts[:, None] * squares,
        steps=steps,
    )
    priced = spec.smooth or spec.steps or task.problem.pays_effort
    return CurveCost(np.array([shape.duration(k) for k in shape.legs]), moving, torques if priced else None)


def other_equations(shape: CurveLayout, count: int) -> Index:
    """Indices of the equations that limit neither torques nor time derivatives, out of `count` equations."""
    own = [shape.torque_rows(leg).ravel() for leg in shape.legs]
    own += [shape.rates_of_all(order) for order in shape.orders]
    return np.setdiff1d(np.arange(count), np.concatenate(own))


def curve_program(task: Task, guess: Curve, spec: CurveSpec, shape: CurveLayout, data: NlpData) -> CurveProgram:
    """Program for sequential convexification.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        spec: requirements of the curve.
        shape: layout of the program.
        data: the nonlinear program's parameters and bounds.
    """
    problem, bases = task.problem, [leg.basis for leg in guess.legs]
    limits, (lower, upper) = rate_limits(problem, spec.constraints), data.x_bounds
    torques = np.concatenate([shape.torques(leg) for leg in shape.legs])
    free = lower < upper
    free[torques] = False

    def bounds(rows: Index) -> tuple[Array, Array]:
        return data.g_bounds[0][rows], data.g_bounds[1][rows]

    others, required = None, spec.constraints.required_distances(problem)
    if (which := other_equations(shape, data.g_bounds[0].size)).size:
        rows = rows_of(problem, spec.constraints)
        program = task.in_time(lambda scheme: build(task.dynamics, shape, rows, scheme.compile))
        others = OtherRows(program, data.p, which, bounds(which))
    points = [(basis, basis.gauss(POINTS)[0].ravel()) for basis in bases]
    return CurveProgram(
        shape=shape,
        torque_rows=TorqueRows(problem.robot, problem.limits.actuators.half_range, points, shape),
        derivative_rows=tuple(
            DerivativeRows.of(bases, shape, k, finite(limits[k]), bounds(shape.rates_of_all(k))) for k in shape.orders
        ),
        cost=curve_cost(task, guess, spec, shape),
        bounds=data.x_bounds,
        free=free,
        torques=torques,
        others=others,
        clearance=None if required is None else clearance_rows(required, guess, task.policy),
    )


def prepare_curve(task: Task, guess: Curve, spec: CurveSpec) -> None:
    """Build the functions that `solve_curve` needs, cold and warm.

    Args and raises: as for `solve_curve`.
    """
    shape, rows = curve_layout(task.problem, guess, spec.constraints), rows_of(task.problem, spec.constraints)
    for warm in () if solved_by_steps(task, shape, rows) else (False, True):
        _solver(task, shape, rows, warm)


def solved_by_steps(task: Task, shape: CurveLayout, rows: tuple[StageRows, ...]) -> bool:
    """Whether sequential steps solve the problem: speed-limited, with limits of torque, velocity and position only."""
    problem, plain = task.problem, not rows and shape == CurveLayout(shape.joints, shape.intervals[:1])
    return plain and task.policy.curves.cruises and not problem.pays_effort


def _solver(task: Task, shape: CurveLayout, rows: tuple[StageRows, ...], warm: bool) -> Ipopt[Program]:
    """The solver of the program; a program without machine code is rebuilt once its code is ready."""
    if arrived():
        forget()
    numbers = task.policy.curves
    accepted = Acceptable(100 * numbers.tolerance, 100 * numbers.tolerance, numbers.tolerance)
    settings = SolverSettings(numbers.tolerance, numbers.patience, acceptable=accepted)
    if warm:
        settings = replace(settings, barrier=10 * numbers.tolerance, push=numbers.tolerance / 100, warm=True)
    return task.in_time(lambda scheme: ipopt_for(settings, build, task.dynamics, shape, rows, scheme.compile))


def straight_curve(task: Task, intervals: int) -> Curve:
    """The straight path as a curve.

    Args:
        task: the problem and its settings.
        intervals: number of intervals of every leg.
    """
    problem, numbers = task.problem, task.policy.curves
    basis = Basis(graded(intervals, numbers.shortest))
    if numbers.cruises:
        travel = np.max(np.abs(np.diff(problem.poses, axis=0)) / problem.limits.velocity, axis=1)
        durations = numbers.slack * np.maximum(travel, 1e-3 * np.sum(travel))
        if problem.via and problem.jerk_limit is not None:  # from a faster guess IPOPT does not find back
            durations = np.maximum(durations, numbers.gentle * _ramped_times(problem))
    else:
        travel = np.max(np.abs(np.diff(problem.poses, axis=0)), axis=1)
        travel = travel if travel.any() else np.ones_like(travel)  # from a moving state back to its own position
        durations = spline(problem, []).duration * travel / travel.sum()
    return Curve.straight(problem, basis, durations)


def _ramped_times(problem: MinimumTimeProblem) -> Array:
    """Times of the legs from rest to rest at the velocity limits, with ramps of limited jerk [s], shape (legs,)."""
    v = np.where(np.isfinite(problem.limits.velocity), problem.limits.velocity, 1.0)
    ramps = 2 * np.sqrt(v / np.asarray(problem.jerk_limit))
    if problem.acceleration_limit is not None:
        ramps = ramps + v / np.asarray(problem.acceleration_limit)
    travel = np.abs(np.diff(problem.poses, axis=0))
    return np.asarray(np.max(np.where(travel > 0, travel / v + ramps, 0.0), axis=1))
