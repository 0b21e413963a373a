"""`--require`: conditions on a motion besides usable, which decide between exit codes 0 and 4."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from armdyn.cli.invocation import in_options
from armdyn.cli.options.groups import TASK, option
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import part

REQUIRE = option(
    "certified|extremal|gap:X",
    "Condition on the motion besides usable, else exit code 4: extremal (locally optimal), gap:X (proven to be at "
    "most X above the least time, as gap:0.5% or gap:0.005), or certified (extremal, or gap:0.1%). May be given again.",
    rich_help_panel=TASK,
)


def requirements_of(texts: Sequence[str] | None) -> dict[str, float | None]:
    """Parse the values of --require.

    Returns:
        The largest gap of each requirement, as a part of the lower bound; None: of "certified" and "extremal".

    Raises:
        ProblemError: a text is no requirement.
    """
    stripped = [text.strip() for text in texts or ()]
    return {text: None if text in ("certified", "extremal") else largest_gap(text) for text in stripped}


def largest_gap(text: str) -> float:
    """The gap of "gap:X", as a part of the lower bound.

    Raises:
        ProblemError: the text is no such requirement.
    """
    kind, colon, rest = text.partition(":")
    if kind.strip() != "gap" or not colon:
        raise ProblemError(f"--require {text!r}: write certified, extremal or gap:X, such as gap:0.5%")
    most = part(rest, f"--require {text}")
    if not 0 <= most <= 1:
        raise ProblemError(f"--require {text!r}: the gap is from 0 to 100 %, written gap:0.5% or gap:0.005")
    return most


def missing_of(required: Mapping[str, float | None], usable: bool, reached: Mapping[str, Any]) -> list[str]:
    """Unmet requirements of a motion, with remedies; all if the motion is not usable.

    Args:
        required: of the motion, as of `requirements_of`.
        usable: whether it is.
        reached: as `words.standing` says.
    """
    gap = reached["gap"] if reached["gap_proven"] else None
    missing = []
    for text, most in required.items():
        met = reached[text] if most is None else gap is not None and gap <= most
        if not (usable and met):
            why = reached["missing"][text if most is None else "gap"] if usable else "the motion is not usable"
            missing.append(f"{text} is missing: {why}")
    return missing


def missing_words(missing: Sequence[str]) -> dict[str, str]:
    """Requirements that are not met, for `facts_table`."""
    return {"required": "\n".join(map(in_options, missing))} if missing else {}
