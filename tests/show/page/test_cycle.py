"""A cycle's page: steps under the slider and in a table, parts where they are."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.show.page.cycle import CarriedPart, parts_in, shown_parts, step_data, steps_section
from armdyn.show.page.facts import Facts
from armdyn.show.page.motions import ShownMotion, Subject
from armdyn.show.page.report import report_html, report_of
from armdyn.trajectory import Load
from problems import paper_arm
from show.browser import open_page
from show.motions import quintic
from show.page.test_report import EVIL

PART = {
    "mass": 0.1,
    "name": "bolt",
    "frame": "tip",
    "shapes": [{"type": "sphere", "center": [0, 0, 0], "radius": 0.02}],
}


def cycle(first="to the bolt"):
    """RR goes to a part, grasps it at 0.3 s, and carries it back from 0.5 s on."""
    robot, none, load = paper_arm("rr"), Load(0.0), Load(0.1)
    there = quintic(robot, [0.0, 0.0], [1.0, 0.5], 0.3).as_piece(name=first, load=none)
    rest = ad.Trajectory.at_rest([1.0, 0.5], [0.0, 0.0], 0.2, robot.joint_names)
    back = quintic(robot, [1.0, 0.5], [0.0, 0.0], 0.4).as_piece(name="back", load=load)
    motion = there + rest.as_piece(name="grasp bolt", load=load, event="grasp") + back
    steps = [
        {"number": 1, "name": first, "begin": 0.0, "duration": 0.3, "share": 1 / 3, "carries": None,
         "decided_by": "torque of joint1, 45 %", "would_help": "10 % more of it saves 5 ms"},
        {"number": 2, "name": "grasp bolt", "begin": 0.3, "duration": 0.2, "share": 2 / 9,
         "carries": {"name": "bolt", "mass": 0.1}, "decided_by": "a rest of 0.2 s", "would_help": ""},
        {"number": 3, "name": "back", "begin": 0.5, "duration": 0.4, "share": 4 / 9,
         "carries": {"name": "bolt", "mass": 0.1}},
    ]  # fmt: skip
    facts = {"steps": steps, "usable": True, "gap": 0.01, "dwell": 0.2, "order": [1, 2, 3], "checks": [],
             "assessment": "The fastest cycle.", "parts": [{"part": PART, "begin": 0.3, "end": None}]}  # fmt: skip
    return robot, ShownMotion("cycle", motion, Facts(facts))


def test_steps_are_the_pieces_of_the_motion():
    _, move = cycle()
    rows = step_data(move.motion)
    assert [(row["name"], row["rest"], row["carries"]) for row in rows] == [
        ("to the bolt", False, 0.0), ("grasp bolt", True, 0.1), ("back", False, 0.1)
    ]  # fmt: skip
    np.testing.assert_allclose([row["begin"] for row in rows], [0, 0.3, 0.5], atol=1e-6)
    assert step_data(quintic(paper_arm("rr"), [0.0, 0.0], [1.0, 0.5], 0.3)) == []


def test_a_part_waits_is_carried_and_rests():
    robot, move = cycle()
    part = ad.Payload(mass=0.1, frame="tip")
    first, second = CarriedPart(part, 0.3, 0.6), CarriedPart(part, 0.6, 0.7)
    before, carried, after = shown_parts(robot, move.motion, [first])
    assert [(one.begin, one.end) for one in (before, carried, after)] == [(0.0, 0.3), (0.3, 0.6), (0.6, None)]
    tip = robot.model.frames[robot.model.getFrameId("tip")]
    assert carried.shapes[0].joint == tip.parentJoint and before.shapes[0].joint == after.shapes[0].joint == 0
    assert np.linalg.norm(before.shapes[0].placement[:3, 3] - after.shapes[0].placement[:3, 3]) > 0.01
    # One that is taken up where it was released stands there only once.
    assert [(one.begin, one.end) for one in shown_parts(robot, move.motion, [first, second])] == [
        (0.0, 0.3), (0.3, 0.6), (0.6, 0.6), (0.6, 0.7), (0.7, None)
    ]  # fmt: skip
    assert not list(shown_parts(robot, move.motion, [CarriedPart(ad.Payload(mass=1, frame="nowhere"), 0, None)]))


def test_parts_of_a_stranger_s_result_are_left_out():
    good = {"part": PART, "begin": 0.3, "end": None}
    bad = [
        {"part": {"mass": "x"}, "begin": 0.0}, {"part": PART},
        {"part": {"shapes": [{"type": "mesh", "file": "/etc"}]}, "begin": 0},
        {"part": {"weight": 1}, "begin": 0.0},
    ]  # fmt: skip
    assert [part.payload.name for part in parts_in(Facts({"parts": [*bad, good]}))] == ["bolt"]


def test_the_page_has_tiles_table_and_verdict():
    robot, move = cycle(EVIL)
    report = report_of(Subject.of(robot), [move], "cell")
    assert report.verdict.level == "good" and "1 %" in report.headline and "3 steps" in report.lead
    assert {"an hour": "4000 cycles", "longest step": "0.4000 s"}.items() <= {
        t.label: t.value for t in report.tiles
    }.items()
    decides = [{"joint": "joint1", "limit": "velocity limit", "part": 0.2}]
    more = move.facts.values | {"closed": False, "decides": decides}  # of 0.9 s 0.2 s are a rest
    tiles = report_of(Subject.of(robot), [replace(move, facts=Facts(more))], "cell").tiles
    assert [(t.value, t.note) for t in tiles if t.label == "decided most by"] == [("22.2 %", "rests")]
    assert "an hour" not in {t.label for t in tiles}
    section = steps_section(move.facts)
    assert "10 % more of it saves 5 ms" in section.body and EVIL not in report_html(report)
    assert steps_section(Facts()) is None


@pytest.mark.slow
def test_the_step_of_the_moment_is_seen(chromium, tmp_path):
    robot, move = cycle()
    path = tmp_path / "report.html"
    path.write_text(report_html(report_of(Subject.of(robot), [move], "cell")))
    with open_page(chromium, path) as (page, _, errors):
        page.evaluate("armdyn.pause()")
        for time, name, drawn in (
            (0.1, "to the bolt", [True, False]),
            (0.4, "grasp bolt", [False, True]),
            (0.9, "back", [False, True]),
        ):
            page.evaluate(f"armdyn.seek({time})")
            assert page.locator("#bands .current").inner_text() == name
            assert page.locator("#step").inner_text().startswith(name)
            assert page.locator("#steps tr.current").inner_text().split("\t")[0].endswith(name)
            assert page.evaluate("armdyn.parts") == drawn
        page.locator("#steps tbody tr").nth(1).click()
        assert page.evaluate("armdyn.time") == pytest.approx(0.3, abs=1e-6)
        assert not errors
