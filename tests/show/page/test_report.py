"""The report as a page: its text, its rights, and its size."""

import base64
import hashlib
import json
import re
from dataclasses import asdict, replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import TrajectoryError
from armdyn.show.page.facts import Facts
from armdyn.show.page.joints import compared
from armdyn.show.page.motions import ShownMotion, Subject
from armdyn.show.page.report import Report, report_html, report_of
from armdyn.show.page.sections import deciding_section, optima_section, td
from armdyn.show.page.verdict import tiles_of, verdict_of
from armdyn.studies.preset_costs import ConditionCost
from show.motions import quintic
from show.page.runs import judged

EVIL = "</script><script>window.broken = 1</script><img src=x onerror='broken=1'>{{viewer}}{{policy}}"


def page_of(*moves, robot, title=""):
    return report_html(report_of(Subject.of(robot), moves, title))


def text_of(page):
    return re.sub(r"<[^>]*>", " ", re.sub(r"<(script|style)\b.*?</\1>", "", page, flags=re.S))


def test_it_names_missing_conditions_and_remedies():
    robot, move = judged()
    page = page_of(move, robot=robot, title="rr")
    said = " ".join(text_of(page).split())
    for words in (
        "Executable, not proven optimal", "H is not constant", "What you can do", "--max-intervals",
        "armdyn mintime rr",
        "joint2, torque limit", "27.5 %", "0.2125 s", "+0.35 ms",
    ):  # fmt: skip
        assert words in said, words
    assert '<div class="verdict fair">' in page


@pytest.mark.parametrize(
    ("facts", "level", "headline"),
    [
        ({"usable": False, "duration": None}, "bad", "No motion found"),
        ({"usable": False}, "bad", "Not executable"),
        ({"certified": True, "extremal": True}, "good", "Executable, locally optimal (Pontryagin)"),
        ({"gap": 0.16, "gap_proven": True}, "fair", "Executable, proven within 16 % of the fastest"),
        ({}, "fair", "Executable, not proven optimal"),
    ],
)
def test_verdicts(facts, level, headline):
    robot, move = judged(**facts)
    report = report_of(Subject.of(robot), [move])
    assert isinstance(report, Report)
    assert (report.verdict.level, report.verdict.headline) == (level, headline)


def of_a_pid_loop(arrival):
    return {"arrival_rule": "last_entry_first_joint", "arrival_time": arrival, "settling_time": None,
            "max_real_eigenvalue": -0.9, "message": "not settled"}  # fmt: skip


@pytest.mark.parametrize(
    ("facts", "level", "headline"),
    [
        (of_a_pid_loop(4.5535), "good", "Arrived after 4.5535 s"),
        (of_a_pid_loop(None), "bad", "Did not arrive"),
        (
            {**of_a_pid_loop(4.5535), "limits_exceeded": ["x reaches 141 %"]},
            "bad",
            "Arrived after 4.5535 s, but exceeded its limits",
        ),
        ({"peak_error": 0.1, "settled_time": 0.3, "failed_time": None}, "good", "Settled after 0.3000 s"),
        ({"peak_error": 0.1, "settled_time": 0.3, "failed_time": 0.1}, "fair", "Settled after 0.3000 s"),
        ({"peak_error": 0.1, "settled_time": None, "failed_time": 0.1}, "bad", "Did not settle"),
        (
            {"peak_error": 0.1, "settled_time": 0.3, "peak_velocity": 1.2, "limits_exceeded": ["j1: 120 %"]},
            "bad",
            "Settled after 0.3000 s, but exceeded its limits",
        ),
        (
            {"optimal_duration": 0.2, "ratio": 2.5, "feasible": True, "success": True},
            "good",
            "Keeps its limits, takes 2.5 times as long as the fastest",
        ),
        (
            {"optimal_duration": None, "ratio": None, "feasible": False},
            "bad",
            "Breaks its limits, no fastest motion was found",
        ),
    ],
)
def test_verdicts_of_loops_and_of_planners(facts, level, headline):
    verdict = verdict_of(Facts(facts))
    assert (verdict.level, verdict.headline) == (level, headline)


