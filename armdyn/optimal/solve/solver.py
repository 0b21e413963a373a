"""Solvers of nonlinear programs: their inputs and results.

minimise f(x, p) subject to lower ≤ x ≤ upper and lower ≤ g(x, p) ≤ upper.
"""

from dataclasses import dataclass
from typing import Protocol, Self, TypeVar

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.problem.status import Status, Stop
from armdyn.optimal.program.assembly import Program

P_co = TypeVar("P_co", bound=Program, covariant=True)


@dataclass(frozen=True, eq=False)
class NlpData:
    """Numbers of one nonlinear program: initial unknowns, parameters, bounds.

    Attributes:
        x: unknowns initial unknowns.
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


class Solver(Protocol[P_co]):
    """Solver that is set up for one program.

    Attributes:
        program: the program.
    """

    @property
    def program(self) -> P_co: ...

    def solve(self, data: NlpData, stop: Stop, warm_start: NlpResult | None = None) -> NlpResult:
        """Solve the program.

        Args:
            data: the program's numbers.
            stop: stopping condition, polled every few iterations.
            warm_start: result of a similar program, for a warm start if the settings request it.
        """
        ...

    def equations(self, x: Array, p: Array) -> Array:
        """Values of the equations at unknowns and parameters."""
        ...
