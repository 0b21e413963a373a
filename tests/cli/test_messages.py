"""Messages in the words of the door: options on the command line, arguments in Python, keys in files."""

import ast
import re
import shlex
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import armdyn as ad
from armdyn.cli import invocation
from armdyn.cli.invocation import in_options
from armdyn.errors import ProblemError
from armdyn.optimal.constraints.registry import PATH_CONSTRAINTS
from cli.command import app, run_here, run_json

SOURCE = Path(ad.__file__).parent
PYTHON_ONLY = {
    "control/laws/pid.py", "control/loop/loop.py", "control/stability", "models/robots/arm.py", "optimal/program",
    "optimal/problem_files.py", "paper", "parsing", "show", "studies/executor.py", "studies/dask_cluster.py",
    "studies/reading.py",
    "studies/tuning/tune.py", "dynamics", "cli", "studies/rows.py",
}  # fmt: skip
"""Their messages are about values that only Python makes, or about keys of files; the command line's own are checked
by its tests."""


@cache
def messages():
    """Texts of errors and warnings, as (file, line, text); formatted values are ¤."""
    return tuple(_messages())


def _messages():
    for file in sorted(SOURCE.rglob("*.py")):
        name = file.relative_to(SOURCE).as_posix()
        if any(name.startswith(one) for one in PYTHON_ONLY):
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            raised = node.exc if isinstance(node, ast.Raise) else None
            if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "warn":
                raised = node
            for part in [] if raised is None else ast.walk(raised):
                if isinstance(part, ast.JoinedStr):
                    pieces = [str(one.value) if isinstance(one, ast.Constant) else "¤" for one in part.values]
                    yield name, part.lineno, "".join(pieces)
                elif isinstance(part, ast.Constant) and isinstance(part.value, str):
                    yield name, part.lineno, part.value


def options():
    """Names of all options of all commands, as arguments in Python are called, that no other word has."""
    flags = {flag for command in app.registered_commands for flag in _flags(command.callback)}
    return {flag.lstrip("-").replace("-", "_") for flag in flags if "-" in flag.lstrip("-")}


def _flags(callback):
    return [invocation._flag(hint) for hint in callback.__annotations__.values() if invocation._flag(hint)]


@pytest.mark.slow
def test_no_message_gives_a_keyword_of_python():
    wrong = [
        f"{name}:{line}: {text}"
        for name, line, text in messages()
        if re.search(r"(?<![<\w&?`-])[a-z]+(_[a-z]+)*=(?![=\"¤])", re.sub(r"[\w.]+\([^()]*\)", "", text))
    ]
    assert not wrong


@pytest.mark.slow
def test_arguments_that_are_options_stand_in_backticks():
    """At the beginning of a message they are translated as they are."""
    names = options()
    wrong = [
        f"{name}:{line}: {text}"
        for name, line, text in messages()
        for word in re.findall(r"(?<![`\w.=(-])[a-z]+_[a-z_]+\b(?![`=(])", text)
        if word in names and not text.startswith(word)
    ]
    assert not wrong


def test_every_limit_along_the_way_has_its_option():
    for kind in PATH_CONSTRAINTS:
        if getattr(kind, "option", ""):
            assert in_options(f"{kind.__name__} is 0") == f"--limit {kind.option} is 0"


POSES = ("--q-start", "0,0", "--q-goal", "1,1")
REACHED = {
    "torque limits": (("mintime", "arm.urdf", *POSES), "give --effort-limit, or name the joint in --passive"),
    "no motor": (
        ("mintime", "rr", *POSES, "--effort-limit", "0"),
        "give --effort-limit, or name fewer joints in --pas",
    ),
    "regulator": (("track", "arm.urdf", *POSES, "--ramp", "1"), "give --effort-limit"),
    "degrees": (("mintime", "rr", "--q-start", "0,0", "--q-goal", "90,0"), "within all limits: --degrees"),
    "slow": (("mintime", "rr", *POSES, "--velocity-limit", "1e-9"), "give --velocity-limit of 0.00028 rad/s or more"),
    "tip speed": (("mintime", "rr", *POSES, "--limit", "tip-speed=1e-12"), "--limit tip-speed is 1e-12 m/s"),
    "reserve": (("mintime", "rr", *POSES, "--reserve", "1"), "--reserve of joint 'joint1' is 1.0"),
    "via": (("mintime", "rr", *POSES, "--via", "1"), "--via[0] has shape (1,)"),
    "contact": (("mintime", "rr", *POSES, "--allow-contact", "a,b"), "--allow-contact[0]: no link"),
    "unnamed": (("export", "m.npz", "--format", "ros2"), "the motion's joint_names is empty"),
    "arm": (("mintime", "ur5", "--arm", "a,b", *POSES), "--arm: "),
    "a file": (("mintime", "problem.toml"), "problem.toml, line 3: joint 'joint1' has torque limits"),
}


@pytest.mark.parametrize("case", REACHED)
def test_the_command_line_speaks_of_options(case, tmp_path):
    arguments, said = REACHED[case]
    text = re.sub(r'effort="[^"]*"', 'effort="0"', ad.Robot.from_spec(ad.ArmSpec.paper("rr")).urdf)
    (tmp_path / "arm.urdf").write_text(text)
    (tmp_path / "problem.toml").write_text('[robot]\nname = "arm.urdf"\n[problem]\nq_start = [0, 0]\nq_goal = [1, 1]\n')
    rest = np.zeros((2, 2))
    ad.Trajectory([0.0, 1.0], rest, rest, rest).save(tmp_path / "m.npz")
    message = run_json(*arguments, code=2, cwd=tmp_path)["message"]
    assert said in message and "`" not in message and not re.search(r"[a-z_]{3,}=", message)


