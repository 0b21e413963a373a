"""A study's cases, done by a crew, each a row as soon as it has ended."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from armdyn.arguments import expect, flag, function, listener, one_of
from armdyn.optimal.problem.stop import Stop, stopping
from armdyn.studies.sweeps.database import SYNCS, Database, Row, Sync, database
from armdyn.studies.sweeps.executors.executor import Case, Crew, Ended
from armdyn.studies.sweeps.executors.local import local_crew
from armdyn.studies.sweeps.neighbours import Neighbours
from armdyn.studies.sweeps.pace import Pace
from armdyn.studies.sweeps.study import Study
from armdyn.studies.sweeps.tasks.task import INTERRUPTED, Outcome, Task

ATTEMPTS = 3
"""At a case whose workers die."""
DIED, ERROR = "worker_died", "error"
"""Statuses that say nothing of the case itself: `run_study` may try these again."""

_LISTEN = 0.25
"""How long is waited before Ctrl-C is looked for, and progress told [s]."""

CrewOf = Callable[[Task], AbstractContextManager[Crew]]


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a study is.

    Attributes:
        cases: of it.
        done: of them, with those of earlier runs.
        bad: of those done in this run, how many are not what was wanted.
        left: the least and the most time that is likely to be left [s]; None: too early to say.
        workers: of the crew.
    """

    cases: int
    done: int
    bad: int
    left: tuple[float, float] | None
    workers: int


@dataclass(frozen=True, kw_only=True)
class StudyRun:
    """What there is of a study.

    Attributes:
        file: with its rows.
        cases: of the study.
        counts: rows of each status.
        done_here: rows that this run has added.
        interrupted: some cases are missing, for Ctrl-C was pressed.
        seconds: that this run took [s].
    """

    file: Path
    cases: int
    counts: dict[str, int]
    done_here: int
    interrupted: bool
    seconds: float


def run_study(
    study: Study,
    file: str | os.PathLike[str],
    crew: CrewOf = local_crew,
    progress: Callable[[Progress], None] | None = None,
    *,
    again: bool = False,
    sync: Sync = "full",
) -> StudyRun:
    """Do a study's cases, or those that are missing of one that was stopped or killed.

    A case whose worker dies is done by another, three times at most; then its row says so. Ctrl-C ends it with the
    rows that there are.

    Args:
        study: with its task.
        file: SQLite, for the rows.
        crew: who works, for a task: `local_crew`, or `cluster_crew(address)`.
        progress: told how far it is.
        again: do cases once more whose workers died, or whose work raised what it should not.
        sync: when a row is on the disk itself, see `database`.

    Raises:
        ResultError: the file is of another study, damaged, or another process is at it.
        FileError: it cannot be read or written.
        DiskFullError: there is no room for a row.
    """
    expect(study, Study, "study", "read_study(path)")
    function(crew, "crew")
    tell, again = listener(progress), flag(again, "again")
    one_of(sync, SYNCS, "sync")
    began = time.monotonic()
    with database(file, study.asked(), sync) as rows:
        if again:
            rows.forget((DIED, ERROR))
        before = rows.numbers()
        with stopping(np.inf) as stop:
            if len(before) < len(study):
                with crew(study.task) as who:
                    _Sweep(study, rows, who, stop, tell, before).run()
        there = rows.counts()
    done = sum(there.values())
    return StudyRun(
        file=Path(file), cases=len(study), counts=there, done_here=done - len(before),
        interrupted=done < len(study), seconds=time.monotonic() - began,
    )  # fmt: skip


@dataclass
class _Sweep:
    """One run of a study."""

    study: Study
    rows: Database
    crew: Crew
    stop: Stop
    tell: Callable[[Progress], None]
    done: set[int]
    deaths: dict[int, int] = field(default_factory=dict)
    waiting: deque[int] = field(default_factory=deque)
    again: deque[int] = field(default_factory=deque)
    bad: int = 0

    def run(self) -> None:
        """Until all is done, or Ctrl-C."""
        self.waiting = deque(k for k in range(len(self.study)) if k not in self.done)
        near = Neighbours(self.study, self.rows.moved()) if self.study.task.uses_neighbours else None
        pace, left = Pace(), len(self.waiting)
        self._give(near, {})
        while left and not self.stop:
            rows, motions = list[Row](), dict[int, bytes]()
            for one in self.crew.ended(_LISTEN):
                row = self._row(one)
                if row is None:
                    self.again.append(one.k)
                    continue
                rows.append(row)
                pace.add(one.seconds)
                if one.outcome and one.outcome.motion:
                    motions[one.k] = one.outcome.motion
            if near:
                near.moved.update(motions)
            self._give(near, motions)  # first, so that nobody waits for the disk
            if rows:
                self.rows.append(rows, motions)
                self.bad += sum(not row.good for row in rows)
                left -= len(rows)
            told = Progress(
                cases=len(self.study),
                done=len(self.study) - left,
                bad=self.bad,
                left=pace.left(left),
                workers=self.crew.size,
            )
            self.tell(told)

    def _give(self, near: Neighbours | None, fresh: Mapping[int, bytes]) -> None:
        """Have so many cases worked on as the crew wants.

        Args:
            near: who is near; None: no motion is a guess.
            fresh: motions that have no row yet.
        """
        while count := self.crew.wanted(len(self.again) + len(self.waiting)):
            motions, cases = dict(fresh), list[Case]()
            for k in [(self.again or self.waiting).popleft() for _ in range(count)]:
                about = near.near(k) if near else ()
                neighbour = next((n for n in about if near and n in near.moved), None)
                if neighbour is not None and neighbour not in motions:
                    motions[neighbour] = self.rows.motion(neighbour)  # once, and so it is sent
                guess = b"" if neighbour is None else motions[neighbour]
                case = Case(k=k, settings=self.study.parameters(k), guess=guess, begun_from=neighbour, near=about)
                cases.append(case)
            self.crew.give(cases)

    def _row(self, ended: Ended) -> Row | None:
        """Of what came back; None: it is to be done again."""
        k, outcome = ended.k, ended.outcome
        self.deaths[k] = self.deaths.get(k, 0) + ended.deaths + (outcome is None and not ended.deaths)
        if outcome is None:
            if self.deaths[k] < ATTEMPTS:
                return None
            outcome = Outcome(
                status=DIED, message=f"whoever worked on it died, {self.deaths[k]} times; last {ended.worker}"
            )
        if outcome.status == INTERRUPTED:
            return None
        deaths = self.deaths.pop(k)
        return Row(
            k=k, status=outcome.status, good=outcome.good, message=outcome.message, settings=self.study.parameters(k),
            facts=outcome.facts, seconds=round(ended.seconds, 6), worker=ended.worker,
            attempts=deaths + (outcome.status != DIED), begun_from=ended.begun_from,
        )  # fmt: skip
