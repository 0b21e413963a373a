"""Tuned numbers of multiple shooting, and of path constraints."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.problem.policy.tuned import LARGE, tuned


@dataclass(frozen=True, kw_only=True)
class PathConstraintPolicy:
    """Tightening of path constraints until the replay keeps them, and slowing down."""

    cases: ClassVar = "RR: spheres, boxes; RR, RRR: torque rates, dry friction; Panda: a post; UR5"

    rounds: int = tuned(12, "rounds", "of meshes solved again, and of slowing a motion down: most take one or two")
    slow_samples: int = tuned(1000, "samples", "of a slowed or checked motion; of one along profiles at least", "RR")
    near: float = tuned(1e-4, "rad or m", "of via points and goal: a further round gains too little")
    tolerance: float = tuned(1e-6, "of a limit, m or rad", "excess of acceleration, jerk, frame speed, or of a region")
    region_part: float = tuned(0.97, "of a tolerance", "in the first program: frames deviate between knots")
    region_tightening: float = tuned(5e-3, "of a tolerance", "further tightening where a frame leaves its region")
    least_region: float = tuned(0.5, "of a tolerance", "in a program, at least")
    settled: float = tuned(2e-4, "of the duration", "gain by a divided mesh that ends its refinement")
    rate_tightening: float = tuned(1e-5, "of a limit", "further tightening, beyond the replay's excess")
    least_part: float = tuned(0.9, "of a limit", "in a program, at least: a mesh that needs less is too coarse")
    slower: float = tuned(2e-3, "of the duration", "that slowing down may cost before limits are tightened")


@dataclass(frozen=True, kw_only=True)
class ShootingPolicy:
    """Tuned numbers of multiple shooting from a mesh's motion, of its correction, and of its costates."""

    cases: ClassVar = "random arms (RR, seed 1; RRR)"

    rounds: int = tuned(
        12, "rounds", "of Newton's method, and on the replay's miss: most take three; more with torques on limits"
    )
    far: float = tuned(0.1, "rad or m", "miss beyond which the linear correction does not hold", LARGE)
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
    )
    least_spacing: float = tuned(2.5e-4, "of the duration", "between the times of the costates' linear program")
    state_bound: float = tuned(3.0, "of ways and largest speeds", "bound of changes of states in that program")
    converged: float = tuned(1e-6, "of the duration", "accuracy of that program: 1 % of the certificate's tolerance")
