"""Where results go is looked at before the work begins; a full disk is an end of its own."""

import errno
import json
import os
import sys
import warnings
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

import armdyn as ad
from armdyn.cli.console import Answer, progress_bar
from armdyn.cli.execution import carry_out
from armdyn.cli.options.results import OutputOptions
from armdyn.models import Robot
from armdyn.paper.outcomes.store import load_outcome
from armdyn.paper.plan import Plan
from cli.command import app

COMMAND = [sys.executable, "-c", "from armdyn.cli import main; main()"]
COMMANDS = {
    "mintime": ["mintime", "rr"],
    "pid": ["pid", "r"],
    "sweep": ["sweep", "r", "--payload", "0.1"],
    "replay": ["replay", "r", "motion.npz"],
    "export": ["export", "motion.npz"],
    "reproduce": ["reproduce", "--only", "example4", "--payload", "0.1006"],
    "urdf": ["urdf", "rr"],
}
WORK = {
    "mintime": "armdyn.solve_minimum_time",
    "pid": "armdyn.simulate_pid",
    "sweep": "armdyn.cli.sweeps.payloads.chain",
    "replay": "armdyn.show.page.report.write_page",
    "export": "armdyn.cli.export.write_whole",
    "reproduce": "armdyn.paper.reproduce.run_case",
    "urdf": "armdyn.cli.paper.write_whole",
}


