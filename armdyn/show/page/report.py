"""A report: one HTML file of one motion or several, with the arm, its curves under one cursor, and its verdict.

Facts become a `Report`, a value; only `report_html` writes a page.
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from armdyn.errors import TrajectoryError
from armdyn.files import write_whole
from armdyn.reprs import joints_of
from armdyn.show.markup import Html, asset, element, fill, join, packed_text, script, script_json, viewer_script
from armdyn.show.page import joints, sections
from armdyn.show.page.cycle import costs_section, parts_in, step_data, steps_section
from armdyn.show.page.joints import motor_section
from armdyn.show.page.motions import ShownMotion, Subject, motions_data, until
from armdyn.show.page.scene import mark_of, playing_speed, scene_data, short_names
from armdyn.show.page.sections import Section
from armdyn.show.page.verdict import Tile, Verdict, tiles_of, verdict_of

MOST_MOVES = 5
"""Motions in one report: one colour each."""


@dataclass(frozen=True)
class Replay:
    """Options of a page that opens with the arm alone.

    Attributes:
        fps: stored frames per second of playing time, from 1e-3 to 1e3.
        slow_motion: seconds shown per second of motion, from 1e-6 to 1e6; None: about 4 s in all.
    """

    fps: float = 60
    slow_motion: float | None = None


@dataclass(frozen=True, eq=False)
class Report:
    """Content of a report.

    Attributes:
        title: its heading.
        lead: a line below.
        headline: the verdict in a few words, and of which motion where there are several.
        verdict: of its first motion.
        tiles: the numbers that are seen first.
        sections: below the plots.
        data: input of the scripts, as JSON; none of a page without scripts.
    """

    title: str
    lead: str
    headline: str
    verdict: Verdict
    tiles: tuple[Tile, ...]
    sections: tuple[Section, ...]
    data: Mapping[str, Any] = field(default_factory=dict)


def report_of(
    subject: Subject,
    moves: Sequence[ShownMotion],
    title: str = "",
    end: float | None = None,
    replay: Replay | None = None,
) -> Report:
    """A report of motions of one arm. The first motion is judged; the others are compared with it.

    Args:
        subject: the arm.
        moves: at least one; at most `MOST_MOVES` if it is no replay.
        title: empty: the robot's name.
        end: each motion is drawn up to this time [s], and judged as a whole. None: all of it is drawn.
        replay: the page opens with the arm alone, and several arms stand apart. None: the page opens with arm and
            curves, and several arms stand in one place.

    Raises:
        TrajectoryError: there is no motion, there are too many, or one has another number of joints than the arm.
        ProblemError: see `Replay`.
    """
    if not moves:
        raise TrajectoryError(f"no motion given; a page shows 1 or more, a report 1 to {MOST_MOVES}")
    if replay is None and len(moves) > MOST_MOVES:
        raise TrajectoryError(f"a report shows 1 to {MOST_MOVES} motions, not {len(moves)}")
    for move in moves:
        if not move.motion.q.shape[1] == move.motion.v.shape[1] == len(subject.joints):
            raise TrajectoryError(
                f"{move.name}: a motion of {move.motion.q.shape[1]} joints cannot move {subject.name}, which has "
                f"{len(subject.joints)}"
            )
    data = _data(subject, moves, end, replay)
    first = moves[0]
    verdict = verdict_of(first.facts)
    count = len(subject.joints)
    lead = [joints_of(count)]
    if subject.robot is not None and subject.robot.payload is not None and subject.robot.payload.mass:
        lead.append(f"payload {1000 * subject.robot.payload.mass:g} g")
    if steps := first.facts.parts("steps"):
        lead.append(f"{len(steps)} steps, {'closed' if first.facts.true('closed') else 'open'}")
        lead += dict.fromkeys(f"{one.payload.name}, {one.payload.mass:g} kg" for one in parts_in(first.facts))
    if len(moves) > 1:
        lead.append(f"{first.name} against {', '.join(move.name for move in moves[1:])}")
    rows = joints.compared(moves, subject.limits)
    judged = len(moves) > 1 and all(move.facts.values for move in moves)  # a run's own reference is not
    tiles = joints.comparison_tiles(rows) if judged else tiles_of(first.facts, first.motion.duration, subject.sliding)
    return Report(
        title or subject.name,
        " · ".join(lead),
        verdict.headline if len(moves) == 1 or not first.facts.values else f"{first.name}: {verdict.headline}",
        verdict,
        tuple(tiles),
        tuple(_sections(subject, moves, verdict, rows)),
        data,
    )


def _sections(
    subject: Subject, moves: Sequence[ShownMotion], verdict: Verdict, rows: Sequence[joints.Compared]
) -> list[Section]:
    facts, duration = moves[0].facts, moves[0].motion.duration
    others = [(k, move) for k, move in enumerate(moves) if k]
    found = [
        steps_section(facts),
        joints.comparison_section(rows),
        sections.verdict_section(verdict),
        *(sections.verdict_section(verdict_of(move.facts), f"-{k}", move.name) for k, move in others),
        sections.deciding_section(facts, duration),
        costs_section(facts),
        sections.sensitivity_section(facts, subject.joints),
        sections.optima_section(facts, duration),
        sections.path_constraint_section(facts),
        sections.controller_section(facts),
        joints.joint_section(moves[0], subject),
        motor_section(moves[0], subject),
        sections.model_section(subject.name, facts),
        sections.making_section(facts),
        *(sections.making_section(move.facts, f"-{k}", move.name) for k, move in others),
    ]
    return [section for section in found if section is not None]


def _data(subject: Subject, moves: Sequence[ShownMotion], end: float | None, replay: Replay | None) -> dict[str, Any]:
    """Data of the scripts: curves up to a time, the span seen at first [s], the scene, compressed."""
    seen = joints.initial_span(moves, end) if replay is None else None
    shown = [replace(move, motion=until(move.motion, end)) for move in moves]
    motions = [move.motion for move in shown]
    speed = playing_speed([min(motion.duration, seen or np.inf) for motion in motions])
    packed = None
    if subject.robot is not None:
        options = replay or Replay()
        facts = moves[0].facts
        marks = [mark_of(facts.part("clearance")), mark_of(facts.part("contact"), always=True)]
        scene = scene_data(
            subject.robot, motions, fps=options.fps, slow_motion=options.slow_motion, obstacles=subject.obstacles,
            touching=subject.touching, marks=[mark for mark in marks if mark is not None], parts=parts_in(facts),
        )  # fmt: skip
        speed = scene["speed"] if replay else speed
        packed = packed_text(script_json(scene))
    verdicts = [verdict_of(move.facts) for move in moves]
    return {
        "alone": replay is not None,
        "joints": list(subject.joints),
        "labels": short_names(subject.joints),
        "verdicts": [[one.level, "" if one.level == "none" else one.headline] for one in verdicts],
        "cut": [drawn.motion.duration < whole.motion.duration for drawn, whole in zip(shown, moves, strict=True)],
        "speed": speed,
        "seen": seen,
        "steps": step_data(shown[0].motion),
        "motions": motions_data(shown, subject),
        "scene": packed,
    }


def write_page(path: str | os.PathLike[str], report: Report) -> Path:
    """Write the page of a report; returns the path.

    Raises:
        FileError: the folder cannot be written.
    """
    return write_whole(path, report_html(report).encode())


def report_html(report: Report) -> str:
    """The page, whose scripts are all its own."""
    return fill(page_template(evaluates=bool(report.data["alone"])), page_fields(report) | {"viewer": viewer_script()})


def page_fields(report: Report) -> dict[str, str]:
    """Parts of a page that differ from report to report, by their names in `page_template`."""
    return {
        "title": join([report.title]),
        "lead": join([report.lead]),
        "level": report.verdict.level,
        "headline": join([report.headline]),
        "said": join([report.verdict.said]),
        "tiles": join(tile_html(tile) for tile in report.tiles),
        "sections": join(section_html(section) for section in _filled(report.sections)),
        "data": script_json(report.data),
    }


def _filled(sections: Sequence[Section]) -> list[Section]:
    """Sections without half a row: a narrow one that is alone between wide ones is wide, too."""
    wide = [True, *(one.wide for one in sections), True]
    return [
        replace(one, wide=one.wide or (before and after))
        for one, before, after in zip(sections, wide, wide[2:], strict=False)
    ]


def page_template(*, evaluates: bool) -> str:
    """The page with {{viewer}} for `viewer_script` and {{name}} for each of `page_fields`.

    Its policy lets only its own scripts run, by their checksums, and nothing leave the page.

    Args:
        evaluates: scripts that drive the page from outside may evaluate text in it, as a browser under test does.
    """
    scripts = {"plot": script("uplot/uPlot.iife.min.js")}
    scripts |= {name: script(f"{name}.js") for name in ("scene", "zoom", "curves", "player", "report")}
    styles = {"plotstyle": asset("uplot/uPlot.min.css"), "style": asset("report.css")}
    hashes = (hashlib.sha256(text.encode()).digest() for text in [viewer_script(), *scripts.values()])
    allowed = " ".join(f"'sha256-{base64.b64encode(each).decode('ascii')}'" for each in hashes)
    if evaluates:
        allowed += " 'unsafe-eval'"
    # MeshCat's controls bring a style sheet of their own, with a picture in it.
    rest = "style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
    static = {**scripts, **styles, "policy": f"default-src 'none'; script-src {allowed}; {rest}"}
    return re.sub(r"\{\{(\w+)\}\}", lambda match: static.get(match[1], match[0]), asset("report.html"))


def tile_html(tile: Tile) -> Html:
    """A headline number as an item of the page's list."""
    parts = [element("span", tile.label), element("b", tile.value)]
    return element("li", *parts, *([element("small", tile.note)] if tile.note else []))


def section_html(section: Section) -> Html:
    """A section as a card of the page."""
    kind = "card wide" if section.wide else "card"
    return element("section", element("h2", section.title), section.body, id=section.name, class_=kind)
