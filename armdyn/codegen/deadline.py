"""Deadline of building programs: set by the solve, checked before and while C is compiled."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_deadline: ContextVar[float] = ContextVar("deadline", default=float("inf"))
_stopped: ContextVar[Callable[[], bool]] = ContextVar("stopped", default=lambda: False)


_LATE = 1.0
"""Time by which work that no one can stop may end after the deadline [s]: estimates are rough."""


class NoTimeError(Exception):
    """Too little time is left to compile, or to build. Caught within every solve, which continues without, or ends."""


@contextmanager
def until(deadline: float, stopped: Callable[[], bool] = lambda: False) -> Iterator[None]:
    """Context with a deadline for building: a time of `time.perf_counter` [s], or a stop."""
    tokens = _deadline.set(deadline), _stopped.set(stopped)
    try:
        yield
    finally:
        _deadline.reset(tokens[0])
        _stopped.reset(tokens[1])


@contextmanager
def part_of_time(part: float) -> Iterator[None]:
    """Context with a share of the time left as its deadline."""
    token = _deadline.set(time.perf_counter() + part * left())
    try:
        yield
    finally:
        _deadline.reset(token)


def expect_time(seconds: float, work: str) -> None:
    """Check that there is time for work that cannot be stopped, before it begins.

    Args:
        seconds: estimate of the time that it takes [s].
        work: in words, such as "building its equations".

    Raises:
        NoTimeError: it would end more than a second after the deadline, or takes more than one after it, or a stop.
    """
    if seconds > max(left(), 0.0) + _LATE:
        raise NoTimeError(f"{work} takes some {seconds:.2g} s")


def left() -> float:
    """Time left [s]; 0 once stopped, infinite without a deadline."""
    return 0.0 if _stopped.get()() else _deadline.get() - time.perf_counter()
