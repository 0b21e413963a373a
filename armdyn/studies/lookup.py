"""Outcomes found by case."""

from collections.abc import Iterable
from dataclasses import replace

from armdyn.control.arrival import ArrivalRule
from armdyn.studies.cases import Case, Outcome

_RULE: ArrivalRule = "last_entry_first_joint"


def by_case(outcomes: Iterable[Outcome]) -> dict[Case, Outcome]:
    """Outcomes by what was moved how: under the default arrival rule's case, whichever rule a run had."""
    return {replace(outcome.case, arrival_rule=_RULE): outcome for outcome in outcomes}
