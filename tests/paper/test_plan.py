"""Which cases a plan takes, in which order, and which begins where another has ended."""

import pytest

from armdyn.errors import ProblemError
from armdyn.paper import EXAMPLES, PAYLOAD
from armdyn.paper.outcomes.case import Case
from armdyn.paper.plan import EXAMPLES_OF_PART, Plan, neighbour
from armdyn.paper.printed.examples import PAYLOADS


def test_everything_is_every_example_with_every_payload():
    cases = Plan().cases()
    assert len(cases) == len(set(cases))
    for one in EXAMPLES:
        assert {case.payload for case in cases if case.example == one.number} == set(PAYLOADS)
    kinds = {(case.arm, case.kind, case.reading) for case in cases}
    assert {("r", "minimum_time", "mM"), ("rr", "time_energy", "mM"), ("rrr", "minimum_time", "tip")} <= kinds
    assert any(case.variant == "printed" for case in cases)
    assert any(case.states == "example 2" for case in cases)
    shown = [case.payload == PAYLOAD for case in cases]
    assert shown == sorted(shown, reverse=True)  # something to look at comes first
    # Of the others the longest come first, so that no core waits for one at the end.
    first, last = cases[sum(shown)], cases[-1]
    assert (first.arm, first.kind, last.kind) == ("rrr", "minimum_time", "pid")


@pytest.mark.parametrize("part", EXAMPLES_OF_PART)
def test_a_part_takes_its_examples_only(part):
    cases = Plan(only=(part,)).cases()
    assert {case.example for case in cases} == set(EXAMPLES_OF_PART[part])
    payloads = {case.payload for case in cases}
    if part == "table3":
        assert not cases
    elif part.startswith("figure") or part == "table7":
        assert payloads == {PAYLOAD}  # the paper has them for this one alone
    else:
        assert payloads == set(PAYLOADS)


def test_payloads_and_rules_are_taken():
    plan = Plan(only=("example4",), payloads=(0.2, 0.3), arrival_rule="first_crossing")
    assert {case.payload for case in plan.cases()} == {0.2, 0.3} and plan.shown_payload == 0.2
    assert all(case.arrival_rule == "first_crossing" for case in plan.cases())
    assert Plan(payloads=(0.2, PAYLOAD)).shown_payload == PAYLOAD == Plan().shown_payload


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"only": ("table9",)}, "no 'table9'"),
        ({"payloads": (-0.1,)}, "-0.1 kg"),
        ({"payloads": (float("nan"),)}, "nan kg"),
    ],
)
def test_plans_that_cannot_be_are_refused(given, message):
    with pytest.raises(ProblemError, match=message):
        Plan(**given)


def test_neighbours_lead_from_the_payload_that_is_shown_outwards():
    cases = Plan().cases()
    led = {
        round(1000 * case.payload, 1): round(1000 * near.payload, 1)
        for case in cases
        if case.arm == "rrr" and case.kind == "time_energy" and (near := neighbour(case, cases, PAYLOAD))
    }
    # 500 g is far from lighter payloads, and 100.6 g is the root.
    known = {21.2: 31.2, 31.2: 51.8, 51.8: 100.6, 121.9: 100.6, 130.7: 121.9, 150.5: 130.7, 200.0: 150.5, 1000.0: 500.0}
    assert led == known


def test_of_minimum_time_1_kg_is_searched_alone():
    cases = Plan().cases()
    heavy = next(case for case in cases if (case.arm, case.kind, case.payload) == ("rrr", "minimum_time", 1.0))
    assert neighbour(heavy, cases, PAYLOAD) is None


def test_a_neighbour_is_the_same_case_but_for_the_payload():
    cases = Plan().cases()
    for case in cases:
        near = neighbour(case, cases, PAYLOAD)
        if near is not None:
            assert (near.example, near.kind, near.reading) == (case.example, case.kind, case.reading)


@pytest.mark.parametrize("case", [Case(4, "r", "pid", 0.1219), Case(1, "r", "time_energy", 0.1219)])
def test_loops_and_one_joint_take_no_neighbour(case):
    assert neighbour(case, Plan().cases(), PAYLOAD) is None
