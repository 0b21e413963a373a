"""Which of many answers are one optimum."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import armdyn as ad
from armdyn.optimal.mesh.direct import Attempt
from armdyn.optimal.mesh.search import (
    agreeing,
    crossover_guesses,
    distinct,
    enough,
    find,
    grouped,
    ranked,
    search,
    within,
)
from armdyn.optimal.mesh.starts import SAMPLES, Guesses, crossover, spline
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.task import Task
from problems import paper_problem


def settings_of(task):
    """Meshes and solver settings of a search's guesses."""
    return [(intervals, one) for one in task.coarse() for intervals in task.policy.search.meshes]


STATUSES = st.sampled_from([ad.Status.SOLVED, ad.Status.SOLVED, ad.Status.FAILED, ad.Status.ITERATION_LIMIT])


def attempt(duration, status=ad.Status.SOLVED, intervals=15, q=0.0):
    motion = ad.Trajectory([0, duration], np.full((2, 1), q), np.zeros((2, 1)), np.zeros((2, 1)))
    return Attempt(status, "", motion, intervals, 1, None)


def durations(attempts):
    return [a.trajectory.duration for a in attempts]


ATTEMPTS = st.lists(st.builds(attempt, st.floats(0.1, 10), STATUSES, st.sampled_from([15, 25])), max_size=30)


@given(st.lists(st.floats(0.1, 10)), st.floats(0, 0.5))
def test_groups_lose_none_and_hold_those_like_their_first(numbers, same):
    alike = within(same)
    groups = grouped(sorted(numbers), alike)
    assert [number for group in groups for number in group] == sorted(numbers)
    assert all(alike(group[0], number) for group in groups for number in group)
    assert all(not alike(before[0], after[0]) for before, after in pairwise(groups))


@given(ATTEMPTS)
def test_ranked_loses_none_and_puts_converged_ones_first(attempts):
    order = ranked(attempts)
    assert sorted(map(id, order)) == sorted(map(id, attempts))
    converged = [a.status is ad.Status.SOLVED for a in order]
    assert converged == sorted(converged, reverse=True)
    assert durations(order[: sum(converged)]) == sorted(durations(order[: sum(converged)]))


@given(ATTEMPTS)
def test_distinct_ones_converged_and_all_that_did_are_near_one_of_them(attempts):
    same = 0.01
    kept = distinct(attempts, same)
    assert all(a.status is ad.Status.SOLVED for a in kept)
    solved = [a for a in attempts if a.status is ad.Status.SOLVED]
    assert bool(kept) == bool(solved)
    # A group reaches `same` beyond its best, and the finest mesh's speaks for it.
    assert all(b > a for a, b in pairwise(durations(kept)))
    assert all(any(abs(d / k - 1) <= 2.1 * same for k in durations(kept)) for d in durations(solved))
    if solved:
        assert kept[0].trajectory.duration <= min(durations(solved)) * (1 + same)
    assert len(distinct(kept, 0.0)) == len(kept)


def test_distinct_keeps_the_best_of_each():
    found = distinct([attempt(1.0), attempt(1.001), attempt(1.1), attempt(2.0, ad.Status.FAILED)], 2e-3)
    assert durations(found) == [1.0, 1.1]


def test_the_finer_mesh_speaks_for_an_optimum():
    found = distinct([attempt(1.0), attempt(1.001, intervals=25), attempt(1.1)], 2e-3)
    assert [a.intervals for a in found] == [25, 15]


@given(ATTEMPTS)
def test_motions_that_are_alike_differ_by_their_durations_alone(attempts):
    assert distinct(attempts, 0.01, apart=0.3) == distinct(attempts, 0.01)


def test_of_one_duration_motions_far_apart_are_two_optima():
    attempts = [attempt(1.0), attempt(1.0005, q=0.5), attempt(1.001, q=0.4)]
    assert durations(distinct(attempts, 2e-3)) == [1.0]
    assert durations(distinct(attempts, 2e-3, apart=0.3)) == [1.0, 1.0005]


PROBLEM = paper_problem("rrr")
POLICY = Policy.of(PROBLEM).search
PARENTS = [spline(PROBLEM, [np.array(via)]) for via in ([0.5, -1.0, 1.0], [-1.0, 2.0, 3.0], [2.0, 0.0, -2.0])]


