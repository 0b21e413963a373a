"""A problem in TOML is the problem in Python; mistakes have a line; strangers' files reach nothing else."""

import dataclasses
import inspect
import re
from pathlib import Path

import numpy as np
import pytest

import armdyn as ad
from armdyn.cli.typed.positions import reading_degrees
from armdyn.cli.typed.problem_file import OPTIONS, PROBLEM, ROBOT, problem_of
from armdyn.errors import ProblemError
from cli.command import answer, run_here

DOCS = (Path(__file__).parents[3] / "docs" / "problem_files.md").read_text()
RR = """[robot]
name = "rr"
payload = { mass = 0.1006 }

[problem]
q_start = [-1.5, "2deg"]
q_goal = [0.2, "-pi/84"]

[options]
effort = "quick"
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Writes a problem file, in a folder of its own that is the working folder, and gives its name."""
    (tmp_path / "home").mkdir()
    monkeypatch.chdir(tmp_path / "home")

    def put(text):
        Path("problem.toml").write_text(text)
        return "problem.toml"

    return put


def refused(name):
    with pytest.raises(ProblemError) as caught:
        problem_of(name)
    return str(caught.value)


def test_names_are_those_of_python():
    fields = {field.name for field in dataclasses.fields(ad.MinimumTimeProblem) if field.init}
    assert set(PROBLEM) == fields - {"robot"}
    assert set(OPTIONS) <= {field.name for field in dataclasses.fields(ad.MinimumTimeOptions)}
    assert set(ROBOT) - {"name", "passive"} <= set(inspect.signature(ad.Robot.from_urdf).parameters)


def test_a_file_is_the_problem_in_python(write):
    posed = problem_of(write(RR))
    arm = posed.problem.robot
    same = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), ad.Payload(mass=0.1006))
    assert arm.model_hash == same.model_hash and posed.options == {"effort": "quick"}
    assert np.array_equal(posed.problem.q_start, [-1.5, np.deg2rad(2)])
    assert np.array_equal(posed.problem.q_goal, [0.2, -np.pi / 84])


def test_the_example_of_the_docs_is_a_problem(write):
    example = re.search(r"```toml\n(.*?)```", DOCS, re.S)[1]
    problem = problem_of(write(example)).problem
    assert np.array_equal(problem.q_start, ad.Robot.from_library("panda").pose("ready"))
    assert problem.robot.payload.mass == 0.5 and len(problem.via) == 1 and problem.obstacles[0].radius == 0.1
    assert problem.conditions[0].limit == 2.5 and np.all(np.asarray(problem.reserve) == 0.05)
    # What is commented out there is right, too.
    other = example.replace('# lock = { panda_joint7 = "45deg" }   arm', 'lock = { panda_joint7 = "45deg" }\narm')
    other = re.sub(r"(?m)^(q_goal|via|reserve|conditions).*$", "", other).replace("# goal_pose", "goal_pose")
    other = re.sub(r"}   instead.*", "}", re.sub(r"\[\[problem.obstacles.*?\n\n", "", other, flags=re.S))
    other = (
        other.replace('q_start = "ready"', "q_start = [0, -0.785, 0, -2.356, 0, 1.571]")
        .replace('"panda_hand_tcp"', '"panda_link7"')
        .replace(", rpy = [0, 3.14, 0]", "")
    )
    problem = problem_of(write(other)).problem
    assert problem.robot.nv == 6 and problem.robot.locked["panda_joint7"] == pytest.approx(np.pi / 4)
    assert problem.goal_pose.frame == "panda_link7"


def test_a_urdf_beside_the_file_and_below(write, tmp_path):
    text = ad.urdf_from_spec(ad.ArmSpec.paper("rr"))
    (tmp_path / "home" / "arms").mkdir()
    (tmp_path / "home" / "arms" / "mine.urdf").write_text(text)
    name = write(RR.replace('"rr"', '"arms/mine.urdf"'))
    assert problem_of(name).problem.robot.nv == 2
    assert problem_of(f"{tmp_path}/home/../home/{name}").problem.robot.nv == 2


