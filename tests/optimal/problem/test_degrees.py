"""A pose beyond its limits that is within them as degrees was perhaps meant so."""

import pytest

import armdyn as ad
from armdyn.errors import ProblemError

MEANT = "did you mean degrees"


def refused(robot, q):
    with pytest.raises(ProblemError, match="outside its limits") as caught:
        ad.MinimumTimeProblem(robot, q_start=[0.0] * robot.nv, q_goal=q, effort_limit=10.0)
    return str(caught.value)


@pytest.fixture
def rr():
    return ad.Robot.from_spec(ad.ArmSpec.paper("rr"))


def test_degrees_are_recognised(rr):
    assert MEANT in refused(rr, [-90.0, 0.0]) and MEANT in refused(rr, [0.1, 45.0])


def test_no_hint_at_degrees_where_they_exceed_the_limits_too(rr):
    assert MEANT not in refused(rr, [-90.0, 1000.0])


def test_no_hint_at_degrees_where_a_limit_is_slightly_exceeded():
    panda = ad.Robot.from_library("panda")
    start = panda.pose("ready")
    with pytest.raises(ProblemError) as caught:  # 3 degrees would be within all limits; 3 rad was meant
        ad.MinimumTimeProblem(panda, q_start=start, q_goal=[3.0, *start[1:]])
    assert MEANT not in str(caught.value)


def test_joints_that_slide_are_in_metres():
    cart = ad.Robot.from_library("cart_pole")
    words = refused(cart, [1000.0, 180.0])
    assert MEANT not in words and "is 1000 m, outside its limits" in words
