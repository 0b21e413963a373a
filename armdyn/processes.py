"""Jobs side by side in processes, as IPOPT does not stand threads."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from typing import TypeVar

Result = TypeVar("Result")


def in_processes(jobs: Sequence[Callable[[], Result]], workers: int | None) -> Iterator[Result]:
    """The jobs' results, in their order, each as soon as those before it are there.

    Workers are forks, which know all that was built before; jobs are begun in order, results are pickled. Who has seen
    enough stops asking: what is still under way is then killed. Jobs ask a `Stop` of this process, which forks share.

    Args:
        jobs: what is to be done. A job whose worker dies or raises is done again here.
        workers: processes at most; None: one per core. With one, or where there is no fork, all is done here.
    """
    count = min(workers or os.cpu_count() or 1, len(jobs))
    forks = "fork" in multiprocessing.get_all_start_methods() and not multiprocessing.current_process().daemon
    if count <= 1 or not forks:
        for job in jobs:
            yield job()
        return
    crew = [_hired(jobs) for _ in range(count)]
    try:
        yield from _in_order(jobs, [line for _, line in crew])
    finally:
        for process, line in crew:  # nobody waits for their end, which takes as long as a small solve
            process.kill()
            line.close()


def _in_order(jobs: Sequence[Callable[[], Result]], lines: Sequence[Connection]) -> Iterator[Result]:
    results: dict[int, Result] = {}
    idle, under_way = list(lines), dict[Connection, int]()
    begun = 0
    for k, job in enumerate(jobs):
        while k not in results:
            while idle and begun < len(jobs):
                line = idle.pop()
                with suppress(OSError):  # else it is no more
                    line.send(begun)
                    under_way[line] = begun
                    begun += 1
            if k not in under_way.values():  # nobody is left to do it, or who did it died of it
                results[k] = job()
                begun = max(begun, k + 1)
                break
            ready = wait(list(under_way))
            for line in [line for line in under_way if line in ready]:
                own = under_way.pop(line)
                with suppress(OSError, EOFError):
                    results[own] = line.recv()
                    idle.append(line)
        yield results.pop(k)


def _hired(jobs: Sequence[Callable[[], Result]]) -> tuple[ForkProcess, Connection]:
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(jobs, theirs), daemon=True)
    process.start()
    theirs.close()
    return process, ours


def _work(jobs: Sequence[Callable[[], Result]], line: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a `Stop` says so
    try:
        while True:
            line.send(jobs[line.recv()]())
    except BaseException:  # whoever waits hears that the line is dead, and does the job himself
        os._exit(1)
