"""Settings of a solver of nonlinear programs."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Acceptable:
    """Error, above the tolerance, at which a solver may stop without further progress.

    Attributes:
        tolerance: error of the optimality conditions, on the scaled problem.
        equations: error of the equations, on the scaled problem.
        cost: largest relative change of the cost; None: any. The stagewise method requires it of the barrier function
            over `after` iterations; with None it ends at its tolerance or its iteration limit alone.
        after: number of consecutive iterations.
    """

    tolerance: float
    equations: float
    cost: float | None = None
    after: int = 6


@dataclass(frozen=True)
class SolverSettings:
    """Settings of one solve of a program: tolerance, iterations, initial barrier.

    Attributes:
        tolerance: error of the optimality conditions and the equations, on the scaled problem.
        max_iterations: iteration limit.
        verbose: print the iterations.
        barrier: first barrier parameter of an interior-point method, by default IPOPT's; others ignore it.
        acceptable: error at which it may stop early; None: the solver's default.
        exact: whether bounds are not relaxed and only the tolerance is accepted.
        push: largest distance by which the start is moved off its bounds, whose multipliers the stagewise method then
            initialises from the barrier; None: the solver's default.
        warm: whether to start from the multipliers of a similar program, too.
        convex: least curvature that the stagewise method gives the torques of an interval in which the cost is not
            convex; 0: all unknowns are regularised alike, as in IPOPT.
    """

    tolerance: float
    max_iterations: int = 500
    verbose: bool = False
    barrier: float = 0.1
    acceptable: Acceptable | None = None
    exact: bool = False
    push: float | None = None
    warm: bool = False
    convex: float = 0.0
