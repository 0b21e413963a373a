"""Texts of the studio's page."""

from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.answer.words import assessment, decided_words
from armdyn.show.markup import element
from armdyn.show.page.scene import short_names
from armdyn.show.studio.session import Session

_SLOW = 0.4
"""Time after which a computation is mentioned [s]: earlier, the text would flicker."""


def answer_html(session: Session) -> str:
    """The panel of the motion: duration, gap, deciding limits, warnings; and the running computation."""
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
    return str(element("div", *lines, style="padding:.2em .8em .4em;font-size:.9em;line-height:1.45"))


def status(session: Session) -> str:
    """Whether the shown motion is that of the state, in a few words."""
    if session.current:
        return "" if session.solution is not None else "no motion"
    if session.refused:
        return "of an earlier state" if session.solution is not None else "nothing to compute"
    seconds = session.computing or 0.0
    return "computing …" if seconds < _SLOW else f"computing … {seconds:.1f} s"


def facts_of(solution: Solution) -> list[str]:
    """Whether a motion is executable, its proven gap, and the limits that decide its duration."""
    joints = solution.problem.robot.joint_names
    names = dict(zip(joints, short_names(joints), strict=True))
    decided = decided_words(solution, names)
    return [assessment(solution), *([f"Its time is decided by {decided}."] if decided else [])]


def warnings_of(session: Session) -> list[str]:
    """Faults of the state or its motion, a sentence each."""
    lines = [session.refused, *session.warnings, session.failed if session.current else "", session.unsaved]
    return [f"{one[0].upper()}{one[1:]}." for one in lines if one]


def note_html(words: str) -> str:
    """HTML of the line below the save buttons."""
    return str(element("div", words, role="status", style="padding:0 .8em;font-size:.85em;overflow-wrap:anywhere"))
