"""The policy as a table: numbers that depend on the kind of problem, and a reason for every number."""

import math

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.problem.options import Scheme
from armdyn.optimal.problem.policy.policy import Policy, policy_for
from armdyn.optimal.problem.task import Task
from problems import paper_problem

UR5 = {"q_start": [0, -1, 1, -1, -1.5, 0], "q_goal": [-1.5, -1.8, 1.6, -0.4, 0.3, 1.0]}
BALL = ad.Sphere((0.3, 0.0, -0.1), 0.05)


def problem(kind):
    if kind == "ur5":
        return ad.MinimumTimeProblem(ad.Robot.from_library("ur5"), **UR5)
    arm, _, more = kind.partition(" ")
    extra = {
        "": {},
        "ball": {"obstacles": [BALL]},
        "jerk": {"jerk_limit": 1e5},
        "effort": {"effort_weight": 1.0},
        "free": {"position_limit": (-np.inf, np.inf)},
        "via": {"via": [np.zeros(len(arm))]},
    }
    return paper_problem(arm, **extra[more])


TABLE = {
    # kind: starts, condensed, flat, linear, curves alone, their starts, neighbour_starts
    "r": (1, True, None, False, False, 4, 1),
    "rr": (32, True, None, False, False, 4, 8),
    "rrr": (140, True, None, False, False, 4, 12),
    "rr ball": (16, False, 1e-4, False, False, 4, 8),
    "rr jerk": (16, False, 1e-4, True, False, 4, 8),
    "rr via": (16, False, None, False, False, 4, 8),
    "rr effort": (200, True, None, True, False, 4, 4),
    "ur5": (100, True, None, False, True, 1, 1),
}


@pytest.mark.parametrize("kind", TABLE)
def test_numbers_that_depend_on_the_kind_of_problem(kind):
    policy = Policy.of(problem(kind))
    program, search, curves = policy.program, policy.search, policy.curves
    found = (
        search.starts, program.condensed, program.flat, program.linear,
        policy.strategy.curves_alone, curves.starts, search.neighbour_starts,
    )  # fmt: skip
    assert found == TABLE[kind]


STRATEGIES = {
    # kind: methods, fallback, whether a lower bound is computed
    "rr": (("mesh",), ("curves",), False),
    "rr ball": (("mesh",), ("curves",), False),
    "rr effort": (("mesh",), ("curves",), False),
    "ur5": (("curves",), (), True),
}


@pytest.mark.parametrize("kind", STRATEGIES)
def test_the_strategy_of_a_kind_of_problem(kind):
    strategy = Policy.of(problem(kind)).strategy
    assert (strategy.methods, strategy.fallback, strategy.bounded) == STRATEGIES[kind]


def test_where_velocity_limits_shape_the_motion_curves_come_first():
    for more, methods in (({}, ("curves", "mesh")), ({"effort_weight": 0.1}, ("mesh",))):
        strategy = Policy.of(paper_problem("rr", velocity_limit=3.0, **more)).strategy
        assert strategy.methods == methods and strategy.bounded == (not more)


@pytest.mark.parametrize(
    ("kind", "changed"), [("rr", 0.0), ("rrr", 0.4), ("rrr ball", 0.0), ("rrr effort", 0.4), ("ur5", 0.0)]
)
def test_optima_are_changed_where_there_are_hundreds(kind, changed):
    numbers = Policy.of(problem(kind)).search
    assert numbers.mutated == changed


@pytest.mark.parametrize(
    ("kind", "far"),
    [("r", 0), ("rr", 4), ("rrr", 4), ("rrr free", 8), ("rr ball", 0), ("ur5", 0)],
)
def test_where_there_are_many_optima_guesses_are_far_and_hasty_and_all_are_solved(kind, far):
    numbers = Policy.of(problem(kind)).search
    assert numbers.uniform_spread == far
    assert (numbers.uniform_spread > 0) == (numbers.guess_duration < 1) == (not numbers.ends_early)


