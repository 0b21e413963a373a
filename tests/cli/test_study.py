"""`armdyn sweep STUDY.toml`, as a user sees it."""

import os
import signal
import subprocess
import time
from unittest.mock import Mock

import pytest

from armdyn.cli.sweeps.study import _left
from armdyn.show.figures import sweeps as figures
from armdyn.studies.rows import read_rows
from armdyn.studies.tables import study_table
from cli.command import COMMAND, answer, run_here, run_json

STUDY = """
[arms.r]
q_start = [-1.5707963267948966]
q_goal = [0.15707963267948966]
[vary]
payload = { from = 0.05, to = 0.2, count = 3 }
reserve = [0.0, 0.1]
"""


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "payloads.toml"
    path.write_text(STUDY)
    return path


@pytest.mark.slow
def test_rows_tables_and_figures(study, tmp_path, monkeypatch):
    output = answer(run_here("sweep", study, "--parquet", "--json", cwd=tmp_path))
    assert output["status"] == "done" and output["done"] == output["cases"] == output["done_here"] == 6
    folder = tmp_path / "results" / "sweep-payloads"
    names = {path.name for path in folder.iterdir() if not path.name.endswith((".lock", "-wal", "-shm"))}
    assert names == {file.rpartition("/")[2] for file in output["files"]}
    assert names >= {"study.sqlite", "rows.csv", "rows.parquet", "curve.png", "map.pdf", "pareto.png"}
    rows = study_table(folder / "study.sqlite")
    assert [row["payload"] for row in rows] == [0.05, 0.05, 0.125, 0.125, 0.2, 0.2]
    assert all(row["certified"] for row in rows)
    again = run_here("sweep", study, "--no-figure", cwd=tmp_path)
    assert again.returncode == 0 and "6 of 6: 6 usable" in again.stdout and "0 rows in" in again.stdout
    monkeypatch.setattr(figures, "figures_of", Mock(side_effect=KeyboardInterrupt))
    pressed = run_here("sweep", study, cwd=tmp_path)
    assert pressed.returncode == 130
    assert " ".join(pressed.stderr.split()) == (
        "armdyn: interrupted; finished rows are in results/sweep-payloads: the same command does the others"
    )


def test_a_refused_case_is_reported(study, tmp_path):
    study.write_text(STUDY + "q_goal.joint1 = [-1.5707963267948966]\n")
    done = run_here("sweep", study, "--no-figure", cwd=tmp_path)
    assert done.returncode == 3
    assert "6 of 6: 6 refused" in done.stdout and "same state" in done.stdout


@pytest.mark.slow
def test_payloads_of_a_robot_leave_a_study_s_rows_in_the_same_folder(tmp_path):
    (tmp_path / "r.toml").write_text("[arms.r]\nq_start = [-1.0]\nq_goal = [1.0]\n[vary]\npayload = [0.1, 0.2]\n")
    run_here("sweep", "r.toml", "--no-figure", cwd=tmp_path)
    run_here("sweep", "r", "--payload", "0.1", "--no-figure", cwd=tmp_path)
    assert len(study_table(tmp_path / "results" / "sweep-r" / "study.sqlite")) == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--payload", "1"], "read from the file alone"),
        (["--q-start", "1"], "--q-start: "),
        (["--reserve", "0.1"], "--reserve: "),
        (["--lock", "a=1"], "--lock: "),
        (["--starts", "3"], "--starts: "),
        (["--require", "certified"], "a study's rows say which motions are certified"),
        (["--scheduler", "here"], "write HOST:PORT"),
        (["--scheduler", "here:1", "--workers", "2"], "--workers are processes of this machine"),
    ],
)
def test_options_that_say_something_else(study, tmp_path, arguments, words):
    done = run_here("sweep", study, *arguments, cwd=tmp_path)
    assert done.returncode == 2 and words in " ".join(done.stderr.split())
    assert not list(tmp_path.glob("results/*/study.sqlite"))


