"""Cases done in parallel: each once, also when workers die."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from functools import partial
from pathlib import Path

import pytest

from armdyn.errors import FileError, ResultError
from armdyn.studies.executor import Ended, local_executor
from armdyn.studies.problems import ARM
from armdyn.studies.rows import read_rows, row_store
from armdyn.studies.run import TimeLeft, run_study
from armdyn.studies.study import Axis, Study
from armdyn.studies.tasks.task import CaseResult
from toys import Square, row_count, squares

TWO = partial(local_executor, workers=2)
HERE = Path(__file__).parents[1]


def rows_of(file):
    with read_rows(file) as rows:
        return list(rows.rows())


def test_every_case_has_its_row(tmp_path):
    messages = []
    run = run_study(squares(20), tmp_path / "s.sqlite", TWO, messages.append)
    rows = rows_of(run.file)
    assert [(row.k, row.settings["x"], row.facts["square"]) for row in rows] == [(k, k, k * k) for k in range(20)]
    assert run.counts == {"squared": 20} and run.done_here == 20 and not run.interrupted
    assert {row.attempts for row in rows} == {1} and len({row.worker for row in rows}) <= 2
    assert messages[-1].done == messages[-1].cases == 20 and messages[-1].workers == 2


def test_bad_cases_have_rows_too(tmp_path):
    run = run_study(squares(6, refused=(1,), error=(3,)), tmp_path / "s.sqlite", TWO)
    rows = rows_of(run.file)
    assert [row.status for row in rows] == ["squared", "refused", "squared", "error", "squared", "squared"]
    assert rows[1].message == "x is 1" and rows[3].message == "ZeroDivisionError: one over nothing"
    assert [row.good for row in rows] == [True, False, True, False, True, True]


def test_a_death_is_tried_again_elsewhere_and_the_third_is_a_row(tmp_path):
    study = squares(12, deadly=(4,), once=(2, 7), marks=str(tmp_path))
    run = run_study(study, tmp_path / "s.sqlite", TWO)
    rows = rows_of(run.file)
    assert [row.k for row in rows] == list(range(12))
    assert [row.attempts for row in rows] == [1, 1, 2, 1, 3, 1, 1, 2, 1, 1, 1, 1]
    assert rows[4].status == "worker_died" and "died, 3 times" in rows[4].message
    assert all(row.status == "squared" for row in rows if row.k != 4)
    # The same again does nothing; with `again` the dead one is tried once more, and now there is nothing deadly.
    assert run_study(study, run.file, TWO).done_here == 0
    mended = run_study(squares(12), run.file, TWO, again=True)
    assert mended.counts == {"squared": 12}


def test_ctrl_c_keeps_the_rows_and_the_rest_follows(tmp_path):
    def press(progress):
        if progress.done >= 5:
            os.kill(os.getpid(), signal.SIGINT)

    study = squares(40, seconds=0.02)
    first = run_study(study, tmp_path / "s.sqlite", TWO, press)
    assert first.interrupted and 5 <= first.done_here < 40
    second = run_study(study, first.file, TWO)
    assert not second.interrupted and first.done_here + second.done_here == 40
    assert [row.k for row in rows_of(first.file)] == list(range(40))


KILLED = """
import sys
sys.path.insert(0, {here!r})
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from functools import partial
from toys import squares
from armdyn.studies.executor import Ended, local_executor
from armdyn.studies.run import run_study
run_study(squares(60, seconds=0.02), {file!r}, partial(local_executor, workers=2))
"""


@pytest.mark.slow
def test_a_study_killed_twice_is_resumed(tmp_path):
    file = tmp_path / "s.sqlite"
    command = [sys.executable, "-c", KILLED.format(here=str(HERE), file=str(file))]
    counts = []
    for more in (10, 15):
        process = subprocess.Popen(command)
        until = (counts[-1] if counts else 0) + more
        while row_count(file) < until:
            assert process.poll() is None
            time.sleep(0.01)
        process.kill()
        process.wait()
        counts.append(row_count(file))
    assert counts[-1] < 60
    run_study(squares(60), file, TWO)
    rows = rows_of(file)
    assert [(row.k, row.facts["square"]) for row in rows] == [(k, k * k) for k in range(60)]


def test_a_case_has_no_second_row(tmp_path):
    study = squares(3)
    run_study(study, tmp_path / "s.sqlite", TWO)
    row = rows_of(tmp_path / "s.sqlite")[1]
    with (
        row_store(tmp_path / "s.sqlite", study.description) as rows,
        pytest.raises(ResultError, match="a row already"),
    ):
        rows.append([row], {})


def test_another_study_is_refused_with_the_differences(tmp_path):
    run_study(squares(3), tmp_path / "s.sqlite", TWO)
    with pytest.raises(
        ResultError, match=r"vary\.x\.values is \[0\.0, 1\.0, 2\.0\] there and \[0\.0, 1\.0, 2\.0, 3\.0.*Repeat that"
    ):
        run_study(squares(4), tmp_path / "s.sqlite", TWO)
    older = {**squares(3).description(), "format": "armdyn-sweep-0"}
    with (
        pytest.raises(ResultError, match=r"format is \"armdyn-sweep-1\" there .* here\. Choose another `file`"),
        row_store(tmp_path / "s.sqlite", lambda: older),
    ):
        pass  # rows of another format cannot be repeated by this version
    assert len(rows_of(tmp_path / "s.sqlite")) == 3


def test_one_at_a_time(tmp_path, monkeypatch):
    monkeypatch.setattr("armdyn.studies.rows._LOCK_TIMEOUT", 0.1)
    study = squares(2)
    with (
        row_store(tmp_path / "s.sqlite", study.description),
        pytest.raises(ResultError, match="another process is at this study"),
        row_store(tmp_path / "s.sqlite", study.description),
    ):
        pass


def test_another_study_of_ours(tmp_path):
    other = tmp_path / "other.sqlite"
    with sqlite3.connect(other) as connection:
        connection.execute("CREATE TABLE t (x)")
    text = tmp_path / "text.sqlite"
    text.write_bytes(b"no database at all" * 100)
    for file, words in ((other, "not one of a study"), (text, "no study's file, or damaged")):
        with pytest.raises(ResultError, match=words):
            run_study(squares(2), file, TWO)
        with pytest.raises(ResultError, match=words), read_rows(file):
            pass
    with pytest.raises(FileError, match="no such file"), read_rows(tmp_path / "none.sqlite"):
        pass


def test_a_case_begins_with_the_nearest_that_is_ready(tmp_path):
    arms = Axis(name=ARM, values=("p", "q"))
    numbers = Axis(name="x", low=0.0, high=9.0, count=10)
    study = Study(task=Square(neighbours="add"), axes=(arms, numbers))
    run = run_study(study, tmp_path / "s.sqlite", partial(local_executor, workers=1))
    for row in rows_of(run.file):
        # One at a time, in order: the last one of the same arm is ready, and nothing is nearer.
        before = None if row.settings["x"] == 0 else row.k - 1
        assert row.begun_from == before
        assert row.facts["begun"] == (None if before is None else row.settings["x"] - 1)


def test_time_left_is_by_mean_and_spread_of_the_cases():
    now = [0.0]
    alike, unlike = TimeLeft(lambda: now[0]), TimeLeft(lambda: now[0])
    for k in range(8):
        now[0] += 2.0
        assert alike.left(5) is None or k >= 5
        alike.add(4.0)  # two workers
        unlike.add(2.0 if k % 2 else 6.0)
    assert alike.left(10) == pytest.approx((20.0, 20.0))
    least, most = unlike.left(10)
    # σ² = 4 · 8/7 about 4 s: 2 · (σ / 4) √(100 / 8 + 10) = 5.07 cases of 2 s either side.
    assert (least, most) == pytest.approx((20 - 10.14, 20 + 10.14), abs=0.01)


class Requeued:
    """An executor that has a case given again, as a cluster does after its connection broke."""

    size = 1

    def __init__(self):
        self.waiting, self.requeued = [], False

    def batch_size(self, left):
        return min(left, 1 - len(self.waiting))

    def give(self, cases):
        self.waiting += cases

    def ended(self, seconds):
        case = self.waiting.pop()
        status = "squared" if self.requeued else "interrupted"
        self.requeued = True
        return [Ended(k=case.k, result=CaseResult(status=status, good=True))]


def test_a_case_that_comes_back_undone_is_given_again(tmp_path):
    run = run_study(squares(3), tmp_path / "s.sqlite", lambda task: nullcontext(Requeued()))
    assert run.counts == {"squared": 3} and not run.interrupted


def test_writers_take_turns_and_leave_no_lock(tmp_path):
    file, inside, most = tmp_path / "rows.sqlite", [], []

    def write():
        for _ in range(20):
            with row_store(file, dict):
                inside.append(1)
                most.append(len(inside))
                time.sleep(0.001)
                inside.pop()

    with ThreadPoolExecutor(4) as pool:
        for each in [pool.submit(write) for _ in range(4)]:
            each.result()
    assert most == [1] * 80
    assert [one.name for one in tmp_path.iterdir()] == ["rows.sqlite"]
