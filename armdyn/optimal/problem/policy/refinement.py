"""Tuned numbers of refinement: meshes of a motion, its arcs and switching times, shooting, path constraints."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.problem.policy.tuned import LARGE, PLANAR, tuned


@dataclass(frozen=True, kw_only=True)
class MotionMeshPolicy:
    """Tuned numbers of mesh refinement until the motion is resolved."""

    cases: ClassVar = "random arms (RR, seed 1; RRR)"

    most: int = tuned(4000, "knots", "of a mesh: more take a second; those that were certified took 4,200")
    rounds: int = tuned(
        3, "meshes", "before the last; with six 26 motions take twice the time, no faster; with two some lose 1e-6"
    )
    iterations: int = tuned(150, "iterations", "on a mesh, at most: certified motions of 80 problems took 80")
    tolerance: float = tuned(
        1e-7, "scaled", "of all meshes but the last, a hundredth on it, hundredfold if a motion hardly becomes faster"
    )
    barrier: float = tuned(1e-6, "scaled", "on the first mesh; a hundredth near a solution; a thousandth on the last")
    push: float = tuned(1e-5, "of the range", "least distance of the start from bounds")
    convex: float = tuned(
        1e-5, "of T for half a torque's range", "least curvature of torques where T has none: half the iterations"
    )
    decrease: float = tuned(
        3e-8, "of the duration", "of the barrier function, or the last mesh counts as solved; thirtyfold before"
    )
    patience: int = tuned(12, "iterations", "over which the decrease is measured")
    parts: int = tuned(4, "parts", "of a divided interval, at most")
    jump: float = tuned(0.03, "of half a torque's range", "between intervals that are to be divided")
    bend: float = tuned(
        5e-4, "of half the range of a torque's motion", "at a knot that needs no more; half: 3e-5 of T, twice the CPU"
    )
    velocity_excess: float = tuned(2e-5, "of a velocity limit", "excess within an interval of constant torque")
    gap: float = tuned(1e-9, "of a joint's way or speed", "error of collocation in an interval: its gradient's is 1e-5")
    least: float = tuned(4e-6, "of the duration", "a shorter interval is not divided")
    kept: tuple[float, ...] = tuned(
        (3e-5, 3e-4, 3e-3), "of a torque limit", "for feedback, in turn, of a motion that no replay reproduces without"
    )
    ties: tuple[float, ...] = tuned(
        (3e-6, 1e-4, 3e-4),
        "of 1 for time",
        "of full torques, for idle joints; the next where none converges; after the first mesh from the second on: a "
        "quarter of the iterations",
    )
    work: int = tuned(700_000, "intervals", "times iterations of a problem, then no mesh is begun: 5 CPU s for RRR")
    abandoned: float = tuned(5e-4, "of the best cost", "excess that ends a mesh: the second is accurate to 2e-4")
    further_meshes: int = tuned(4, "meshes", "divided where the motion is not yet certified, at most")


@dataclass(frozen=True, kw_only=True)
class ArcsPolicy:
    """Tuned numbers of the detection of arcs on a mesh."""

    cases: ClassVar = "RRR: ten payloads, random pairs; Panda, UR5; " + PLANAR

    near: float = tuned(2e-3, "of a limit", "a torque or speed within this is on its limit: IPOPT leaves 1e-4")
    near_speed: float = tuned(
        2e-2, "of a limit", "a mesh is divided at speeds within this: a constant torque keeps the limit in the mean"
    )
    in_contact: float = tuned(5e-3, "rad or m, or of a velocity limit", "a mesh is divided so near a limit")
    brief: float = tuned(5e-3, "of the duration", "off all limits is a switch: a mesh is divided around it")
    touching: float = tuned(2e-5, "of a joint's way", "a position so near its limit is on it; a speed, of its limit")


@dataclass(frozen=True, kw_only=True)
class PolishPolicy:
    """Tuned numbers of Newton's method for the exact switching times of a mesh's bang arcs."""

    cases: ClassVar = PLANAR

    brief: float = tuned(0.02, "of an interval", "time on the other limit that is a switch there and back, no rounding")
    segments: int = tuned(16, "segments", "of a motion, at least: unstable arms need some")
    steps: int = tuned(8, "steps", "of order six in a segment: states are then right to 1e-9")
    difference: float = tuned(1e-4, "of a joint's way or speed", "step of differences: rounding equals truncation")
    rounds: int = tuned(20, "steps", "of Newton's method, also on the replay's miss; most take three to eight")
    halves: int = tuned(8, "halvings", "of a step")
    structures: int = tuned(3, "structures", "of one motion: switches that meet vanish")
    most: int = tuned(40, "switches", "of one motion: more are a torque between its limits, which chatters on a mesh")


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

    rounds: int = tuned(12, "rounds", "of Newton's method, and on the replay's miss: most take three")
    far: float = tuned(0.1, "rad or m", "miss beyond which the linear correction does not hold", LARGE)
    steps: int = tuned(1280, "steps", "of the whole motion at least: a coarse mesh's intervals take several")
    near: float = tuned(1e-5, "of half a torque's range", "a torque of the mesh so near its limit is on it")
    closed: float = tuned(1e-11, "of a joint's way or speed", "gap that counts as closed; on exact arcs a tenth")
    held: float = tuned(
        0.1, "of a limit", "distance at which it may be active (of a position, per way); a fifth doubles the saving"
    )
    state_bound: float = tuned(
        3.0, "of ways and largest speeds", "bound of changes of states in the linear program for the costates"
    )
    converged: float = tuned(
        1e-5, "of the duration", "accuracy of that program: a tenth of the certificate's tolerance"
    )
