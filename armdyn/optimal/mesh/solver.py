"""Inputs and results of the solvers of nonlinear programs, IPOPT and the stagewise method.

minimise f(x, p) subject to lower ≤ x ≤ upper and lower ≤ g(x, p) ≤ upper.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.problem.status import Status, Stop


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
