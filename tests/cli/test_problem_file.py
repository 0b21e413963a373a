"""Problem files on the command line, in the place of a robot."""

import re

import pytest

from armdyn.cli.invocation import running
from armdyn.cli.options.poses import PoseOptions
from armdyn.cli.options.task import refuse_with_a_file
from armdyn.errors import ProblemError
from armdyn.optimal.problem_files import read_problem_file
from cli.command import answer, run_here
from problems import RR_FILE


def refused(name):
    with pytest.raises(ProblemError) as caught:
        read_problem_file(name)
    return str(caught.value)


def test_the_command_line_does_not_say_it_again(write_problem):
    name = write_problem(RR_FILE)
    for options in (
        ["--payload", 1],
        ["--q-start", "0,0"],
        ["--wrap"],
        ["--arm", "a,b"],
        ["--clearance", 1],
        ["--degrees"],
    ):
        facts = answer(run_here("mintime", name, *options, "--json"), 2)
        assert facts["message"].startswith(options[0]) and re.search(
            "has its own units|the file alone", facts["message"]
        ), options


def test_bound_takes_a_file_and_some_say_that_they_do_not(write_problem):
    name = write_problem(RR_FILE.replace("q_start", "velocity_limit = 5\nq_start"))
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
        pytest.param(
            ("tune", "--controller", "lqr", "--generations", 1, "--members", 2, "--held-out", 1), marks=pytest.mark.slow
        ),
    ],
)
def test_closed_loops_take_the_arm_and_the_poses_of_a_file(write_problem, command):
    name, (what, *options) = write_problem(RR_FILE), command
    output, same = (run_here(what, *robot, *options, "--json") for robot in ((name,), ("rr", *TASK)))
    output, same = (answer(one, one.returncode) for one in (output, same))
    assert output.keys() == same.keys()
    # Of r, rr and rrr by name pid's arrival is the paper's, of joint 1; a file's arm is any arm.
    beside = {"files", "write_seconds", "seconds"} | ({"arrival_rule", "arrival_time"} if what == "pid" else set())
    assert {key for key in output if output[key] != same[key]} <= beside
    message = answer(run_here(what, name, *options, *TASK[:2], "--json"), 2)["message"]
    assert message == "--payload: with a file it is read from the file alone; write it into problem.toml"


def test_track_follows_the_problem_of_a_file(write_problem):
    output = run_here(
        "track",
        write_problem(RR_FILE.replace("q_start", "reserve = 0.2\nq_start")),
        "--json",
        "--no-figure",
        "--no-report",
    )
    same = run_here("track", "rr", *TASK, "--reserve", 0.2, "--json", "--no-figure", "--no-report")
    assert answer(output)["reference_duration"] == pytest.approx(
        answer(same)["reference_duration"], rel=1e-8
    )  # certified
    moving = run_here(
        "track", write_problem(RR_FILE.replace("q_start", "v_start = [1, 0]\nq_start")), "--ramp", 0.5, "--json"
    )
    assert "from rest to rest" in answer(moving, 2)["message"]


def test_a_sweep_over_payload_takes_a_file(write_problem):
    name = write_problem(RR_FILE)
    output = answer(run_here("sweep", name, "--payload", "0,0.1006", "--json", "--no-figure"))
    same = answer(run_here("sweep", "rr", "--payload", "0,0.1006", *TASK[2:], "--json", "--no-figure"))
    for one, other in zip(output["rows"], same["rows"], strict=True):
        assert one["payload_kg"] == other["payload_kg"]
        assert one["duration_s"] == pytest.approx(other["duration_s"], rel=1e-8)  # both are certified
    message = answer(run_here("sweep", name, "--payload", "0,1", "--q-goal", "0,0", "--json"), 2)["message"]
    assert message == "--q-goal: with a file it is read from the file alone; write it into problem.toml"


def test_degrees_are_not_of_files(write_problem):
    with running("mintime", {}, {"degrees": True}), pytest.raises(ProblemError, match="has its own units"):
        refuse_with_a_file(write_problem(RR_FILE), PoseOptions())


def test_mintime_solves_a_file_and_its_options_go_before(write_problem):
    facts = answer(
        run_here("mintime", write_problem(RR_FILE), "--json", "--no-figure", "--no-report", "--require", "certified")
    )
    task = ("--payload", 0.1006, "--q-start", "-1.5,2deg", "--q-goal", "0.2,-pi/84", "--search", "quick")
    output = run_here("mintime", "rr", *task, "--json", "--no-figure", "--no-report")
    assert facts["duration"] == answer(output)["duration"] and facts["files"][0].startswith("results/mintime-problem")
    facts = answer(run_here("mintime", "problem.toml", "--json", "--no-figure", "--no-report", "--time-limit", "-1"), 2)
    assert "--time-limit" in facts["message"]
