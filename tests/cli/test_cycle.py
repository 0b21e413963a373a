"""`armdyn cycle`: the table, files, JSON and exit codes of a cycle file."""

import csv
import io
import json
import signal
import subprocess
import time
from pathlib import Path

import psutil
import pytest

import armdyn as ad
from armdyn.cli.motion.cycle import rate_of
from armdyn.errors import ProblemError
from armdyn.optimal.problem.policy.search import CyclePolicy
from armdyn.parallel import core_count
from armdyn.trajectory.formats import FORMATS
from cli.command import COMMAND, answer, run, run_here, run_json
from cycles import BOLT


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A small cycle, solved once: its folder, and the printed JSON."""
    folder = tmp_path_factory.mktemp("cycle")
    (folder / "bolt.toml").write_text(BOLT)
    formats = ("--format", "csv", "--format", "ros2")
    return folder, run_json("cycle", "bolt.toml", "--no-figure", "--out", "out", "--costs", *formats, cwd=folder)


def test_json_says_each_step_with_its_share_and_remedy(solved):
    _, facts = solved
    assert (facts["success"], facts["status"], facts["order"], facts["closed"]) == (True, "solved", [1, 2, 3, 4], False)
    assert [step["kind"] for step in facts["steps"]] == ["move", "grasp", "move", "release"]
    assert sum(step["duration"] for step in facts["steps"]) == pytest.approx(facts["duration"], rel=1e-12)
    assert sum(step["share"] for step in facts["steps"]) == pytest.approx(1.0)
    assert facts["gap"] == pytest.approx(facts["duration"] / facts["lower_bound"] - 1)
    first, grasp, second, release = facts["steps"]
    assert (first["carries"], second["carries"]) == (None, {"name": "bolt", "mass": 0.1})
    assert "torque of joint" in first["decided_by"] and "10 % more of it saves at most" in first["would_help"]
    assert (grasp["decided_by"], grasp["would_help"]) == ("a rest of 0.2 s", "10 % shorter saves 20 ms")
    assert (release["decided_by"], release["would_help"]) == ("", "")
    assert "step 2 (grasp bolt) without its rest: 200 ms less" in [cost["said"] for cost in facts["costs"]]
    assert [(part["begin"], part["end"]) for part in facts["parts"]] == [(grasp["begin"], release["begin"])]


def test_help_names_the_number_of_programs_that_is_the_default():
    words = " ".join(run_here("cycle", "--help").stdout.replace("│", " ").split())
    assert f"By default {CyclePolicy().bound_programs}." in words


def test_files_are_the_motion_with_its_payloads_its_formats_and_the_table(solved):
    folder, facts = solved
    names = {Path(file).name for file in facts["files"]}
    assert names == {"trajectory.npz", "report.html", "result.json", "steps.csv", "trajectory.csv", "trajectory.json"}
    motion = ad.Trajectory.load(folder / "out" / "trajectory.npz")
    assert [(piece.name, piece.event, piece.load.mass) for piece in motion.pieces] == [
        ("to the bolt", "", 0.0), ("grasp bolt", "grasp", 0.1), ("to the hole", "", 0.1),
        ("release bolt", "release", 0.0),
    ]  # fmt: skip
    # The release at the very end, without a rest, is a piece of 1 µs.
    assert motion.duration == pytest.approx(facts["duration"] + 1e-6, abs=1e-9)
    rows = list(csv.DictReader(io.StringIO((folder / "out" / "steps.csv").read_text())))
    assert [(row["step"], row["what"], row["carries"]) for row in rows[:3]] == [
        ("1", "to the bolt", ""), ("2", "grasp bolt", "bolt, 0.1 kg"), ("3", "to the hole", "bolt, 0.1 kg")
    ]  # fmt: skip
    result = json.loads((folder / "out" / "result.json").read_text())
    assert result["steps"] == facts["steps"] and result["request"]["command"].startswith("armdyn cycle bolt.toml")


def test_the_table_is_for_people(solved):
    folder, _ = solved
    (folder / "again.toml").write_text(BOLT.replace("[cycle]", "[cycle]\nclosed = true"))
    done = run_here(
        "cycle", "again.toml", "--no-figure", "--no-report", "--out", "out", "--require", "gap:1e-9", cwd=folder
    )
    assert done.returncode == 4
    for words in (
        "to the bolt",
        "a rest of",
        "cycles an hour",
        "no useful lower bound",
        "is missing: gap",
        "no cycle through",
    ):
        assert words in " ".join(done.stdout.split()), words


def test_a_program_of_too_many_rows_is_exported_piece_by_piece(tmp_path):
    assert rate_of(FORMATS["csv"], 450.0, tmp_path) == 250.0
    with pytest.raises(ProblemError, match=r"--format urscript: 450 s at 500 Hz .* armdyn export .* --piece N"):
        rate_of(FORMATS["urscript"], 450.0, tmp_path)


@pytest.mark.slow
def test_a_rest_of_minutes_has_a_file_of_a_lower_rate(tmp_path):
    (tmp_path / "bolt.toml").write_text(BOLT.replace("dwell = 0.2", "dwell = 300"))
    said = run_here("cycle", "bolt.toml", "--no-figure", "--no-report", "--out", "out", cwd=tmp_path).stdout
    assert "300 s of it at rest" in said and "an hour" not in said  # it ends elsewhere: there is no next one
    assert "a rest of 300 s,10 % shorter saves 30 s" in (tmp_path / "out" / "steps.csv").read_text()
    _, _, second, *others = (tmp_path / "out" / "trajectory.csv").read_text().splitlines()
    assert second.startswith("0.002,") and others[-1].startswith("300.")


@pytest.mark.parametrize(
    ("change", "arguments", "code", "said"),
    [
        (("0.4, 0.6", "0.4"), (), 2, "bolt.toml, line 9: .*step 1|to has"),
        (("mass = 0.1", "mass = 90"), (), 2, "step 2 (grasp bolt): the arm cannot rest with 'bolt' of 90 kg"),
        (("", ""), ("--format", "cvs"), 2, "--format is 'cvs'"),
        (("", ""), ("--require", "certified"), 2, "of a cycle the gap can be required"),
        (("", ""), ("--require", "speed:3"), 2, "of a cycle the gap can be required"),
        (("", ""), ("--format", "urscript"), 2, "has 2 joints; urscript is for arms of 6"),
        (('search = "quick"', "time_limit = 1e-3"), (), 3, "time"),
    ],
)
def test_faults_are_named(tmp_path, change, arguments, code, said):
    (tmp_path / "bolt.toml").write_text(BOLT.replace(*change))
    facts = run_json("cycle", "bolt.toml", "--out", "out", *arguments, code=code, cwd=tmp_path)
    assert not facts["success"]
    assert any(words in facts["message"] for words in said.split("|")), facts["message"]


def test_options_override_the_file_s(tmp_path):
    (tmp_path / "bolt.toml").write_text(BOLT)
    facts = run_json("cycle", "bolt.toml", "--out", "out", "--time-limit", "0.002", code=3, cwd=tmp_path)
    assert facts["status"] == "time_limit" and facts["duration"] is None
    assert "the time limit of 0.002 s" in facts["message"]
    assert [Path(file).name for file in facts["files"]] == ["result.json"]


@pytest.mark.slow
@pytest.mark.skipif(core_count() < 2, reason="workers are forked where there are cores for them")
def test_an_interrupt_of_the_command_alone_reaches_its_workers(tmp_path):
    # With 1 kg no search of RRR with this many guesses ends early: it takes minutes.
    text = BOLT.replace('"rr"', '"rrr"').replace("mass = 0.1", "mass = 1").replace('search = "quick"', "starts = 5000")
    poses = {"0.1, 0.2": "-1.4, 0.1, 0.1", "0.4, 0.6": "-1.7, 0.1, 0.1", "1.0, -0.4": "-1.3, -0.4, 0.1"}
    for two, three in poses.items():
        text = text.replace(two, three)
    (tmp_path / "bolt.toml").write_text(text)
    arguments = ["cycle", "bolt.toml", "--json", "--no-report", "--no-figure", "--out", "out"]
    process = subprocess.Popen([*COMMAND, *arguments], stdout=-1, stderr=-1, text=True, cwd=tmp_path)
    workers = list[psutil.Process]()
    while process.poll() is None and sum(one.cpu_times().user for one in workers) < 0.5:
        time.sleep(0.01)
        workers = psutil.Process(process.pid).children()
    process.send_signal(signal.SIGINT)  # a terminal would tell the workers, too
    facts = answer(subprocess.CompletedProcess((), process.wait(60), *process.communicate()), code=130)
    assert facts["status"] == "interrupted" and not facts["success"]
    assert (tmp_path / "out" / "result.json").exists()


def test_without_a_file_the_example_is_named(tmp_path):
    assert "armdyn cycle --example" in run_json("cycle", code=2, cwd=tmp_path)["message"]


def test_the_example_is_that_of_the_repository_and_overwrites_nothing(tmp_path):
    facts = run_json("cycle", "--example", cwd=tmp_path)
    assert facts["files"] == ["cell.toml"]
    own = Path(__file__).parents[2] / "examples" / "cell.toml"
    assert (tmp_path / "cell.toml").read_bytes() == own.read_bytes()
    assert "is there already" in run_json("cycle", "--example", code=2, cwd=tmp_path)["message"]
    run_json("cycle", "other.toml", "--example", cwd=tmp_path)
    cycle = ad.read_cycle(tmp_path / "other.toml")
    assert cycle.closed and [arm.payload.mass for arm in cycle.arms if arm.payload] == [1.0, 1.0]


@pytest.mark.slow
def test_a_cycle_between_obstacles_that_is_infeasible_says_so_and_nothing_more(tmp_path):
    file = tmp_path / "cell.toml"
    ball = '{ type = "sphere", name = "ball", center = [0.34, 0, -0.12], radius = 0.05 }'
    text = BOLT.replace("start = [0.1, 0.2]", f"start = [0.1, 0.2]\nobstacles = [{ball}]")
    file.write_text(text.replace("[1.0, -0.4]", "[-0.6, 0.4]"))
    done = run("cycle", file, "--no-figure", "--no-report", "--out", tmp_path)
    assert done.returncode == 3 and "inside 'ball'" in " ".join(done.stdout.split())
    assert not done.stderr  # such as nanobind's about geometry that is alive at the end
