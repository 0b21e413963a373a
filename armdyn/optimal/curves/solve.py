"""The fastest curve near a guess: by sequential convexification, or with other path constraints by IPOPT.

Sequential convexification has cost and torques by hand, other equations by CasADi.
"""

from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.codegen.background import arrived
from armdyn.locks import forget
from armdyn.optimal.constraints.rows import StageRows
from armdyn.optimal.curves.curve import Basis, Curve, graded
from armdyn.optimal.curves.curve_program import CurveProgram, curve_program
from armdyn.optimal.curves.layout import CurveLayout, CurveSpec, curve_layout, finite
from armdyn.optimal.curves.nlp_data import assemble_curve
from armdyn.optimal.curves.program import build, rows_of
from armdyn.optimal.curves.sequential import Sequence, Sequential, Tighten
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
        sequential: whether sequential convexification found it.
    """

    curve: Curve
    result: NlpResult
    shape: CurveLayout
    rows: tuple[StageRows, ...]
    guessed: float
    limits: Flags
    sequential: bool = False

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
    only_sequential: bool = False,
) -> Solved:
    """Solve the program of curves from one guess.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        spec: requirements of the curve.
        warm_start: result of a similar specification, for a warm start with its multipliers.
        tighten: see `Sequential.solve`, for programs solved sequentially.
        only_sequential: do not fall back on IPOPT if sequential convexification does not converge.
    """
    shape, rows = curve_layout(task.problem, guess, spec.constraints), rows_of(task.problem, spec.constraints)
    avoids = task.problem.has_regions or spec.constraints.required_distances(task.problem) is not None
    if avoids or (solves_sequentially(task, shape, rows) and (warm_start is None or warm_start.sequential)):
        numbers, warm = task.policy.sequential, warm_start is not None or (avoids and spec.least > 0)
        enough = numbers.enough if avoids and not spec.least else numbers.free_enough
        found = solve_sequentially(task, guess, spec, enough, warm, None if avoids else tighten)
        if avoids or found.converged or task.stop or only_sequential:
            return found
        # With many torques at their limits throughout, first derivatives converge slowly.
    same = warm_start is not None and not warm_start.sequential and (warm_start.shape, warm_start.rows) == (shape, rows)
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


def solve_sequentially(
    task: Task, guess: Curve, spec: CurveSpec, enough: float, warm: bool = False, tighten: Tighten | None = None
) -> Solved:
    """Solve a program of curves by sequential convexification.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        spec: requirements of the curve.
        enough: see `Sequential.solve`, also `warm` and `tighten`.
        warm: whether the guess is nearly the solution.
        tighten: new torque bounds after a step.
    """
    shape, rows = curve_layout(task.problem, guess, spec.constraints), rows_of(task.problem, spec.constraints)
    data = assemble_curve(task, guess, spec, shape)
    program = curve_program(task, guess, spec, shape, data)
    lower, upper = (side[program.torques] for side in data.x_bounds)
    loop = Sequential(program, (lower, upper), guess.duration, task.policy.sequential, task.stop)
    found = loop.solve(data.x, enough, warm, tighten)
    result, limits = _with_multipliers(found, program, data, guess.duration), np.less(*data.g_bounds)
    return Solved(shape.curve(guess, result.x), result, shape, rows, guess.duration, limits, sequential=True)


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


def prepare_curve(task: Task, guess: Curve, spec: CurveSpec) -> None:
    """Build the functions that `solve_curve` needs, cold and warm.

    Args and raises: as for `solve_curve`.
    """
    shape, rows = curve_layout(task.problem, guess, spec.constraints), rows_of(task.problem, spec.constraints)
    for warm in () if solves_sequentially(task, shape, rows) else (False, True):
        _solver(task, shape, rows, warm)


def solves_sequentially(task: Task, shape: CurveLayout, rows: tuple[StageRows, ...]) -> bool:
    """Whether convexification suffices: speed-limited, with limits of torque, velocity and position only."""
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
    v, (acceleration, jerk) = finite(problem.limits.velocity), problem.rates
    ramps = 2 * np.sqrt(v / jerk) + v / acceleration
    travel = np.abs(np.diff(problem.poses, axis=0))
    return np.asarray(np.max(np.where(travel > 0, travel / v + ramps, 0.0), axis=1))
