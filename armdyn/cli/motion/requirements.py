"""Option `--require`: conditions on a motion besides being usable."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from armdyn.cli.options.groups import TASK, option
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import part

REQUIRE = option(
    "certified|extremal|gap:X",
    "Condition on the motion besides usable, else exit code 4: certified, extremal, or proven to be at most X above "
    "the least time, such as gap:0.5% or gap:0.005. May be given again.",
    rich_help_panel=TASK,
)

_PLAIN = ("certified", "extremal")


@dataclass(frozen=True)
class Requirement:
    """A condition of --require.

    Attributes:
        text: the option's value.
        kind: "certified", "extremal" or "gap".
        most: the largest gap, as a part of the lower bound; ignored for other kinds.
    """

    text: str
    kind: str
    most: float = 0.0


def requirements_of(texts: Sequence[str]) -> tuple[Requirement, ...]:
    """Parse the requirements of --require.

    Raises:
        ProblemError: a text is no requirement.
    """
    return tuple(_requirement(text.strip()) for text in texts)


def missing_of(required: Sequence[Requirement], usable: bool, reached: Mapping[str, Any]) -> list[str]:
    """Unmet requirements of a motion, with remedies; all if the motion is not usable.

    Args:
        required: of the motion.
        usable: whether it is.
        reached: as `words.standing` says.
    """
    gap, held = reached["gap"] if reached["gap_proven"] else None, {kind: reached[kind] for kind in _PLAIN}
    return [
        f"{one.text} is missing: {reached['missing'][one.kind] if usable else 'the motion is not usable'}"
        for one in required
        if not (usable and held.get(one.kind, gap is not None and gap <= one.most))
    ]


def _requirement(text: str) -> Requirement:
    if text in _PLAIN:
        return Requirement(text, text)
    kind, colon, rest = text.partition(":")
    if kind.strip() != "gap" or not colon:
        raise ProblemError(f"--require {text!r}: write certified, extremal or gap:X, such as gap:0.5%")
    most = part(rest, f"--require {text}")
    if not 0 <= most <= 1:
        raise ProblemError(f"--require {text!r}: the gap is from 0 to 100 %, written gap:0.5% or gap:0.005")
    return Requirement(text, "gap", most)
