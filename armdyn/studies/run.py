"""Engine of all studies: an executor runs the cases, and each result is stored as a row at once."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol, cast

import numpy as np

from armdyn.arguments import expect, flag, function, listener, one_of, path_of
from armdyn.errors import ResultError
from armdyn.optimal.problem.status import Stop, stopping
from armdyn.parallel import LISTEN
from armdyn.studies.executor import HERE, Ended, Executor, ExecutorOf, StudyCase, local_executor
from armdyn.studies.rows import SYNCS, RowStore, StudyRow, Sync, row_store
from armdyn.studies.study import Cases, Study
from armdyn.studies.tasks.task import ERROR, INTERRUPTED, CaseResult, StudyTask

_FEWEST = 5
"""Cases that must have ended before there is an estimate."""
_SURE = 2.0
"""Standard deviations either side: 95 % of normal estimates."""


class TimeLeft:
    """Estimate of the remaining time from the mean and variance of the ended cases.

    A case's time is taken as a random number with the mean and variance seen. That is wrong where later cases are
    harder than earlier ones, as along a grid's axis: the estimate then lags behind, and its range is too narrow.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        self._clock, self._began = clock, clock()
        self._times: list[float] = []

    def add(self, seconds: float) -> None:
        """Add a case with its duration [s]."""
        self._times.append(seconds)

    def left(self, cases: int) -> tuple[float, float] | None:
        """Least and greatest likely time for a number of cases [s]; None: too early.

        The mean is of wall time per case, for any number of workers, waits included. Its relative
        spread is that of the cases' own times: σ √(m² / n + m) for the sum of m more after n, the first term for the
        mean's uncertainty, the second for chance.
        """
        if (count := len(self._times)) < _FEWEST:
            return None
        each = (self._clock() - self._began) / count
        mean = float(np.mean(self._times))
        spread = float(np.std(self._times, ddof=1)) / mean if mean > 0 else 0.0
        off = _SURE * spread * np.sqrt(cases * cases / count + cases)
        return max(cases - off, 0.0) * each, (cases + off) * each


ATTEMPTS = 3
"""Worker deaths after which a case gets a row."""
DIED = "worker_died"
"""Status of a case whose workers died."""

_TOLD = 0.1
"""Least interval [s] between two reports of progress."""


@dataclass(frozen=True, kw_only=True)
class Progress:
    """Progress of a study.

    Attributes:
        cases: number of cases.
        done: number of rows, with those of earlier runs.
        bad: number of rows of this run that are not good.
        left: least and greatest likely time [s] until the end; None: too early to say.
        workers: number of workers.
    """

    cases: int
    done: int
    bad: int
    left: tuple[float, float] | None
    workers: int


@dataclass(frozen=True, kw_only=True)
class StudyRun:
    """Result of one run of a study.

    Attributes:
        file: of the rows.
        cases: number of cases.
        counts: number of rows of each status.
        done_here: number of rows that this run has added.
        interrupted: rows are missing, because Ctrl-C was pressed.
        seconds: duration of this run [s].
    """

    file: Path
    cases: int
    counts: dict[str, int]
    done_here: int
    interrupted: bool
    seconds: float


class ChainTask(StudyTask, Protocol):
    """Task whose cases are solved again from the motions of later cases."""

    def promising(self, row: StudyRow, later: StudyRow) -> bool:
        """Whether the motion of a later case may improve a row."""

    def better(self, row: StudyRow, other: StudyRow) -> bool:
        """Whether a row is better than another one of the same case."""


def run_study(
    study: Study,
    file: str | os.PathLike[str],
    executor: ExecutorOf = local_executor,
    progress: Callable[[Progress], None] | None = None,
    *,
    again: bool = False,
    sync: Sync = "full",
) -> StudyRun:
    """Run the missing cases of a study.

    A case whose worker dies is given to another one, three times at most; then its row says so. Ctrl-C ends the run and
    keeps the rows so far.

    Args:
        study: its task and cases.
        file: SQLite, for the rows.
        executor: executor for a task: `local_executor`, `in_process`, or `dask_executor(address)`.
        progress: called with the progress.
        again: do cases once more whose workers died, or whose work raised an unexpected exception.
        sync: when a row is on the disk itself, see `row_store`.

    Raises:
        ResultError: the file belongs to another study, is damaged, or another process writes to it.
        FileError: the file cannot be read or written.
        DiskFullError: the disk is full.
    """
    expect(study, Cases, "study", "read_study(path)")
    function(executor, "executor")
    progress, again = listener(progress), flag(again, "again")
    one_of(sync, SYNCS, "sync")
    path = Path(path_of(file, "file", error=ResultError))
    began = time.monotonic()
    with row_store(path, study.description, sync) as rows, stopping(np.inf) as stop:
        if again:
            rows.forget((DIED, ERROR))
        before = len(rows.numbers())
        chain = study.task.neighbours == "chain"
        if before < len(study) or chain:
            with executor(study.task) as opened:
                CaseRun(study, rows, opened, stop, progress).go()
        counts = rows.counts()
    done = sum(counts.values())
    return StudyRun(
        file=path, cases=len(study), counts=counts, done_here=done - before,
        interrupted=done < len(study) or (chain and bool(stop)), seconds=time.monotonic() - began,
    )  # fmt: skip


