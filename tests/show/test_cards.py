"""Cards of a notebook: their content, with names from files as text."""

import dataclasses
import html.parser

import numpy as np
import pytest
from lxml import etree

import armdyn as ad
from armdyn.show.values import card
from problems import POSES

EVIL = "<script>alert(1)</script>--><img src=x onerror=alert(2)>\"'&$x$"


@pytest.fixture(scope="module")
def robot():
    return ad.Robot.from_spec(ad.ArmSpec.paper("rr"))


@pytest.fixture(scope="module")
def problem(robot):
    start, goal = POSES["rr"]
    return ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, via=[[0.0, 0.0]])


@pytest.fixture(scope="module")
def solution(robot):
    start, goal = POSES["rr"]
    plain = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)
    return ad.solve_minimum_time(plain, ad.MinimumTimeOptions(search="quick"))


@pytest.fixture(scope="module")
def run(robot, solution):
    return ad.track(robot, solution.trajectory, ad.Lqr(), duration=0.5)


@pytest.fixture(scope="module")
def cards(robot, problem, solution, run):
    """The card of each value; to draw one takes a fifth of a second."""
    values = {"robot": robot, "problem": problem, "solution": solution, "motion": solution.trajectory, "run": run}
    return {name: value._repr_html_() for name, value in values.items()}


def text_of(markup):
    """The card's words; that it is well-formed is checked on the way."""
    return " ".join("".join(etree.fromstring(markup.replace("xlink:", "")).itertext()).split())


class Tags(html.parser.HTMLParser):
    """Elements and attributes as a browser's rules find them, comments included."""

    def __init__(self, markup):
        super().__init__()
        self.tags, self.attributes = set(), set()
        self.feed(markup)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.attributes |= {name for name, _ in attrs}


def test_a_robot(cards):
    words = text_of(cards["robot"])
    assert words.startswith("rr: 2 joints") and "tip" in words and "±3.142" in words


def test_a_problem(cards):
    words = text_of(cards["problem"])
    assert "Minimum time of rr" in words and "via points" in words and "-1.571" in words


def test_a_solution(cards, solution):
    words = text_of(cards["solution"])
    assert "locally optimal" in words and f"{solution.duration:.9f} s" in words and "time decided by" in words


@pytest.mark.slow
def test_a_motion_and_a_run(cards, solution, run):
    words = text_of(cards["motion"])
    assert "minimum time" in words and f"{solution.trajectory.t.size}" in words and "largest torque" in words
    words = text_of(cards["run"])
    assert run.message in words and "% of its limit" in words


@pytest.mark.slow
def test_every_card_has_a_picture_and_two_of_a_page_no_id_in_common(cards):
    ids = []
    for markup in cards.values():
        tree = etree.fromstring(markup.replace("xlink:", ""))
        assert tree.findall(".//svg") and len(markup) < 300_000
        ids += {each.get("id") for each in tree.iter() if each.get("id")}
    assert len(ids) == len(set(ids))


def test_a_long_motion_is_a_small_picture():
    t = np.linspace(0, 10, 50_000)
    q = np.sin(np.outer(t, [50.0, 61.0, 72.0]))
    assert len(ad.Trajectory(t, q, q, q)._repr_html_()) < 300_000


@pytest.mark.slow
def test_names_from_files_are_text(cards, robot, problem, solution, run):
    evil = dataclasses.replace(robot, name=EVIL, tip="tip", joint_names=(EVIL, f"{EVIL}2"), source=EVIL)
    motion = dataclasses.replace(solution.trajectory, name=EVIL, joint_names=evil.joint_names)
    request = problem.variant(robot=evil)
    found = dataclasses.replace(solution, problem=request, message=EVIL, trajectory=motion, decides=())
    values = (evil, request, found, motion, dataclasses.replace(run, trajectory=motion, message=EVIL))
    plain = Tags("".join(cards.values()))
    for markup in map(card, values):
        tags = Tags(markup)
        assert tags.tags <= plain.tags and "script" not in tags.tags and "img" not in tags.tags
        assert tags.attributes <= plain.attributes
        assert "alert(1)" in text_of(markup)


def test_a_motion_that_was_not_found_has_a_card(solution):
    none = dataclasses.replace(solution, moves=False, success=False, message="stopped")
    words = text_of(none._repr_html_())
    assert "stopped" in words and "duration" not in words


def test_of_other_things_there_is_none():
    with pytest.raises(TypeError, match="no card for dict"):
        card({})