def test_the_claim_on_the_fastest_motion_is_named():
    facts = {"optimal_duration": 0.2, "ratio": 2.5, "feasible": True, "certified": True, "extremal": True}
    near = facts | {"extremal": False, "gap": 5e-4, "gap_proven": True}
    for each, claim in ((facts, "locally optimal (Pontryagin)"), (near, "proven within 0.05 % of the fastest")):
        assert verdict_of(Facts(each)).checks[-1] == ("the fastest motion", True, f"0.2000 s: {claim}")


def test_a_number_has_the_same_digits_everywhere():
    robot, move = judged()
    loop = {"arrival_rule": "last_entry_first_joint", "arrival_time": 4.5535}
    report = report_of(Subject.of(robot), [move, replace(move, name="loop", facts=Facts(loop))])
    said = text_of(report_html(report))
    assert said.count("+2068.3 %") == 2 and "e+03" not in said
    tracked = verdict_of(Facts({"peak_error": 0.1, "settled_time": 0.3, "peak_velocity": 0.04664}))
    assert ("keeps position and speed limits", True, "largest speed 4.66 % of its limit") in tracked.checks
    beyond = {"peak_error": 0.1, "settled_time": 0.3, "peak_velocity": 1.2, "limits_exceeded": ["j1: 120 %"]}
    rows = compared([move, replace(move, facts=Facts(beyond))], robot.limits)
    assert rows[1].verdict == "Settled, but exceeded its limits"


def test_a_section_alone_between_wide_ones_takes_the_whole_width():
    robot, move = judged()
    loop = replace(move, facts=Facts({"peak_error": 0.1, "settled_time": 0.3}))
    report = report_of(Subject.of(robot), [loop, replace(move, name="reference", facts=Facts({}))])
    page = report_html(report)
    kinds = dict(re.findall(r'<section id="([\w-]+)" class="([\w ]+)"', page))
    assert kinds["comparison"] == kinds["verdict"] == kinds["joints"] == "card wide"


def test_iterations_that_were_not_counted_are_not_said():
    robot, move = judged(solve_time=9.7)
    assert "iterations" not in text_of(page_of(move, robot=robot))
    assert "9.70 s, 5 iterations" in text_of(page_of(judged(solve_time=9.7, iterations=5)[1], robot=robot))


def test_minus_signs_of_cells_are_minus_signs():
    for number, shown in (("-2.5e-05", "−2.5e−05"), ("2.5e-05", "2.5e−05"), ("-1 to -3", "−1 to −3")):
        assert td(number) == f"<td>{shown}</td>"
    assert td("2025-01-16, ur5-3") == "<td>2025-01-16, ur5-3</td>"


def test_a_nought_has_no_sign():
    robot, _ = judged()
    loop = quintic(robot, [0, 0], [-1e-9, 1], 1.0, "PID")
    assert "0.0000 rad" in (said := text_of(page_of(ShownMotion("PID", loop, Facts()), robot=robot)))
    assert "−0.0000" not in said


def test_errors_have_the_unit_of_the_joints():
    assert {tile.value for tile in tiles_of(Facts({"peak_error": 0.06}), 1.0, [False, False])} >= {"0.06 rad"}


def test_a_bare_motion_is_not_judged():
    robot, move = judged()
    report = report_of(Subject.of(robot), [replace(move, facts=Facts())])
    assert (report.verdict.level, report.verdict.headline) == ("none", "Not judged")
    assert [section.name for section in report.sections] == ["joints", "model"]


def test_only_its_own_scripts_may_run_and_nothing_leaves_it():
    robot, move = judged()
    page = page_of(move, robot=robot)
    assert page == page_of(move, robot=robot)
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)[1]
    allowed = dict(part.strip().split(" ", 1) for part in policy.split(";"))
    assert allowed["default-src"] == "'none'" and "unsafe" not in allowed["script-src"]
    scripts = re.findall(r"<script>(.*?)</script>", page, re.S)
    hashes = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
    assert allowed["script-src"].split() == [f"'sha256-{each}'" for each in hashes]
    assert not re.findall(r"(?:https?|wss?|ftp)://", page.replace("`ws://", ""))
    assert not re.findall(r"<(?:link|img|iframe)\b|<script[^>]+src", page)
    assert "\r" not in page  # a browser would take it out, and the checksums would be others


