"""IPOPT, set up for one program and called from one place."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import Any, Generic, Self, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.codegen.deadline import NoTimeError, until
from armdyn.locks import built_once, one_at_a_time
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.program.assembly import Program
from armdyn.optimal.solve.monitor import Monitor
from armdyn.optimal.solve.silence import silence
from armdyn.optimal.task.options import DirectOptions
from armdyn.optimal.task.scheme import Scheme
from armdyn.optimal.task.task import Task

Array = NDArray[np.float64]
P = TypeVar("P", bound=Program)
S = TypeVar("S")

_ASKED, _SMALL = 5, 2000
"""Iterations between two questions whether to stop, in programs of so many unknowns: a question costs as much as the
gradients of a small arm. Larger ones, whose iterations take a tenth of a second, ask after each."""
_KEPT = 64
"""Programs that stay built."""

_STATUS = {
    "Solve_Succeeded": Status.SOLVED,
    "Solved_To_Acceptable_Level": Status.SOLVED,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Restoration_Failed": Status.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Status.ITERATION_LIMIT,
    "Maximum_CpuTime_Exceeded": Status.TIME_LIMIT,
    "Maximum_WallTime_Exceeded": Status.TIME_LIMIT,
    "User_Requested_Stop": Status.INTERRUPTED,
}


@dataclass(frozen=True)
class IpoptSettings:
    """How IPOPT goes about a program.

    Attributes:
        tolerance: IPOPT's tol on the scaled problem.
        max_iterations: IPOPT's max_iter.
        verbose: let IPOPT print.
        options: further IPOPT options and their values.
    """

    tolerance: float
    max_iterations: int
    verbose: bool = False
    options: tuple[tuple[str, float | str], ...] = ()

    @classmethod
    def of(cls, options: DirectOptions, **more: float | str) -> Self:
        """Those of a call on a mesh, and further IPOPT options."""
        own = ("mu_init", options.barrier)
        return cls(options.tolerance, options.max_iterations, options.verbose, (own, *more.items()))


@dataclass(frozen=True, eq=False)
class NlpResult:
    """What IPOPT made of a program.

    Attributes:
        status: how it ended.
        message: IPOPT's word for it.
        iterations: of IPOPT.
        x: the unknowns where it ended; those where it began if it ended in none that are finite.
        lam_x: multipliers of the unknowns' bounds.
        lam_g: multipliers of the equations.
    """

    status: Status
    message: str
    iterations: int
    x: Array
    lam_x: Array
    lam_g: Array


class Ipopt(Generic[P]):
    """IPOPT set up for a program, with exact derivatives.

    Attributes:
        program: what it solves.
    """

    def __init__(self, program: P, settings: IpoptSettings):
        nx, ng, parameters = (program.functions[name].numel() for name in ("x", "g", "p"))
        self.program = program
        self._monitor, self._verbose = Monitor(nx, ng, parameters), settings.verbose
        self._solver = ca.nlpsol(
            "minimum_time",
            "ipopt",
            program.functions,
            {
                "jac_g": program.jacobian,
                "hess_lag": program.hessian,
                "iteration_callback": self._monitor,
                "iteration_callback_step": _ASKED if nx <= _SMALL else 1,
                "calc_multipliers": False,
                "error_on_fail": False,
                "print_time": False,
                "show_eval_warnings": settings.verbose,
                "ipopt": {
                    "tol": settings.tolerance,
                    "max_iter": settings.max_iterations,
                    "nlp_scaling_method": "none",  # the unknowns and equations are scaled already
                    "fixed_variable_treatment": "make_parameter",
                    "print_level": 5 if settings.verbose else 0,
                    "sb": "yes",
                    **dict(settings.options),
                },
            },
        )

    @classmethod
    def of(cls, settings: IpoptSettings, build: Callable[..., P], *arguments: Hashable) -> "Ipopt[P]":
        """IPOPT for what a function builds of its arguments: built once, and shared by all who ask for the same."""
        return _built(settings, build, arguments)

    def solve(
        self,
        x: Array,
        p: Array,
        x_bounds: tuple[Array, Array],
        g_bounds: tuple[Array, Array],
        stop: Stop,
        near: NlpResult | None = None,
    ) -> NlpResult:
        """One call of IPOPT, and all of them go through here.

        Args:
            x: the unknowns to start from.
            p: parameters.
            x_bounds: least and largest unknowns.
            g_bounds: least and largest values of the equations.
            stop: asked every few iterations of this call.
            near: what became of a program that was nearly the same: its multipliers are started from, too, if the
                settings say so.
        """
        (lbx, ubx), (lbg, ubg) = x_bounds, g_bounds
        more = {} if near is None else {"lam_x0": near.lam_x, "lam_g0": near.lam_g}
        with one_at_a_time, self._monitor.asking(stop), silence(self._verbose):
            result = self._solver(x0=x, p=p, lbx=lbx, ubx=ubx, lbg=lbg, ubg=ubg, **more)
            stats: dict[str, Any] = self._solver.stats()
        lam_x, lam_g = (np.array(result[name]).ravel() for name in ("lam_x", "lam_g"))
        found = np.array(result["x"]).ravel()
        return ended(str(stats["return_status"]), stop, int(stats["iter_count"]), found, x, lam_x, lam_g)

    def equations(self, x: Array, p: Array) -> Array:
        """Values of the program's equations at unknowns and parameters."""
        return np.array(self._solver.get_function("nlp_g")(x, p)).ravel()


def ended(word: str, stop: Stop, iterations: int, x: Array, begun: Array, lam_x: Array, lam_g: Array) -> NlpResult:
    """What became of a program.

    Args:
        word: IPOPT's, for how it ended.
        stop: that it asked.
        iterations: that it took.
        x: the unknowns where it ended.
        begun: those where it began, which are taken where the others are not finite.
        lam_x: multipliers of the unknowns' bounds.
        lam_g: multipliers of the equations.
    """
    status = _STATUS.get(word, Status.FAILED)
    if status is Status.INTERRUPTED and not stop.interrupted:
        status, word = Status.TIME_LIMIT, "time limit reached"
    if not np.all(np.isfinite(x)):
        status, x = Status.FAILED if status is Status.SOLVED else status, begun
    return NlpResult(status, word.replace("_", " "), iterations, x, lam_x, lam_g)


def in_time(task: Task, build: Callable[[Scheme], S]) -> S:
    """What a function of the task's scheme builds: by the deadline, in machine code only where there is time for that.

    Args:
        task: whose scheme and deadline they are.
        build: calls `Ipopt.of`, say.

    Raises:
        LateError: the time is up before that of what takes seconds to build is ready.
    """
    stop = task.stop
    with until(stop.deadline, lambda: stop.interrupted):
        if not stop.hurried:
            try:
                return build(task.scheme)
            except NoTimeError:
                stop.hurried = True
        return build(replace(task.scheme, compile=False))


@built_once(maxsize=_KEPT)
def _built(settings: IpoptSettings, build: Callable[..., P], arguments: tuple[Hashable, ...]) -> Ipopt[P]:
    return Ipopt(build(*arguments), settings)
