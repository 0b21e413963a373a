import sys

import pytest

import armdyn.cli.robots as robots
from armdyn.models import PLANAR_ARMS, Robot
from armdyn.models.robots.library import BENCHMARKS, LIBRARY_ARMS
from armdyn.show.results import load_result
from armdyn.trajectory import Trajectory
from cli.command import run_here, run_json
from models.mjcf.arms import RR


@pytest.mark.slow
def test_every_arm_is_listed_and_loads(listed):
    assert listed["success"] and listed["status"] == "listed"
    assert [arm["name"] for arm in listed["robots"]] == [*PLANAR_ARMS, *BENCHMARKS, *LIBRARY_ARMS]
    assert all(arm["loads"] for arm in listed["robots"]), [arm for arm in listed["robots"] if not arm["loads"]]


def test_missing_conditions(listed):
    arms = {arm["name"]: arm for arm in listed["robots"]}
    assert arms["double_pendulum"]["missing"]["effort"] == ["joint1", "joint2"]
    assert arms["bravo7_no_ee"]["missing"]["effort"] == ["joint1", "joint4", "joint6"]
    assert arms["panda"]["missing"] == {"position": [], "velocity": [], "effort": []}
    assert arms["panda"]["locked"] == {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    assert arms["kinova"]["continuous"] == ["j2s6s200_joint_1", "j2s6s200_joint_4", "j2s6s200_joint_6"]
    assert arms["cart_pole"]["passive"] == ["pole"] and arms["cart_pole"]["missing"]["effort"] == []
    assert arms["panda"]["passive"] == []
    assert (arms["baxter_left"]["robot"], arms["baxter_left"]["dof"], arms["so100"]["dof"]) == ("baxter", 7, 5)


def test_robots_that_do_not_load_say_why(listed):
    others = {robot["name"]: robot for robot in listed["others"]}
    assert "SDF" in others["cassie"]["reason"] and not others["cassie"]["loads"]
    assert others["romeo"]["loads"]  # its fingers follow joints of its hands, which are locked
    assert all(robot["loads"] or robot["reason"] for robot in others.values())


def test_one_bad_robot_does_not_hide_the_others(monkeypatch):
    def damaged(source, *_):
        raise OSError(f"{source.name}: input/output error")

    monkeypatch.setattr(Robot, "from_source", damaged)
    facts = robots._facts("panda", lambda name: None)
    assert facts["loads"] is False and facts["reason"] == "OSError: panda: input/output error"
    assert robots._row(facts)[-1] == "OSError: panda: input/output error"


@pytest.mark.slow
def test_table_teaches():
    words = " ".join(run_here("robots").stdout.split())
    assert "needs --effort-limit (all joints)" in words and "of baxter" in words
    assert "no motor (shoulder)" in words
    assert "armdyn doctor NAME" in words


def test_any_part_of_a_robot_is_an_arm():
    answer = run_json(
        "doctor", "talos", "--arm", "torso_2_joint,gripper_left_base_link", "--lock", "arm_left_7_joint=.1"
    )
    assert [joint["name"] for joint in answer["joints"]] == [
        "torso_2_joint",
        *(f"arm_left_{i}_joint" for i in range(1, 7)),
    ]
    assert answer["tip"] == "gripper_left_base_link"
    assert "locked at 0.1: arm_left_7_joint" in answer["remarks"]


@pytest.mark.parametrize(
    ("robot", "part", "words"),
    [
        ("talos", "torso_2_joint", "is not FIRST,LAST"),
        ("talos", ",arm_left_2_joint", "is not FIRST,LAST"),
        ("talos", "torso_2_joint,nose", "no link, frame or joint 'nose'"),
        ("rr", "joint1,joint2", "--arm: 'rr' has no joints to lock"),
    ],
)
def test_a_wrong_arm_is_refused(robot, part, words):
    assert words in run_json("doctor", robot, "--arm", part, code=2)["message"]


@pytest.fixture
def mjcf(tmp_path):
    path = tmp_path / "rr.xml"
    path.write_text(RR)
    return path


def test_mjcf_is_known_by_its_root(mjcf):
    answer = run_json("doctor", mjcf)
    assert [joint["effort_upper"] for joint in answer["joints"]] == [3.0, 3.0] and answer["tip"] == "tip"
    assert [joint["name"] for joint in run_json("doctor", mjcf, "--lock", "joint1=0.1")["joints"]] == ["joint2"]
    mjcf.write_text(RR.replace("<worldbody>", "<worldbody><include file='/etc/passwd'/>"))
    message = run_json("doctor", mjcf, code=2)["message"]
    assert f"{mjcf}: include '/etc/passwd': is outside the folder" in message


@pytest.mark.slow
def test_the_fastest_motion_of_an_mjcf(mjcf, tmp_path):
    """The paper's Example 2 without payload, as of its own arm; it is drawn as rods."""
    task = (
        "--q-start=-1.570796,0.0374",
        "--q-goal=0.15708,-0.0374",
        "--payload",
        0.1006,
        "--no-figure",
        "--out",
        tmp_path / "out",
    )
    answer, same = run_json("mintime", mjcf, *task), run_json("mintime", "rr", *task)
    assert answer["duration"] == pytest.approx(same["duration"], rel=1e-6)  # other additions, the same arcs


@pytest.mark.parametrize(
    ("name", "words"),
    [("ur5e", "did you mean 'ur5'?"), ("pandaa", "did you mean 'panda'?"), ("rrrr", "did you mean 'rrr'?")],
)
def test_mistyped_names(name, words):
    message = run_json("doctor", name, code=2)["message"]
    assert f"no robot named {name!r}; {words}" in message and "robot_descriptions" not in message


def test_names_of_robot_descriptions(monkeypatch):
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    for name in ("ur5_description", "robot_descriptions:ur5_description"):
        assert "pip install robot_descriptions" in run_json("doctor", name, code=2)["message"]


@pytest.mark.slow
def test_a_motion_of_another_arm_is_pointed_out(tmp_path):
    run_json("pid", "rr", "--payload", 0.1, "--duration", 0.5, "--no-figure", "--out", tmp_path, code=3)
    result, motion = load_result(tmp_path / "result.json"), Trajectory.load(tmp_path / "trajectory.npz")
    assert result["model"]["hash"] == motion.model_hash != ""
    assert not run_json("replay", "rr", tmp_path / "trajectory.npz", "--payload", 0.1, "--out", tmp_path)["warnings"]
    (warning,) = run_json("replay", "rr", tmp_path / "trajectory.npz", "--payload", 0.2, "--out", tmp_path)["warnings"]
    assert "another arm, payload or friction" in warning
