"""Protocol of executors, which run the cases of a study; sequential execution in one worker."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

from armdyn.studies.rows import Value
from armdyn.studies.tasks.task import CaseResult, StudyTask, result_of

HERE = "this process"
"""Name of the worker that is the engine's own process: when its case is interrupted, the study ends."""


@dataclass(frozen=True, kw_only=True)
class StudyCase:
    """A case of a study as a worker gets it.

    Attributes:
        k: its number.
        settings: of the case.
        guess: motion of a neighbour; empty: none.
        begun_from: number of that neighbour; None: none.
        near: numbers of its neighbours, the nearest first: the motion of one that the same worker has just done is
            preferred to a farther guess.
        revisit: the case has a row already.
    """

    k: int
    settings: Mapping[str, Value]
    guess: bytes = b""
    begun_from: int | None = None
    near: tuple[int, ...] = ()
    revisit: bool = False


@dataclass(frozen=True, kw_only=True)
class Ended:
    """Report of a worker on a case.

    Attributes:
        k: number of the case.
        result: None: the worker died.
        seconds: work on it [s].
        worker: name of the worker.
        deaths: number of workers that died of the case, and that the executor has replaced itself.
        begun_from: number of the case whose motion was the guess; None: none.
    """

    k: int
    result: CaseResult | None
    seconds: float = 0.0
    worker: str = ""
    deaths: int = 0
    begun_from: int | None = None


class Executor(Protocol):
    """Workers of a study, which are sent cases and report results."""

    @property
    def size(self) -> int:
        """Number of cases that run concurrently."""

    def batch_size(self, left: int) -> int:
        """Number of cases to send to a worker now; 0 if all workers are busy.

        Args:
            left: number of cases that wait.
        """

    def give(self, cases: Sequence[StudyCase]) -> None:
        """Submit cases to one worker, which runs them in sequence."""

    def ended(self, seconds: float) -> list[Ended]:
        """Wait for reports, at most this time [s]."""


ExecutorOf = Callable[[StudyTask], AbstractContextManager[Executor]]
"""Opens an executor for a task."""


def run_in_turn(task: StudyTask, cases: Sequence[StudyCase], time_limit: float) -> Iterator[Ended]:
    """Do cases one after the other, each from the nearest available motion.

    Args:
        task: the work on each.
        cases: at least one; the first is done in any case.
        time_limit: time [s] after which no case is begun; the caller submits the remaining ones again.
    """
    began, motions = time.perf_counter(), dict[int, bytes]()
    for case in cases:
        begun_from, guess = _nearest(case, motions)
        result, seconds = result_of(task, case.settings, guess, case.revisit)
        if result.motion:
            motions[case.k] = result.motion
        yield Ended(k=case.k, result=result, seconds=seconds, begun_from=begun_from)
        if time.perf_counter() - began > time_limit:
            return


def _nearest(case: StudyCase, motions: Mapping[int, bytes]) -> tuple[int | None, bytes]:
    """Number and motion of the nearest case, among those solved by this worker and the submitted guess."""
    for k in case.near:
        if k == case.begun_from:
            break
        if k in motions:
            return k, motions[k]
    return case.begun_from, case.guess
