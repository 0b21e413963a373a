"""Outcome of a case of the paper."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from armdyn.paper.outcomes.case import Case
from armdyn.paper.printed.loop import PAPER_RULE
from armdyn.trajectory import Trajectory

Fact = float | str | bool | None | list[float]


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result of a case.

    Attributes:
        case: the problem or loop.
        time: t_f, or the time of arrival [s]; None if there is none.
        trajectory: the motion; None if there is none.
        success: certified or landed (open loop), arrived (closed loop).
        status: one word.
        message: the status in words.
        facts: further numbers: see `run_case`.
        summary: the content of its result.json.
    """

    case: Case
    time: float | None
    trajectory: Trajectory | None
    success: bool
    status: str
    message: str
    facts: dict[str, Fact] = field(default_factory=dict)
    summary: dict[str, object] = field(default_factory=dict)


def by_case(outcomes: Iterable[Outcome]) -> dict[Case, Outcome]:
    """Outcomes by case; the arrival rule is not part of the key."""
    return {replace(outcome.case, arrival_rule=PAPER_RULE): outcome for outcome in outcomes}
