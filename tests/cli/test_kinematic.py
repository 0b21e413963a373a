"""The commands on a vendor's file without inertias: what needs none works, and `--kinematic`."""

import base64

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import UrdfError
from armdyn.show.page.facts import Facts
from armdyn.show.page.joints import joint_section
from armdyn.show.page.motions import ShownMotion, Subject, motions_data
from cli.command import run_here, run_json
from oracles import joint, link, urdf

LIMIT = '<limit lower="-2" upper="2" effort="100" velocity="3"/>'
VENDOR = urdf(
    *(link(name, "") for name in ("base", "a", "b", "c")),
    *(
        joint(f"j{i}", *ends, inside=f'<origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>{LIMIT}')
        for i, ends in enumerate((("base", "a"), ("a", "b"), ("b", "c")), 1)
    ),
)
PRESET = """name = "mine"
robot = "vendor"
joints = ["j1", "j2", "j3"]
[limits]
velocity = 3.0
acceleration = 6.0
torque = 10.0
[interfaces.position]
rate = 250
necessary = ["velocity", "acceleration", "torque"]
"""
POSES = ("--q-start", "0,0,0", "--q-goal", "1,0.5,-0.5")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "arm.urdf").write_text(VENDOR)
    (tmp_path / "mine.toml").write_text(PRESET)
    (tmp_path / "motion.csv").write_text("t,j1,j2,j3\n0,0,0,0\n0.5,0.2,0.1,-0.1\n1,0.4,0.2,-0.2\n1.5,0.4,0.2,-0.2\n")
    return tmp_path


def test_doctor_lists_the_links_once(folder):
    data = run_json("doctor", "arm.urdf", cwd=folder)
    assert data["status"] == "no_dynamics" and data["success"] and len(data["joints"]) == 3
    (remark,) = (one for one in data["remarks"] if "without mass" in one)
    assert "a, b, c." in remark and "--kinematic" in remark and "--density" in remark


def test_a_motion_is_shown_and_checked(folder, unrendered):
    assert run_json("replay", "arm.urdf", "motion.csv", "--out", "page", cwd=folder)["success"]
    assert "unknown, as the arm" in (folder / "page" / "replay.html").read_text()
    without = (folder / "mine.toml").read_text().replace(', "acceleration"', "")  # which jumps in a table of positions
    (folder / "loose.toml").write_text(without)
    data = run_json("check", "motion.csv", "--preset", "loose.toml", "--robot", "arm.urdf", cwd=folder)
    assert data["status"] == "accepted" and "not checked" in str(data)
    assert run_json("robots", "arm.urdf", cwd=folder)["joints"] == ["j1", "j2", "j3"]


def test_minimum_time(folder):
    options = ("--no-figure", "--no-report", "--out", "m")
    data = run_json("mintime", "arm.urdf", *POSES, *options, code=2, cwd=folder)
    assert "links without mass: a, b, c" in data["message"] and "(armdyn identify)" in data["message"]
    assert "--kinematic" in data["message"] and "--armature" in data["message"]
    rotors = run_here("mintime", "arm.urdf", *POSES, *options, "--armature", "0.5", cwd=folder)
    assert rotors.returncode == 0 and "j3 turns a rotor alone" in " ".join(rotors.stdout.split())
    data = run_json("mintime", "arm.urdf", *POSES, *options, "--kinematic", "--preset", "mine.toml", cwd=folder)
    # 1 rad at 6 rad/s²; the replay keeps 1e-6.
    assert data["duration"] == pytest.approx(2 / 6**0.5, rel=1e-6) and data["kinematic"] and data["certified"]
    assert {cost["condition"] for cost in data["controller"]["costs"]} == {"velocity", "acceleration"}
    said = run_here("mintime", "arm.urdf", *POSES, *options, "--kinematic", "--jerk-limit", "9", cwd=folder).stdout
    assert "without torques: the arm's inertias are unknown" in " ".join(said.split())
    # Controllers get no efforts of zero.
    assert run_json("export", "m/trajectory.npz", "--format", "ros2", "--out", "e", cwd=folder)["success"]
    assert '"effort"' not in (folder / "e" / "trajectory.json").read_text()
    bound = run_json("bound", "arm.urdf", *POSES, "--kinematic", "--acceleration-limit", "6", cwd=folder)
    assert bound["bound"] == pytest.approx(2 / 6**0.5, rel=1e-3)


