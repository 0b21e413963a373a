"""Strategy: by which methods a kind of problem is solved, chosen once."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from armdyn.optimal.task.policy.curves import TRAINED
from armdyn.optimal.task.policy.tuned import by_kind

Method = Literal["arcs", "time-energy", "mesh", "curves"]
"""From guesses to replayed optima: switching times of torques on their limits; smooth torques where effort has a
weight; collocation, tightened until the replay keeps the path constraints; B-splines with inverse dynamics."""


@dataclass(frozen=True, kw_only=True)
class StrategyPolicy:
    """Methods in the order in which they are tried."""

    cases: ClassVar = TRAINED

    methods: tuple[Method, ...] = by_kind(
        "methods",
        "tried in turn until an optimum is certified: beyond three joints idle ones leave arcs undetermined, and "
        "curves stand alone; where velocity limits shape the motion curves are often proven, and come first",
    )
    fallback: tuple[Method, ...] = by_kind(
        "methods",
        "tried from what landed where no optimum is usable: a curve is a motion whether it converges or not; it needs "
        "a motor at every joint, since a torque of zero would be an equation all along it",
        "by definition",
    )
    bounded: bool = by_kind("-", "velocity limits shape the motion: a lower bound by them is computed concurrently")

    @property
    def curves_alone(self) -> bool:
        """Whether curves are the only method."""
        return self.methods == ("curves",)
