"""`armdyn export`: files of a motion."""

import json

import mujoco
import numpy as np
import pandas
import pytest
import yaml

import armdyn as ad
from armdyn.trajectory import Trajectory
from armdyn.trajectory.planned import read_planned
from cli.command import answer, run_here
from problems import pick_and_place, solved


@pytest.fixture
def here(tmp_path):
    """A folder with the motion of RR."""
    solved("rr").trajectory.save(tmp_path / "trajectory.npz")
    return tmp_path


def test_a_table_next_to_the_file(here):
    output = answer(run_here("export", "trajectory.npz", "--json", cwd=here))
    assert output["success"] and output["status"] == "written" and output["files"] == ["trajectory.csv"]
    table = pandas.read_csv(here / "trajectory.csv")
    samples = solved("rr").trajectory.resample(1000)
    assert len(table) == output["samples"] == samples.t.size
    np.testing.assert_array_equal(table["tau_joint2 [N m or N]"], samples.tau[:, 1])


def test_ros_reads_it(here):
    file = "deeper/still/trajectory.json"
    output = answer(
        run_here(
            "export", "trajectory.npz", "--format", "ros2", "--rate", "500", "--out", "deeper/still", "--json", cwd=here
        )
    )
    assert output["rate"] == 500 and output["files"] == [file]
    text, samples = (here / file).read_text(), solved("rr").trajectory.resample(500, least=1)
    assert yaml.safe_load(text) == json.loads(text) == samples.to_joint_trajectory()


def test_ros_s_message_is_read_back(here):
    run_here("export", "trajectory.npz", "--format", "ros2", "--rate", "1000", cwd=here)
    samples = solved("rr").trajectory.resample(1000, least=1)  # what is left of a tick is in the last step
    planned = read_planned(here / "trajectory.json", samples.joint_names)
    assert planned.t == pytest.approx(samples.t, abs=0.5e-9)  # whole nanoseconds
    for what in ("q", "v", "a", "tau"):
        np.testing.assert_array_equal(getattr(planned, what), getattr(samples, what))


def test_mujoco_reads_it(here):
    run_here("export", "trajectory.npz", "--format", "mujoco", cwd=here)
    (here / "arm.xml").write_text(mujoco.MjSpec.from_string(solved("rr").problem.robot.urdf).to_xml())
    (here / "both.xml").write_text('<mujoco><include file="arm.xml"/><include file="trajectory.xml"/></mujoco>')
    model = mujoco.MjModel.from_xml_path(str(here / "both.xml"))
    assert (model.nu, model.nkey) == (2, solved("rr").trajectory.resample(1000).t.size)
    run_here("export", "trajectory.npz", "--format", "mujoco", "--no-motors", cwd=here)
    assert "<motor" not in (here / "trajectory.xml").read_text()


def test_its_own_samples(here):
    output = answer(run_here("export", "trajectory.npz", "--rate", "own", "--json", cwd=here))
    assert output["rate"] is None and output["samples"] == solved("rr").trajectory.resample().t.size


def test_words(here):
    done = run_here("export", "trajectory.npz", cwd=here)
    assert done.returncode == 0
    assert " ".join(done.stdout.split()) == "trajectory.csv (212 rows at 1000 Hz, 0.210672 s)"


def test_too_many_rows_are_bad_input(here):
    long = Trajectory([0.0, 1e4], np.zeros((2, 1)), np.zeros((2, 1)), np.zeros((2, 1)))
    long.save(here / "long.npz")
    output = answer(run_here("export", "long.npz", "--json", cwd=here), 2)
    assert "give a lower rate" in output["message"]
    output = answer(run_here("export", "long.npz", "--format", "ros2", "--rate", "1", "--json", cwd=here), 2)
    assert "joint_names is empty" in output["message"]
    assert sorted(path.name for path in here.iterdir()) == ["long.npz", "trajectory.npz"]


def test_a_folder_in_the_files_place(here):
    (here / "trajectory.csv").mkdir()
    output = answer(run_here("export", "trajectory.npz", "--json", cwd=here), 2)
    assert "trajectory.csv: cannot be written (it is a folder" in output["message"]


