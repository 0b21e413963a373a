"""How a solver of nonlinear programs is set up."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Acceptable:
    """An error, above the tolerance, at which a solver may stop once it no longer makes progress.

    Attributes:
        tolerance: of the optimality conditions, on the scaled problem.
        equations: of the equations.
        cost: largest relative change of the cost; None: any. The stagewise method asks for that of the barrier
            function in `after` iterations; with None it ends at its tolerance or its iteration limit alone.
        after: iterations in a row.
    """

    tolerance: float
    equations: float
    cost: float | None = None
    after: int = 6


@dataclass(frozen=True)
class SolverSettings:
    """Settings of one solve of a program: tolerance, iterations, initial barrier.

    Attributes:
        tolerance: of the optimality conditions and the equations, on the scaled problem.
        max_iterations: at most.
        verbose: print the iterations.
        barrier: first barrier parameter of an interior-point method, by default IPOPT's; others ignore it.
        acceptable: error at which it may stop early; None: as the solver has it.
        exact: bounds are not relaxed, and nothing but the tolerance is accepted.
        push: how far the start may be moved off its bounds, whose multipliers the stagewise method then takes from the
            barrier; None: as the solver has it.
        warm: start from the multipliers of a nearly equal program, too.
        convex: least curvature that the stagewise method gives the torques of an interval along which the cost has no
            minimum; 0: it gives as much to all unknowns, as IPOPT does.
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
