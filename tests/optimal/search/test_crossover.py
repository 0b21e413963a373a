"""Changes of optima: motions to begin with, and the same for the same seed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armdyn.optimal.program.guesses import Guesses
from armdyn.optimal.search.multistart import SearchSettings, crossover, crossover_guesses, search
from armdyn.optimal.search.starts import SAMPLES, spline
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.policy.policy import Policy
from armdyn.optimal.task.task import Task
from problems import paper_problem

PROBLEM = paper_problem("rrr")
POLICY = Policy.of(PROBLEM).search
PARENTS = [spline(PROBLEM, [np.array(via)]) for via in ([0.5, -1.0, 1.0], [-1.0, 2.0, 3.0], [2.0, 0.0, -2.0])]


def child(problem, parents, seed, number, policy=POLICY):
    """A change of some motions."""
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
def test_kinds_of_change_take_turns(seed):
    """All joints bent; some of the mate's; one led elsewhere. The only parent's other joints are its own."""
    alone = paper_problem("rrr", position_limit=(-np.inf, np.inf))
    bent, led = (child(alone, PARENTS[:1], seed, number) for number in (0, 2))
    crossed = child(alone, PARENTS[:2], seed, 1)

    def own(guess, parent):
        s = np.linspace(0, 1, len(guess.t))
        return np.max(np.abs(guess.q - parent(s * parent.duration).q), axis=0) < 1e-12

    assert np.sum(own(bent, PARENTS[0])) == 0
    assert np.sum(own(led, PARENTS[0])) == 2
    of_first, of_second = own(crossed, PARENTS[0]), own(crossed, PARENTS[1])
    assert np.all(of_first ^ of_second) and 0 < np.sum(of_first) < 3


@given(number=st.sampled_from([0, 2]), seed=st.integers(0, 2**16))
def test_a_childs_velocities_are_those_of_its_way(number, seed):
    free = paper_problem("rrr", position_limit=(-np.inf, np.inf))
    guess = child(free, PARENTS[:1], seed, number)
    slopes = np.gradient(guess.q, guess.t, axis=0)[2:-2]
    # Central differences of a way whose third derivative is at most some 1e3 of its size, over a fiftieth of it.
    assert np.max(np.abs(guess.v[2:-2] - slopes)) <= 0.05 * np.max(np.abs(guess.v))


@pytest.mark.slow
def test_changes_of_optima_are_the_same_on_any_number_of_cores_and_find_better_ones():
    def found(workers):
        task = Task.of(PROBLEM, MinimumTimeOptions(workers=workers))
        search_settings = SearchSettings(task.meshes, task.coarse())
        first = search(task, 12, search_settings)
        return first, crossover_guesses(task, first, 24, search_settings)

    (first, alone), (_, together) = found(1), found(2)
    assert len(alone) == 24
    assert [a.trajectory.duration for a in alone] == [a.trajectory.duration for a in together]
    best, better = (min(a.trajectory.duration for a in some if a.usable) for some in (first, alone))
    assert better <= best * (1 + 1e-3)  # coarse durations of one optimum differ by that


def test_there_are_no_changes_of_nothing():
    task = Task.of(PROBLEM, MinimumTimeOptions(workers=1))
    first = search(task, 1, SearchSettings(task.meshes, task.coarse()))
    failed = [replace(attempt, status=type(attempt.status).FAILED) for attempt in first]
    assert crossover_guesses(task, failed, 6, SearchSettings(task.meshes, task.coarse())) == []


def test_a_later_lineage_has_other_changes_of_the_same():
    task = Task.of(PROBLEM, MinimumTimeOptions(workers=1))
    search_settings = SearchSettings(task.meshes, task.coarse())
    ancestors = search(task, 4, search_settings)
    both, later = (
        crossover_guesses(task, ancestors, 4, search_settings),
        crossover_guesses(task, ancestors, 2, search_settings, first=2),
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
