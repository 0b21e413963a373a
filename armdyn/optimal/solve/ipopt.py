"""IPOPT, set up for the programs of `transcription`."""

from collections.abc import Mapping

import casadi as ca

from armdyn.optimal.program.assembly import Program
from armdyn.optimal.solve.monitor import Monitor

_ASKED = 5
"""Iterations between two questions whether to stop: a question costs as much as the gradients of a small arm."""


def make_solver(
    nlp: Program,
    tolerance: float,
    max_iterations: int,
    *,
    verbose: bool = False,
    options: Mapping[str, float | str] | None = None,
) -> tuple[ca.Function, Monitor]:
    """A solver with exact derivatives, and the monitor that can stop it.

    Args:
        nlp: the program.
        tolerance: IPOPT's tol on the scaled problem.
        max_iterations: IPOPT's max_iter.
        verbose: let IPOPT print.
        options: further IPOPT options.
    """
    nx, ng, parameters = (nlp.functions[name].numel() for name in ("x", "g", "p"))
    monitor = Monitor(nx, ng, parameters)
    solver = ca.nlpsol(
        "minimum_time",
        "ipopt",
        nlp.functions,
        {
            "jac_g": nlp.jacobian,
            "hess_lag": nlp.hessian,
            "iteration_callback": monitor,
            "iteration_callback_step": _ASKED,
            "calc_multipliers": False,
            "error_on_fail": False,
            "print_time": False,
            "show_eval_warnings": verbose,
            "ipopt": {
                "tol": tolerance,
                "max_iter": max_iterations,
                "nlp_scaling_method": "none",  # the unknowns and equations are scaled already
                "fixed_variable_treatment": "make_parameter",
                "print_level": 5 if verbose else 0,
                "sb": "yes",
                **(options or {}),
            },
        },
    )
    return solver, monitor
