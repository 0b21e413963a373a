"""One motion with more and more payload."""

from dataclasses import replace

import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal import Status
from armdyn.optimal.verify.optimum import trajectory_cost
from armdyn.studies.continuation import continuation
from armdyn.studies.tasks import minimum_time as module
from problems import paper_problem


@pytest.mark.slow
def test_same_optima_as_each_for_itself():
    masses, order = (0.0518, 0.1006, 0.2), []
    solutions = continuation(
        [paper_problem("rr", mass) for mass in masses], done=lambda k, s: order.append((k, s.duration))
    )
    alone = [ad.solve_minimum_time(paper_problem("rr", mass)) for mass in masses]
    assert all(solution.certificate.ok for solution in solutions)
    # Both are certified to 1e-9 relative; two searches may stop at different multiples of rounding below that.
    assert [s.duration for s in solutions] == pytest.approx([s.duration for s in alone], rel=1e-8)
    assert order == [(k, solution.duration) for k, solution in enumerate(solutions)]


@pytest.mark.slow
def test_time_and_energy_as_each_for_itself():
    problems = [paper_problem("rr", mass, effort_weight=1.0, effort_limit=30.0) for mass in (0.1006, 0.1219)]
    # The reference's J: collocation of another kind, on finer and finer meshes.
    known = (0.5577320121886695, 0.5781908970767553)
    for solution, best in zip(continuation(problems), known, strict=True):
        assert solution.certified
        assert trajectory_cost(solution.trajectory, 1.0) == pytest.approx(best, rel=1e-7)


@pytest.mark.slow
def test_a_neighbour_leads_where_a_search_of_its_own_does_not():
    """RRR with 121.9 g: five guesses miss the optimum that the neighbour of 100.6 g leads to by 7 percent."""
    few = ad.MinimumTimeOptions(starts=5)
    problems = [paper_problem("rrr", mass) for mass in (0.1006, 0.1219)]
    solutions = continuation(problems, few)
    assert all(solution.success for solution in solutions)
    assert solutions[1].duration < 0.95 * ad.solve_minimum_time(problems[1], few).duration
    # The slope that the first one's multipliers give is that of the branch: the rest is curvature.
    assert solutions[0].sensitivities().payload_mass * 0.0213 == pytest.approx(
        solutions[1].duration - solutions[0].duration, rel=0.05
    )


@pytest.mark.slow
def test_a_larger_arm_with_more_and_more_payload():
    start, goal = [0, -1, 1, -1, -1.5, 0], [-1.5, -1.8, 1.6, -0.4, 0.3, 1.0]
    arms = [ad.Robot.from_library("ur5", payload=ad.Payload(mass=mass)) for mass in (1.0, 5.0)]
    problems = [ad.MinimumTimeProblem(arm, q_start=start, q_goal=goal) for arm in arms]
    first, second = continuation(problems)
    assert first.success and second.success
    # The straight way is among the guesses of the second, too.
    assert second.duration <= ad.solve_minimum_time(problems[1]).duration * (1 + 1e-9)
    # Velocity limits shape the motion: payload matters in its ramps only.
    assert problems[0].duration_bound() < first.duration == pytest.approx(second.duration, rel=0.02)


def test_the_way_back_takes_a_later_searchs_optimum(monkeypatch):
    """Where the first search is sent astray, the second problem's optimum puts it right."""
    solve, calls = module.solve_minimum_time, []

    def astray(problem, options, progress):
        calls.append(len(options.guesses))
        solution = solve(problem, options, progress)
        # A slower motion of other arcs, as a poor search would have left.
        return replace(solution, duration=2 * solution.duration, arcs=()) if len(calls) == 1 else solution

    monkeypatch.setattr(module, "solve_minimum_time", astray)
    solutions = continuation([paper_problem("r", 0.1), paper_problem("r", 0.11)])
    assert calls == [0, 1, 1]
    monkeypatch.undo()
    assert solutions[0].duration == pytest.approx(ad.solve_minimum_time(paper_problem("r", 0.1)).duration, rel=1e-9)


def test_interruption_keeps_the_results_so_far(monkeypatch):
    solve, calls = module.solve_minimum_time, []

    def interrupted(problem, options, progress):
        calls.append(problem)
        solution = solve(problem, options, progress)
        return replace(solution, status=Status.INTERRUPTED, success=False) if len(calls) == 2 else solution

    monkeypatch.setattr(module, "solve_minimum_time", interrupted)
    solutions = continuation([paper_problem("r", mass) for mass in (0.1, 0.11, 0.12)])
    assert len(solutions) == len(calls) == 2
    assert solutions[0].success and solutions[1].status is Status.INTERRUPTED


def test_nothing_and_nonsense():
    assert continuation([]) == ()
    with pytest.raises(ProblemError, match=r"problems\[1\] moves joint1, joint2; the first moves joint1"):
        continuation([paper_problem("r", 0.1), paper_problem("rr", 0.1)])
    guess = ad.solve_minimum_time(paper_problem("r", 0.1)).trajectory
    with pytest.raises(ProblemError, match=r"guesses\[0\] moves 1 joint, rr has 2"):
        ad.solve_minimum_time(paper_problem("rr", 0.1), ad.MinimumTimeOptions(guesses=(guess,)))
