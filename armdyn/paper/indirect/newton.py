"""Newton's method with steps that are halved until the residual falls.

Deuflhard, Newton Methods for Nonlinear Problems, section 3.1; the required descent is Armijo's, of the residual's
norm: |F(x + λd)| < (1 − λ/10) |F(x)|.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.problem.status import Status, Stop

_DESCENT = 0.1
"""Least actual decrease of a step, as a part of that predicted by the linearised equations."""
_TO_ZERO = 0.9
"""Part of the way to zero that unknowns which stay positive go in one step."""


class SingularError(Exception):
    """The linearised equations have no solution."""


@dataclass(frozen=True, eq=False)
class Point:
    """Equations F(x) = 0 at some x.

    Attributes:
        residual: F(x), shape (n,).
        step: returns the d of F'(x) d = −F(x), shape (n,); raises SingularError if there is none.
    """

    residual: Array
    step: Callable[[], Array]

    @property
    def largest(self) -> float:
        """Largest |F_i|."""
        return float(np.max(np.abs(self.residual)))


@dataclass(frozen=True, eq=False)
class Root:
    """Result of Newton's method.

    Attributes:
        unknowns: x, shape (n,).
        residual: F(x), shape (n,).
        steps: taken.
        status: SOLVED; ITERATION_LIMIT; FAILED; or the stop's status.
        reason: the status in words.
    """

    unknowns: Array
    residual: Array
    steps: int
    status: Status
    reason: str


def newton(
    equations: Callable[[Array], Point],
    start: Array,
    *,
    tolerance: float,
    steps: int,
    shortest: float,
    positive: int = 0,
    stop: Stop | None = None,
) -> Root:
    """Find a root of n equations near a guess, or the last iterate.

    Args:
        equations: F and its linear solver, at a given x.
        start: the guess, shape (n,).
        tolerance: of the largest |F_i|.
        steps: at most.
        shortest: part of a step below which it is given up.
        positive: number of the last unknowns that are positive and stay so.
        stop: polled before every step.
    """
    unknowns, point, taken = start, equations(start), 0

    def ended(status: Status, reason: str) -> Root:
        return Root(unknowns, point.residual, taken, status, reason)

    while taken < steps:
        if point.largest <= tolerance:
            return ended(Status.SOLVED, "Newton's method converged")
        if stop:
            return ended(stop.status, stop.status.replace("_", " "))
        try:
            step = point.step()
        except SingularError:
            return ended(Status.FAILED, "the Jacobian is singular")
        length = _longest(unknowns, step, positive)
        while length >= shortest:
            tried = unknowns + length * step
            after = equations(tried)
            if np.linalg.norm(after.residual) < (1 - _DESCENT * length) * np.linalg.norm(point.residual):
                break
            length /= 2
        else:
            return ended(Status.FAILED, "Newton's method is stuck")
        unknowns, point, taken = tried, after, taken + 1
    return ended(Status.ITERATION_LIMIT, "Newton's method used up its steps")


def _longest(unknowns: Array, step: Array, positive: int) -> float:
    """Largest part of a step that keeps unknowns positive."""
    shrink = -step[unknowns.size - positive :] / unknowns[unknowns.size - positive :]
    return min(1.0, _TO_ZERO / max(float(np.max(shrink, initial=0.0)), 1e-9))