def test_names_stay_text():
    robot, move = judged(request={"command": EVIL, "options": {EVIL: EVIL}}, what_to_do=[EVIL], message=EVIL)
    robot = replace(robot, name=EVIL, joint_names=(EVIL, "joint2"))
    page = page_of(replace(move, name=EVIL), robot=robot, title=EVIL)
    clean = page_of(judged()[1], robot=judged()[0])
    assert page.count("<script") == clean.count("<script") and "<img" not in page
    assert page.count("{{viewer}}") > 0  # as text: nothing was put in its place
    data = json.loads(re.search(r'id="armdyn-data">(.*?)</script>', page, re.S)[1])
    assert data["joints"][0] == EVIL


def test_a_planar_arms_report_is_small():
    robot, move = judged()
    assert len(page_of(move, robot=robot).encode()) < 2e6


@pytest.mark.slow
def test_a_pandas_report_is_not_large():
    robot = ad.Robot.from_library("panda")
    home = np.array([0, -0.3, 0, -2.2, 0, 2, 0.8])
    moves = [
        ShownMotion(name, quintic(robot, home, home + rise, 0.8), Facts()) for name, rise in (("a", 0.4), ("b", 0.2))
    ]
    assert len(page_of(*moves, robot=robot).encode()) < 8e6


def test_limits_of_the_problem_are_listed_with_their_worst():
    conditions = [
        {"name": "jerk limits", "share": 0.5, "said": "50 of 100 rad/s³ at most, by 'joint1'", "reasons": []},
        {"name": "speed of 'tip'", "share": 1.2, "said": "1.2 m/s at most, of 1 m/s", "reasons": ["too fast"]},
        {"name": "via points", "share": None, "said": "at 0.1 s", "reasons": []},
    ]
    robot, move = judged(conditions=conditions, reserve={"effort": [0.1, 0.1], "velocity": [0, 0]})
    page = page_of(move, robot=robot)
    section = page[page.index("Path constraints") :]
    section = " ".join(text_of(section[: section.index("</section>")]).split())
    assert "jerk limits 50 of 100 rad/s³ at most, by 'joint1' 50 % yes" in section.replace("&#x27;", "'")
    assert "1.2 m/s at most, of 1 m/s 120 % no" in section and "via points" not in section
    assert "kept for feedback 10 % of torque limits" in section


def test_costs_of_the_controllers_conditions_are_listed():
    priced = (
        ConditionCost("torque_rate", 0.9995, 0.494, 0.0229),
        ConditionCost("jerk", 0.5, reason="the motion stays below its limit"),
        ConditionCost("velocity", 1.0, None, None),
        ConditionCost("acceleration", 1.0, 0.5, 1e-9),
    )
    costs = [asdict(one) | {"said": one.said} for one in priced]
    robot, move = judged(controller={"preset": "franka-panda", "interface": "torque", "costs": costs})
    page = page_of(move, robot=robot)
    section = page[page.index("Costs of the controller") :]
    section = " ".join(text_of(section[: section.index("</section>")]).split())
    assert "franka-panda, torque interface" in section
    assert "torque rate 99.95 % at least 22.9 ms, 4.4 % of the time: 0.4940 s without it" in section
    assert "jerk 50 % nothing, the motion stays below its limit" in section
    assert "velocity 100 % unknown, no motion was found without it" in section
    assert "acceleration 100 % nothing, without it no faster motion was found" in section  # a cost of rounding
    assert "Costs of the controller" not in page_of(judged()[1], robot=robot)


def test_paths_are_shown_without_their_folders():
    command = "armdyn mintime '/home/me/my arms/arm.urdf' --q-start=-pi/2,0 --obstacle=/tmp/box.json --out ~/runs/one"
    options = {
        "robot": "/home/me/my arms/arm.urdf",
        "obstacle": ["/tmp/box.json", "sphere:1@0,0,0"],
        "q_start": "pi/2,0",
    }
    robot, move = judged(
        request={"command": command, "options": options}, model={"source": "/home/me/my arms/arm.urdf"}
    )
    page = page_of(move, robot=robot)
    assert "armdyn mintime arm.urdf --q-start=-pi/2,0 --obstacle=box.json --out one" in page
    assert not re.search("/home|my arms|/tmp|~", text_of(page)) and "box.json, sphere:1@0,0,0" in page


