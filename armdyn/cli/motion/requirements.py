"""Option `--require`: conditions on a motion besides being usable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from armdyn.cli.options.groups import TASK, option
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import number

if TYPE_CHECKING:
    from armdyn.optimal import Solution

REQUIRE = option(
    "certified|extremal|gap:X",
    "Condition on the motion besides usable, else exit code 4: certified, extremal, or proven to be at most X above "
    "the least time, such as gap:0.5% or gap:0.005. May be given again.",
    rich_help_panel=TASK,
)

_PLAIN: tuple[Literal["certified", "extremal"], ...] = ("certified", "extremal")


@dataclass(frozen=True)
class Requirement:
    """A condition of --require.

    Attributes:
        text: as it was given.
        kind: which.
        most: the largest gap, as a part of the lower bound; of the others not looked at.
    """

    text: str
    kind: Literal["certified", "extremal", "gap"]
    most: float = 0.0

    def met_by(self, solution: Solution) -> bool:
        """Whether a solution meets it."""
        if self.kind == "gap":
            return solution.gap_proven and solution.gap is not None and solution.gap <= self.most
        return solution.certified if self.kind == "certified" else solution.certificate.extremal


def requirements_of(texts: Sequence[str]) -> tuple[Requirement, ...]:
    """Requirements as --require says them.

    Raises:
        ProblemError: a text is none.
    """
    return tuple(_requirement(text.strip()) for text in texts)


def missing_of(required: Sequence[Requirement], solution: Solution) -> list[str]:
    """Requirements that a solution does not meet, with remedies; of a motion that is not usable, all."""
    return [
        f"{one.text} is missing: {_why(one, solution)}"
        for one in required
        if not (solution.usable and one.met_by(solution))
    ]


def _why(one: Requirement, solution: Solution) -> str:
    """Why a requirement is not met, or a remedy."""
    from armdyn.optimal.answer.advice import advice
    from armdyn.optimal.proof.certificate import percent

    if not solution.usable:
        return "the motion is not usable"
    if one.kind == "certified":
        return "; ".join(solution.certificate.reasons)
    if one.kind == "gap" and solution.gap_proven and solution.gap is not None:
        return f"the gap is {percent(solution.gap)}"
    lines = advice(solution.problem, solution.certificate, solution.constraint_reports, solution.phases is not None)
    return lines.get(one.kind, "; ".join(solution.certificate.reasons))


def _requirement(text: str) -> Requirement:
    for plain in _PLAIN:
        if text == plain:
            return Requirement(text, plain)
    kind, colon, rest = text.partition(":")
    if kind.strip() != "gap" or not colon:
        raise ProblemError(f"--require {text!r}: write certified, extremal or gap:X, such as gap:0.5%")
    share = rest.strip().endswith("%")
    most = number(rest.strip().removesuffix("%"), f"--require {text}") / (100 if share else 1)
    if not 0 <= most <= 1:
        raise ProblemError(f"--require {text!r}: the gap is from 0 to 100 %, written gap:0.5% or gap:0.005")
    return Requirement(text, "gap", most)