@pytest.mark.parametrize(("optima", "guesses"), [(1, 7), (2, 16), (3, 29), (4, 46), (5, 67)])
def test_enough_guesses_by_the_rule(optima, guesses):
    """W (n - 1) / (n - W - 2) <= W + 1/2 is n >= 2 W² + 3 W + 2."""
    assert guesses == 2 * optima**2 + 3 * optima + 2
    assert not enough(guesses - 1, optima) and enough(guesses, optima)


@given(st.integers(0, 200), st.integers(1, 40))
def test_enough_is_monotonic_in_guesses_and_optima(solved, optima):
    if enough(solved, optima):
        assert enough(solved + 1, optima)
        assert optima == 1 or enough(solved, optima - 1)


@given(st.lists(st.floats(0.1, 10)), st.floats(0, 0.5))
def test_agreeing_costs_are_those_near_the_least(costs, slower):
    near = [cost <= min(costs) * (1 + slower) for cost in costs]
    assert agreeing(sorted(costs), slower) == (np.mean(near) if costs else 1.0)


def progress_of(problem, **numbers):
    """What a search with other numbers says."""
    said = []
    task = Task.of(problem, MinimumTimeOptions(workers=1), progress=said.append)
    task = replace(task, policy=task.policy.changed("search", **numbers))
    find(task)
    return said


def test_many_guesses_end_where_nearly_all_lead_to_the_best():
    near = PROBLEM.variant(q_goal=PROBLEM.q_start + 0.3)  # a short way: one optimum
    ended, whole = (progress_of(near, starts=60, tested=8, alike=share) for share in (0.8, 1.1))
    assert any("guess 36 of 36" in each for each in whole) and any("child" in each for each in whole)
    assert any("guess 8 of 36" in each for each in ended) and not any("child" in each for each in ended)
    assert not any("guess 12 of 36" in each for each in ended)


def test_as_many_guesses_follow_where_few_lead_to_the_best():
    once, twice = (progress_of(PROBLEM, starts=5, scattered=share) for share in (0.0, 1.1))
    assert sum("guess 3 of 3" in each for each in once) == 1
    assert sum("guess 3 of 3" in each for each in twice) == 2


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))])
def test_two_optima_in_eighteen_guesses_are_not_all(seed):
    # With seed 0 the first 18 guesses meet two optima; the rule alone stopped there, 2.5 % above the best.
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rrr"), ad.Payload(mass=0.19294733258132388))
    start = [-1.869881403849072, -1.107083679785835, -0.4812790536802387]
    goal = [-1.8499273272589185, 1.034333397049223, -2.646961662238542]
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(seed=seed))
    assert solution.certified, solution.message
    assert solution.duration == pytest.approx(0.202300272, rel=1e-7)


@pytest.mark.slow
def test_one_optimum_in_sixty_guesses_is_not_all():
    # Sixty random guesses meet one optimum, 5.9 % above one that changes of it lead to.
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rrr"), ad.Payload(mass=0.10971324773677378))
    start = [2.830885167286576, 1.2244864070872925, 0.7769804054725773]
    goal = [1.602303546985627, 1.831530582499113, 1.0189342293009767]
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)
    solution = ad.solve_minimum_time(problem)
    assert solution.certified, solution.message
    assert solution.duration == pytest.approx(0.190948654, rel=1e-7)


def child(problem, parents, seed, number, policy=POLICY):
    """Crossover or mutation of some motions."""
    guesses = crossover(problem, Guesses.sampled(parents, SAMPLES), np.random.default_rng(seed), number, policy)
    return guesses.motion(0, problem.robot.joint_names)


@given(number=st.integers(0, 50), seed=st.integers(0, 2**16), many=st.integers(1, 3))
def test_a_child_goes_from_start_to_goal_within_its_limits(number, seed, many):
    guess = child(PROBLEM, PARENTS[:many], seed, number)
    np.testing.assert_allclose(guess.q[[0, -1]], [PROBLEM.q_start, PROBLEM.q_goal], atol=1e-12)
    limits = PROBLEM.limits
    assert np.all(limits.position_lower <= guess.q) and np.all(guess.q <= limits.position_upper)
    assert np.all(limits.effort_lower <= guess.tau) and np.all(guess.tau <= limits.effort_upper)
    again = child(PROBLEM, PARENTS[:many], seed, number)
    np.testing.assert_array_equal(guess.q, again.q)


