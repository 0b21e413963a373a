"""Texts of the studio's page."""

from __future__ import annotations

from collections.abc import Iterator

from armdyn.errors import ArmdynError
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.answer.summary import minimum_time_summary
from armdyn.optimal.proof.certificate import percent
from armdyn.show.markup import Html, element, join
from armdyn.show.page.facts import Facts
from armdyn.show.page.scene import short_names
from armdyn.show.page.verdict import verdict_of
from armdyn.show.studio.session import Session

_MOST_LIMITS = 3
"""That are named as deciding the duration."""
_SLOW = 0.4
"""A computation that takes longer is mentioned [s]: a flicker helps nobody."""


def answer_html(session: Session) -> Html:
    """The panel of the motion: duration, gap, what decides, warnings; and what is being computed."""
    solution = session.solution
    big = "–" if solution is None else f"{solution.duration:.4f} s"
    head = element("span", big, style="font-size:1.7em;font-weight:600;font-variant-numeric:tabular-nums")
    note = element("span", f" {status(session)}", style="opacity:.75")
    lines = [element("div", head, note, id="studio-answer", role="status")]
    if solution is not None:
        lines += [element("div", one) for one in facts_of(solution)]
    lines += [
        element("div", f"⚠ {one}", style="margin-top:.4em;padding-left:.5em;border-left:3px solid #e8710a")
        for one in warnings_of(session)
    ]
    return element("div", join(lines), style="padding:.2em .8em .4em;font-size:.9em;line-height:1.45")


def status(session: Session) -> str:
    """Whether the shown motion is that of the state, in a few words."""
    if session.current:
        return "" if session.solution is not None else "no motion"
    if session.refused:
        return "of an earlier state" if session.solution is not None else "nothing to compute"
    seconds = session.computing or 0.0
    return "computing …" if seconds < _SLOW else f"computing … {seconds:.1f} s"


def facts_of(solution: Solution) -> Iterator[str]:
    """How near to the optimum a motion is proven to be, and what decides its duration."""
    facts = Facts(minimum_time_summary(solution))
    if not solution.usable:
        yield verdict_of(facts).said
    elif solution.gap is not None and solution.gap_proven:
        yield f"Executable; proven to be at most {percent(max(solution.gap, 0.0))} slower than the fastest possible."
    else:
        yield "Executable; no lower bound is known, so a faster motion may exist."
    names = dict(zip(solution.problem.robot.joint_names, short_names(solution.problem.robot.joint_names), strict=True))
    shares = [f"{names.get(one.joint, one.joint)} {one.limit} ({100 * one.part:.0f} %)" for one in solution.decides]
    if shares and solution.usable:
        yield f"Decided by {', '.join(shares[:_MOST_LIMITS])}."


def warnings_of(session: Session) -> list[str]:
    """All that is wrong with the state or its motion, a sentence each."""
    said = [session.refused, *session.warnings, session.failed if session.current else "", session.unsaved]
    return [f"{one[0].upper()}{one[1:]}." for one in said if one]


def saved_words(error_or_path: object) -> str:
    """The note that a button to save leaves."""
    if isinstance(error_or_path, ArmdynError):
        return f"Not saved: {error_or_path}"
    return f"Saved: {error_or_path}"