def test_python_speaks_of_arguments():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    with pytest.raises(ProblemError, match=r"give `effort_limit`, or name fewer joints in `passive`"):
        ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[1, 1], effort_limit=0)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["nix=1"], "--effort-limit: there is no joint 'nix'; there are joint1, joint2"),
        (["50", "joint1=1"], "--effort-limit is given 2 times: once, or each as JOINT=NUMBER"),
        (["joint1=1,2"], "--effort-limit: 'joint1=1,2' must be JOINT=NUMBER throughout, each joint once"),
        (
            ["joint1=1", "joint1=2"],
            "--effort-limit: 'joint1=1,joint1=2' must be JOINT=NUMBER throughout, each joint once",
        ),
    ],
)
def test_limits_by_joint_name_that_are_none(options, says):
    typed = [word for one in options for word in ("--effort-limit", one)]
    done = run_here("mintime", "rr", *typed, "--no-figure")
    assert done.returncode == 2
    assert says in " ".join(done.stderr.split())


@pytest.mark.slow
def test_limits_by_joint_name_change_these_joints_alone(tmp_path):
    given = (
        "--effort-limit",
        "joint2=0.2",
        "--effort-limit",
        "joint1=2",
        "--no-figure",
        "--no-report",
        "--out",
        tmp_path,
    )
    found = ad.Trajectory.load(run_json("mintime", "rr", *given)["files"][0])
    assert np.max(np.abs(found.tau), axis=0) == pytest.approx([2.0, 0.2])  # bang-bang: both are reached


def test_one_number_that_raises_a_files_limits_is_said(tmp_path):
    given = "ur5", "--q-start", "home", "--q-goal", "home", "--effort-limit"
    said = " ".join(run_here("mintime", *given, "100", cwd=tmp_path).stderr.split())
    assert "--effort-limit 100 raises the file's limits of wrist_1_joint from 28, wrist_2_joint from 28" in said
    assert "shoulder" not in said.partition("; JOINT=")[0]
    for quiet in ("20", "wrist_1_joint=100", "150,150,150,100,100,100"):
        assert "raises" not in run_here("mintime", *given, quiet, cwd=tmp_path).stderr


UNPHYSICAL = '<inertia ixx=".9" ixy="0" ixz="0" iyy=".02" iyz="0" izz=".01"/>'


@pytest.mark.slow
def test_the_last_line_of_a_refusal_mends_the_file(tmp_path):
    """An impossible inertia and a missing torque limit, one after the other, were two runs and no command."""
    text = ad.Robot.from_spec(ad.ArmSpec.paper("rr")).urdf
    text = re.sub(r'effort="[^"]*"', 'effort="0"', re.sub(r"<inertia [^>]*>", UNPHYSICAL, text, count=1), count=1)
    (tmp_path / "my arm.urdf").write_text(text)
    given = "mintime", "my arm.urdf", *POSES, "--no-figure", "--no-report", "--effort-limit", "joint2=3"
    done = run_here(*given, cwd=tmp_path)
    *_, line = done.stderr.splitlines()
    assert done.returncode == 2 and "no torque limit: joint1" in " ".join(done.stderr.split())
    repair, again = line.replace("…", "3").split(" && ")
    assert repair == "armdyn doctor 'my arm.urdf' --repair --large nearest --out 'my arm-repaired.urdf'"
    assert run_here(*shlex.split(repair)[1:], cwd=tmp_path).returncode == 0
    assert run_here(*shlex.split(again)[1:], cwd=tmp_path).returncode == 0


def test_joints_without_torque_limits_are_named_at_once(tmp_path):
    text = re.sub(r'effort="[^"]*"', 'effort="0"', ad.Robot.from_spec(ad.ArmSpec.paper("rr")).urdf)
    (tmp_path / "arm.urdf").write_text(text)
    message = run_json("mintime", "arm.urdf", *POSES, code=2, cwd=tmp_path)["message"]
    assert "'joint1' has torque limits" in message and "'joint2' has torque limits" in message
    held = np.abs(ad.Robot.from_urdf(tmp_path / "arm.urdf").holding_torque([0, 0]))  # level, the hardest pose
    assert f"up to [N m or N]: joint1 {held[0]:.3g}, joint2 {held[1]:.3g}" in message
    assert message.endswith(
        "\narmdyn mintime arm.urdf --q-start 0,0 --q-goal 1,1 --json --effort-limit joint1=…,joint2=…"
    )
    with pytest.raises(ProblemError, match=r"; to mend: effort_limit=\{'joint1': …, 'joint2': …\}$"):
        ad.MinimumTimeProblem(ad.Robot.from_urdf(tmp_path / "arm.urdf"), q_start=[0, 0], q_goal=[1, 1])


def test_a_method_that_cannot_solve_the_problem_is_named_as_it_is_typed():
    refused = run_here("mintime", "rr", "--method", "profiles")
    assert refused.returncode == 2
    said = " ".join(refused.stderr.split())
    assert "--method profiles cannot solve this: every joint needs --acceleration-limit or --jerk-limit" in said


def test_an_option_without_effect_is_a_warning_in_the_answer(tmp_path):
    found = run_json("mintime", "r", "--calm", "0.01", "--starts", "1", "--no-report", "--no-figure", "--out", tmp_path)
    assert found["warnings"] == ["--calm has no effect here: motions of a mesh are as fast as can be"]
