"""Sections 6.1 to 6.3: claims held against motions, real and made up."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.paper.claims.statements import Check, Statement, statements
from armdyn.paper.outcomes.case import Case
from paper.computed import outcome, outcomes

TOPICS = ["Total time", "Oscillations", "Range of speeds", "Effect of payloads", "Stability"]


def by_topic(arm, of=None):
    return {item.topic: item for item in statements(arm, outcomes() if of is None else of)}


def check(item, words):
    found = [one for one in item.checks if words in one.claim]
    assert len(found) == 1, [one.claim for one in item.checks]
    return found[0]


@pytest.mark.slow
def test_statements_on_one_link():
    items = by_topic("r")
    assert list(items) == TOPICS
    assert [item.item for item in items.values()] == ["(i)", "(ii)", "(iii)", "(iv)", "(v)"]
    assert {item.section for item in items.values()} == {"6.1"}

    times = items["Total time"]
    assert check(times, "minimum time of Example 1 is 0.331 s").holds is False
    assert check(times, "there after 4.317 s").holds
    assert check(times, "takes longer").holds

    swings = items["Oscillations"]
    assert check(swings, "range of positions").holds is False
    assert check(swings, "range of velocities").holds
    assert check(swings, "range of torques").holds
    assert check(swings, "less oscillation").holds is False
    assert check(swings, "almost 3 oscillations").holds is False
    assert "Reversals 0 against 3" in check(swings, "less oscillation").finding

    assert items["Range of speeds"].verdict == "supported"
    payloads = items["Effect of payloads"]
    assert check(payloads, "minimum time, payload at the tip").holds
    assert check(payloads, "PID loop, m → m + M").holds
    falls = check(payloads, "PID loop, payload at the tip")
    assert falls.holds is False and "it falls" in falls.finding

    stays = items["Stability"]
    assert stays.verdict == "supported"
    assert "-1.096 1/s: stable" in check(stays, "stays stable").finding


def test_an_unstable_loop_is_found_out():
    items = by_topic("rrr")
    stable, printed, _ = items["Stability"].checks
    assert stable.holds is False and "+1.303 1/s: unstable" in stable.finding
    assert "(7) as printed" in printed.claim and ": stable" in printed.finding
    assert check(items["Total time"], "there after 6.235 s").holds is False


def test_missing_outcomes_are_not_judged():
    items = by_topic("rr")
    assert items["Range of speeds"].verdict == "not computed"
    assert check(items["Total time"], "minimum time").holds is None
    assert check(items["Total time"], "takes longer").holds is None
    assert all(item.verdict != "supported" for item in by_topic("rr", []).values() if item.topic != "Stability")


def test_a_payload_that_does_not_arrive_is_counted():
    one = check(by_topic("rr")["Effect of payloads"], "PID loop, payload at the tip")
    assert one.holds is False
    assert "1 of 2 payloads has no time" in one.finding


def test_verdict_is_over_possible_checks():
    def verdict(*holds):
        return Statement("6.1", "(i)", "x", tuple(Check("", "", one) for one in holds)).verdict

    assert verdict(True, True, None) == "supported"
    assert verdict(True, False) == "partly supported"
    assert verdict(False, None) == "not supported"
    assert verdict(None) == verdict() == "not computed"


def test_claims_follow_the_motions():
    """The same claims of a made-up arm that oscillates most when it is time-optimal."""
    case, loop = Case(1, "r", "minimum_time", 0.1006), Case(4, "r", "pid", 0.1006)
    goal, start = case.q_goal[0], case.q_start[0]
    t = np.linspace(0, 1, 2001)

    def motion(turns):
        w = (2 * turns + 1) * np.pi
        q = goal + (start - goal) * np.cos(w * t / 2) ** 2
        v = -(start - goal) * w / 2 * np.sin(w * t)
        return ad.Trajectory(t=t, q=q[:, None], v=v[:, None], tau=np.cos(w * t)[:, None] * (turns + 1))

    made = [
        replace(outcome(case), trajectory=motion(3), time=0.331),
        replace(outcome(loop), trajectory=motion(0), time=0.2),
    ]
    items = by_topic("r", made)
    swings = items["Oscillations"]
    assert check(swings, "less oscillation").holds and check(swings, "almost 3").holds
    assert "Reversals 6 against 0" in check(swings, "less oscillation").finding
    assert check(items["Total time"], "0.331 s").holds
    assert check(items["Total time"], "takes longer").holds is False


@pytest.mark.parametrize("arm", ["r", "rr", "rrr"])
def test_findings_are_whole_sentences(arm):
    for item in statements(arm, outcomes()):
        for one in item.checks:
            for text in (one.claim, one.finding):
                assert text.endswith(".") and text == text.strip() and "nan" not in text and ".." not in text
