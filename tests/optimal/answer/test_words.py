"""Printed text of a solution."""

import dataclasses

import pytest

import armdyn as ad
from armdyn.optimal.answer.advice import advice
from armdyn.optimal.answer.words import standing, verdict
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import ON_CURVE, Certificate
from problems import POSES


@pytest.fixture(scope="module")
def solution():
    start, goal = POSES["rr"]
    problem = ad.MinimumTimeProblem(ad.Robot.from_spec(ad.ArmSpec.paper("rr")), q_start=start, q_goal=goal)
    return ad.solve_minimum_time(problem, ad.MinimumTimeOptions(search="quick"))


def test_print_says_duration_verdict_and_deciding_limits(solution):
    words = str(solution)
    assert words.startswith(f"The fastest motion found for rr, 2 joints, takes {solution.duration:.6f} s. ")
    assert "The motion is executable. Pontryagin's conditions hold along it" in words
    first = solution.decides[0]
    assert f"Its time is decided by {first.name} {100 * first.part:.3g} %, " in words and " ms." in words
    assert len(words.splitlines()) == 1 and words.endswith(".")


def test_print_says_the_bound(solution):
    bound = 0.98 * solution.duration
    proven = dataclasses.replace(solution.certificate, lower_bound=bound, gap=solution.duration / bound - 1)
    words = str(dataclasses.replace(solution, certificate=proven))
    assert "It is proven to be at most 2.05 % slower than the fastest possible." in words
    assert f"No motion is faster than {bound:.6f} s." in words


def test_a_bound_that_is_far_below_says_nothing(solution):
    """As a cycle's, which was "proven to be at most 12000 % slower"."""
    for times, useless in ((1.9, False), (121.0, True)):
        far = dataclasses.replace(solution.certificate, lower_bound=solution.duration / times, gap=times - 1)
        words = str(dataclasses.replace(solution, certificate=far))
        assert ("no useful lower bound is known" in words, "% slower" in words) == (useless, not useless)


def test_a_motion_certified_by_its_bound_is_reported_so(solution):
    bound = solution.duration / 1.0005
    near = dataclasses.replace(
        solution.certificate, hamiltonian_spread=float("inf"), lower_bound=bound, gap=solution.duration / bound - 1
    )
    words = str(dataclasses.replace(solution, certificate=near))
    assert "It is proven to be at most 0.05 % slower than the fastest possible." in words


def test_an_unusable_motion_is_reported(solution):
    missed = dataclasses.replace(solution.certificate, goal_error=0.1)
    short = dataclasses.replace(solution, certificate=missed, success=False, message="ends beside the goal")
    assert "The motion is not executable: ends beside the goal." in str(short) and "What you can do: " in str(short)
    assert verdict(short) == "not usable" and "decided by" not in str(short)


def test_only_options_above_their_defaults_are_advice_that_was_followed(solution):
    problem, weighted = solution.problem, solution.problem.variant(effort_weight=1.0)
    curve = ad.MinimumTimeProblem(ad.Robot.from_library("panda"), q_start="ready", q_goal=[0.5, 0, 0, -1.5, 0, 2, 0])
    useless = {"search": {"calm", "bound_programs"}}
    for own, numbers in ((problem, "search"), (weighted, "search"), (curve, "curves")):
        normal = getattr(Task.of(own).policy, numbers).starts
        for starts, followed in ((normal, set()), (normal + 1, {"starts"})):
            task = Task.of(own, ad.MinimumTimeOptions(starts=starts, max_intervals=100, search="quick"))
            others = useless.get(numbers, {"max_intervals", "bound_programs"})
            assert {*task.not_advised(Status.TIME_LIMIT)} == followed | others
    task = Task.of(problem, ad.MinimumTimeOptions(search="thorough", max_intervals=161))
    raised = {"search", "time_limit", "max_intervals"}
    assert {*task.not_advised(Status.SOLVED)} == raised | useless["search"]
    assert {*solution.followed} == {"time_limit"} | useless["search"]  # it did not end the search


def test_what_was_raised_is_advised_again_neither_with_a_motion_nor_without(solution):
    raised = {"search": "thorough", "max_intervals": 161}
    for options, named in (({}, True), ({"starts": 1}, True), ({"starts": 33}, False)):
        found = ad.solve_minimum_time(solution.problem, ad.MinimumTimeOptions(time_limit=1e-3, **raised, **options))
        (line,) = found.what_to_do
        assert not found.moves and "a longer `time_limit`" in line and "max_intervals" not in line
        assert ("`starts`" in line) == named
    for options, words in (({}, "try more `max_intervals` or more `starts`; "), (raised, "try more `starts`; ")):
        task = Task.of(solution.problem, ad.MinimumTimeOptions(**options))
        plain = dataclasses.replace(
            solution, phases=None, certificate=Certificate(0.0, 0.0, 0.0), followed=task.not_advised(solution.status)
        )
        assert f"its arcs were not resolved: {words}" in plain.what_to_do[0] == standing(plain)["missing"]["extremal"]
    followed = ("starts", "max_intervals", "time_limit")
    assert "resolved: try another `seed`; " in dataclasses.replace(plain, followed=followed).what_to_do[0]


def test_no_motion_has_no_duration(solution):
    none = dataclasses.replace(
        solution, moves=False, success=False, message="stopped", certificate=ad.Certificate(1.0, 1.0, 1.0)
    )
    assert str(none).startswith("No motion was found for rr, 2 joints: stopped.")
    assert f"{solution.duration:.4f}" not in str(none) and "no motion" in repr(none)


def test_advice_that_was_followed_is_not_given_again(solution):
    problem = ad.MinimumTimeProblem(ad.Robot.from_library("panda"), q_start="ready", q_goal=[0.5, 0, 0, -1.5, 0, 2, 0])
    plain = Certificate(0.0, 0.0, 0.0, lower_bound=1.0, gap=0.02, remark=ON_CURVE)
    curve = dataclasses.replace(solution, problem=problem, certificate=plain, phases=None)
    several = (), ("search",), ("search", "starts")
    said = [advice(dataclasses.replace(curve, followed=followed))["gap"] for followed in several]
    assert "`search` thorough or more `starts`" in said[0]
    assert "`search`" not in said[1] and "more `starts`" in said[1] and said[2].startswith("much of the gap")
