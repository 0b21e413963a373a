"""Tuned numbers of the search of a cycle's branches."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.task.policy.tuned import tuned


@dataclass(frozen=True, kw_only=True)
class CyclePolicy:
    """Tuned numbers of the choice among branches of a cycle's stops, and of the end of their search."""

    cases: ClassVar = "25/300/25 mm: UR5, Panda, Kinova; Panda, bins and wall"

    turned: int = tuned(
        100,
        "joint positions",
        "of a branch with whole turns of its joints, at most: three ways for each of four joints",
    )
    alike: int = tuned(
        8,
        "pairs of branches",
        "refused for one reason before all of a move are: a six-axis arm has eight branches, with turns thousands of "
        "pairs",
    )
    quick: float = tuned(
        0.5,
        "of the duration",
        "by which other tours may still be shorter when a quick search ends: bounds ignore straight segments and "
        "obstacles, so that most tours would have to be solved",
    )
    bound_part: float = tuned(
        0.1, "of the time limit", "for the bound of the whole cycle, where the search has used it up"
    )
