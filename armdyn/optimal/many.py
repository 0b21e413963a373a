"""Many minimum-time problems on all cores."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from armdyn.arguments import expect, listener, several
from armdyn.optimal.answer.solution import Solution, without_motion
from armdyn.optimal.minimum_time import solve_minimum_time
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status, Stop, stopping
from armdyn.parallel import LISTEN, ForkPool, job_pool


def solve_many(
    problems: Sequence[MinimumTimeProblem],
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> list[Solution]:
    """Solve problems in parallel, each as by `solve_minimum_time` alone.

    Every problem has one process; the first is solved in this process before workers are forked, so that they share its
    compiled programs. A solution does not depend on the number of workers or their order.
    `MinimumTimeOptions(bound=False)` leaves out the lower bounds, for data sets without proofs.

    Args:
        problems: problems of one robot or of several.
        options: options of every solve; `workers` is the number of processes, None: one per core.
        progress: called with a line of text after every solution.

    Returns:
        One solution for each problem, in their order. If a solve raised, or its workers died, `status` is "failed"
        and `message` the reason. After Ctrl-C unfinished problems have the status "interrupted".

    Raises:
        ProblemError: problems, options or progress has a wrong type.
    """
    given = several(problems, "problems")
    checked = [expect(one, MinimumTimeProblem, f"problems[{k}]") for k, one in enumerate(given)]
    options = MinimumTimeOptions() if options is None else expect(options, MinimumTimeOptions, "options")
    batch = _Batch(checked, replace(options, workers=1), listener(progress))
    with stopping(np.inf) as stop:
        batch.solve(0, stop)
        with job_pool([partial(_solved, one, batch.options) for one in checked], options.workers) as pool:
            if pool.count and not stop:
                batch.share(pool, stop)
            for k in range(len(checked)):  # without workers
                batch.solve(k, stop)
    return batch.solutions()


class _Batch:
    """Problems and their solutions so far."""

    def __init__(
        self, problems: Sequence[MinimumTimeProblem], options: MinimumTimeOptions, progress: Callable[[str], None]
    ):
        self.problems, self.options, self._progress = problems, options, progress
        self._known, self._usable, self._began = dict[int, Solution](), 0, time.monotonic()

    def solve(self, k: int, stop: Stop) -> None:
        """Solve the problem of index k in this process, unless it is solved, or there is none, or `stop` is set."""
        if stop or k in self._known or k >= len(self.problems):
            return
        solution = _solved(self.problems[k], self.options)
        if solution.status is Status.INTERRUPTED:  # the solve itself received Ctrl-C
            stop.interrupt()
        else:
            self._add(k, solution)

    def share(self, pool: ForkPool[Solution], stop: Stop) -> None:
        """Solve the remaining problems by workers."""
        waiting, deaths = deque(k for k in range(len(self.problems)) if k not in self._known), set[int]()
        while len(self._known) < len(self.problems) and not stop:
            while pool.idle and waiting:
                pool.submit(waiting[0], waiting.popleft())
            for k, _, result in pool.finished(LISTEN):
                if result is not None and result[0].status is not Status.INTERRUPTED:
                    own, solved = self.problems[k], result[0].problem  # for a goal pose, its chosen branch
                    self._add(k, replace(result[0], problem=own if len(own.goals) == 1 else solved))
                    continue
                if result is None and k in deaths:  # such as for lack of memory
                    self._add(k, without_motion(self.problems[k], Status.FAILED, "its worker died, twice"))
                else:
                    waiting.append(k)
                    deaths |= {k} if result is None else set()

    def solutions(self) -> list[Solution]:
        """Solutions of all problems; "interrupted" for missing ones."""
        missing = "interrupted before it was solved"
        return [
            self._known.get(k) or without_motion(problem, Status.INTERRUPTED, missing)
            for k, problem in enumerate(self.problems)
        ]

    def _add(self, k: int, solution: Solution) -> None:
        self._known[k] = solution
        self._usable += solution.usable
        done, count = len(self._known), len(self.problems)
        left = (time.monotonic() - self._began) / done * (count - done)
        self._progress(
            f"{done} of {count} solved, {self._usable} usable" + (f"; about {left:.0f} s left" if left >= 1 else "")
        )


def _solved(problem: MinimumTimeProblem, options: MinimumTimeOptions) -> Solution:
    """The solution of one problem; an exception becomes its status."""
    try:
        return solve_minimum_time(problem, options)
    except Exception as error:  # reported by its solution; the other problems are solved
        return without_motion(problem, Status.FAILED, f"{type(error).__name__}: {error}")
