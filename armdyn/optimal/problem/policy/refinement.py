"""Tuned numbers of refinement: meshes of a motion, arcs read off them, their exact switching times."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.problem.policy.tuned import PLANAR, tuned


@dataclass(frozen=True, kw_only=True)
class MotionMeshPolicy:
    """Tuned numbers of mesh refinement until the motion is resolved."""

    cases: ClassVar = "random arms (RR, seed 1; RRR)"

    most: int = tuned(4000, "knots", "of a mesh: more take a second; those that were certified took 4,200")
    rounds: int = tuned(
        4, "meshes", "with seven motions of 26 are no faster, and take twice the time; with three some are 1e-6 slower"
    )
    iterations: int = tuned(150, "iterations", "on a mesh, at most: certified motions of 80 problems took 80")
    tolerance: float = tuned(
        1e-7,
        "scaled",
        "of all meshes but the last, a hundredth on it, hundredfold if a motion hardly becomes faster: with idle "
        "joints 1e-9 takes 100 iterations, for the same switches",
    )
    barrier: float = tuned(
        1e-6,
        "scaled",
        "first of the interior-point method on the first mesh; a hundredth on the others, as their initial solution's, "
        "and a thousandth on the last: with 1e-6 a motion on 2,000 intervals first becomes 1 % slower",
    )
    push: float = tuned(1e-5, "of the range", "least distance of the start from bounds")
    convex: float = tuned(
        1e-5,
        "of T for half a torque's range",
        "least curvature of torques where T is not convex, in their interval: half the iterations of one for all",
    )
    decrease: float = tuned(
        3e-8,
        "of the duration",
        "least decrease of the barrier function, or the last mesh counts as solved; thirtyfold on the meshes before",
    )
    patience: int = tuned(12, "iterations", "over which the decrease is measured")
    parts: int = tuned(4, "parts", "of a divided interval, at most")
    jump: float = tuned(0.03, "of half a torque's range", "between intervals that are to be divided")
    bend: float = tuned(
        5e-4,
        "of half the range of a torque's motion",
        "at a knot of linear torques that needs no more: half of it takes 3e-5 of T less, in twice the CPU time",
        "RR, RRR: limited accelerations; time-energy",
    )
    velocity_excess: float = tuned(2e-5, "of a velocity limit", "excess within an interval of constant torque")
    gap: float = tuned(1e-9, "of a joint's way or speed", "error of collocation in an interval: its gradient's is 1e-5")
    least: float = tuned(4e-6, "of the duration", "a shorter interval is not divided")
    slower: float = tuned(
        1e-2,
        "of the duration",
        "a solution slower by more is another optimum; with 4e-3 one of 35 was lost, which finer meshes slow by 0.47 %",
        "RRR, 500 g; random arms (RRR)",
    )
    ties: tuple[float, ...] = tuned(
        (3e-6, 1e-4),
        "of 1 for time",
        "weight of full torques, which determines joints idle in time-optimal motion; of meshes after the first the "
        "second: a quarter of the iterations for 5e-7 of T",
    )
    work: int = tuned(
        700_000,
        "intervals",
        "times iterations of the meshes of one optimum, after which no mesh is begun: 5 CPU s with three joints",
    )
    further_meshes: int = tuned(4, "meshes", "divided where the motion is not yet certified, at most")


@dataclass(frozen=True, kw_only=True)
class ArcsPolicy:
    """Tuned numbers of the detection of arcs on a mesh."""

    cases: ClassVar = "RRR: ten payloads, random pairs; Panda, UR5; " + PLANAR

    near: float = tuned(
        2e-3, "of a limit", "a torque or speed within this is on its limit: IPOPT's barrier leaves 1e-4"
    )
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