def test_a_robot_has_no_scheduler(tmp_path):
    done = run_here("sweep", "r", "--scheduler", "node1:8786", cwd=tmp_path)
    assert done.returncode == 2 and "are for a study file" in " ".join(done.stderr.split())


def test_another_study_for_the_same_rows(study, tmp_path):
    run_here("sweep", study, "--no-figure", "--out", tmp_path / "out")
    study.write_text(STUDY.replace("0.1]", "0.2]"))
    done = run_here("sweep", study, "--no-figure", "--out", tmp_path / "out", "--json")
    output = answer(done, code=2)["message"]
    assert "vary.reserve.values is [0.0, 0.1] there and [0.0, 0.2] here" in output


@pytest.mark.slow
def test_ctrl_c_leaves_rows_and_tables(study, tmp_path):
    study.write_text(STUDY.replace("count = 3", "count = 500"))
    process = subprocess.Popen(
        [*COMMAND, "sweep", str(study), "--no-figure", "--json", "--out", "out"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    file = tmp_path / "out" / "study.sqlite"
    while rows_of(file) < 4:
        assert process.poll() is None
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)  # a terminal's goes to the workers, too
    out, errors = process.communicate(timeout=60)
    output = answer(subprocess.CompletedProcess([], process.returncode, out, errors), code=130)
    assert output["status"] == "interrupted" and 4 <= output["done"] < 1000
    assert len((tmp_path / "out" / "rows.csv").read_text().splitlines()) == output["done"] + 1 == rows_of(file) + 1
    assert all(row["status"] == "usable" for row in study_table(file))


def rows_of(file):
    try:
        with read_rows(file) as rows:
            return len(rows.numbers())
    except (OSError, ValueError):  # there is none yet
        return 0


RR = """
[arms.rr]
q_start = [-1.5707963267948966, 0.037399912542735635]
q_goal = [0.15707963267948966, -0.037399912542735635]
[vary]
payload = { from = 0.05, to = 0.25, count = 4 }
reserve = { from = 0.0, to = 0.2, count = 3 }
"""


@pytest.mark.slow
def test_a_study_killed_twice_is_resumed(tmp_path):
    """As a user's machine does it: SIGKILL, the same command, SIGKILL, the same command."""
    (tmp_path / "study.toml").write_text(RR)
    command = ["sweep", "study.toml", "--no-figure", "--out", "out"]
    file, before = tmp_path / "out" / "study.sqlite", 0
    for _ in range(2):
        process = subprocess.Popen([*COMMAND, *command], cwd=tmp_path, stdout=subprocess.DEVNULL)
        while rows_of(file) < before + 3:
            assert process.poll() is None
            time.sleep(0.01)
        process.kill()
        process.wait()
        before = rows_of(file)
    assert before < 12
    output = run_json(*command, cwd=tmp_path)
    assert output["done"] == 12 and output["done_here"] == 12 - before
    rows = study_table(file)
    assert [row["k"] for row in rows] == list(range(12)) and all(row["certified"] for row in rows)
    # In one go, without neighbours: the same, as certified optima are to 1e-9.
    (tmp_path / "alone.toml").write_text(RR + "[search]\nneighbours = 'off'\n")
    assert run_here("sweep", "alone.toml", "--no-figure", "--out", "alone", cwd=tmp_path).returncode == 0
    alone = study_table(tmp_path / "alone" / "study.sqlite")
    assert [row["duration_s"] for row in rows] == pytest.approx([row["duration_s"] for row in alone], rel=1e-8)
    assert not any(row["begun_from"] for row in alone) and sum(row["begun_from"] is not None for row in rows) >= 6


@pytest.mark.parametrize(
    ("left", "words"),
    [
        (None, "time left not yet known"),
        ((0.0, 0.4), "0 s left"),
        ((40.0, 80.0), "40 to 80 s left"),
        ((100.0, 300.0), "2 to 5 min left"),
        ((290.0, 310.0), "5 min left"),
        ((3600.0, 9000.0), "1 to 2 h left"),
    ],
)
def test_a_time_that_is_left(left, words):
    assert _left(left) == words
