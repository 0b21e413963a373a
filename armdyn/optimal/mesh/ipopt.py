"""Numbers and results of nonlinear programs, and IPOPT, which polls a stopping condition and prints nothing.

minimise f(x, p) subject to lower ≤ x ≤ upper and lower ≤ g(x, p) ≤ upper.
"""

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, Self, TypeVar

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.locks import built_once, one_at_a_time
from armdyn.optimal.mesh.assembly import Program
from armdyn.optimal.mesh.layout import KEPT
from armdyn.optimal.problem.options import SolverSettings
from armdyn.optimal.problem.status import Status, Stop


@dataclass(frozen=True, eq=False)
class NlpData:
    """Numbers of one nonlinear program: initial unknowns, parameters, bounds.

    Attributes:
        x: initial unknowns.
        p: parameters.
        x_bounds: lower and upper bounds of the unknowns.
        g_bounds: lower and upper bounds of the equations.
    """

    x: Array
    p: Array
    x_bounds: tuple[Array, Array]
    g_bounds: tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class NlpResult:
    """Result of one solve.

    Attributes:
        status: status of the solve.
        message: the solver's status in words.
        iterations: number of iterations.
        x: the last unknowns; the initial ones if the last are not finite.
        lam_x: multipliers of the unknowns' bounds, positive at upper ones.
        lam_g: multipliers of the equations, likewise.
    """

    status: Status
    message: str
    iterations: int
    x: Array
    lam_x: Array
    lam_g: Array

    @classmethod
    def of(
        cls, status: Status, message: str, stop: Stop, iterations: int, data: NlpData, found: tuple[Array, Array, Array]
    ) -> Self:
        """Make the result; after a stop with its reason, after an overflow with the initial unknowns.

        Args:
            status: the solver's status; INTERRUPTED after a stop.
            message: the solver's status in words.
            stop: stopping condition that was polled.
            iterations: number of iterations.
            data: the program.
            found: last x, lam_x and lam_g.
        """
        x, lam_x, lam_g = found
        if status is Status.INTERRUPTED:
            status, message = stop.status, stop.word
        if not np.all(np.isfinite(x)):
            status, x = Status.FAILED if status is Status.SOLVED else status, data.x
        return cls(status, message, iterations, x, lam_x, lam_g)


class Monitor(ca.Callback):
    """Iteration callback of `casadi.nlpsol` that polls a `Stop`."""

    def __init__(self, nx: int, ng: int, np_: int):
        ca.Callback.__init__(self)
        self._sizes = {"x": nx, "f": 1, "g": ng, "lam_x": nx, "lam_g": ng, "lam_p": np_}
        self._stop: Stop | None = None
        self._raised: BaseException | None = None
        self.construct("monitor", {})

    @contextmanager
    def watching(self, stop: Stop) -> Iterator[None]:
        """Context in which the iterations poll a `Stop`; re-raises its exceptions, such as a second Ctrl-C."""
        self._stop, self._raised = stop, None
        try:
            yield
        finally:
            self._stop = None
        if self._raised is not None:
            raise self._raised

    def get_n_in(self) -> int:
        """Number of inputs: the outputs of nlpsol."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """One output: whether to stop."""
        return 1

    def get_name_in(self, i: int) -> str:
        """Name of an input, as in nlpsol."""
        return str(ca.nlpsol_out(i))

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """Sparsity of each input: dense columns."""
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(i)], 1)

    def eval(self, arguments: Any) -> list[int]:
        """Returns nonzero to stop IPOPT."""
        try:
            return [int(bool(self._stop))]
        except BaseException as failure:  # stops IPOPT, without CasADi's message on the terminal
            self._raised = failure
            return [1]


P = TypeVar("P", bound=Program)

POLL, _SMALL = 10, 1000
"""Iterations between polls of the stopping condition, and the most unknowns of programs that poll so rarely: a poll
costs as much as the gradients of a small arm, and may wait for threads. Larger programs, with iterations of up to a
tenth of a second, poll after each."""

STATUS = {
    "Solve_Succeeded": Status.SOLVED,
    "Solved_To_Acceptable_Level": Status.SOLVED,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Restoration_Failed": Status.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Status.ITERATION_LIMIT,
    "Maximum_CpuTime_Exceeded": Status.TIME_LIMIT,
    "Maximum_WallTime_Exceeded": Status.TIME_LIMIT,
    "User_Requested_Stop": Status.INTERRUPTED,
}
"""IPOPT's return statuses."""


