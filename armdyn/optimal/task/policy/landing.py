"""Tuned numbers of replays, terminal corrections, multiple shooting and path constraints."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.task.policy.tuned import LARGE, PLANAR, tuned


@dataclass(frozen=True, kw_only=True)
class LandingPolicy:
    """Tuned numbers of the terminal correction of a mesh's torques."""

    cases: ClassVar = LARGE

    rounds: int = tuned(8, "rounds", "of Newton's method on the replay's miss", PLANAR)
    landed: float = tuned(1e-9, "rad or m", "miss of the goal that is a few of the integrator's own", PLANAR)
    far: float = tuned(0.1, "rad or m", "miss beyond which a replay is no neighbour of what is sought")
    check_part: float = tuned(
        0.3, "of the time limit", "kept for replay and checks of what the search has", "Panda, xArm6"
    )
    check_time: float = tuned(1.0, "s", "the same, at most", "Panda, xArm6")


@dataclass(frozen=True, kw_only=True)
class PathConstraintPolicy:
    """Tightening of path constraints until the replay keeps them."""

    cases: ClassVar = "RR: spheres, boxes"

    rounds: int = tuned(8, "rounds", "of meshes solved again", "RR: spheres, boxes; Panda: a post")
    near: float = tuned(1e-4, "rad or m", "of via points and goal: no further round is worth its seconds", "RR, Panda")
    beside_region: float = tuned(1e-6, "m or rad", "outside a region that is passed: as of all other limits")
    region_part: float = tuned(
        0.97, "of a tolerance", "that is asked for at first: the rest is for what lies between", "Panda, UR5"
    )
    region_spare: float = tuned(
        5e-3, "of a tolerance", "asked for besides, where a frame leaves its region", "Panda, UR5"
    )
    least_region: float = tuned(0.5, "of a tolerance", "that a program is asked for", "Panda, UR5")
    far: float = tuned(0.1, "rad or m", "of the goal: the mesh was too coarse for what the arm does", "RR, Panda")
    settled: float = tuned(
        5e-4, "of the duration", "that a mesh twice as fine changes no more is the answer", "RR, RRR"
    )
    rate_tolerance: float = tuned(
        1e-6, "of a limit", "of acceleration, jerk and frame speed: as of all other limits", "by definition"
    )
    rate_spare: float = tuned(
        1e-4, "of a limit", "asked for besides, where a program is to be stricter by what its replay exceeds", "UR5"
    )
    least_part: float = tuned(0.9, "of a limit", "that a program is asked for: one that needs less is too coarse", "RR")
    slower: float = tuned(
        2e-3, "of the duration", "that slowing down may cost before a program is asked more strictly", "RR, UR5, Panda"
    )


@dataclass(frozen=True, kw_only=True)
class ShootingPolicy:
    """Tuned numbers of multiple shooting from a mesh's motion, and of its costates."""

    cases: ClassVar = "random arms (RR, seed 1)"

    rounds: int = tuned(12, "rounds", "of Newton's method: most take three, those with torques on limits more")
    steps: int = tuned(1280, "steps", "of the whole motion at least: a coarse mesh's intervals take several")
    near: float = tuned(1e-5, "of half a torque's range", "a torque of the mesh so near its limit is on it")
    closed: float = tuned(1e-12, "of a joint's way or speed", "gaps that are the integrator's own")
    states: float = tuned(1.0, "-", "cost of a change of a state against that of all torques")
    longer: float = tuned(1.0, "-", "the same of a change of the duration")
    held: float = tuned(
        0.1,
        "of a limit",
        "a velocity, or as a part of its way a position, so near may be held by it: with a fifth of it the saving is "
        "twice to eight times as large where a joint is idle between contacts",
        "random arms (RRR)",
    )
    stretch: float = tuned(
        2.5e-4, "of the duration", "between costates of the linear program, at least", "random arms (RRR)"
    )
    furthest: float = tuned(
        3.0, "-", "bound of changes of the states in that program, as parts of their ways and largest speeds"
    )
    converged: float = tuned(
        1e-6, "of the duration", "to which that program is solved, where it can be: a hundredth of what is certified"
    )