def test_a_program_for_a_controller_has_its_rate(tmp_path):
    t = np.linspace(0, 0.2, 50)
    rest = np.zeros((50, 6))
    names = ad.Robot.from_library("ur5").joint_names
    Trajectory(t, rest, rest, rest, names).save(tmp_path / "m.npz")
    payload = ("--payload", "2.5", "--payload-com", "0,0,0.08")
    output = answer(run_here("export", "m.npz", "--format", "urscript", *payload, "--json", cwd=tmp_path))
    assert (output["rate"], output["files"], output["deviation"]) == (500, ["m.script"], None)
    assert (
        "set_target_payload(2.500000000, [0.000000000, 0.000000000, 0.080000000])"
        in (tmp_path / "m.script").read_text()
    )
    output = answer(run_here("export", "m.npz", "--format", "ur-rtde", "--tolerance", "0.03", "--json", cwd=tmp_path))
    assert output["files"] == ["m.py"] and "TOLERANCE = 0.03" in (tmp_path / "m.py").read_text()
    output = answer(run_here("export", "m.npz", "--format", "urscript", "--rate", "100", "--json", cwd=tmp_path), 2)
    assert "500 or 125" in output["message"]
    output = answer(run_here("export", "m.npz", *payload, "--json", cwd=tmp_path), 2)
    assert output["message"] == "--payload is of the formats urscript, ur-rtde, panda-python; csv has none"


def test_the_deviation_of_ros2_control_is_said_and_bounded(here):
    output = answer(run_here("export", "trajectory.npz", "--format", "ros2", "--json", cwd=here))
    # 4000 rad/s² within the first step, in which the quintic begins with none: 0.017 a h².
    assert output["rate"] == 1000 and 0 < output["deviation"] < 1.5e-4
    tight = ("export", "trajectory.npz", "--format", "ros2", "--tolerance", "4e-6", "--json")
    output = answer(run_here(*tight, cwd=here))
    assert output["rate"] > 1000 and output["deviation"] <= 4e-6  # raised
    output = answer(run_here(*tight, "--rate", "1000", cwd=here), 3)
    assert "give a higher --rate or --tolerance; --rate 8000 would do" in output["message"]


def exported_message(file, holds):
    assert answer(run_here("export", file, "--format", "ros2", "--json"))["holds"] is holds
    return file.with_suffix(".json").read_text()


def test_a_model_of_the_arm_that_moved(tmp_path):
    bare = ("--no-figure", "--no-report", "--json", "--out", "run")
    answer(run_here("mintime", "rr", "--payload", "0.1006", *bare, cwd=tmp_path))
    output = answer(run_here("export", "run/trajectory.npz", "--format", "mujoco", "--model", "--json", cwd=tmp_path))
    model = mujoco.MjSpec.from_file(str(tmp_path / output["files"][0])).compile()
    assert (model.nv, model.nu, model.nkey) == (2, 6, output["samples"]) and output["rate"] == 4000
    (tmp_path / "alone.npz").write_bytes((tmp_path / "run" / "trajectory.npz").read_bytes())
    # ros2_control repeats the last point for good.
    last = json.loads(exported_message(tmp_path / "run" / "trajectory.npz", holds=True))["points"][-1]
    arm = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), ad.Payload(mass=0.1006))
    np.testing.assert_allclose(last["effort"], arm.holding_torque(last["positions"]), rtol=1e-12)
    assert str(last["accelerations"]) == "[0.0, 0.0]"  # no -0.0
    exported_message(tmp_path / "alone.npz", holds=False)
    (tmp_path / "run" / "reference.npz").write_bytes((tmp_path / "alone.npz").read_bytes())  # as track leaves it
    exported_message(tmp_path / "run" / "reference.npz", holds=True)
    alone = ("export", "alone.npz", "--format", "mujoco", "--model", "--json")
    assert "give --robot" in answer(run_here(*alone, cwd=tmp_path), 2)["message"]
    assert "another arm, payload" in answer(run_here(*alone, "--robot", "rr", cwd=tmp_path), 2)["message"]
    output = answer(run_here("export", "alone.npz", "--model", "--json", cwd=tmp_path), 2)
    assert output["message"] == "--model is of the format mujoco; csv has none"


def test_a_motion_whose_payload_changes(tmp_path):
    motion = pick_and_place()[1]
    motion.save(tmp_path / "m.npz")
    output = answer(run_here("export", "m.npz", "--json", cwd=tmp_path))
    assert ",grasp," in (tmp_path / output["files"][0]).read_text() and output["duration"] == motion.duration
    keys = ("export", "m.npz", "--format", "mujoco", "--json")
    assert "--piece" in answer(run_here(*keys, cwd=tmp_path), 2)["message"]
    assert answer(run_here(*keys, "--piece", "2", cwd=tmp_path))["duration"] == pytest.approx(0.1)
    output = answer(run_here(*keys, "--piece", "3", "--model", "--robot", "rr", cwd=tmp_path))
    model = mujoco.MjSpec.from_file(str(tmp_path / output["files"][0])).compile()
    arm = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    carried = sum(model.body_mass) - sum(inertia.mass for inertia in list(arm.model.inertias)[1:])
    assert carried == pytest.approx(0.1006, rel=1e-6)
    output = answer(run_here("export", "m.npz", "--piece", "4", "--json", cwd=tmp_path), 2)
    assert output["message"] == "--piece is 4; the motion has 3 pieces"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--format", "mujoco", "--preset", "franka-panda"), "--preset checks commands for a controller"),
        (("--format", "mujoco", "--interface", "torque"), "--interface torque needs --preset"),
        (
            ("--format", "mujoco", "--robot", "rr"),
            "--robot, --no-geometry, --no-feedback, --lock, --arm, --tool and --package-dir",
        ),
        (("--lock", "joint1=0"), "need --model"),
    ],
)
def test_options_that_would_not_do_anything_are_refused(here, given, said):
    output = answer(run_here("export", "trajectory.npz", *given, "--json", cwd=here), 2)
    assert said in output["message"] and sorted(path.name for path in here.iterdir()) == ["trajectory.npz"]


