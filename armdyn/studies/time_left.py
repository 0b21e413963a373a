"""Estimate of the time that a study still takes."""

import math
import time
from collections.abc import Callable

_FEWEST = 5
"""Cases that must have ended before there is an estimate."""
_SURE = 2.0
"""Standard deviations either side: 95 % of normal estimates."""


class TimeLeft:
    """Estimate by the mean and variance of the cases that have ended.

    A case's time is taken as a random number with the mean and variance seen. That is wrong where later cases are
    harder than earlier ones, as along a grid's axis: the estimate then lags behind, and its range is too narrow.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        self._clock, self._began = clock, clock()
        self._n, self._sum, self._squares = 0, 0.0, 0.0

    def add(self, seconds: float) -> None:
        """Add a case that took so long [s]."""
        self._n += 1
        self._sum += seconds
        self._squares += seconds * seconds

    def left(self, cases: int) -> tuple[float, float] | None:
        """Least and greatest likely time for so many cases [s]; None: too early to say.

        The mean is what a case took on the clock, whatever the number of workers and what they wait for. Its relative
        spread is that of the cases' own times: σ √(m² / n + m) for the sum of m more after n, the first term for the
        mean not being known, the second for chance.
        """
        if self._n < _FEWEST:
            return None
        each = (self._clock() - self._began) / self._n
        mean = self._sum / self._n
        variance = max(self._squares / self._n - mean * mean, 0.0) * self._n / (self._n - 1)
        spread = math.sqrt(variance) / mean if mean > 0 else 0.0
        off = _SURE * spread * math.sqrt(cases * cases / self._n + cases)
        return max(cases - off, 0.0) * each, (cases + off) * each