def test_a_file_reaches_nothing_outside_its_folder(write, tmp_path):
    (tmp_path / "outside.urdf").write_text(ad.urdf_from_spec(ad.ArmSpec.paper("rr")))
    Path("link.urdf").symlink_to(tmp_path / "outside.urdf")
    for name in ("../outside.urdf", str(tmp_path / "outside.urdf"), "link.urdf", "/etc/passwd", "x/../../outside.urdf"):
        assert "is outside the folder" in refused(write(RR.replace('"rr"', f'"{name}"'))), name
    assert "fetched from the internet" in refused(write(RR.replace('"rr"', '"panda_description"')))
    assert "is no path" in refused(write(RR.replace('"rr"', '"a\\u0000.urdf"')))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("q_goal", "q_gaol", "line 7: no key 'q_gaol' in [problem]; did you mean 'q_goal'?"),
        ("mass", "mas", "line 3: no key 'mas' in [robot.payload]; did you mean 'mass'?"),
        ("[options]", "[optoins]", "line 9: no table 'optoins' at the top; did you mean 'options'?"),
        ('"quick"', '"fast"', "line 10: effort is 'fast'; it is one of"),
        ("-1.5,", "-90,", "line 6: start of joint 'joint1' (index 0) is -90 rad, outside its limits"),
        ("0.2,", "true,", "line 7: q_goal has True; a position is a number"),
        ('"-pi/84"]', '"-pi/84", 1]', "line 7: q_goal has shape (3,)"),
        ('"2deg"', '"2m"', "line 6: q_start: '2m', but the joint turns"),
        ('[0.2, "-pi/84"]', '"hoem"', "line 7: q_goal is 'hoem'; expected a number per joint"),
        ("mass = 0.1006", "mass = -1", "line 3: payload mass is -1"),
        ("{ mass = 0.1006 }", "1", "line 3: payload is 1; it is a table"),
        ('name = "rr"', "name = 1", "line 2: name of the robot is 1"),
        ('name = "rr"', 'name = "rrrr"', "line 2: no robot named 'rrrr'; did you mean 'rrr'?"),
        ("q_start = ", "wrap = 1\nq_start = ", "line 6: wrap is 1; it must be True or False"),
        ("q_start = ", "via = 1\nq_start = ", "line 6: via is 1; it must be a list"),
        ("q_start = ", "obstacles = [1]\nq_start = ", 'line 6: obstacle 1: "type" is None'),
        ("q_start = ", "conditions = ['x']\nq_start = ", "line 6: --limit: no limit is called 'x'"),
        ("q_start = ", "#", "line 5: [problem] has no q_start: 2 positions of joint1, joint2"),
        ("payload =", "lock = { joint1 = 1 }\npayload =", "line 3: --lock: 'rr' has no joints to lock"),
        ("payload =", "arm = 'x'\npayload =", "line 3: arm is 'x'; it is two joints or links"),
    ],
)  # fmt: skip
def test_mistakes_have_their_line(write, old, new, words):
    assert f"problem.toml, {words}" in refused(write(RR.replace(old, new, 1)))


def test_the_command_line_does_not_say_it_again(write):
    name = write(RR)
    for options in (
        ["--payload", 1],
        ["--q-start", "0,0"],
        ["--wrap"],
        ["--arm", "a,b"],
        ["--clearance", 1],
        ["--degrees"],
    ):
        facts = answer(run_here("mintime", name, *options, "--json"), 2)
        assert facts["message"].startswith(options[0]) and "says" in facts["message"], options


def test_bound_takes_a_file_and_some_say_that_they_do_not(write):
    name = write(RR.replace("q_start", "velocity_limit = 5\nq_start"))
    facts = answer(run_here("bound", name, "--json"))
    assert facts["robot"] == "rr" and facts["kinematic"] == pytest.approx(1.7 / 5, rel=1e-12)
    for command in ("doctor", "robots"):
        message = answer(run_here(command, name, "--json"), 2)["message"]
        assert "is a problem file, which mintime, bound, sweep, track" in message