def test_a_program_has_the_rate_of_its_controller(tmp_path):
    rest = np.zeros((50, 6))
    names = ad.Robot.from_library("ur5").joint_names
    Trajectory(np.linspace(0, 0.2, 50), rest, rest, rest, names).save(tmp_path / "m.npz")
    program = ("export", "m.npz", "--format", "urscript", "--json")
    assert answer(run_here(*program, "--preset", "ur5", cwd=tmp_path))["rate"] == 125  # a CB3 has no other
    assert answer(run_here(*program, "--preset", "ur5e", cwd=tmp_path))["rate"] == 500


def test_out_with_the_name_of_a_file_is_that_file(here):
    """It was a folder of that name: motion.yaml/trajectory.json."""
    out = ("export", "trajectory.npz", "--json", "--out")
    assert answer(run_here(*out, "motion.yaml", "--format", "ros2", cwd=here))["files"] == ["motion.yaml"]
    assert answer(run_here(*out, "new/motion.yml", cwd=here))["files"] == ["new/motion.yml"]  # the format by its ending
    assert set(json.loads((here / "motion.yaml").read_text())) == {"header", "joint_names", "points"}
    message = answer(run_here(*out, "motion.csv", "--format", "ros2", cwd=here), 2)["message"]
    assert message.startswith("motion.csv: ends in .csv, but a .json file would be written")
    assert answer(run_here(*out, "run.2026", cwd=here))["files"] == ["run.2026/trajectory.csv"]
    (here / "old.csv").mkdir()
    assert answer(run_here(*out, "old.csv", cwd=here))["files"] == ["old.csv/trajectory.csv"]


def test_a_command_of_several_files_refuses_the_name_of_one(here):
    for command in (("mintime", "rr"), ("pid", "rr"), ("reproduce",)):
        message = answer(run_here(*command, "--out", "motion.html", "--json", cwd=here), 2)["message"]
        assert message.startswith("motion.html: has the name of a file, but this command writes "), command
    assert not (here / "motion.html").exists()
    file = answer(run_here("urdf", "rr", "--out", "my.urdf", "--json", cwd=here))["files"]
    assert file == ["my.urdf"] and (here / "my.urdf").read_text().startswith("<")


@pytest.mark.parametrize(
    ("kind", "arm", "preset"),
    [("urscript", "ur5", "ur5e"), ("ur-rtde", "ur5", "ur5e"), ("panda-python", "panda", "franka-panda")],
)
def test_a_program_is_for_its_own_arms(tmp_path, kind, arm, preset):
    robot = ad.Robot.from_library(arm)
    t, still = np.linspace(0, 0.2, 50), np.zeros((50, robot.nv))
    slow, fast = (still + speed * t[:, None] for speed in (0.1, 7.0))
    others = [f"axis_{i}" for i in range(robot.nv)]
    for name, q, names, words in (
        ("own", slow, [f"left_{one}" for one in robot.joint_names], ""),
        ("foreign", slow, others, f"{kind} is a program for a {'UR' if robot.nv == 6 else 'Franka'} arm, and joint "),
        ("fast", fast, robot.joint_names, "moves at 7 rad/s, and no joint of one is faster than "),
    ):
        v = np.gradient(q, t, axis=0)
        Trajectory(t, q, v, still, names).save(tmp_path / f"{name}.npz")
        output = answer(run_here("export", f"{name}.npz", "--format", kind, "--json", cwd=tmp_path), 2 if words else 0)
        assert words in output.get("message", "")
    assert (
        "joint 'axis_0' is no name of one's; --preset checks"
        in answer(run_here("export", "foreign.npz", "--format", kind, "--json", cwd=tmp_path), 2)["message"]
    )
    given = run_here("export", "fast.npz", "--format", kind, "--preset", preset, "--json", cwd=tmp_path)
    assert "not written" in answer(given, 3)["message"]  # by the preset's own rules
