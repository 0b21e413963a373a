"""A report: one HTML file of one motion or several, with the arm, its curves under one cursor, and what is to be said.

Facts become a `Report`, a value; `report_html` is the only one that knows how a page is written.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armdyn.errors import TrajectoryError
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.obstacles import Obstacle
from armdyn.models.values.joint_limits import JointLimits
from armdyn.show.markup import Html, element, fill, join, script_json
from armdyn.show.page.assets import asset, script, viewer_script
from armdyn.show.page.course import Move, course_data, until
from armdyn.show.page.joints import (
    Compared,
    compared,
    comparison_section,
    comparison_tiles,
    joint_section,
    worth_seeing,
)
from armdyn.show.page.scene import playing_speed, scene_data, short_names
from armdyn.show.page.sections import (
    Section,
    course_section,
    deciding_section,
    making_section,
    model_section,
    optima_section,
    sensitivity_section,
    verdict_section,
)
from armdyn.show.page.verdict import Tile, Verdict, tiles_of, verdict_of

MOST_MOVES = 5
"""Motions in one report: one colour each."""

_SCRIPT = re.compile(r"<script>(.*?)</script>", re.DOTALL)


@dataclass(frozen=True, eq=False)
class Subject:
    """What moves, as far as a report must know it: also of a robot that is not at hand.

    Attributes:
        name: of the robot.
        joints: their names.
        limits: of the joints.
        sliding: which slide instead of turning.
        robot: drawn in three dimensions; None: it is not at hand.
        obstacles: drawn where they stand.
    """

    name: str
    joints: tuple[str, ...]
    limits: JointLimits
    sliding: tuple[bool, ...]
    robot: Robot | None = None
    obstacles: tuple[Obstacle, ...] = ()

    @classmethod
    def of(cls, robot: Robot, obstacles: Sequence[Obstacle] = ()) -> Subject:
        """A robot that is at hand."""
        sliding = tuple(robot.slides.tolist())
        return cls(robot.name, tuple(robot.joint_names), robot.limits, sliding, robot, tuple(obstacles))


@dataclass(frozen=True, eq=False)
class Report:
    """All that a report says and shows.

    Attributes:
        title: its heading.
        lead: a line below.
        headline: the verdict in a few words, and of which motion where there are several.
        verdict: of its first motion.
        tiles: the numbers that are seen first.
        sections: below the plots.
        data: what the scripts draw, as JSON says it.
    """

    title: str
    lead: str
    headline: str
    verdict: Verdict
    tiles: tuple[Tile, ...]
    sections: tuple[Section, ...]
    data: Mapping[str, Any]


def report_of(subject: Subject, moves: Sequence[Move], title: str = "", end: float | None = None) -> Report:
    """A report of motions of one arm; the first is the one that is judged, the others its ghosts.

    Args:
        subject: what moves.
        moves: at least one, at most `MOST_MOVES`.
        title: empty: the robot's name.
        end: so much of each motion is drawn [s]; what is said is of all of it. None: all.

    Raises:
        TrajectoryError: there is none, there are too many, or one has another number of joints than the arm.
    """
    if not 1 <= len(moves) <= MOST_MOVES:
        raise TrajectoryError(f"a report shows 1 to {MOST_MOVES} motions, not {len(moves)}")
    for move in moves:
        if not move.motion.q.shape[1] == move.motion.v.shape[1] == len(subject.joints):
            raise TrajectoryError(
                f"{move.name}: a motion of {move.motion.q.shape[1]} joints, where {subject.name} has "
                f"{len(subject.joints)}"
            )
    first = moves[0]
    verdict = verdict_of(first.facts)
    count = len(subject.joints)
    lead = [f"{count} joint{'s' if count > 1 else ''}"]
    if subject.robot is not None and subject.robot.payload is not None and subject.robot.payload.mass:
        lead.append(f"payload {1000 * subject.robot.payload.mass:g} g")
    if len(moves) > 1:
        lead.append(f"{first.name} beside {', '.join(move.name for move in moves[1:])}")
    rows = compared(moves, subject.limits)
    judged = len(moves) > 1 and all(move.facts.values for move in moves)  # a run's own reference is not
    tiles = comparison_tiles(rows) if judged else tiles_of(first.facts, first.motion.duration)
    return Report(
        title or subject.name,
        " · ".join(lead),
        verdict.headline if len(moves) == 1 or not first.facts.values else f"{first.name}: {verdict.headline}",
        verdict,
        tuple(tiles),
        tuple(_sections(subject, moves, verdict, rows)),
        _data(subject, moves, end, worth_seeing(rows, end)),
    )


def _sections(subject: Subject, moves: Sequence[Move], verdict: Verdict, rows: Sequence[Compared]) -> list[Section]:
    facts, duration = moves[0].facts, moves[0].motion.duration
    others = [(k, move) for k, move in enumerate(moves) if k]
    sections = [
        comparison_section(rows),
        verdict_section(verdict),
        *(verdict_section(verdict_of(move.facts), f"-{k}", move.name) for k, move in others),
        deciding_section(facts, duration),
        sensitivity_section(facts, subject.joints),
        optima_section(facts, duration),
        course_section(facts),
        *(joint_section(move, subject.joints, subject.limits, subject.sliding) for move in moves[:1]),
        model_section(subject.name, facts),
        making_section(facts),
        *(making_section(move.facts, f"-{k}", move.name) for k, move in others),
    ]
    return [section for section in sections if section is not None]


def _data(subject: Subject, moves: Sequence[Move], end: float | None, seen: float | None) -> dict[str, Any]:
    """What the scripts draw, up to a time, and how much is seen at first [s]. The scene, the largest, is packed."""
    shown = [replace(move, motion=until(move.motion, end)) for move in moves]
    motions = [move.motion for move in shown]
    scene = None
    if subject.robot is not None:
        text = script_json(scene_data(subject.robot, motions, obstacles=subject.obstacles))
        scene = base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode("ascii")
    return {
        "joints": list(subject.joints),
        "labels": short_names(subject.joints),
        "cut": [drawn.motion.duration < whole.motion.duration for drawn, whole in zip(shown, moves, strict=True)],
        "speed": playing_speed([min(motion.duration, seen or np.inf) for motion in motions]),
        "seen": seen,
        "course": course_data(shown, subject.limits, subject.sliding),
        "scene": scene,
    }


def report_html(report: Report) -> str:
    """The page. Its policy lets only its own scripts run, by their checksums, and nothing leave it."""
    body = fill(
        asset("report.html"),
        {
            "title": join([report.title]),
            "lead": join([report.lead]),
            "level": report.verdict.level,
            "headline": join([report.headline]),
            "said": join([report.verdict.said]),
            "tiles": join(_tile(tile) for tile in report.tiles),
            "sections": join(_section(section) for section in report.sections),
            "plotstyle": asset("uplot/uPlot.min.css"),
            "style": asset("report.css"),
            "data": script_json(report.data),
            "viewer": viewer_script(),
            "plot": script("uplot/uPlot.iife.min.js"),
            "scene": script("scene.js"),
            "zoom": script("zoom.js"),
            "curves": script("curves.js"),
            "player": script("player.js"),
            "report": script("report.js"),
            "policy": "{{policy}}",  # known when the scripts are
        },
    )
    hashes = (hashlib.sha256(text.encode()).digest() for text in _SCRIPT.findall(body))
    allowed = " ".join(f"'sha256-{base64.b64encode(each).decode('ascii')}'" for each in hashes)
    # MeshCat's controls bring a style sheet of their own, with a picture in it.
    rest = "style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
    policy = f"default-src 'none'; script-src {allowed}; {rest}"
    return body.replace("{{policy}}", policy, 1)


def _tile(tile: Tile) -> Html:
    parts = [element("span", tile.label), element("b", tile.value)]
    return element("li", *parts, *([element("small", tile.note)] if tile.note else []))


def _section(section: Section) -> Html:
    kind = "card wide" if section.wide else "card"
    return element("section", element("h2", section.title), section.body, id=section.name, class_=kind)
