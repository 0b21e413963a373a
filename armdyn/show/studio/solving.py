"""Solver process of the studio: the newest request wins, and the running computation is stopped for it."""

import os
import signal
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Generic, Self, TypeVar

from armdyn.parallel import fork_pool

Request = TypeVar("Request")
Result = TypeVar("Result")

_GRACE = 1.0
"""Least time of a computation before a newer request stops it [s]: during a drag, motions of a moment ago appear,
instead of none until the hand rests."""
_RETRY = 5.0
"""Time after which a stopped computation is interrupted once more [s]: it still checks its motion."""
_POLL = 0.02
"""Polling period of the process and the requests [s]."""


class NewestFirst(Generic[Request, Result]):
    """Runs a function in a process of its own, for the newest of all waiting requests.

    A context: the process is forked when it is entered, before threads of others are there, and ends with it.
    """

    def __init__(self, do: Callable[[Request], Result], first: Request):
        self._do = do
        self._waiting: Request | None = first
        self._solved: tuple[Request, Result | None] | None = None
        self._since: float | None = None
        self._lock, self._wake, self._forked = threading.Lock(), threading.Event(), threading.Event()
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="studio solver", daemon=True)

    def __enter__(self) -> Self:
        self._wake.set()
        self._thread.start()
        self._forked.wait()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._closed = True
        self._wake.set()
        self._thread.join()

    def request(self, what: Request) -> None:
        """Submit a request, which replaces all earlier ones."""
        with self._lock:
            self._waiting = what
            self._since = self._since or time.monotonic()
        self._wake.set()

    @property
    def seconds(self) -> float | None:
        """Time for which a computation has been under way [s]; None if there is none."""
        since = self._since
        return None if since is None else time.monotonic() - since

    def newest(self) -> tuple[Request, Result | None] | None:
        """The newest request that was done, and its result, once; None: no new one.

        The result is None where the process ended unexpectedly.
        """
        with self._lock:
            found, self._solved = self._solved, None
        return found

    def _newer(self) -> bool:
        return self._waiting is not None

    def _receive(self, what: Request) -> Result:
        """Do what is requested, interruptible also where SIGINT is ignored by inheritance: a studio in the background.

        There the process leaves the group of the terminal, whose Ctrl-C stays ignored.
        """
        if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
            os.setpgid(0, 0)
            signal.signal(signal.SIGINT, lambda number, frame: None)
        return self._do(what)

    def _run(self) -> None:
        with fork_pool(self._receive, 1) as pool:
            while not self._closed:
                with self._lock:
                    what, self._waiting = self._waiting, None
                    self._since = None if what is None else time.monotonic()
                if what is None:
                    self._wake.wait()
                    self._wake.clear()
                    continue
                pool.submit(0, what)
                self._forked.set()
                due = time.monotonic() + _GRACE
                while not (found := pool.finished(_POLL)) and not self._closed:
                    if self._newer() and time.monotonic() >= due:
                        pool.interrupt()
                        due = time.monotonic() + _RETRY
                with self._lock:
                    for _, _, result in found:
                        self._solved = what, None if result is None else result[0]