TASK = ("--payload", 0.1006, "--q-start", "-1.5,2deg", "--q-goal", "0.2,-pi/84")


@pytest.mark.parametrize(
    "command",
    [
        ("track", "--ramp", 0.5, "--plant-payload", 0.12, "--no-report", "--no-figure"),
        ("pid", "--duration", 1, "--no-report", "--no-figure"),
        ("monte-carlo", "--ramp", 0.5, "--count", 3, "--payload-range", "0.9,1.1", "--no-figure"),
        ("tune", "--controller", "lqr", "--generations", 1, "--members", 2, "--held-out", 1),
    ],
)
def test_closed_loops_take_the_arm_and_the_poses_of_a_file(write, command):
    name, (what, *options) = write(RR), command
    told, same = (run_here(what, *robot, *options, "--json") for robot in ((name,), ("rr", *TASK)))
    told, same = (answer(one, one.returncode) for one in (told, same))
    assert told.keys() == same.keys()
    # Of r, rr and rrr by name pid's arrival is the paper's, of joint 1; a file's arm is any arm.
    beside = {"files", "write_seconds", "seconds"} | ({"arrival_rule", "arrival_time"} if what == "pid" else set())
    assert {key for key in told if told[key] != same[key]} <= beside
    message = answer(run_here(what, name, *options, *TASK[:2], "--json"), 2)["message"]
    assert message == "--payload: problem.toml says what the problem is; write it there"


def test_track_follows_the_problem_of_a_file(write):
    told = run_here(
        "track", write(RR.replace("q_start", "reserve = 0.2\nq_start")), "--json", "--no-figure", "--no-report"
    )
    same = run_here("track", "rr", *TASK, "--reserve", 0.2, "--json", "--no-figure", "--no-report")
    assert answer(told)["reference_duration"] == pytest.approx(
        answer(same)["reference_duration"], rel=1e-8
    )  # certified
    moving = run_here("track", write(RR.replace("q_start", "v_start = [1, 0]\nq_start")), "--ramp", 0.5, "--json")
    assert "from rest to rest" in answer(moving, 2)["message"]


def test_a_sweep_over_payload_takes_a_file(write):
    name = write(RR)
    told = answer(run_here("sweep", name, "--payload", "0,0.1006", "--json", "--no-figure"))
    same = answer(run_here("sweep", "rr", "--payload", "0,0.1006", *TASK[2:], "--json", "--no-figure"))
    for one, other in zip(told["rows"], same["rows"], strict=True):
        assert one["payload_kg"] == other["payload_kg"]
        assert one["duration_s"] == pytest.approx(other["duration_s"], rel=1e-8)  # both are certified
    message = answer(run_here("sweep", name, "--payload", "0,1", "--q-goal", "0,0", "--json"), 2)["message"]
    assert message == "--q-goal: problem.toml says what the problem is; write it there"


def test_degrees_are_not_of_files(write):
    with reading_degrees(True):
        assert "says units itself" in refused(write(RR))


def test_mintime_solves_a_file_and_its_options_go_before(write):
    facts = answer(run_here("mintime", write(RR), "--json", "--no-figure", "--no-report", "--require", "certified"))
    task = ("--payload", 0.1006, "--q-start", "-1.5,2deg", "--q-goal", "0.2,-pi/84", "--effort", "quick")
    told = run_here("mintime", "rr", *task, "--json", "--no-figure", "--no-report")
    assert facts["duration"] == answer(told)["duration"] and facts["files"][0].startswith("results/mintime-problem")
    facts = answer(run_here("mintime", "problem.toml", "--json", "--no-figure", "--no-report", "--time-limit", "-1"), 2)
    assert "--time-limit" in facts["message"]
