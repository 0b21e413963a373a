"""What counts as the arrival of a closed-loop motion."""

from dataclasses import dataclass
from typing import Literal

from armdyn.arguments import number, one_of

ArrivalRule = Literal["last_entry_first_joint", "last_entry_all_joints", "first_crossing"]
"""When the arm is "in the final position":

- "last_entry_all_joints": when the largest |eᵢ| enters the tolerance to stay.
- "last_entry_first_joint": when |e₁| enters the tolerance to stay, wherever the other joints are.
- "first_crossing": when e₁ first is zero, however far joint 1 then overshoots.
"""
ARRIVAL_RULES: tuple[ArrivalRule, ...] = ("last_entry_all_joints", "last_entry_first_joint", "first_crossing")


@dataclass(frozen=True)
class Arrival:
    """What counts as being in the final position.

    Attributes:
        rule: see `ArrivalRule`.
        tolerance: of a joint's error [rad or m].

    Raises:
        ProblemError: unknown rule, or tolerance not positive.
    """

    rule: ArrivalRule = "last_entry_all_joints"
    tolerance: float = 0.005

    def __post_init__(self) -> None:
        one_of(self.rule, ARRIVAL_RULES, "arrival_rule")
        number(self.tolerance, "arrival_tolerance", unit="rad", sign="positive")
