"""Positions as people type them: units, --degrees, names of poses."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

import armdyn as ad
from armdyn.cli.invocation import running
from armdyn.cli.options.joints import friction_words
from armdyn.cli.options.poses import check_units_of_sliding_locks, position, positions
from armdyn.errors import ProblemError
from problems import CART


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1.5", 1.5), ("-2e-3", -2e-3), ("pi/2", math.pi / 2), ("90deg", math.pi / 2), ("-45 deg", -math.pi / 4),
        ("180°", math.pi), ("1.57rad", 1.57), ("1e1deg", math.radians(10)), ("pi/4rad", math.pi / 4), ("inf", math.inf),
    ],
)  # fmt: skip
def test_angles(text, value):
    assert position(text, "--q-goal") == pytest.approx(value, rel=1e-15)


def test_joints_that_slide_are_in_metres():
    assert position("0.1m", "--q-goal", slides=True) == 0.1
    rubbing = friction_words(ad.Robot.from_urdf_string(CART, damping=1, friction=2))["joint friction"]
    assert rubbing == "viscous 1 N s/m, Coulomb 2 N (over 0.05 m/s)"
    with pytest.raises(ProblemError, match="'90deg', but the joint slides"):
        position("90deg", "--q-goal", slides=True)
    with pytest.raises(ProblemError, match=r"'0\.1m', but the joint turns"):
        position("0.1m", "--q-goal")


@pytest.mark.parametrize("text", ["", "deg", "x", "1,2", "1degree", "1 2deg", "90degdeg", "m", "--1"])
def test_a_wrong_position_is_refused(text):
    with pytest.raises(ProblemError, match="is not a number"):
        position(text, "--q-goal")


@given(st.floats(-720, 720))
def test_degrees_are_degrees_with_a_unit_and_with_the_option(angle):
    with running("mintime", {}, {"degrees": True}):
        assert position(repr(angle), "") == math.radians(angle)
        assert position(f"{angle!r}rad", "") == angle
        assert position("pi/2", "") == math.pi / 2
        assert position(repr(angle), "", slides=True) == angle
    assert position(f"{angle!r}deg", "") == math.radians(angle)
    assert position(repr(angle), "") == angle


def test_poses_by_name_and_by_joint():
    panda, cart = ad.Robot.from_library("panda"), ad.Robot.from_library("cart_pole")
    assert positions("ready", "--q-start", panda) == panda.pose("ready").tolist()
    with running("mintime", {}, {"degrees": True}):
        assert positions("ready", "--q-start", panda) == panda.pose("ready").tolist()
        assert positions("0.5,90", "--q-goal", cart) == [0.5, math.pi / 2]
    assert positions("0.5m,90deg", "--q-goal", cart) == [0.5, math.pi / 2]
    assert positions("1,2,3", "--q-goal", cart) == [1, 2, 3]  # the problem says how many it wants
    one = ad.Robot.from_spec(ad.ArmSpec.paper("r"))
    assert positions("90deg", "--q-goal", one) == [math.pi / 2] and positions("zero", "--q-goal", one) == [0]


def test_a_name_that_is_not_known_says_which_are():
    with pytest.raises(
        ProblemError, match=r"'hme'; expected a number per joint .*pose of ur5 \(zero, home, up\); did you mean 'home'"
    ):
        positions("hme", "--q-start", ad.Robot.from_library("ur5"))


def test_degrees_of_a_lock_that_slides_need_a_unit():
    tiago = ad.Robot.from_library("tiago", lock={"torso_lift_joint": 0.1}, arm=("arm_1_joint", "arm_4_joint"))
    check_units_of_sliding_locks(["torso_lift_joint=0.1"], tiago)
    with running("mintime", {}, {"degrees": True}):
        check_units_of_sliding_locks(["torso_lift_joint=0.1m", "arm_5_joint=5"], tiago)
        with pytest.raises(ProblemError, match="torso_lift_joint: the joint slides"):
            check_units_of_sliding_locks(["torso_lift_joint=0.1"], tiago)


def test_degrees_of_a_lock_of_unknown_kind_need_a_unit():
    bare = ad.Robot.from_model(ad.Robot.from_library("panda").model)
    with running("mintime", {}, {"degrees": True}), pytest.raises(ProblemError, match="say the unit"):
        check_units_of_sliding_locks(["panda_joint1=5"], bare)
