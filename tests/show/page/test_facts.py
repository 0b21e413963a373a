"""Untrusted facts are read, or empty; they never raise."""

import pytest

from armdyn.show.page.facts import Facts
from armdyn.show.page.motions import Subject
from armdyn.show.page.report import report_html, report_of
from show.page.runs import FACTS, judged

ODD = [None, True, -1, 1e308, 10**400, "text", [], [None, "x", 3, [], {}], {}, {"a": {}}]


def test_of_another_kind_is_nothing():
    facts = Facts({"a": "1", "b": True, "c": 10**400, "d": [1, "x", None], "e": {"f": 2}, "g": "x" * 10**5})
    assert facts.number("a") is None and facts.number("b") is None and facts.number("c") is None
    assert facts.numbers("d") == [1.0, None, None]
    assert facts.texts("d") == ["x"]
    assert facts.part("e").number("f") == 2 and facts.part("a").values == {}
    assert len(facts.text("g")) == 2000
    assert not facts.true("a") and facts.true("b")


@pytest.mark.parametrize("name", [*FACTS, "model", "reserve", "clearance", "conditions", "versions", "idle"])
def test_a_report_is_written_with_any_facts(name):
    robot, _ = judged()
    for odd in ODD:
        _, move = judged(**{name: odd})
        assert report_of(Subject.of(robot), [move]).sections
    report_html(report_of(Subject.of(robot), [move]))
