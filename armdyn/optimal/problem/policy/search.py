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

    cases: ClassVar = "RR and RRR, random; with rows RR and Panda"

    linear: bool = by_kind(
        "-",
        "torque linear between knots, but in the search with effort: it may not jump, or limits fall with speed",
        "by definition",
    )
    condensed: bool = by_kind("-", "without the interval's middle: half the unknowns, without path constraints")
    flat: float | None = by_kind("scaled", "IPOPT's error at which it may stop: rows make the minimum flat")
    near_limit: float = tuned(
        1e-3, "of travel or limit", "least distance of guesses from limits exceeded between knots", UNRECORDED
    )
    coarse_tolerance: float = tuned(
        1e-5, "scaled", "of IPOPT in the search: 1e-4 is too inaccurate; a tenth from another mesh", PLANAR
    )
    coarse_barriers: tuple[float, ...] = by_kind(
        "scaled", "IPOPT's mu_init in turn: small ones keep more of the guess, larger ones lose fewer best optima"
    )
    guess_iterations: int | None = by_kind(
        "iterations", "of a guess of RRR, at most: of 70 problems no best optimum took more than 150", "random arms"
    )
    fine_barrier: float = tuned(1e-4, "scaled", "mu_init on another mesh, a tenth on the same: 1e-3 loses one in 40")


@dataclass(frozen=True, kw_only=True)
class SearchPolicy:
    """Tuned numbers of the search: its guesses, and the choice of optima to refine."""

    cases: ClassVar = "RRR, random; " + PLANAR

    starts: int = by_kind(
        "guesses",
        "32 for RR (few for 1 kg; 200 with effort), 140 for RRR; 16 with path constraints, 40 if a motor is "
        "missing; 64 of either with effort",
    )
    meshes: tuple[int, ...] = by_kind(
        "intervals", "of the guesses in turn; coarse ones admit spurious optima of swinging joints, and with effort"
    )
    fine_mesh: int = by_kind("intervals", "on which coarse optima are told apart; a quarter of the first finer mesh's")
    ends_early: bool = by_kind("-", "once few optima recur; of many it would lose 5.9 % of the duration, and save 12 %")
    tested: int = tuned(40, "guesses", "of many, at least, before the search ends as nearly all lead to the best")
    near_best: float = tuned(0.02, "of the least cost", "excess of a guess that counts as leading to the best")
    alike: float = tuned(0.9, "of the guesses", "that lead to the best: the search ends")
    scattered: float = by_kind("of the guesses", "if fewer lead to the best, as many guesses follow")
    neighbour_starts: int = by_kind(
        "guesses", "near a neighbour's optimum; half with effort; beyond RRR the straight path"
    )
    side_by_side: bool = by_kind("-", "in processes: up to two joints a fork takes as long as the solve")
    refined: int = tuned(4, "optima", "that are solved on a finer mesh")
    fine_solves: int = tuned(6, "times as many", "coarse optima are solved on the finer mesh: many are spurious")
    only_listed: float = tuned(1.2, "of the best duration", "coarse solutions slower than that are only listed")
    too_coarse: float = tuned(
        1.05, "of the coarse duration", "on the finer mesh: the search is repeated; of a goal's bound: it is not tried"
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
        "of random poses instead; 0: none. Within 4 rad 32 hasty guesses miss 1 % of RR, near ones 2 %; of RRR 100 "
        "miss one best optimum in three, near ones one in two; within 8 rad if joints turn more than twice",
        "RRR, random: the twelve hardest of a hundred pairs; random arms (seeds 341, 383)",
    )
    guess_duration: float = by_kind("-", "of that at which a guess's torques fit: from 0.4 RRR goes to more optima")
    mutated: float = by_kind("of the guesses", "are mutations of optima: one in ten finds what 100 random ones do")
    selection_scale: float = tuned(3.0, "optima", "of the best, about, that are mutated most often, of twice as many")
    midpoint_spread: float = tuned(
        0.3, "times the way", "deviation of all joints at half time; rad or m, and of the logarithm, of swings"
    )
    joint_offset: float = tuned(6.0, "rad or m", "largest offset of a mutation of one joint")
    mutation_duration: float = tuned(1.2, "of an optimum's duration", "initial duration of its mutations")
    batch: int = tuned(
        4, "guesses", "sent to a worker at once, or solved before an early end is tested; eightfold, mutated at once"
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
    least_step: float = tuned(1e-3, "rad or m", "last step: far below coarse solves; a descending end saves its square")
    others: float = tuned(1e-3, "-", "weight of all joints' times against the slowest's: the other joints stay near")
    end_solves: int = tuned(8, "solves", "of an end that descends along its pose: RRR needs two to six")
    bound: float = tuned(0.1, "of the time limit", "for the bound of all goals, or of a cycle, at least", UNRECORDED)

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

    turned: int = tuned(100, "joint positions", "of a branch with turns of its joints, at most: 3 ways for each of 4")
    alike: int = tuned(8, "pairs of branches", "refused alike before all of a move are: six axes have eight branches")
    quick: float = tuned(
        0.5, "of the duration", "that other tours may save when a quick search ends: else most would have to be solved"
    )
    bound_programs: int = tuned(
        600, "linear programs", "of that bound: 10 s of a Panda's on two cores, which still rises; a UR5's takes 450"
    )
