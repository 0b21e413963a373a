"""The fastest curve near a guess: by IPOPT, or with obstacles or regions by sequential convexification."""

from dataclasses import dataclass
from math import inf

from armdyn.codegen.background import arrived
from armdyn.locks import forget
from armdyn.optimal.flat.clearance_rows import clearance_rows
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.nlp_data import CurveSpec, assemble_curve, curve_layout, rows_of
from armdyn.optimal.flat.program import CurveLayout, build
from armdyn.optimal.flat.sequential import CurveProgram, Sequential, built
from armdyn.optimal.path_constraints.rows import Rows
from armdyn.optimal.problem.status import Status
from armdyn.optimal.program.assembly import Program
from armdyn.optimal.solve.registry import in_time, solver_for
from armdyn.optimal.solve.solver import NlpResult, Solver
from armdyn.optimal.task.solver_settings import Acceptable, SolverSettings
from armdyn.optimal.task.task import Task

_WARM = 1e-9
"""How far a warm start may be moved off its bounds."""


@dataclass(frozen=True, eq=False)
class Solved:
    """Result of one guess.

    Attributes:
        curve: where it ended: a motion, whether it converged or not.
        result: the solver's words and multipliers.
        shape: of the program.
        rows: of its path constraints.
        guessed: duration that the guess had, with which the program measures time [s].
    """

    curve: Curve
    result: NlpResult
    shape: CurveLayout
    rows: tuple[Rows, ...]
    guessed: float

    @property
    def converged(self) -> bool:
        """Whether IPOPT converged to a local optimum."""
        return self.result.status is Status.SOLVED


def solve_curve(task: Task, guess: Curve, spec: CurveSpec, near: Solved | None = None) -> Solved:
    """Solve the program of curves from one guess.

    Args:
        task: what is to be solved, and how.
        guess: where it starts.
        spec: what is asked of the curve.
        near: what came out where nearly the same was asked: it is started from with its multipliers.

    Raises:
        LateError: the time is up before the program is built.
    """
    shape = curve_layout(task.problem, guess, spec.constraints)
    if task.problem.regional or spec.constraints.asked_distances(task.problem) is not None:
        numbers = task.policy.sequential
        trust, eager = (numbers.fine_trust, None) if near is None else (numbers.again_trust, 0)
        return solve_among_obstacles(task, guess, spec, trust, numbers.enough, eager=eager)
    rows = rows_of(task.problem, spec.constraints)
    near = near if near is not None and (near.shape, near.rows) == (shape, rows) else None
    solver = _solver(task, shape, rows, warm=near is not None)
    nlp_data = assemble_curve(task, guess, spec, shape)
    result = solver.solve(nlp_data, task.stop, None if near is None else near.result)
    return Solved(shape.curve(guess, result.x), result, shape, rows, guess.duration)


def solve_among_obstacles(
    task: Task,
    guess: Curve,
    spec: CurveSpec,
    trust: float,
    enough: float,
    beaten: float = inf,
    eager: int | None = None,
) -> Solved:
    """Solve a program of curves that keep distances, or frames in regions.

    Args:
        task: what is to be solved, and how.
        guess: where it starts.
        spec: what is asked of the curve.
        trust: first radius of the trust region [rad or m].
        enough: relative change of the merit at which the sequence ends.
        beaten: a duration [s]: a sequence that is not near it after a few steps ends.
        eager: first steps that are taken whatever they do; None: the policy's.
    """
    problem, numbers = task.problem, task.policy.sequential
    shape, rows = curve_layout(problem, guess, spec.constraints), rows_of(problem, spec.constraints)
    program, cost = in_time(task, lambda scheme: built(task.dynamics, shape, rows, scheme.compile))
    asked = spec.constraints.asked_distances(problem)
    near = None if asked is None else clearance_rows(asked, guess, numbers)
    data = assemble_curve(task, guess, spec, shape)
    own = CurveProgram(program, cost, data, shape, guess, problem.limits.velocity, near)
    result = Sequential(own, numbers, task.stop).solve(trust, enough, beaten, eager)
    return Solved(shape.curve(guess, result.x), result, shape, rows, guess.duration)


def prepare_curve(task: Task, guess: Curve, spec: CurveSpec) -> None:
    """Build the functions that `solve_curve` needs, cold and warm, unless they are built.

    Args and raises: as of `solve_curve`.
    """
    shape, rows = curve_layout(task.problem, guess, spec.constraints), rows_of(task.problem, spec.constraints)
    for warm in (False, True):
        _solver(task, shape, rows, warm)


def _solver(task: Task, shape: CurveLayout, rows: tuple[Rows, ...], warm: bool) -> Solver[Program]:
    """The solver of the program; a program built without machine code that has arrived since is built again."""
    if arrived():
        forget()
    numbers, options = task.policy.curves, task.options
    settings = SolverSettings(
        numbers.tolerance,
        min(options.max_iterations, numbers.patience),
        options.verbose,
        numbers.warm_barrier if warm else numbers.barrier,
        Acceptable(numbers.accepted, numbers.accepted, numbers.tolerance, numbers.accepted_after),
        push=_WARM if warm else None,
        warm=warm,
    )
    return in_time(task, lambda scheme: solver_for(task, settings, build, task.dynamics, shape, rows, scheme.compile))