def test_of_several_motions_their_times_are_seen_first():
    robot, move = judged()
    loop = quintic(robot, [0, 0], [1, 1], 10.0, "PID")
    moves = [move, ShownMotion("PID", loop, Facts({"arrival_time": 0.42, "arrival_rule": "all_joints"}))]
    report = report_of(Subject.of(robot), moves)
    assert [(tile.label, tile.value) for tile in report.tiles] == [("minimum time", "0.2100 s"), ("PID", "0.4200 s")]
    assert report.tiles[1].note == "+100.0 %, arrived"
    # The loop was watched for 10 s and is there after 0.42: a fifth more of it is seen at first.
    assert report.data["seen"] == pytest.approx(1.2 * 0.42)
    assert report_of(Subject.of(robot), moves, end=0.5).data["seen"] is None
    assert report_of(Subject.of(robot), [move]).data["seen"] is None


def test_a_robot_that_is_not_at_hand():
    robot, move = judged()
    subject = Subject("rr", robot.joint_names, robot.limits, (False, False))
    report = report_of(subject, [move])
    assert report.data["scene"] is None
    assert len(report_html(report).encode()) < 2e6


def test_bad_input():
    robot, move = judged()
    with pytest.raises(TrajectoryError, match="1 to 5"):
        report_of(Subject.of(robot), [])
    with pytest.raises(TrajectoryError, match="2 joints"):
        report_of(Subject.of(ad.Robot.from_spec(ad.ArmSpec.paper("rrr"))), [move])


def test_torque_speed_curves_are_drawn_with_the_motion_inside():
    robot, move = judged()
    assert 'id="motors"' not in page_of(move, robot=robot)
    robot = robot.with_torque_speed({"joint1": [[0, 3], [4, 3], [16, 1]]})  # 8 rad/s: 7/3 N m
    page = page_of(move, robot=robot)
    (section,) = re.findall(r'<section[^>]*id="motors".*?</section>', page, flags=re.S)
    assert section.count("<polygon") == 1 and section.count("<polyline") == 1 and "joint1: ±16 rad/s" in section
    (joints,) = re.findall(r'<section[^>]*id="joints".*?</section>', page, flags=re.S)
    assert "129 %" in joints and "over" in joints  # 3 of 7/3 N m, since this motion knows nothing of the curve


def test_seconds_that_more_of_a_limit_saves_are_no_powers_of_ten_of_ms():
    facts = Facts({"decides": [{"joint": "j", "limit": "velocity limit", "part": 1.0}], "calm": 0.137})
    section = deciding_section(facts, 300.0)
    assert "1 % more saves at most 3 s" in section.body and "140 ms are given" in section.body
    again = {"joint": "j", "limit": "velocity limit", "part": 1.0, "saved": 1e-6, "ties": ["k's jerk limit"]}
    assert (
        "1 % more saves 0.001 ms, as k&#x27;s jerk limit ties with it"
        in deciding_section(Facts({"decides": [again]}), 300.0).body
    )


def test_a_motion_without_a_result_is_not_said_to_be_of_another_planner():
    verdict = verdict_of(Facts({"feasible": True, "replay_error": 1e-9, "growth": 1.0}))
    assert verdict.headline == "Keeps its limits" and "planner" not in verdict.said


@pytest.mark.parametrize(
    ("effort", "words"),
    [(False, "Slower motions that are optimal"), (True, "cost more time and effort together (J) than this;")],
)
def test_other_optima_say_what_they_are_compared_by_and_their_differences_in_per_cent(effort, words):
    section = optima_section(Facts({"local_optima": [0.18, 0.22, 0.44], "pays_effort": effort}), 0.2)
    said = " ".join(text_of(section.body).split())
    assert words in said
    assert all(one in said for one in ("0.1800 s -10 %", "0.2200 s +10 %", "0.4400 s +120 %")), said


@pytest.mark.parametrize(("effort", "words"), [(False, "the next one takes"), (True, "the fastest of them takes")])
def test_the_next_optimum_is_the_fastest_only_where_time_alone_is_paid(effort, words):
    notes = [tile.note for tile in tiles_of(judged(pays_effort=effort)[1].facts, 0.21, [False, False])]
    assert f"{words} 0.2125 s" in notes
