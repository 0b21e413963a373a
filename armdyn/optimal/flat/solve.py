"""The fastest curve near a guess, by IPOPT."""

from dataclasses import dataclass, replace

from armdyn.codegen.background import arrived
from armdyn.locks import forget
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.nlp_data import CurveSpec, assemble_curve, curve_layout, rows_of
from armdyn.optimal.flat.program import CurveLayout, build
from armdyn.optimal.path_constraints.rows import Rows
from armdyn.optimal.problem.status import Status
from armdyn.optimal.program.assembly import Program
from armdyn.optimal.solve.ipopt import Ipopt, IpoptSettings, NlpResult, in_time
from armdyn.optimal.task.task import Task

_WARM = 1e-9
"""How far IPOPT may push a warm start off its bounds."""


@dataclass(frozen=True, eq=False)
class Solved:
    """What IPOPT made of one guess.

    Attributes:
        curve: where it ended: a motion, whether it converged or not.
        result: IPOPT's own words and multipliers.
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
        """It is a local optimum of the program."""
        return self.result.status is Status.SOLVED


def solve_curve(task: Task, guess: Curve, spec: CurveSpec, near: Solved | None = None) -> Solved:
    """One call of IPOPT.

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
    result = solver.solve(
        nlp_data.x, nlp_data.p, nlp_data.x_bounds, nlp_data.g_bounds, task.stop, None if near is None else near.result
    )
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


def _solver(task: Task, shape: CurveLayout, rows: tuple[Rows, ...], warm: bool) -> Ipopt[Program]:
    """IPOPT for the program; what was built without machine code that has arrived since is built again."""
    if arrived():
        forget()
    numbers, options = task.policy.curves, task.options
    flat = {"tol": numbers.accepted, "constr_viol_tol": numbers.accepted, "obj_change_tol": numbers.tolerance}
    still: dict[str, float | str] = {f"acceptable_{name}": value for name, value in flat.items()}
    still["acceptable_iter"] = numbers.accepted_after
    more = still | {"mu_init": numbers.barrier}
    if warm:
        pushes = ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac", "mult_bound_push")
        more = still | {"mu_init": numbers.warm_barrier, "warm_start_init_point": "yes"}
        more |= {f"warm_start_{push}": _WARM for push in pushes}
    patience = min(options.max_iterations, numbers.patience)
    settings = IpoptSettings(numbers.tolerance, patience, options.verbose, tuple(more.items()))
    return in_time(task, lambda scheme: Ipopt.of(settings, build, task.dynamics, shape, rows, scheme.compile))
