"""Limits of joints, of which some have no motor."""

import numpy as np
import pytest

from armdyn.errors import ProblemError
from armdyn.models import JointLimits

JOINTS = ("a", "b", "c")


def limits(lower, upper):
    wide = np.full(len(upper), np.inf)
    return JointLimits(
        position_lower=-wide, position_upper=wide, velocity=wide, effort_lower=lower, effort_upper=upper
    )  # fmt: skip


def test_passive_joints_have_no_torque():
    own = limits([-1.0, 0.0, 0.0], [3.0, 0.0, 2.0])
    assert own.passive.tolist() == [False, True, False]  # the last pushes one way
    assert own.actuators.scale.tolist() == [2.0, 1.0, 1.0]  # half the ranges; the least of the others'


def test_sizes_are_positive_where_nothing_has_a_motor():
    assert limits([0.0, 0.0], [0.0, 0.0]).actuators.scale.tolist() == [1.0, 1.0]


def test_without_motors():
    own = limits([-1.0, -2.0, -3.0], [1.0, 2.0, np.inf])
    idle = own.without_motors(iter(["c", "a"]), JOINTS, ProblemError)
    assert idle.effort_lower.tolist() == [0.0, -2.0, 0.0] and idle.effort_upper.tolist() == [0.0, 2.0, 0.0]
    assert own.without_motors((), JOINTS, ProblemError).effort_upper.tolist() == [1.0, 2.0, np.inf]


@pytest.mark.parametrize(
    ("passive", "words"), [(["d"], "there are a, b, c"), ("a", "must be a list"), ([3], r"passive\[0\] is 3")]
)
def test_a_wrong_joint_is_refused(passive, words):
    with pytest.raises(ProblemError, match=words):
        limits([-1.0] * 3, [1.0] * 3).without_motors(passive, JOINTS, ProblemError)


def test_limits_in_words_are_ranges_and_joints_without_a_motor():
    nothing = np.inf
    limits = JointLimits(
        position_lower=np.array([-1.0, -nothing, -nothing]), position_upper=np.array([1.0, nothing, 2.0]),
        velocity=np.array([3.0, nothing, nothing]), effort_lower=np.array([-4.0, 0.0, -nothing]),
        effort_upper=np.array([5.0, 0.0, nothing]),
    )  # fmt: skip
    assert limits.words() == [("±1", "3", "-4 … 5"), ("-", "-", "no motor"), ("- … 2", "-", "-")]
