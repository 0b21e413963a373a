"""How long building a program may take: said where a solve begins, asked between what takes long to build."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_deadline: ContextVar[float] = ContextVar("deadline", default=float("inf"))


class NoTimeError(Exception):
    """There is no time to compile: build without. It never leaves a solve."""


class LateError(Exception):
    """The time is up in the midst of building. It never leaves a solve."""


@contextmanager
def until(deadline: float) -> Iterator[None]:
    """Within it building is to be done by a time of `time.perf_counter` [s]."""
    token = _deadline.set(deadline)
    try:
        yield
    finally:
        _deadline.reset(token)


def left() -> float:
    """What is left [s]; infinite where nobody has said."""
    return _deadline.get() - time.perf_counter()


def ask() -> None:
    """Go on only while there is time.

    Raises:
        LateError: there is none.
    """
    if left() <= 0:
        raise LateError
