"""Options of a solve, settings of one solve of a nonlinear program, and its transcription scheme."""

from dataclasses import dataclass
from typing import Literal

from armdyn.arguments import Checked, checked, each, expect, flag, number, one_of, whole
from armdyn.optimal.problem.choices import METHOD_NAMES, SEARCH_LEVELS, MethodName, SearchLevel
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

Control = Literal["linear", "constant"]


@dataclass(frozen=True)
class Scheme:
    """Transcription scheme: collocation by forward dynamics.

    Attributes:
        control: torque between knots, which keeps its bounds everywhere.
        compile: whether derivatives become machine code: always, never, or (None) if cheap (see `compiled`).
    """

    control: Control = "linear"
    compile: bool | None = None


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
        barrier: first barrier parameter of an interior-point method, by default IPOPT's; others ignore it.
        acceptable: error at which it may stop early; None: the solver's default.
        push: largest distance by which the start is moved off its bounds, whose multipliers the stagewise method then
            initialises from the barrier; None: the solver's default.
        warm: whether to start from the multipliers of a similar program, too.
        convex: least curvature that the stagewise method gives the torques of an interval in which the cost is not
            convex; 0: all unknowns are regularised alike, as in IPOPT.
    """

    tolerance: float
    max_iterations: int = 500
    barrier: float = 0.1
    acceptable: Acceptable | None = None
    push: float | None = None
    warm: bool = False
    convex: float = 0.0


MAX_STARTS = 10**5
"""Largest number of guesses: a hundred times that of `search="thorough"`; all are drawn before the search begins."""
MAX_CALM = 0.5
"""Upper bound on `MinimumTimeOptions.calm`: a motion with more is not one of least time."""


@brief
@dataclass(frozen=True, kw_only=True)
class MinimumTimeOptions(Checked):
    """Options of `solve_minimum_time`.

    An attribute that is None is decided by the problem's policy; `armdyn doctor ROBOT --policy` shows it with reasons.

    One that has no effect on the problem at hand is warned of.

    Attributes:
        method: "mesh": collocation of the equations of motion, exact where torques decide, for arms of few joints and
            for joints without a motor; "curves": B-splines with torques by inverse dynamics, for many joints, where
            speeds decide, and among obstacles; "profiles": every joint's own fastest profile, the optimum where limits
            of acceleration or jerk decide. None: by the class of the problem, which may try several.
        guesses: motions of the same joints as additional initial guesses, such as optima of similar problems.
        search: level of the search: "quick" solves a third of the guesses, "thorough" five times as many, without
            ending early, and refines five times as many optima (docs/search.md); likewise for curves, and where effort
            has a weight, which have numbers of their own.
        starts: number of guesses of the global search, whatever the level; at most 100,000.
        seed: seed of the guesses after the first; the same seed gives the same answer.
        max_intervals: intervals of the finest mesh of the search, tried if a coarser one does not converge or its
            replay misses the goal. No effect on curves.
        compile: the program's derivatives as machine code, ten times as fast, built once by the C compiler and cached
            for the user: always, never, or (None) if the build takes only seconds or is cached already.
        calm: part of the duration that may be spent on calm joints, where motions are curves: the answer is the motion
            with the least travel and fewest reversals of the joints among those slower than the fastest by this part. A
            motion proven within 0.1 % of the least duration stays so. 0: the fastest motion.
        bound: prove a lower bound on the duration, where velocity limits shape the motion; False: the same motion in
            less time, without a gap or a certificate by the bound.
        bound_programs: number of linear programs for the lower bound of a cycle with goal poses as stops, 0.02 to 0.1 s
            each on one core; more may prove a smaller gap. None: the number in `BoundPolicy`.
        time_limit: wall time of the whole solve [s]. The search is limited by counts of work, the same on every
            machine; the clock only ends it, and then `status` is "time_limit" unless the motion is certified. Checking
            the motion takes up to 1 s and a tenth of the limit more. Of arms of more than twenty joints one step of a
            solver, which nothing interrupts, may take seconds beyond it; equations whose building would take longer
            than is left are not begun. Reading the robot is not part of it.
        workers: processes of search and refinement; None: one per core. The answer does not depend on them. Threads may
            solve concurrently: IPOPT is locked, and each thread gets the answer that it would get alone.
    """

    method: MethodName | None = checked(one_of, None, known=METHOD_NAMES)
    guesses: tuple[Trajectory, ...] = checked(each, (), of=expect, kind=Trajectory)
    search: SearchLevel = checked(one_of, "normal", known=SEARCH_LEVELS)
    starts: int | None = checked(whole, None, least=1, most=MAX_STARTS)
    seed: int = checked(whole, 0, least=0)
    max_intervals: int = checked(whole, 160, least=1)
    compile: bool | None = checked(flag, None)
    calm: float = checked(number, 1e-3, least=0.0, most=MAX_CALM)
    bound: bool = checked(flag, True)
    bound_programs: int | None = checked(whole, None, least=1)
    time_limit: float = checked(number, 300.0, sign="positive", finite=False)
    workers: int | None = checked(whole, None, least=1)
