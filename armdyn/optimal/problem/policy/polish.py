"""Tuned numbers of the polish: exact switching times of a mesh's bang arcs."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.problem.policy.tuned import PLANAR, tuned


@dataclass(frozen=True, kw_only=True)
class PolishPolicy:
    """Tuned numbers of Newton's method for the switching times."""

    cases: ClassVar = PLANAR

    brief: float = tuned(0.02, "of an interval", "time on the other limit that is a switch there and back, no rounding")
    segments: int = tuned(16, "segments", "of a motion, at least: unstable arms need some")
    steps: int = tuned(8, "steps", "of order six in a segment: states are then right to 1e-9")
    difference: float = tuned(1e-4, "of a joint's way or speed", "step of differences: rounding equals truncation")
    rounds: int = tuned(
        20, "steps", "of Newton's method; most take three to eight; also of the goal, by the replay's miss"
    )
    halves: int = tuned(8, "halvings", "of a step")
    structures: int = tuned(3, "structures", "of one motion: switches that meet vanish")
    near: float = tuned(1e-4, "of a joint's way, or of a velocity limit", "distance from a limit that is a touch")
    most: int = tuned(40, "switches", "of one motion: more are a torque between its limits, which chatters on a mesh")