def test_closed_loops_need_inertias(folder):
    data = run_json("pid", "arm.urdf", *POSES, code=2, cwd=folder)
    assert "moves no inertia; links without mass: a, b, c" in data["message"]


def test_pages_say_that_torques_are_unknown(folder):
    motion = ad.trajectory_from_path(ad.Robot.from_urdf(folder / "arm.urdf"), [0, 1, 2], np.outer([0, 1, 2], [0.1] * 3))
    subject, shown = Subject.of(ad.Robot.from_urdf(folder / "arm.urdf")), ShownMotion("straight", motion, Facts())
    (move,) = motions_data([shown], subject)["moves"]
    torques, speeds = (np.frombuffer(base64.b64decode(move[name]), "<f4") for name in ("tau", "v"))
    assert np.all(np.isnan(torques)) and np.all(np.isfinite(speeds))
    assert str(joint_section(shown, subject).body).count("unknown") == 3


@pytest.mark.slow
def test_a_cycle_is_planned_without_torques(folder):
    """It was refused, since the motors were to hold the arm at its stops."""
    steps = "".join(
        f'[[steps]]\n{step}\n'
        for step in ('move = "a"\nto = [1, 0.5, -0.5]', 'grasp = "bar"', 'move = "b"\nto = [0.2, 0.5, -0.5]',
                     'release = "bar"', "wait = 0.2")
    )  # fmt: skip
    conditions = "kinematic = true\nacceleration_limit = 5"
    head = (
        f'[robot]\nname = "arm.urdf"\n[cycle]\nstart = [0, 0, 0]\nclosed = true\n{conditions}\n[parts.bar]\nmass = 1\n'
    )
    (folder / "cell.toml").write_text(head + steps)
    data = run_json("cycle", "cell.toml", "--format", "ros2", "--out", "c", cwd=folder)
    ways = (1.0, 0.8, np.hypot(0, 0.5))  # of the slowest joint of each move; 2 sqrt(way / a) each, and the rest
    assert data["usable"] and data["duration"] == pytest.approx(sum(2 * np.sqrt(w / 5) for w in ways) + 0.2, rel=1e-6)
    assert "Torques are left out." in data["assessment"]
    assert not np.any(ad.Trajectory.load(folder / "c/trajectory.npz").tau)


def test_the_comparison_says_that_there_are_no_torques(folder, unrendered):
    """It said 0 J and 0 %."""
    for limit in ("5", "4"):
        run_json("mintime", "arm.urdf", *POSES, "--kinematic", "--acceleration-limit", limit, "--no-figure",
                 "--no-report", "--out", limit, cwd=folder)  # fmt: skip
    for row in run_json("compare", "5", "4", "--out", "c", cwd=folder)["motions"]:
        assert row["work"] is None and row["torque"] is None and row["speed"] > 0
    said = run_here("compare", "5", "4", "--out", "d", cwd=folder).stdout
    assert said.count("no torques") == 2 and " J " not in said
    assert "no torques" in (folder / "d/report.html").read_text()


@pytest.mark.parametrize("command", [["track"], ["pid"], ["bound"], ["mintime"], ["optimality", "m.npz"]])
def test_what_needs_torques_says_what_works(command, folder):
    t = np.linspace(0, 1, 11)
    way = np.outer(t**2 * (3 - 2 * t), [1.0, 0.5, -0.5])
    ad.Trajectory(t, way, np.gradient(way, t, axis=0), 0 * way).save(folder / "m.npz")
    poses = () if command[0] == "optimality" else POSES
    message = run_json(command[0], "arm.urdf", *command[1:], *poses, code=2, cwd=folder)["message"]
    assert "links without mass: a, b, c." in message and "armdyn doctor arm.urdf --repair --density 2700" in message
    assert message.endswith("Replay, compare, check and armdyn mintime --kinematic need no torques")


def test_the_live_resolver_and_the_reserve_say_what_works(folder):
    robot = ad.Robot.from_urdf(folder / "arm.urdf")
    with pytest.raises(UrdfError, match=r"MinimumTimeProblem\(…, kinematic=True\) need no torques"):
        ad.Resolver(robot).solve([0, 0, 0], [0, 0, 0], [1, 0.5, -0.5])
    given = "--kinematic", "--acceleration-limit", "5", "--for-tracking"
    message = run_json("mintime", "arm.urdf", *POSES, *given, code=2, cwd=folder)["message"]
    assert message == "--for-tracking chooses the torque reserve: leave out --kinematic"