@pytest.mark.parametrize("arm", ["rr", "rrr"])
def test_with_effort_guesses_are_near_and_hasty(arm):
    with_effort, without = (Policy.of(problem(kind)).search for kind in (f"{arm} effort", arm))
    assert with_effort.uniform_spread == 0 < with_effort.spread
    assert with_effort.guess_duration == without.guess_duration < 1


def test_every_number_says_its_unit_its_reason_and_its_cases():
    table = list(Policy.of(problem("rr")).rows())
    names = [name for name, *_ in table]
    assert len(names) == len(set(names)) > 100
    for name, value, unit, why, cases in table:
        assert unit and why and cases, name
        assert value is None or isinstance(value, (bool, int, float, str, tuple)), name
        assert not isinstance(value, float) or math.isfinite(value), name


def test_a_number_is_changed_in_a_copy():
    policy = Policy.of(problem("rr"))
    other = policy.changed("search", starts=3)
    assert (other.search.starts, policy.search.starts) == (3, 32)
    assert other.program == policy.program


def test_torques_are_constant_unless_a_condition_forbids_jumps():
    options = ad.MinimumTimeOptions(compile=False)
    assert Task.of(problem("rr jerk"), options).scheme == Scheme("linear", False)
    assert Task.of(problem("rr"), options).scheme == Scheme("constant", False)


@pytest.mark.parametrize(("effort", "guesses", "optima"), [("quick", 8, 6), ("normal", 24, 6), ("thorough", 120, 30)])
def test_effort_scales_all_guesses(effort, guesses, optima):
    search = Policy.of(paper_problem("rrr", effort_weight=1.0)).search
    options = ad.MinimumTimeOptions(search=effort)
    assert (search.guesses(options, 24), search.refinements(options, 6)) == (guesses, optima)
    settings = ad.MinimumTimeOptions(search=effort, starts=3)
    assert (search.guesses(settings, 24), search.refinements(settings, 6)) == (3, optima)


@pytest.mark.parametrize(
    ("method", "more", "why"),
    [
        ("mesh", {"obstacles": [BALL]}, "`method` mesh cannot solve this: it does not avoid obstacles"),
        ("mesh", {"self_collision": True}, "nor the arm itself"),
        ("mesh", {"relative_effort_weight": 1.0}, "no `relative_effort_weight`"),
        ("mesh", {"via": [ad.GoalPose("tip", (0.3, 0.0, -0.1), tolerance=(0.02, 0, 0.02, 0, 0, 0))]}, "regions on it"),
        ("curves", {"passive": ["joint2"], "q_goal": [0.1, -0.1]}, "joint 'joint2' has no motor"),
        ("profiles", {}, "needs `acceleration_limit` or `jerk_limit`"),
        ("profiles", {"acceleration_limit": 5.0, "v_goal": [0.1, 0.0]}, "from rest to rest"),
    ],
)
@pytest.mark.filterwarnings("ignore::armdyn.ArmdynWarning")
def test_a_method_that_cannot_solve_the_problem_is_refused(method, more, why):
    with pytest.raises(ProblemError, match=why):
        policy_for(paper_problem("rr").variant(**more), method)


@pytest.mark.parametrize(
    ("method", "more", "own"),
    [
        ("mesh", {}, ("mesh",)),
        ("mesh", {"velocity_limit": 5.0}, ("mesh",)),  # chosen by the problem, curves come first
        ("mesh", {"effort_weight": 1.0}, ("mesh",)),
        ("mesh", {"jerk_limit": 1e4}, ("mesh",)),
        ("curves", {"jerk_limit": 1e4}, ("curves",)),
        ("profiles", {"jerk_limit": 1e4}, ("profiles",)),
    ],
)
def test_a_named_method_is_the_only_one(method, more, own):
    problem = paper_problem("rr").variant(**more)
    task = Task.of(problem, ad.MinimumTimeOptions(method=method))
    assert task.policy.strategy.methods == own and task.policy.strategy.fallback == ()
    other = task.for_problem(problem.variant(q_goal=[0.2, 0.1]))
    assert other.policy.strategy.methods == own  # of all goals, and without obstacles