def run(*arguments, code):
    """One command in this process, and its JSON object."""
    done = CliRunner().invoke(app, [*map(str, arguments), "--json"])
    assert done.exit_code == code, done.output
    return json.loads(done.stdout)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a motion, and no command that gets to work in it."""
    monkeypatch.chdir(tmp_path)
    ends = [[0.0], [1.0]]
    ad.Trajectory(t=[0.0, 1.0], q=ends, v=[[0.0], [0.0]], tau=[[0.0], [0.0]]).save("motion.npz")
    return tmp_path


@pytest.fixture
def idle(monkeypatch):
    """Commands that fail where they would begin to work."""

    def begun(*_, **__):
        raise AssertionError("the work has begun")

    for work in WORK.values():
        monkeypatch.setattr(work, begun)


@pytest.mark.parametrize("command", COMMANDS)
def test_an_out_that_cannot_be_written_is_refused_before_the_work(command, here, idle):
    (here / "file").write_text("mine")
    for out, words in {
        "file": "a file is in the way",
        "file/below/it": "a file is in the way",
        "x" * 260: "File name too long",
        "/proc/self/results": "cannot be written to",
    }.items():
        answer = run(*COMMANDS[command], "--out", out, code=2)
        assert answer["status"] == "bad_input" and words in answer["message"] and out in answer["message"]
    assert (here / "file").read_text() == "mine"
    assert {path.name for path in here.iterdir()} == {"file", "motion.npz"}  # nothing is left behind


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
@pytest.mark.parametrize("command", COMMANDS)
def test_an_out_without_permission_is_refused_before_the_work(command, here, idle):
    (here / "closed").mkdir(mode=0o500)
    assert "Permission denied" in run(*COMMANDS[command], "--out", "closed/run", code=2)["message"]


@pytest.mark.parametrize(
    ("command", "name"),
    [
        ("mintime", "trajectory.npz"),
        ("mintime", "figure.pdf"),
        ("pid", "report.html"),
        ("pid", "result.json"),
        ("sweep", "100g.npz"),
        ("sweep", "sweep.csv"),
        ("replay", "replay.html"),
        ("export", "motion.csv"),
        ("reproduce", "index.html"),
        ("urdf", "planar_rr.urdf"),
    ],
)
def test_a_folder_in_a_files_place_is_refused_before_the_work(command, name, here, idle):
    if command == "urdf":
        from armdyn.models import ArmSpec
        from armdyn.models.values.urdf import urdf_file_name

        name = urdf_file_name(ArmSpec.paper("rr"), None)
    (here / "run" / name).mkdir(parents=True)
    answer = run(*COMMANDS[command], "--out", "run", code=2)
    assert f"run/{name}: cannot be written (it is a folder" in answer["message"]


@pytest.mark.parametrize("name", ["cases", "tables", "figures", "example4_r_pid"])
def test_a_file_in_the_place_of_one_of_reproduces_folders(name, here, idle):
    (here / "run").mkdir()
    (here / "run" / name).write_text("")
    answer = run(*COMMANDS["reproduce"], "--out", "run", code=2)
    assert f"run/{name}: cannot be written to (a file is in the way" in answer["message"]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_full_disk_is_exit_5(command, here, monkeypatch):
    quick = ["--time-limit", "0.001"] if command in ("mintime", "sweep") else []

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("os.fsync", full)
    answer = run(*COMMANDS[command], *quick, "--out", "run", code=5)
    assert answer["status"] == "disk_full" and not answer["success"]
    assert answer["message"].startswith("disk full while writing run/")
    assert answer["message"].endswith("; what was written before is whole")
    left = {path.name for path in here.rglob("*") if path.is_file() and path.name != "motion.npz"}
    assert left <= {"payloads.sqlite", "payloads.sqlite.lock"} if command == "sweep" else not left  # the rows are whole


def test_files_written_before_the_disk_was_full_are_whole(tiny_disk):
    answer = run("pid", "r", "--no-figure", "--out", tiny_disk / "run", code=5)
    assert answer["message"].startswith(f"disk full while writing {tiny_disk}/run/report.html")
    assert {path.name for path in (tiny_disk / "run").iterdir()} == {"trajectory.npz", "result.json"}
    assert ad.Trajectory.load(tiny_disk / "run" / "trajectory.npz").model_hash == Robot.from_spec(_r()).model_hash


def test_reproduce_resumes_after_a_full_disk(tiny_disk):
    """Files written before the disk is full stay."""
    (tiny_disk / "filler").write_bytes(bytes(20 * 2**10))
    plan = Plan(only=("example4",))
    answer = run("reproduce", "--only", "example4", "--out", tiny_disk / "run", code=5)
    assert answer["status"] == "disk_full"
    kept = {path.stem for path in (tiny_disk / "run" / "cases").glob("*.json")}
    whole = {case.name for case in plan.cases() if load_outcome(tiny_disk / "run" / "cases", case)}
    assert kept == whole


def test_people_get_one_line(tiny_disk):
    (tiny_disk / "filler").write_bytes(bytes(64 * 2**10))
    done = CliRunner().invoke(app, ["urdf", "rr", "--out", str(Path(tiny_disk) / "run")])
    assert done.exit_code == 5 and "disk full while writing" in " ".join(done.output.split())
    assert "Traceback" not in done.output


def _r():
    return ad.ArmSpec.paper("r")


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_reproduce_counts_the_papers_numbers_and_not_its_own_comparisons(tmp_path):
    done = CliRunner().invoke(app, [*COMMANDS["reproduce"], "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    printed = " ".join(done.output.split())
    # The time of Table 4, which is reproduced, and the torque of Table 7, which does not.
    assert "of 2 numbers in the paper's tables 1 are reproduced, 0 nearly, and 1 by no reading" in printed


@pytest.mark.parametrize(
    ("name", "folder"),
    [("mein arm ü.urdf", "mein_arm_ü"), ("腕.urdf", "腕"), ("робот-2.urdf", "робот-2"), ("a\udcff/../b:\n.urdf", "b_")],
)
def test_a_folder_has_the_letters_of_its_robot_s_name_in_any_script(name, folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert OutputOptions(out=None).folder("mintime", name) == Path("results", f"mintime-{folder}")


def test_a_warning_is_printed_at_once_and_only_once(capsys):
    seen = []

    def command():
        for _ in range(2):
            warnings.warn("the goal cannot be held", ad.ArmdynWarning, stacklevel=1)
        seen.append(capsys.readouterr().err)
        return Answer()

    with pytest.raises(typer.Exit):
        carry_out(command)
    assert seen[0].count("warning: the goal cannot be held") == 1 and not capsys.readouterr().err


def test_a_hidden_bar_does_without_rich_progress(monkeypatch):
    monkeypatch.setitem(sys.modules, "rich.progress", None)  # an import raises
    with progress_bar("study.toml", 2) as bar:
        bar.update(1, "one of two")
        with bar.aside():
            pass
