"""The fastest curve near a guess."""

from dataclasses import dataclass, replace

from armdyn.codegen.background import arrived
from armdyn.locks import forget
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.nlp_data import CurveSpec, assemble_curve, curve_layout, rows_of
from armdyn.optimal.flat.program import CurveLayout, build
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
    rows = rows_of(task.problem, spec.constraints)
    near = near if near is not None and (near.shape, near.rows) == (shape, rows) else None
    solver = _solver(task, shape, rows, warm=near is not None)
    nlp_data = assemble_curve(task, guess, spec, shape)
    result = solver.solve(nlp_data, task.stop, None if near is None else near.result)
    legs = tuple(
        replace(leg, points=result.x[shape.points(k)], duration=float(result.x[shape.duration(k)]))
        for k, leg in enumerate(guess.legs)
    )
    return Solved(Curve(legs), result, shape, rows, guess.duration)


def prepare_curve(task: Task, guess: Curve, spec: CurveSpec) -> None:
    """Build, if it is not there, what `solve_curve` needs from a guess, and from what comes out.

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
