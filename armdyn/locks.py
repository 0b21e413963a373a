"""Lock around everything that CasADi and IPOPT cannot do in two threads at once.

CasADi lets go of the interpreter's lock whenever it is called, so that threads do meet in it. Building expressions
and evaluating Functions are safe there. A solver is not: it has one memory for all callers, and one monitor that
says when to stop. Calls of IPOPT therefore hold `one_at_a_time`, and so does code that builds objects once,
or works in objects that their use changes. It is never held from one call of IPOPT to the next: threads take turns.

A fork waits for its turn, too, so that its child finds nothing half done and no lock of IPOPT's taken.
"""

import os
import threading
from collections.abc import Callable
from contextlib import nullcontext
from functools import cached_property as _cached_property
from functools import lru_cache, wraps
from typing import ParamSpec, TypeVar

Parameters = ParamSpec("Parameters")
Built = TypeVar("Built")
Value = TypeVar("Value")

one_at_a_time = threading.RLock()
"""The lock of the whole process."""

_forget: list[Callable[[], None]] = []

os.register_at_fork(
    before=one_at_a_time.acquire, after_in_parent=one_at_a_time.release, after_in_child=one_at_a_time.release
)


class cached_property(_cached_property[Value]):  # noqa: N801  # as Python's
    """`functools.cached_property` without the lock of Python versions before 3.12.

    That lock is one for all instances of a class: a fork while another thread computes leaves it taken in the
    child for ever. Two threads that read one instance at once may both compute; the values are the same.
    """

    def __init__(self, compute: Callable[..., Value]):
        super().__init__(compute)
        self.lock = nullcontext()


def built_once(maxsize: int) -> Callable[[Callable[Parameters, Built]], Callable[Parameters, Built]]:
    """Decorator that caches results by hashable arguments; one thread builds a result while others wait.

    Args:
        maxsize: number of objects kept.
    """

    def decorate(build: Callable[Parameters, Built]) -> Callable[Parameters, Built]:
        known = lru_cache(maxsize)(build)

        @wraps(known)
        def alone(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Built:
            with one_at_a_time:
                return known(*args, **kwargs)  # type: ignore[arg-type]  # hashable they must be

        _forget.append(known.cache_clear)
        return alone

    return decorate


def forget() -> None:
    """Clear all caches of `built_once`."""
    with one_at_a_time:
        for clear in _forget:
            clear()