@given(seed=st.integers(0, 2**16))
def test_mutations_of_all_joints_crossover_and_mutations_of_one_joint_alternate(seed):
    """Mutation of all joints, crossover, mutation of one joint. The only parent's other joints are its own."""
    alone = paper_problem("rrr", position_limit=(-np.inf, np.inf))
    bent, moved = (child(alone, PARENTS[:1], seed, number) for number in (0, 2))
    crossed = child(alone, PARENTS[:2], seed, 1)

    def own(guess, parent):
        s = np.linspace(0, 1, len(guess.t))
        return np.max(np.abs(guess.q - parent(s * parent.duration).q), axis=0) < 1e-12

    assert np.sum(own(bent, PARENTS[0])) == 0
    assert np.sum(own(moved, PARENTS[0])) == 2
    of_first, of_second = own(crossed, PARENTS[0]), own(crossed, PARENTS[1])
    assert np.all(of_first ^ of_second) and 0 < np.sum(of_first) < 3


@given(number=st.sampled_from([0, 2]), seed=st.integers(0, 2**16))
def test_a_childs_velocities_are_the_derivative_of_its_positions(number, seed):
    free = paper_problem("rrr", position_limit=(-np.inf, np.inf))
    guess = child(free, PARENTS[:1], seed, number)
    slopes = np.gradient(guess.q, guess.t, axis=0)[2:-2]
    # Central differences of a way whose third derivative is at most some 1e3 of its size, over a fiftieth of it.
    assert np.max(np.abs(guess.v[2:-2] - slopes)) <= 0.05 * np.max(np.abs(guess.v))


@pytest.mark.slow
def test_crossover_is_the_same_on_any_number_of_cores_and_finds_better_optima():
    def found(workers):
        task = Task.of(PROBLEM, MinimumTimeOptions(workers=workers))
        settings = settings_of(task)
        first = search(task, 12, settings)
        return first, crossover_guesses(task, first, 24, settings)

    (first, alone), (_, together) = found(1), found(2)
    assert len(alone) == 24
    assert [a.trajectory.duration for a in alone] == [a.trajectory.duration for a in together]
    best, better = (min(a.trajectory.duration for a in some if a.usable) for some in (first, alone))
    assert better <= best * (1 + 1e-3)  # coarse durations of one optimum differ by that


def test_without_optima_there_is_no_crossover():
    task = Task.of(PROBLEM, MinimumTimeOptions(workers=1))
    first = search(task, 1, settings_of(task))
    failed = [replace(attempt, status=type(attempt.status).FAILED) for attempt in first]
    assert crossover_guesses(task, failed, 6, settings_of(task)) == []


def test_later_children_of_the_same_ancestors_are_different():
    task = Task.of(PROBLEM, MinimumTimeOptions(workers=1))
    settings = settings_of(task)
    ancestors = search(task, 4, settings)
    both, later = (
        crossover_guesses(task, ancestors, 4, settings),
        crossover_guesses(task, ancestors, 2, settings, first=2),
    )
    # Changes of one round depend on their numbers and their ancestors alone.
    assert [a.trajectory.duration for a in later] == [a.trajectory.duration for a in both[2:]]
    assert len({a.trajectory.duration for a in both}) == 4


@pytest.mark.parametrize(
    ("field", "number"),
    [
        ("midpoint_spread", 0),
        ("least_spread", 0),
        ("joint_offset", 2),
        ("mutation_duration", 0),
        ("selection_scale", 0),
    ],
)
def test_the_policys_numbers_make_the_changes(field, number):
    """A number of the policy that is changed is a change of some guess: nothing reads the class."""
    still = PROBLEM.variant(q_goal=PROBLEM.q_start + np.array([1e-3, 0, 0]))
    other = replace(POLICY, **{field: 1.5 * getattr(POLICY, field)})

    def guesses(policy):
        return [child(still, PARENTS, seed, number, policy) for seed in range(20)]

    assert any(
        a.q.tobytes() + a.t.tobytes() != b.q.tobytes() + b.t.tobytes()
        for a, b in zip(guesses(POLICY), guesses(other), strict=True)
    )
