"""Pages opened with the arm alone, one HTML file, no server, no network: a replay; a pose in which bodies touch."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from armdyn.arguments import expect
from armdyn.errors import ContactError
from armdyn.models import Robot
from armdyn.models.scene.obstacles import Obstacle
from armdyn.show.page.facts import Facts
from armdyn.show.page.motions import ShownMotion, Subject
from armdyn.show.page.report import Replay, Report, report_of, write_page
from armdyn.show.page.sections import verdict_section
from armdyn.show.page.verdict import Verdict
from armdyn.trajectory import Trajectory

if TYPE_CHECKING:
    from armdyn.optimal.answer.solution import Solution


def write_html(
    robot: Robot,
    trajectories: Sequence[Trajectory | Solution | ShownMotion],
    path: str | os.PathLike[str],
    *,
    fps: float = 60,
    slow_motion: float | None = None,
    obstacles: Sequence[Obstacle] = (),
) -> Path:
    """Write a replay that any browser with WebGL plays, from a file, without a network.

    One trajectory moves the robot in the colours of its URDF. Several move one robot each, in the
    trajectory's colour: one behind the other for a planar arm, else side by side. A button of the page shows the
    curves and the numbers, as in a report.

    Args:
        robot: the arm that moves.
        trajectories: one or more motions of it; they start together. The page gives the verdict on a `Solution`, and on
            a `ShownMotion` with facts.
        path: the HTML file.
        fps: frames per second of playing time that are stored; the page interpolates between them.
        slow_motion: initial playing time over real time; None: about 4 s in all.
        obstacles: drawn where they stand.

    Returns:
        The path written, as given.

    Raises:
        TrajectoryError: there is no trajectory, or one has another number of joints than the robot.
        ProblemError: `fps` is not from 1e-3 to 1e3, or `slow_motion` not from 1e-6 to 1e6.
        OSError: the folder cannot be written.
    """
    return write_page(path, replay_of(robot, trajectories, obstacles, Replay(fps, slow_motion)))


def replay_of(
    robot: Robot,
    trajectories: Sequence[Trajectory | Solution | ShownMotion],
    obstacles: Sequence[Obstacle] = (),
    replay: Replay | None = None,
) -> Report:
    """A replay as a value; arguments and errors as of `write_html`."""
    moves = [_move(one, k) for k, one in enumerate(trajectories)]
    return report_of(Subject.of(robot, obstacles), moves, replay=replay or Replay())


def _move(one: Trajectory | Solution | ShownMotion, k: int) -> ShownMotion:
    if isinstance(one, ShownMotion):
        return one
    if isinstance(one, Trajectory):
        return ShownMotion(one.name or f"trajectory {k + 1}", one, Facts())
    from armdyn.optimal.answer.solution import minimum_time_summary  # slow to import: the optimiser

    return ShownMotion(one.trajectory.name or f"trajectory {k + 1}", one.trajectory, Facts(minimum_time_summary(one)))


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
    return write_page(path, contacts_report(error))


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
