"""Joints of a problem with a motor, and refusals where too few have one."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from problems import paper_arm

ENDS = {"q_start": [0.0, 0.0], "q_goal": [1.0, 0.0]}


def bare():
    """The cart-pole as a stranger's URDF, whose zeros say nothing."""
    return ad.Robot.from_urdf_string(ad.Robot.from_library("cart_pole").urdf)


def upper(problem):
    return problem.limits.effort_upper.tolist()


def test_the_ways_to_say_it_are_one():
    problems = [
        ad.MinimumTimeProblem(bare(), **ENDS, passive=("pole",)),
        ad.MinimumTimeProblem(bare(), **ENDS, effort_limit=[20.0, 0.0]),
        ad.MinimumTimeProblem(bare(), **ENDS, effort_limit=20.0, passive=["pole"]),
        ad.MinimumTimeProblem(bare().with_passive(["pole"]), **ENDS),
        ad.MinimumTimeProblem(ad.Robot.from_library("cart_pole"), **ENDS, effort_limit=20.0),
        ad.MinimumTimeProblem(ad.Robot.from_library("cart_pole"), **ENDS),
    ]
    for problem in problems:
        assert upper(problem) == [20.0, 0.0] and problem.limits.effort_lower.tolist() == [-20.0, 0.0]
        assert problem.limits.passive.tolist() == [False, True]
    assert upper(problems[0].variant(effort_limit=5.0)) == [5.0, 0.0]


def test_an_unset_limit_of_a_urdf_stays_refused():
    with pytest.raises(
        ProblemError, match=r"joint 'pole' has torque limits .* the joint in `passive` if it has no motor"
    ):
        ad.MinimumTimeProblem(bare(), **ENDS)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"passive": ("joint3",)}, "passive: there is no joint 'joint3'; did you mean 'joint[12]'.*joint1, joint2"),
        ({"passive": ("joint1", "joint2")}, "no joint has a motor: .*joint1, joint2.*fewer joints in `passive`"),
        ({"effort_limit": 0.0}, "no joint has a motor"),
        ({"passive": "joint1"}, "passive is 'joint1'; it must be a list"),
        ({"passive": ("joint2",), "relative_effort_weight": 1.0}, "joint 'joint2' has no motor.*give `effort_weight`"),
    ],
)
def test_too_few_motors(more, words):
    with pytest.raises(ProblemError, match=words):
        ad.MinimumTimeProblem(paper_arm("rr"), **ENDS, **more)


def test_a_pole_upright_is_held_by_nothing_and_a_slanting_one_falls():
    robot = ad.Robot.from_library("cart_pole")
    ad.MinimumTimeProblem(
        robot, q_start=[0, 0], q_goal=[0, np.pi]
    )  # sin π is not quite zero; a warning would be raised
    with pytest.warns(ad.ArmdynWarning, match="'pole' needs .* but it has no motor"):
        ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[0, 0.3])


def test_effort_costs_only_where_it_is():
    problem = ad.MinimumTimeProblem(
        ad.Robot.from_library("acrobot"), **ENDS | {"q_goal": [np.pi, 0]}, effort_weight=0.1
    )
    assert problem.effort_weights().tolist() == [0.1, 0.1]