@dataclass
class CaseRun:
    """Runs the cases of a study that have no row yet, until all have one or `stop` is set.

    Attributes:
        cases: to be done.
        rows: where they are kept.
        executor: of the cases' task.
        stop: set by Ctrl-C, or at a deadline.
        progress: called with the progress.
        ended: called with each new row and its result.
    """

    cases: Cases
    rows: RowStore
    executor: Executor
    stop: Stop
    progress: Callable[[Progress], None] = lambda progress: None
    ended: Callable[[StudyRow, CaseResult], None] = lambda row, result: None
    deaths: dict[int, int] = field(default_factory=dict, init=False)

    def go(self) -> None:
        """Do the cases; of a chain also try later motions on earlier cases."""
        self._forward()
        if self.cases.task.neighbours == "chain" and not self.stop:
            self._back()

    def _forward(self) -> None:
        """Do the cases without a row."""
        self.done, self.moved = self.rows.numbers(), self.rows.moved()
        self.waiting = deque(k for k in range(len(self.cases)) if k not in self.done)
        left, bad, reported, time_left = len(self.waiting), 0, -np.inf, TimeLeft()
        self._give({})
        while left and not self.stop:
            rows, motions = list[StudyRow](), dict[int, bytes]()
            for one in self.executor.ended(LISTEN):
                result = self._accepted(one)
                if result is None:
                    if self.stop and one.result:  # its rows so far in this process
                        self.ended(self._row(one, one.result), one.result)
                    self.waiting.appendleft(one.k)
                    continue
                rows.append(self._row(one, result))
                time_left.add(one.seconds)
                if result.motion:
                    motions[one.k] = result.motion
                self.ended(rows[-1], result)
            self.moved.update(motions)
            self._give(motions)  # before the rows are written, so that no worker waits for the disk
            if rows:
                self.rows.append(rows, motions)
                self.done.update(row.k for row in rows)
                bad, left = bad + sum(not row.good for row in rows), left - len(rows)
                self._give(motions)  # cases that wait for these rows
            if not left or time.monotonic() - reported > _TOLD:
                reported, count, likely = time.monotonic(), len(self.cases), time_left.left(left)
                workers = self.executor.size
                self.progress(Progress(cases=count, done=count - left, bad=bad, left=likely, workers=workers))

    def _back(self) -> None:
        """Try the motions of later cases on earlier ones, from the last to the first, and keep the better rows."""
        task, found = cast(ChainTask, self.cases.task), {row.k: row for row in self.rows.rows()}
        for k in reversed(range(len(self.cases))):
            later = next((n for n in self.cases.nearest(k) if n > k), None)
            if later is None or "revisited" in found[k].facts or not task.promising(found[k], found[later]):
                continue
            settings, motion = self.cases.parameters(k), self.rows.motion(later)
            self.executor.give([StudyCase(k=k, settings=settings, guess=motion, begun_from=later, revisit=True)])
            while not (reports := self.executor.ended(LISTEN)) and not self.stop:
                pass
            result = None if self.stop or not reports else self._accepted(reports[0])
            if result is None:
                return
            row, motions = self._row(reports[0], result), dict[int, bytes]()
            if task.better(row, found[k]):
                found[k], motions = row, {k: result.motion}
                self.ended(row, result)
            found[k] = replace(found[k], facts={**found[k].facts, "revisited": later})
            self.rows.append([found[k]], motions, replace=True)

    def _give(self, fresh: Mapping[int, bytes]) -> None:
        """Give as many cases as the executor wants.

        Args:
            fresh: motions that are not stored yet.
        """
        while (count := self.executor.batch_size(len(self.waiting))) and (chosen := self._take(count)):
            motions, cases = dict(fresh), list[StudyCase]()
            for k in chosen:
                near = self._guess_cases(k)
                begun_from = next((n for n in near if n in self.moved), None)
                if begun_from is not None and begun_from not in motions:
                    motions[begun_from] = self.rows.motion(begun_from)  # one object, and so pickled once
                guess = b"" if begun_from is None else motions[begun_from]
                settings = self.cases.parameters(k)
                cases.append(StudyCase(k=k, settings=settings, guess=guess, begun_from=begun_from, near=near))
            self.executor.give(cases)

    def _guess_cases(self, k: int) -> tuple[int, ...]:
        """Cases whose motion may be the guess of a case, the nearest first."""
        kind = self.cases.task.neighbours
        near = () if kind == "off" else self.cases.nearest(k)
        return tuple(n for n in near if n < k) if kind == "chain" else near

    def _take(self, count: int) -> list[int]:
        """Take waiting cases; of a chain the next one, when the one before has its row."""
        if self.cases.task.neighbours == "chain":
            first = self.waiting[0] if self.waiting else 0
            count = int(not first or first - 1 in self.done)
        return [self.waiting.popleft() for _ in range(min(count, len(self.waiting)))]

    def _accepted(self, one: Ended) -> CaseResult | None:
        """Result of a case; None if it is to be repeated."""
        k, result = one.k, one.result
        self.deaths[k] = self.deaths.get(k, 0) + one.deaths + (result is None and not one.deaths)
        if result is None and self.deaths[k] >= ATTEMPTS:
            return CaseResult(status=DIED, message=f"its worker died, {self.deaths[k]} times; last {one.worker}")
        if result is not None and result.status == INTERRUPTED:
            if one.worker == HERE:  # which heard Ctrl-C
                self.stop.interrupt()
            return None
        return result

    def _row(self, one: Ended, result: CaseResult) -> StudyRow:
        return StudyRow(
            k=one.k, status=result.status, good=result.good, message=result.message, facts=result.facts,
            settings=self.cases.parameters(one.k), seconds=round(one.seconds, 6), worker=one.worker,
            attempts=self.deaths.pop(one.k) + (result.status != DIED), begun_from=one.begun_from,
        )  # fmt: skip
