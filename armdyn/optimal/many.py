"""Many minimum-time problems on all cores."""

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from armdyn.arguments import expect, listener, several
from armdyn.optimal.answer.solution import Solution, without_motion
from armdyn.optimal.minimum_time import solve_minimum_time
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status, stopping
from armdyn.parallel import LISTEN, job_pool


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
    report, began = listener(progress), time.monotonic()
    jobs = [partial(_solved, one, replace(options, workers=1)) for one in checked]
    known, waiting, died = dict[int, Solution](), deque(range(len(jobs))), set[int]()
    with stopping(np.inf) as stop, job_pool(jobs, options.workers) as pool:
        while len(known) < len(jobs) and not stop:
            here = not (known and pool.count)
            if here:
                ended: list[tuple[int, Solution | None]] = [(waiting[0], jobs[waiting.popleft()]())]
            else:
                while pool.idle and waiting:
                    pool.submit(waiting[0], waiting.popleft())
                ended = [(k, result and result[0]) for k, _, result in pool.finished(LISTEN)]
            for k, solution in ended:
                if solution is None and k in died:  # such as for lack of memory
                    solution = without_motion(checked[k], Status.FAILED, "its worker died, twice")
                if solution is None or solution.status is Status.INTERRUPTED:
                    waiting.append(k)
                    died |= {k} if solution is None else set()
                    if here:  # the solve itself received Ctrl-C
                        stop.interrupt()
                    continue
                chosen = len(checked[k].goals) > 1  # for a goal pose, its best branch
                known[k] = solution if chosen else replace(solution, problem=checked[k])
                report(_progress(known, len(jobs), time.monotonic() - began))
    missing = "interrupted before it was solved"
    return [known.get(k) or without_motion(problem, Status.INTERRUPTED, missing) for k, problem in enumerate(checked)]


def _progress(known: Mapping[int, Solution], count: int, seconds: float) -> str:
    """Line of text on the solutions so far, after some seconds."""
    done, usable = len(known), sum(one.usable for one in known.values())
    left = seconds / done * (count - done)
    return f"{done} of {count} solved, {usable} usable" + (f"; about {left:.0f} s left" if left >= 1 else "")


def _solved(problem: MinimumTimeProblem, options: MinimumTimeOptions) -> Solution:
    """The solution of one problem; an exception becomes its status."""
    try:
        return solve_minimum_time(problem, options)
    except Exception as error:  # reported by its solution; the other problems are solved
        return without_motion(problem, Status.FAILED, f"{type(error).__name__}: {error}")
