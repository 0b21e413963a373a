"""Solvers of nonlinear programs: their inputs and results.

minimise f(x, p) subject to lower ≤ x ≤ upper and lower ≤ g(x, p) ≤ upper.
"""

from dataclasses import dataclass
from typing import Protocol, Self, TypeVar

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.program.assembly import Program

P_co = TypeVar("P_co", bound=Program, covariant=True)


@dataclass(frozen=True, eq=False)
class NlpData:
    """A program in numbers.

    Attributes:
        x: unknowns to start from.
        p: parameters.
        x_bounds: least and largest unknowns.
        g_bounds: least and largest values of the equations.
    """

    x: Array
    p: Array
    x_bounds: tuple[Array, Array]
    g_bounds: tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class NlpResult:
    """Result of one solve.

    Attributes:
        status: how it ended.
        message: the solver's words for it.
        iterations: that it took.
        x: the unknowns where it ended; those where it began if it ended in none that are finite.
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
        """The result; of a solve that was stopped, why, and of one that has left the finite numbers, its start.

        Args:
            status: as the solver says; INTERRUPTED where `stop` said so.
            message: likewise.
            stop: that it asked.
            iterations: that it took.
            data: the program.
            found: x, lam_x and lam_g where it ended.
        """
        x, lam_x, lam_g = found
        if status is Status.INTERRUPTED and not stop.interrupted:
            status, message = Status.TIME_LIMIT, "time limit reached"
        if not np.all(np.isfinite(x)):
            status, x = Status.FAILED if status is Status.SOLVED else status, data.x
        return cls(status, message, iterations, x, lam_x, lam_g)


class Solver(Protocol[P_co]):
    """A method, set up for one program.

    Attributes:
        program: what it solves.
    """

    @property
    def program(self) -> P_co: ...

    def solve(self, data: NlpData, stop: Stop, near: NlpResult | None = None) -> NlpResult:
        """Solve the program.

        Args:
            data: its numbers.
            stop: asked every few iterations whether to end.
            near: result of a nearly equal program, where the settings are warm.
        """
        ...

    def equations(self, x: Array, p: Array) -> Array:
        """Values of the equations at unknowns and parameters."""
        ...
