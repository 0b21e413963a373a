"""`armdyn reproduce` as a user runs it."""

import csv
import json
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

from cli import command


def run(*arguments, code=0):
    done = command.run_here("reproduce", *arguments)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_one_table_with_two_payloads(tmp_path):
    only = ("--only", "table4", "--payload", "0.1006,0.5", "--out", tmp_path)
    answer = json.loads(run(*only, "--json").stdout)
    assert answer["success"] and answer["status"] == "done" and not answer["failed"]
    rows = list(csv.DictReader((tmp_path / "tables" / "table4.csv").open(newline="")))
    assert {(row["payload_kg"], row["reading"]) for row in rows} == {
        (payload, reading) for payload in ("0.1006", "0.5") for reading in ("tip", "mM")
    }
    assert sum(answer["verdicts"].values()) >= len(rows) and answer["verdicts"]["reproduced"] >= 2
    assert all(Path(file).exists() for file in answer["files"])
    for example in ("example1_r_mintime", "example4_r_pid"):
        folder = {path.name for path in (tmp_path / example).iterdir()}
        assert folder == {"trajectory.npz", "figure.png", "figure.pdf", "report.html", "result.json"}
    # A second run only reads, and says so.
    words = run(*only).stdout
    assert "minimum time" in words and "are reproduced" in " ".join(words.split())
    assert "index.html" in "".join(words.split())  # a long path is broken anywhere


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--only", "table9"), "no 'table9'"),
        (("--payload", "heavy"), "'heavy' is not a number"),
        (("--payload", "-1"), "-1.0 kg"),
        (("--arrival-rule", "soon"), "--arrival-rule is 'soon'"),
    ],
)
def test_bad_input_is_exit_2(tmp_path, arguments, message):
    done = run(*arguments, "--out", tmp_path / "out", code=2)
    assert message in " ".join(done.stderr.split())
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_exit_2(tmp_path):
    (tmp_path / "file").write_text("")
    assert "file" in run("--only", "example4", "--out", tmp_path / "file", code=2).stderr


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_after_an_interrupt_a_study_resumes_from_the_finished_cases(tmp_path):
    # When the first loop of Example 4 has ended, the three others and all of Example 1 are still to come.
    arguments = ["--only", "example4,example1", "--payload", "0.1006,0.5", "--out", str(tmp_path)]
    process = subprocess.Popen(
        [*command.COMMAND, "reproduce", *arguments, "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 200
    while not list(tmp_path.glob("cases/*.json")) and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGINT)
    output, errors = process.communicate(timeout=120)
    assert process.returncode == 130, errors
    answer = json.loads(output)
    assert answer["status"] == "interrupted" and "run the same command again" in answer["message"]
    assert "Traceback" not in errors
    kept = {path: path.stat().st_mtime_ns for path in tmp_path.glob("cases/*.json")}
    assert kept
    again = json.loads(run(*arguments, "--json").stdout)
    assert set(again["cases"]) > {path.stem for path in kept}
    assert all(path.stat().st_mtime_ns == written for path, written in kept.items())
