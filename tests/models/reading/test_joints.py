import numpy as np
import pinocchio as pin
import pytest

from armdyn.errors import SpecError, UnsupportedJointError, UrdfError
from armdyn.models import Robot
from armdyn.models.reading.from_pinocchio import locked_joints
from armdyn.models.reading.urdf_check import dynamics_urdf, parse_urdf
from oracles import LIMIT, joint, link, urdf


def mimic(leader, numbers=""):
    return f'{LIMIT}<mimic joint="{leader}" {numbers}/>'


PINCER = urdf(
    '<link name="base"/>',
    *(link(name) for name in ("mast", "upper", "lower", "hand", "left", "right", "tail", "camera")),
    joint("lift", "base", "mast", "prismatic", '<limit lower="0.2" upper="0.9" effort="9" velocity="1"/>'),
    joint("shoulder", "mast", "upper"),
    joint("bolt", "upper", "lower", "fixed", ""),
    joint("elbow", "lower", "hand"),
    joint("left", "hand", "left", "prismatic"),
    joint("right_finger", "hand", "right", "prismatic", mimic("left", 'multiplier="-2" offset="0.1"')),
    joint("wag", "base", "tail", "continuous", ""),
    joint("clamp", "mast", "camera", "fixed", ""),
)  # fmt: skip
"""A two-joint arm on a lift, with a gripper whose second finger follows the first, and a tail."""


def chain(first, last):
    """The joints that move between two names."""
    model = pin.buildModelFromXML(dynamics_urdf(parse_urdf(PINCER, "pincer")))
    locked = locked_joints(model, "pincer", {}, (first, last))
    return [name for name in list(model.names)[1:] if name not in locked]


@pytest.fixture
def pincer(file):
    return file(PINCER)


@pytest.mark.parametrize(
    ("arm", "joints"),
    [
        (("shoulder", "elbow"), ["shoulder", "elbow"]),
        (("mast", "hand"), ["shoulder", "elbow"]),
        (("base", "elbow"), ["lift", "shoulder", "elbow"]),
        (("lift", "lower"), ["lift", "shoulder"]),
        (("bolt", "elbow"), ["elbow"]),
        (("shoulder", "shoulder"), ["shoulder"]),
        (("hand", "left"), ["left"]),  # the link and the joint of that name
    ],
)
def test_chain(arm, joints):
    assert chain(*arm) == joints


@pytest.mark.parametrize(
    ("arm", "words"),
    [
        (("shoulder", "nose"), "no link, frame or joint 'nose'"),
        (("nose", "elbow"), "no link, frame or joint 'nose'"),
        (("elbow", "shoulder"), "'shoulder' is not behind 'elbow'"),
        (("wag", "elbow"), "'elbow' is not behind 'wag'"),
        (("hand", "base"), "'base' is not behind 'hand'"),
        (("tail", "hand"), "'hand' is not behind 'tail'"),
        (("lower", "upper"), "'upper' is not behind 'lower'"),
        (("camera", "hand"), "'hand' is not behind 'camera'"),  # on the same body, but not on the way
        (("upper", "lower"), "nothing moves"),
        (("hand", "hand"), "nothing moves"),
    ],
)
def test_no_chain(arm, words):
    with pytest.raises(SpecError, match=words):
        chain(*arm)


def test_arm_of_a_file(pincer):
    robot = Robot.from_urdf(pincer, arm=("shoulder", "elbow"))
    assert robot.joint_names == ("shoulder", "elbow")
    # Nearest to zero within 0.2 … 0.9; the finger follows: -2 · 0 + 0.1.
    assert robot.locked == pytest.approx({"lift": 0.2, "left": 0.0, "right_finger": 0.1, "wag": 0.0})
    assert robot.tip == "hand"  # with a joint between, the fingers are no part of it
    assert Robot.from_urdf(pincer, arm=("shoulder", "lower")).tip == "lower"


def test_arm_with_locks(pincer):
    lock = {"left": 0.04, "lift": 0.5, "shoulder": -0.7}
    robot = Robot.from_urdf(pincer, lock=lock, arm=("base", "hand"))
    assert robot.joint_names == ("elbow",)
    assert robot.locked == pytest.approx({**lock, "right_finger": 0.02, "wag": 0.0})


def test_a_follower_of_a_locked_joint_is_locked(pincer):
    robot = Robot.from_urdf(pincer, lock={"left": 0.3})
    assert robot.joint_names == ("lift", "shoulder", "elbow", "wag") and robot.locked["right_finger"] == -0.5


def test_a_follower_of_a_moving_joint_is_refused_unless_locked(pincer):
    with pytest.raises(UnsupportedJointError, match="mimics 'left', which moves") as caught:
        Robot.from_urdf(pincer, lock={"left": "free"})
    assert caught.value.element == "joint 'right_finger'"
    with pytest.raises(UnsupportedJointError, match="which moves"):
        Robot.from_urdf(pincer, arm=("hand", "left"))
    follower = Robot.from_urdf(pincer, arm=("shoulder", "right"))
    assert (follower.joint_names, follower.tip) == (("shoulder", "elbow"), "right")
    robot = Robot.from_urdf(pincer, lock={"right_finger": 0.2})
    assert "left" in robot.joint_names and robot.locked == {"right_finger": 0.2}


@pytest.mark.parametrize("name", ["bolt", "tail_joint", "hand"])
def test_only_moving_joints_can_be_locked(pincer, name):
    with pytest.raises(SpecError, match=f"cannot lock '{name}': .* has joints lift, shoulder, "):
        Robot.from_urdf(pincer, lock={name: 0.0})


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_locks_are_finite(pincer, value):
    with pytest.raises(SpecError, match="cannot lock 'lift' at"):
        Robot.from_urdf(pincer, lock={"lift": value})


def followers(*leaders):
    """A chain of joints j0, j1, …, each following the one named."""
    links = [f"l{i}" for i in range(len(leaders) + 1)]
    joints = [joint(f"j{i}", links[i], links[i + 1], inside=mimic(leader)) for i, leader in enumerate(leaders)]
    return urdf(*map(link, links), *joints)


@pytest.mark.parametrize("leaders", [("j0",), ("j1", "j0"), ("j1", "j2", "j1")])
def test_followers_of_themselves(leaders, read):
    with pytest.raises(UrdfError, match="mimics itself"):
        read(followers(*leaders))


def test_follower_of_an_unknown_joint(read):
    with pytest.raises(UrdfError, match="mimics 'ghost', which is no joint") as caught:
        read(followers("ghost"))
    assert caught.value.element == "joint 'j0'"


@pytest.mark.parametrize("numbers", ['multiplier="nan"', 'offset="x"', 'multiplier=""', 'offset="1e999"'])
def test_follower_by_no_number(numbers, file):
    path = file(urdf(link("a"), link("b"), joint("j", "a", "b", inside=mimic("j", numbers))))
    with pytest.raises(UrdfError, match="is not a finite number"):
        Robot.from_urdf(path)


def test_a_rest_beyond_measure(file):
    far = '<limit lower="1e300" upper="1e301" effort="1" velocity="1"/>'
    path = file(urdf(link("a"), link("b"), link("c"), joint("i", "a", "b"), joint("j", "b", "c", "prismatic", far)))
    with pytest.raises(UrdfError, match=r"would be locked at 1e\+300"):
        Robot.from_urdf(path, arm=("i", "i"))
