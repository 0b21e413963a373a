"""Tuned numbers of the nonlinear program, of the search, and of the search of a cycle's branches."""

import math
from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.problem.choices import SEARCH_LEVELS
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.policy.tuned import PLANAR, UNRECORDED, by_kind, tuned

SWINGS = "cart-pole, acrobot, pendubot, Furuta pendulum"


@dataclass(frozen=True, kw_only=True)
class ProgramPolicy:
    """Tuned numbers of the nonlinear program and of IPOPT."""

    cases: ClassVar = "by definition"

    linear: bool = by_kind("-", "torque linear between knots: jumps are forbidden, or the limits fall with speed")
    condensed: bool = by_kind(
        "-", "the interval's middle is eliminated: half the unknowns, without path constraints", "RR, RRR with 100.6 g"
    )
    flat: float | None = by_kind(
        "scaled",
        "IPOPT's error at which it may stop once the equations hold: path constraints make the minimum flat",
        "sphere and post before RR and Panda",
    )
    near_limit: float = tuned(
        1e-3, "of travel or limit", "least distance of guesses from limits exceeded between knots", UNRECORDED
    )
    coarse_tolerance: float = tuned(
        1e-5, "scaled", "of IPOPT in the search: 1e-4 is too inaccurate; a tenth from another mesh", PLANAR
    )
    coarse_barriers: tuple[float, ...] = by_kind(
        "scaled",
        "IPOPT's mu_init in turn: small ones keep more of the guess; with three joints ten times as large ones miss "
        "fewer best optima",
        "planar arms; RRR, random",
    )
    guess_iterations: int | None = by_kind(
        "iterations",
        "of a guess of three joints, and on the finer mesh, at most: of 70 problems no best optimum took more than 150",
        "random arms (RRR)",
    )
    fine_barrier: float = tuned(
        1e-4,
        "scaled",
        "its mu_init from a solution on another mesh, small to stay near it: with 1e-3 one in forty is lost that 1e-4 "
        "keeps; on the same mesh with slightly tighter limits a tenth",
        "RRR, random",
    )


@dataclass(frozen=True, kw_only=True)
class SearchPolicy:
    """Tuned numbers of the search: its guesses, and the choice of optima to refine."""

    cases: ClassVar = "RRR, random; " + PLANAR

    starts: int = by_kind(
        "guesses",
        "32 for two joints, with path constraints 16, where effort is paid 64: 32 miss the best of RR with 1 kg; 140 "
        "for three, changes of optima among them; 40 where one of two has no motor; around obstacles paths are chosen "
        "among many",
        "planar arms; RRR, random pairs (seed 1); RR, random arms (seeds 337, 347, 401, 409)",
    )
    meshes: tuple[int, ...] = by_kind(
        "intervals",
        "used by the guesses in turn; joints without a motor swing, and coarse meshes admit spurious optima that are "
        "faster than any motion, or with effort in the cost cheaper: 1 kg on 25 intervals by a fifth",
    )
    fine_mesh: int = by_kind(
        "intervals",
        "of the mesh on which optima of coarse meshes are told apart: 40, with effort in the cost 80; four times as "
        "many of the first finer mesh of constant torques",
    )
    ends_early: bool = by_kind(
        "-",
        "end once few optima recur, with path constraints or effort in the cost; else, of 34 searches with three "
        "joints, this would save an eighth of the guesses, and lost 5.9 % of the duration where 60 guesses had led to "
        "one optimum; with two joints 4.3 %",
        "RRR, random (seeds 8, 33, 123, poses within ±π); RR, random arms (seed 337)",
    )
    neighbour_starts: int = by_kind(
        "guesses", "of a search from a neighbour's optimum; half with effort; beyond three joints the straight"
    )
    side_by_side: bool = by_kind("-", "in processes: up to two joints a fork takes as long as the solve")
    refined: int = tuned(4, "optima", "that are solved on a finer mesh")
    fine_solves: int = tuned(6, "times as many", "coarse optima are solved on the finer mesh: many are spurious")
    only_listed: float = tuned(1.2, "of the best duration", "coarse solutions slower than that are only listed")
    too_coarse: float = tuned(
        1.05,
        "of the coarse duration",
        "the best's on the finer mesh from which the search is repeated; a goal whose bound is so far off is not tried",
    )
    too_coarse_confirmed: float = tuned(1.01, "of the coarse duration", "the same, if replays confirm it")
    replay_miss: float = tuned(0.2, "of a joint's way", "they do if those of all its optima miss the goal by this")
    least_spread: float = tuned(2.0, "rad", "least spread of random poses: fast motions fold far off the straight path")
    swing_ups: tuple[int, ...] = tuned(
        (1, 2, 3, 4, 6, 8), "swings", "durations, in turn, of guesses in which joints without a motor swing up", SWINGS
    )
    spread: float = by_kind("times the way", "standard deviation of random poses")
    uniform_spread: float = by_kind(
        "rad",
        "uniform spread of random poses instead; 0: none. Of 160 random RR arms 32 guesses within 4 rad, hasty, miss "
        "1 %, near ones 2 %, 16 near ones that end early 3 %. With three joints, within a turn and a quarter, a "
        "hundred guesses miss one best optimum in three where within 1.5 times the way it is one in two; within 4 rad "
        "where no joint can turn more than twice, as further poses are at its limits; heavy arms, whose search is "
        "repeated, move less",
        "RRR, random: the twelve hardest of a hundred pairs; random arms (seeds 341, 383), pairs of seeds 1 and 33",
    )
    guess_duration: float = by_kind(
        "-",
        "of the duration at which a guess's torques fit: from 0.4 three joints take a tenth fewer iterations, to more "
        "optima",
    )
    mutated: float = by_kind(
        "of the guesses",
        "are mutations of optima of the others: hundreds of random ones find an optimum once, one mutation in ten does",
        "RRR, random: the twelve hardest of a hundred pairs",
    )
    selection_scale: float = tuned(3.0, "optima", "of the best, about, that are mutated most often, of twice as many")
    midpoint_spread: float = tuned(
        0.3,
        "times the way",
        "standard deviation of the offset of all joints at half time; rad or m, and of the logarithm, of swings",
        "RRR, random; " + SWINGS,
    )
    joint_offset: float = tuned(6.0, "rad or m", "largest offset of a mutation of one joint")
    mutation_duration: float = tuned(1.2, "of an optimum's duration", "initial duration of its mutations")
    batch: int = tuned(
        4,
        "guesses",
        "that a worker receives at once: one costs hardly more than its transfer; with more some workers are idle; the "
        "search tests its early end after so many, and eight times as many are mutated at once",
        "RRR, random: iterations of eight pairs dealt to 2, 4, 8 and 16 workers",
    )
    check_part: float = tuned(0.3, "of the time limit", "kept for replay and checks of the result", "Panda, xArm6")
    check_time: float = tuned(1.0, "s", "the same, at most", "Panda, xArm6")

    def guesses(self, options: MinimumTimeOptions, normal: int | None = None) -> int:
        """Number of guesses that the options request.

        Args:
            options: options with starts or the level of search.
            normal: number at the normal level; None: that of this search.
        """
        own = self.starts if normal is None else normal
        return options.starts or max(1, math.ceil(SEARCH_LEVELS[options.search] * own))

    def refinements(self, options: MinimumTimeOptions, normal: int | None = None) -> int:
        """Number of optima to refine that the options request; arguments as for `guesses`."""
        own = self.refined if normal is None else normal
        return own * max(1, round(SEARCH_LEVELS[options.search]))


