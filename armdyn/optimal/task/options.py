"""Options of `solve_minimum_time`."""

from dataclasses import dataclass

from armdyn.arguments import check_fields, checked, expect, flag, number, one_of, several, whole
from armdyn.errors import ProblemError
from armdyn.optimal.task.search_level import SEARCH_LEVELS, SearchLevel
from armdyn.optimal.task.tableau import TABLEAUS, Control, DynamicsForm
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

MAX_STARTS = 10**5
"""Guesses of one search, at most: a hundred times what `search="thorough"` has; they are drawn before it begins."""
MAX_CALM = 0.5
"""Of `MinimumTimeOptions.calm`: more is no longer a motion of least time."""
REPLAY_TOLERANCE = 1e-3
"""Default of `MinimumTimeOptions.replay_tolerance` [rad or m]: about a millimetre at the tip, which a controller makes
up for."""
WAY_TOLERANCE = 1e-2
"""Goal error that counts as landed, at most, as a part of the way from rest to rest: of 1e-5 rad, or an arm that stays
where it is would land."""
LEAST_TOLERANCE = 1e-10
"""Of the replay [rad or m], whatever the way: ten times what integrators of relative tolerance 1e-10 leave."""


def _motions(value: object, name: str) -> tuple[Trajectory, ...]:
    return tuple(expect(one, Trajectory, f"{name}[{i}]") for i, one in enumerate(several(value, name)))


def _meshes(value: object, name: str) -> tuple[int, ...]:
    if not (meshes := several(value, name)):
        raise ProblemError(f"{name} is empty; it must be numbers of at least 1")
    return tuple(whole(mesh, f"{name}[{i}]", least=1) for i, mesh in enumerate(meshes))


@brief
@dataclass(frozen=True, kw_only=True)
class MinimumTimeOptions:
    """Options of `solve_minimum_time`.

    Where an attribute is None the problem's policy decides: `armdyn doctor ROBOT --policy` shows what, and why.
    Arms of more than three joints move along curves: refinements, coarse_intervals, intervals, max_intervals, arcs,
    method, control, dynamics and tolerance say nothing for them.

    Attributes:
        guesses: motions of the same joints to begin with, beside the search's own: optima of similar problems.
        search: how much is searched: "quick" solves a third of the guesses, "thorough" five times as many and all of
            them, and refines three times as many optima (docs/search.md); likewise of curves, and where effort is paid
            for, which have numbers of their own.
        starts: guesses of the global search, whatever the level; at most 100,000.
        seed: of the guesses after the first; the same seed gives the same answer.
        refinements: so many of the optima found are refined, slower ones than a certified one, too; None: these are
            listed as the mesh has them.
        coarse_intervals: of the search's meshes, which its guesses take turns on.
        intervals: of the mesh on which the arcs are read.
        max_intervals: of the finest such mesh, tried when the arcs resist or the replay misses the goal.
        arcs: resolve the arcs to exact switching times; without, the answer is the mesh's.
        replay_tolerance: largest goal error of the replay [rad or m] that counts as landed; from rest to rest at most
            a hundredth of the way.
        method: collocation tableau; "lobatto3" is Hermite-Simpson.
        control: torque "linear" or "constant" between knots; the arcs are read from constant ones.
        dynamics: "forward", accelerations by the articulated-body algorithm; "inverse", torques by recursive
            Newton-Euler with the accelerations as more unknowns.
        compile: the program's derivatives as machine code, ten times as fast, built once by the C compiler and
            kept in the user's cache: always, never, or (None) where building takes only seconds or is done.
        max_iterations: of IPOPT, for one guess on one mesh, or one curve; steps of a curve's convexification likewise.
        tolerance: of IPOPT, on the scaled problem.
        calm: part of the duration that may be given for calm joints, where motions are curves: of those about so much
            slower than the fastest one found, the one whose joints travel and turn back least. A motion within a
            proven thousandth of the least duration stays so. 0: the fastest.
        bound: prove a lower bound on the duration, where velocity limits shape the motion: without, the same motion is
            found in less time, and neither a gap nor a certificate by it is known.
        bound_programs: linear programs that the lower bound of a cycle may take where a stop is a goal pose, 0.02 to
            0.1 s each on one core; more may prove a smaller gap. None: as many as `BoundPolicy` says.
        time_limit: wall time for the whole solve [s]. What is tried is a count of work, the same on every machine; the
            clock only ends it, and then `status` is "time_limit" unless the motion is certified. Checking the motion
            takes up to 1 s and a tenth of the limit beyond it.
        workers: processes of search and refinement; None: one per core. They make no difference to the answer.
            Threads may solve at once: they take turns at IPOPT, and each gets what it would get alone.
        verbose: let solvers print.
    """

    guesses: tuple[Trajectory, ...] = checked(_motions, ())
    search: SearchLevel = checked(one_of, "normal", known=SEARCH_LEVELS)
    starts: int | None = checked(whole, None, least=1, most=MAX_STARTS)
    seed: int = checked(whole, 0, least=0)
    refinements: int | None = checked(whole, None, least=1, most=MAX_STARTS)
    coarse_intervals: tuple[int, ...] | None = checked(_meshes, None)
    intervals: int = checked(whole, 40, least=1)
    max_intervals: int = checked(whole, 160, least=1)
    arcs: bool = checked(flag, True)
    replay_tolerance: float = checked(number, REPLAY_TOLERANCE, sign="positive", finite=False)
    method: str = checked(one_of, "lobatto3", known=tuple(TABLEAUS))
    control: Control = checked(one_of, "constant", known=("linear", "constant"))
    dynamics: DynamicsForm = checked(one_of, "forward", known=("forward", "inverse"))
    compile: bool | None = checked(flag, None)
    max_iterations: int = checked(whole, 500, least=1)
    tolerance: float = checked(number, 1e-8, sign="positive", finite=False)
    calm: float = checked(number, 1e-3, sign="not negative")
    bound: bool = checked(flag, True)
    bound_programs: int | None = checked(whole, None, least=1)
    time_limit: float = checked(number, 300.0, sign="positive", finite=False)
    workers: int | None = checked(whole, None, least=1)
    verbose: bool = checked(flag, False)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.calm > MAX_CALM:
            raise ProblemError(f"calm is {self.calm:g}; a part of the duration of at most {MAX_CALM:g} may be given")
