"""Jobs in parallel processes, some of which wait for others."""

from collections.abc import Callable, Collection, Generator, Mapping, Sequence
from typing import TypeVar

from armdyn.parallel import job_pool

Result = TypeVar("Result")


def as_completed(
    jobs: Sequence[Callable[[], Result]], workers: int | None, after: Mapping[int, Collection[int]] | None = None
) -> Generator[Result]:
    """Results of jobs in parallel processes, in the order in which they finish.

    When the caller stops iterating, jobs under way are interrupted: a job gets SIGINT only where it listens, as
    `solve_minimum_time` does. Jobs that do not end within 1.5 s are killed.

    Args:
        jobs: to be done.
        workers: processes at most, see `armdyn.parallel.in_processes`.
        after: of some jobs, the numbers of others that end before they are begun.

    Raises:
        ValueError: jobs wait for each other.
    """
    waiting, ended = list(range(len(jobs))), set[int]()

    def free() -> int | None:
        """The first job whose predecessors have finished."""
        return next((k for k in waiting if ended.issuperset((after or {}).get(k, ()))), None)

    with job_pool(jobs, workers, patient=True) as pool:
        while waiting or pool.idle < pool.count:
            while pool.idle and (k := free()) is not None:
                waiting.remove(k)
                pool.submit(k, k)
            found = [(k, result) for k, _, result in pool.finished(None)] if pool.idle < pool.count else []
            if not found:  # no worker is busy
                if (k := free()) is None:
                    raise ValueError(f"jobs {waiting} wait for each other")
                waiting.remove(k)
                found = [(k, None)]
            for k, result in found:
                yield jobs[k]() if result is None else result[0]
                ended.add(k)