@dataclass(frozen=True, kw_only=True)
class GoalPolicy:
    """Tuned numbers of the choice among many goals, and of the descent along the joint positions that reach a pose."""

    cases: ClassVar = "RRR; UR5, Panda: positions"

    solved: int = tuned(2, "goals", "solved in full, the best by one coarse solve each", "UR5: eight branches")
    tried: float = tuned(1 / 3, "of the time limit", "for coarse solves of all goals, at most", UNRECORDED)
    slides: int = tuned(25, "linear programs", "for each goal, at most")
    largest_step: float = tuned(0.5, "rad or m", "of any joint, at first and at most; at most of an end that descends")
    least_step: float = tuned(
        1e-3, "rad or m", "last step: far below the resolution of coarse solves; a descending end saves its square"
    )
    others: float = tuned(1e-3, "-", "weight of all joints' times against the slowest's: the other joints stay near")
    end_solves: int = tuned(8, "solves", "of an end that descends along its pose: RRR needs two to six")
    bound: float = tuned(
        0.1, "of the time limit", "for the bound of all goals, and of a whole cycle, at least", UNRECORDED
    )

    @property
    def slid(self) -> int:
        """Number of goals that are kept of those optimised by velocity limits: twice those that are solved."""
        return 2 * self.solved

    @property
    def distinct(self) -> float:
        """Largest difference of a joint within which goals are one, and first step of an end that descends."""
        return self.largest_step / 10


@dataclass(frozen=True, kw_only=True)
class SamePolicy:
    """Tolerances within which two durations are one optimum's, and a slower optimum may be the best after refinement.

    All are relative, by the accuracy of each kind of answer.
    """

    cases: ClassVar = "RRR: random, ten payloads; " + PLANAR

    coarse: float = tuned(2e-3, "-", "on coarse meshes; four times as much against an accurate one")
    distance: float = tuned(0.3, "rad or m", "of two optima of one duration, on the same mesh or different ones")
    resolved: float = tuned(1e-6, "-", "resolved to arcs")
    error_factor: float = tuned(5.0, "-", "times the error of the certified one's mesh, that an optimum may be slower")
    slower: float = tuned(1.02, "of a certified duration", "largest such excess")

    @property
    def mesh(self) -> float:
        """From different guesses on one mesh: a finer one's errors are a quarter at most."""
        return self.coarse / 4


@dataclass(frozen=True, kw_only=True)
class CyclePolicy:
    """Tuned numbers of the choice among branches of a cycle's stops, and of the end of their search."""

    cases: ClassVar = "25/300/25 mm: UR5, Panda, Kinova; Panda, bins and wall"

    turned: int = tuned(
        100, "joint positions", "of a branch with whole turns of its joints, at most: three ways for each of four"
    )
    alike: int = tuned(
        8, "pairs of branches", "refused for one reason before all of a move are: six axes have eight branches"
    )
    quick: float = tuned(
        0.5,
        "of the duration",
        "by which other tours may still be shorter when a quick search ends: bounds ignore straight segments and "
        "obstacles, so that most tours would have to be solved",
    )
    bound_programs: int = tuned(
        600, "linear programs", "of that bound: 10 s of a Panda's on two cores, which still rises; a UR5's takes 450"
    )
