"""Tuned numbers of replays, terminal corrections, multiple shooting and path constraints."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.problem.policy.tuned import LARGE, tuned


@dataclass(frozen=True, kw_only=True)
class LandingPolicy:
    """Tuned numbers of the terminal correction of a mesh's torques."""

    cases: ClassVar = LARGE

    far: float = tuned(0.1, "rad or m", "miss beyond which the linear correction does not hold")
    check_part: float = tuned(
        0.3, "of the time limit", "kept for replay and checks of the search's result", "Panda, xArm6"
    )
    check_time: float = tuned(1.0, "s", "the same, at most", "Panda, xArm6")


@dataclass(frozen=True, kw_only=True)
class PathConstraintPolicy:
    """Tightening of path constraints until the replay keeps them."""

    cases: ClassVar = "RR: spheres, boxes"

    rounds: int = tuned(
        12,
        "rounds",
        "of meshes solved again, and of slowing a motion down: most take one or two",
        "RR, RRR: torque rates, dry friction; Panda: a post",
    )
    near: float = tuned(1e-4, "rad or m", "of via points and goal: a further round gains too little", "RR, Panda")
    tolerance: float = tuned(
        1e-6,
        "of a limit, m or rad",
        "largest excess of acceleration, jerk and frame speed, or outside a region: of all",
    )
    region_part: float = tuned(
        0.97, "of a tolerance", "in the first program; the rest: deviations between knots", "Panda, UR5"
    )
    region_tightening: float = tuned(
        5e-3, "of a tolerance", "further tightening where a frame leaves its region", "Panda, UR5"
    )
    least_region: float = tuned(0.5, "of a tolerance", "in a program, at least", "Panda, UR5")
    settled: float = tuned(2e-4, "of the duration", "gain by a divided mesh that ends its refinement", "RR, RRR")
    rate_tightening: float = tuned(
        1e-5, "of a limit", "further tightening where the limits are tightened by the replay's excess", "UR5"
    )
    least_part: float = tuned(0.9, "of a limit", "in a program, at least: a mesh that needs less is too coarse", "RR")
    slower: float = tuned(
        2e-3, "of the duration", "that slowing down may cost before limits are tightened", "RR, UR5, Panda"
    )


@dataclass(frozen=True, kw_only=True)
class ShootingPolicy:
    """Tuned numbers of multiple shooting from a mesh's motion, and of its costates."""

    cases: ClassVar = "random arms (RR, seed 1)"

    rounds: int = tuned(
        12, "rounds", "of Newton's method, and on the replay's miss: most take three; more with torques on limits"
    )
    steps: int = tuned(1280, "steps", "of the whole motion at least: a coarse mesh's intervals take several")
    near: float = tuned(1e-5, "of half a torque's range", "a torque of the mesh so near its limit is on it")
    closed: float = tuned(
        1e-11,
        "of a joint's way or speed",
        "gap that counts as closed, far below the goal's tolerance; of exact arcs, whose Newton steps go on while they "
        "halve it, a tenth is rounding",
    )
    held: float = tuned(
        0.1,
        "of a limit",
        "distance within which a velocity (or a position, per way) may be active: with a fifth of it the saving is "
        "twice to eight times as large where a joint is idle between contacts",
        "random arms (RRR)",
    )
    least_spacing: float = tuned(
        2.5e-4, "of the duration", "least distance of the linear program's times for the costates", "random arms (RRR)"
    )
    state_bound: float = tuned(
        3.0, "-", "bound of changes of states in that program, relative to their ways and largest speeds"
    )
    converged: float = tuned(
        1e-6, "of the duration", "accuracy of that program: a hundredth of the certificate's tolerance"
    )
