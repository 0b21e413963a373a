"""A page with a pose in which bodies touch that may not: these bodies in red, and the distance of the deepest pair."""

import os
from dataclasses import asdict, replace
from pathlib import Path

from armdyn.arguments import expect
from armdyn.errors import ContactError
from armdyn.files import write_whole
from armdyn.show.page.facts import Facts
from armdyn.show.page.motions import ShownMotion
from armdyn.show.page.report import Replay, Report, Subject, report_html, report_of
from armdyn.show.page.sections import verdict_section
from armdyn.show.page.verdict import Verdict
from armdyn.trajectory import Trajectory

_LISTED = 12
"""Pairs in the sentence at the side; all of them are below it."""


def write_contacts(error: ContactError, path: str | os.PathLike[str]) -> Path:
    """Write a page with the pose that a problem was refused for.

    Args:
        error: as `MinimumTimeProblem` raised it.
        path: the HTML file.

    Returns:
        The path written, as given.

    Raises:
        OSError: the folder cannot be written.
    """
    return write_whole(path, report_html(contacts_report(error)).encode())


def contacts_report(error: ContactError) -> Report:
    """The page of `write_contacts` as a value."""
    robot = expect(error, ContactError, "error").robot
    still = Trajectory.at_rest(error.q, robot.holding_torque(error.q), 1.0, robot.joint_names)
    names = frozenset(name for one in error.contacts for name in (one.body, one.other))
    facts = Facts({"contact": asdict(error.contacts[0])})
    subject = replace(Subject.of(robot, error.obstacles), touching=names)
    report = report_of(subject, [ShownMotion("pose", still, facts)], replay=Replay())
    pairs = tuple((f"{one.body}, {one.other}", False, one.bodies()) for one in error.contacts)
    more = "".join(f"; {one.bodies()}" for one in error.contacts[1:_LISTED])
    verdict = Verdict("bad", "Refused: bodies touch or are too near", f"{error}{more}.", pairs)
    section = verdict_section(verdict)
    return replace(
        report, headline=verdict.headline, verdict=verdict, tiles=(), sections=() if section is None else (section,)
    )
