"""Registry of solvers of nonlinear programs. To add one: write its file, and its line here."""

from collections.abc import Callable, Hashable
from dataclasses import replace
from typing import Any, TypeVar

from armdyn.codegen.deadline import NoTimeError, until
from armdyn.errors import ProblemError
from armdyn.locks import built_once
from armdyn.optimal.program.assembly import Program
from armdyn.optimal.solve.ipopt import Ipopt
from armdyn.optimal.solve.solver import Solver
from armdyn.optimal.task.options import SolverSettings
from armdyn.optimal.task.tableau import Scheme
from armdyn.optimal.task.task import Task

P = TypeVar("P", bound=Program)
S = TypeVar("S")

SOLVERS: dict[str, Callable[[Any, SolverSettings], Solver[Any]]] = {"ipopt": Ipopt}
"""Solvers by their name in `ProgramPolicy.solver`: maps from program and settings to a solver."""

_KEPT = 64
"""Number of solvers that stay in the cache."""


def solver_for(task: Task, settings: SolverSettings, build: Callable[..., P], *arguments: Hashable) -> Solver[P]:
    """The policy's solver for the program that a function builds from arguments; cached by these."""
    return _built(task.policy.program.solver, settings, build, arguments)


def in_time(task: Task, build: Callable[[Scheme], S]) -> S:
    """Build with the task's scheme before its deadline; without compilation if the time is too short.

    Args:
        task: task with scheme and deadline.
        build: function of a scheme, such as a call of `solver_for`.
    """
    stop = task.stop
    with until(stop.deadline, lambda: stop.interrupted):
        if not stop.out_of_time:
            try:
                return build(task.scheme)
            except NoTimeError:
                stop.out_of_time = True
        return build(replace(task.scheme, compile=False))


@built_once(maxsize=_KEPT)
def _built(name: str, settings: SolverSettings, build: Callable[..., P], arguments: tuple[Hashable, ...]) -> Solver[P]:
    if name not in SOLVERS:
        raise ProblemError(f"there is no solver {name!r}; known: {', '.join(SOLVERS)}")
    return SOLVERS[name](build(*arguments), settings)