class Ipopt(Generic[P]):
    """IPOPT set up for a program, with exact derivatives.

    Attributes:
        program: the program.
    """

    def __init__(self, program: P, settings: SolverSettings):
        nx, ng, parameters = (program.functions[name].numel() for name in ("x", "g", "p"))
        self.program = program
        self._monitor = Monitor(nx, ng, parameters)
        self._solver = ca.nlpsol(
            "minimum_time",
            "ipopt",
            program.functions,
            {
                "jac_g": program.jacobian,
                "hess_lag": program.hessian,
                "iteration_callback": self._monitor,
                "iteration_callback_step": POLL if nx <= _SMALL else 1,
                "calc_multipliers": False,
                "calc_lam_p": False,
                "inputs_check": False,  # CasADi warns of equations in fixed unknowns only
                "error_on_fail": False,
                "print_time": False,
                "show_eval_warnings": False,
                "ipopt": _options(settings),
            },
        )

    def solve(self, data: NlpData, stop: Stop, warm_start: NlpResult | None = None) -> NlpResult:
        """Solve the program; the only place that calls IPOPT.

        Args:
            data: the program's numbers.
            stop: stopping condition, polled every few iterations.
            warm_start: result of a similar program, for a warm start if the settings request it.
        """
        (lbx, ubx), (lbg, ubg) = data.x_bounds, data.g_bounds
        more = {} if warm_start is None else {"lam_x0": warm_start.lam_x, "lam_g0": warm_start.lam_g}
        with one_at_a_time, self._monitor.watching(stop):
            result = self._solver(x0=data.x, p=data.p, lbx=lbx, ubx=ubx, lbg=lbg, ubg=ubg, **more)
            stats: dict[str, Any] = self._solver.stats()
        x, lam_x, lam_g = (np.array(result[name]).ravel() for name in ("x", "lam_x", "lam_g"))
        word, iterations = str(stats["return_status"]), int(stats["iter_count"])
        status = STATUS.get(word, Status.FAILED)
        return NlpResult.of(status, word.replace("_", " "), stop, iterations, data, (x, lam_x, lam_g))

    def equations(self, x: Array, p: Array) -> Array:
        """Values of the program's equations at unknowns and parameters."""
        return np.array(self._solver.get_function("nlp_g")(x, p)).ravel()


@built_once(maxsize=KEPT // 4)
def ipopt_for(settings: SolverSettings, build: Callable[..., P], *arguments: Hashable) -> Ipopt[P]:
    """IPOPT for the program that a function builds from arguments; cached by these."""
    return Ipopt(build(*arguments), settings)


def _options(settings: SolverSettings) -> dict[str, float | str]:
    """IPOPT's options from solver settings."""
    options: dict[str, float | str] = {
        "tol": settings.tolerance,
        "max_iter": settings.max_iterations,
        "mu_init": settings.barrier,
        "nlp_scaling_method": "none",  # the unknowns and equations are scaled already
        # With its own permutation MUMPS miscounts negative eigenvalues, and IPOPT regularises in vain: 24 curves of a
        # Panda took 65 iterations in the median and 23.5 s, without it 26 and 7.2 s, to the same optima.
        "mumps_permuting_scaling": 0,
        "fixed_variable_treatment": "make_parameter",
        "print_level": 0,
        "sb": "yes",
    }
    if (accepted := settings.acceptable) is not None:
        options |= {"acceptable_tol": accepted.tolerance, "acceptable_constr_viol_tol": accepted.equations}
        options |= {"acceptable_iter": accepted.after}
        options |= {} if accepted.cost is None else {"acceptable_obj_change_tol": accepted.cost}
    pushes = ["bound_push", "bound_frac"]
    if settings.warm:
        options["warm_start_init_point"] = "yes"
        pushes = [f"warm_start_{name}" for name in (*pushes, "slack_bound_push", "slack_bound_frac", "mult_bound_push")]
    if settings.push is not None:
        options |= dict.fromkeys(pushes, settings.push)
    return options
