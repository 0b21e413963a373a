"""Batch sizes: numbers of cases that are sent to a worker of a cluster at once."""

import math

TARGET = 1.0
"""Intended duration of a batch [s]: a hundred times the overhead of Dask and its client per task."""
_PER_SECOND = 100
"""Batches that one client and scheduler are given at most: where client, scheduler and workers shared two cores, a task
took 8 to 12 ms of the clock."""
MOST = 1000
"""Largest batch [cases]: as many are lost at most when a worker or the client dies."""
_NEW = 0.3
"""Weight of the last batch in the mean."""
_PARTS = 2
"""Batches for each worker that the cases left are at least, so that all have something to do at the end."""


def target(workers: int) -> float:
    """Intended duration of a batch for so many workers [s]."""
    return max(TARGET, workers / _PER_SECOND)


class BatchSize:
    """Batch size from the durations of cases; it begins with one, and at most doubles from batch to batch."""

    def __init__(self) -> None:
        self._mean, self._most = 0.0, 1

    def add(self, cases: int, seconds: float) -> None:
        """A batch of so many cases has taken so long [s]."""
        mean = seconds / cases
        self._mean = (1 - _NEW) * self._mean + _NEW * mean if self._mean else mean
        self._most = max(self._most, min(2 * cases, MOST))

    def cases(self, left: int, workers: int) -> int:
        """Number of cases of the next batch.

        Args:
            left: cases that wait.
            workers: among whom they are shared out.
        """
        wanted = target(workers)
        in_time = math.floor(wanted / self._mean) if self._mean > wanted / MOST else MOST
        share = math.ceil(left / (_PARTS * workers))
        return min(left, max(1, min(in_time, self._most, share)))
