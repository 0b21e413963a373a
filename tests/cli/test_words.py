"""Text of a solution on a terminal."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

import armdyn as ad
from armdyn.cli.invocation import in_options
from armdyn.cli.options.joints import carried_facts, carried_words
from armdyn.models.scene.collision import Clearance
from armdyn.optimal.answer.words import replay_words, solution_words, title_words
from armdyn.optimal.verify.certificate import Certificate
from problems import solved


def failure(**changes):
    nothing = Certificate(np.inf, np.inf, np.inf, remark="no motion was found")
    parts = {"phases": None, "arcs": (), "certificate": nothing, "moves": False, "message": "no motion was found"}
    return replace(solved("r"), **(parts | {"success": False, "status": ad.Status.INFEASIBLE} | changes))


def test_a_failure_pretends_no_digits():
    words = solution_words(failure())
    assert "duration" not in words and "lands" not in words
    assert not any("inf" in said.split() for said in words.values())
    assert title_words(failure()) == "infeasible, no motion to the goal"


def test_a_success_has_all_of_them():
    solution = solved("r")
    assert solution_words(solution)["duration"] == f"{solution.duration:.9f} s"
    assert title_words(solution) == f"minimum time {solution.duration:.4f} s, locally optimal (Pontryagin)"


def test_the_tutorial_explains_lines_that_there_are():
    steps = (Path(__file__).parents[2] / "docs" / "tutorial.md").read_text().partition("## 2.")[0]
    explained = re.findall(r"^- \*\*(.+?)\*\*", steps, flags=re.M)
    assert len(explained) == 5 and set(explained) <= set(solution_words(solved("rr")))


def test_the_nearest_distance_is_said_once():
    near = Clearance(0.02, 0.1, "link2", "post", sure=True)
    assert "nearest" not in solution_words(replace(solved("r"), clearance=near))  # the check of the clearance says it
    assert solution_words(failure(clearance=near))["nearest"] == "'link2' is 20.0 mm from 'post' at t = 0.1 s"


def test_the_best_motion_so_far_is_named_so():
    best = failure(moves=True, status=ad.Status.TIME_LIMIT, certificate=solved("r").certificate)
    assert title_words(best) == f"time limit, best so far {best.duration:.4f} s"
    assert "duration" not in solution_words(best)


def bounded(gap, **changes):
    """A solution whose lower bound is so far below it; by default no extremal."""
    solution = solved("r")
    certificate = replace(solution.certificate, **({"hamiltonian_spread": 1.0} | changes))
    return replace(solution, certificate=certificate.bounded(solution.duration / (1 + gap), solution.duration))


def test_the_checks_are_said_apart():
    words = solution_words(solved("r"))
    assert words["verdict"].startswith("The motion is executable. Pontryagin's conditions hold")
    assert words["lands"].startswith("yes: open-loop replay") and words["keeps its limits"].startswith("yes: ")
    assert words["extremal"].startswith("yes: |H| ≤ ") and "adjoint equations to " in words["extremal"]
    assert words["time decided by"].startswith("joint1's torque limit 4")
    assert words["lower bound"] == "none was computed" and not {"idle", "what you can do"} & set(words)


def test_a_small_gap_certifies_and_a_larger_one_has_a_remedy():
    assert title_words(bounded(4e-4)).endswith(" s, proven within 0.04 % of the fastest")
    near, far = (solution_words(bounded(gap)) for gap in (4e-4, 2e-2))
    slower = "The motion is executable. It is proven to be at most {} % slower than the fastest possible."
    assert near["verdict"] == slower.format("0.04") and far["verdict"] == slower.format("2")
    assert near["extremal"].startswith("no: ") and "what you can do" not in near
    assert near["lower bound"].startswith("yes: at most 0.04 % above the lower bound of 0.17")
    assert title_words(bounded(2e-2)).endswith(" s, proven within 2 % of the fastest")
    assert "`starts`" in far["what you can do"]
    unproven = bounded(4e-4, goal_error=1e-5)
    assert unproven.certificate.reasons[0] in solution_words(unproven)["verdict"]
    assert "about 0.04 %" in solution_words(unproven)["lower bound"]
    assert title_words(unproven).endswith(" s, not proven optimal")


def test_idle_joints_are_named():
    assert "no part of the time is decided by joint2" in solution_words(bounded(0.0, idle=("joint2",)))["idle"]


def test_an_unusable_motion_has_its_remedies_first():
    words = solution_words(failure())
    assert words["verdict"] == "No motion was found: no motion was found." and "lands" not in words
    advice = in_options(words["what you can do"])
    assert "--starts" in advice and "--time-limit" not in advice  # which did not end the search


def test_the_tip_and_the_payloads_place():
    box = ad.Box((0.1, 0.1, 0.1), (0, 0, 0))
    payload = ad.Payload(mass=2.0, com=(0, 0, 0.05), shapes=[box])
    robot = ad.Robot.from_library("panda", payload=payload, tool=ad.Tool(mass=0.5, tip=(0, 0, 0.1)))
    words = carried_words(robot)
    assert words["tip"] == "'tool'"
    hand, load = words["carries"].splitlines()
    assert hand == "tool of 0.5 kg in the frame 'panda_hand_tcp'"
    assert load == "payload of 2 kg at (0, 0, 0.05) m in the frame 'tool', 1 shape"
    assert [body["frame"] for body in carried_facts(robot)["carried"]] == ["panda_hand_tcp", "tool"]
    assert carried_words(ad.Robot.from_library("panda")) == {"tip": "'panda_hand_tcp'"}


def test_the_replay_is_in_the_units_of_the_joints():
    missed = replace(bounded(0.0).certificate, goal_error=0.1, goal_velocity_error=0.3, gap=None)
    for slides, unit, speed in (((True, False), "rad or m", "rad/s or m/s"), ((True,), "m", "m/s")):
        certificate = replace(missed, slides=slides)
        assert f" {unit} of the goal" in replay_words(certificate)
        position, velocity = (one for one in certificate.reasons if "misses" in one)
        assert position.endswith(f" 0.1 {unit}") and velocity.endswith(f" 0.3 {speed}")
