"""Stops a solve from outside: at a deadline, or on Ctrl-C, with the last iterate kept."""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

import casadi as ca
import numpy as np


@dataclass
class Stop:
    """When to stop, and why it was stopped.

    Attributes:
        deadline: by `time.perf_counter` [s].
        interrupted: Ctrl-C was pressed.
    """

    deadline: float = np.inf
    interrupted: bool = False

    @property
    def late(self) -> bool:
        """The deadline has passed."""
        return time.perf_counter() > self.deadline

    def __bool__(self) -> bool:
        return self.interrupted or self.late


@contextmanager
def stopping(seconds: float) -> Iterator[Stop]:
    """Within it Ctrl-C and the clock set a `Stop` instead of raising; a second Ctrl-C raises."""
    stop = Stop(time.perf_counter() + seconds)
    if threading.current_thread() is not threading.main_thread():
        yield stop  # only the main thread gets signals
        return

    def on_interrupt(number: int, frame: FrameType | None) -> None:
        if stop.interrupted:
            raise KeyboardInterrupt
        stop.interrupted = True

    before = signal.signal(signal.SIGINT, on_interrupt)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)


class Monitor(ca.Callback):
    """An iteration callback of `casadi.nlpsol` that asks a `Stop`.

    Attributes:
        stop: set before each solve.
    """

    def __init__(self, nx: int, ng: int, np_: int):
        ca.Callback.__init__(self)
        self._sizes = {"x": nx, "f": 1, "g": ng, "lam_x": nx, "lam_g": ng, "lam_p": np_}
        self.stop = Stop()
        self.construct("monitor", {})

    def get_n_in(self) -> int:
        """What nlpsol puts out goes in."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """One: whether to stop."""
        return 1

    def get_name_in(self, i: int) -> str:
        """As nlpsol calls it."""
        return str(ca.nlpsol_out(i))

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """Dense columns."""
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(i)], 1)

    def eval(self, arguments: Any) -> list[int]:
        """Not zero: stop."""
        return [int(bool(self.stop))]
