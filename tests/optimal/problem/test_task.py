"""Options of a task that have no effect on its problem are said."""

import warnings
from dataclasses import replace

import pytest

import armdyn as ad
from armdyn.optimal.problem.status import Stop
from armdyn.optimal.problem.task import Task
from problems import paper_problem

CURVE = {"q_start": [0, -1, 1, -1, -1.5, 0], "q_goal": [-1.5, -1.8, 1.6, -0.4, 0.3, 1.0]}


@pytest.mark.parametrize(
    ("arm", "more", "options", "words"),
    [
        ("rr", {}, {"calm": 0.01}, ["`calm` has no effect here: motions of a mesh are as fast as can be"]),
        ("rr", {}, {"calm": 0.0, "starts": 100, "max_intervals": 200}, []),  # the fastest is what a mesh gives
        ("rr", {}, {"bound_programs": 9}, ["`bound_programs` has no effect here: it is of cycles"]),
        ("rr", {"velocity_limit": 5.0}, {"calm": 0.01, "max_intervals": 200}, []),  # both are tried
        ("ur5", {}, {"calm": 0.01, "starts": 100, "max_intervals": 200}, ["`max_intervals` has no effect here: "]),
        ("rr", {"relative_effort_weight": 1.0}, {"calm": 0.01}, ["`calm` has no effect here: no time is spent"]),
        ("ur5", {"self_collision": True}, {"starts": 100}, ["`starts` has no effect here: paths are planned"]),
        ("rr", {"jerk_limit": 1e4}, {"method": "profiles", "search": "thorough"}, ["joints have one profile each"]),
    ],
)
def test_an_option_without_effect_is_said_once(arm, more, options, words):
    problem = paper_problem("rr").variant(**more) if arm == "rr" else None
    problem = problem or ad.MinimumTimeProblem(ad.Robot.from_library("ur5"), **CURVE, **more)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        Task.of(problem, ad.MinimumTimeOptions(**options)).warn_of_options()
    said = [str(one.message) for one in caught]
    assert len(said) == len(words) and all(word in line for word, line in zip(words, said, strict=True))


@pytest.mark.parametrize(("calm", "count"), [(0.0, 1), (0.01, 0)])
def test_time_for_calm_joints_that_a_mesh_does_not_take_is_said_after_the_solve(calm, count):
    task = Task.of(paper_problem("rr", velocity_limit=5.0), ad.MinimumTimeOptions(calm=0.05))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        task.warn_of_options()
        task.warn_of_options(calm)
    words = "`calm` has no effect here: the answer is a motion of a mesh, as fast as can be"
    assert [str(one.message) for one in caught] == [words] * count


def test_a_task_for_another_problem_keeps_all_but_what_follows_from_the_problem():
    problem, said, stop = paper_problem("rr"), [], Stop()
    task = Task.of(problem, ad.MinimumTimeOptions(method="mesh", workers=1), stop, said.append)
    task = replace(task, policy=task.policy.changed("search", starts=3), lower_bound=lambda: 0.1, intervals=80)
    other = task.for_problem(problem.variant(q_goal=[0.2, 0.1], jerk_limit=1e4))
    assert other.stop is stop and other.options is task.options and other.lower_bound() == 0.1
    other.progress("heard")
    assert said == ["heard"]
    assert other.policy.search.starts == 3 and other.policy.strategy.methods == ("mesh",)
    assert other.scheme.control == "linear" and other.intervals == 40
