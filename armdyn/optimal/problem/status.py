"""Status of a solve, its worst violation, and conditions that stop it."""

import mmap
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from types import FrameType

import numpy as np

from armdyn.arguments import shown
from armdyn.codegen.background import abandon
from armdyn.errors import ProblemError


class Status(StrEnum):
    """Status of a solve."""

    SOLVED = "solved"
    """Converged, and the replay reaches the goal."""
    REPLAY_MISSED = "replay_missed"
    """Converged on every mesh that was tried, but the replay does not reach the goal."""
    CONDITION_MISSED = "condition_missed"
    """The replay reaches the goal, but collides, misses a via point, or exceeds an acceleration or jerk limit."""
    LIMIT_EXCEEDED = "limit_exceeded"
    """The replay reaches the goal, but exceeds a limit of torque, velocity or position."""
    INFEASIBLE = "infeasible"
    """No motion was found that satisfies all constraints; among obstacles the planner may have found no path."""
    ITERATION_LIMIT = "iteration_limit"
    """The solver reached its iteration limit."""
    TIME_LIMIT = "time_limit"
    """The time limit ended the search or its proof: the best motion so far may be usable, and is not certified."""
    FOLLOWED = "followed"
    """Of a `Resolver`: no motion to the goal was found in time; the rest of the last motion, to its own goal."""
    STOPPED = "stopped"
    """Of a `Resolver`: no motion to the goal was found in time; a stop within all limits."""
    INTERRUPTED = "interrupted"
    """Stopped by Ctrl-C; the best motion so far is kept."""
    FAILED = "failed"
    """The solver failed numerically; the message has its status."""

    @classmethod
    def _missing_(cls, value: object) -> None:
        raise ProblemError(f"status is {shown(value)}; it is one of {', '.join(cls)}")


@dataclass(frozen=True)
class Violation:
    """The worst violation, scaled (1: as large as a limit or the whole motion).

    Attributes:
        constraint: kind: "position defect", "velocity defect", "dynamics", "torque limit", "jerk limit", …
        joint: name of the joint, or of the limited frame or body.
        time: time of the violation [s].
        value: size, scaled.
        excess: size in the limit's own unit, in words; empty where there is none.
    """

    constraint: str
    joint: str
    time: float
    value: float
    excess: str = ""

    def __str__(self) -> str:
        size = self.excess or f"{self.value:.3g} (scaled)"
        return f"{self.constraint} of joint {self.joint!r} at t = {self.time:.4g} s by {size}"


class Stop:
    """Stopping condition of a solve: a deadline or Ctrl-C.

    Processes forked after construction share the interruption, and whether the deadline cut work short.

    Attributes:
        deadline: by `time.perf_counter` [s], a clock that all processes share.
        out_of_time: whether there was no time to compile a program; then no other is compiled either.
        within: stop of the enclosing work: an interruption of one interrupts both; None: no enclosing work.
    """

    def __init__(self, deadline: float = np.inf, interrupted: bool = False, within: "Stop | None" = None):
        self.deadline, self.out_of_time, self.within = deadline, False, within
        self._flags = mmap.mmap(-1, 2)
        self._flags[0] = interrupted

    def interrupt(self) -> None:
        """Record that Ctrl-C was pressed."""
        self._flags[0] = True
        if self.within is not None:
            self.within.interrupt()

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C was pressed."""
        return bool(self._flags[0]) or (self.within is not None and self.within.interrupted)

    @property
    def late(self) -> bool:
        """Whether the deadline has passed."""
        return time.perf_counter() > self.deadline

    @property
    def cut_short(self) -> bool:
        """Whether work was left undone because of the deadline, rather than finished just before it."""
        return bool(self._flags[1])

    def cut(self) -> None:
        """Record that the deadline cut work short."""
        self._flags[1] = True

    @property
    def status(self) -> Status:
        """Status of a solve that was stopped."""
        return Status.INTERRUPTED if self.interrupted else Status.TIME_LIMIT

    @property
    def word(self) -> str:
        """The status in words."""
        return "interrupted" if self.interrupted else "time limit reached"

    def __bool__(self) -> bool:
        """Whether to stop; after the deadline this records `cut_short`: ask only where work is left."""
        if self.late:
            self.cut()
        return self.interrupted or self.late


@contextmanager
def stopping(seconds: float, within: Stop | None = None) -> Iterator[Stop]:
    """Context in which Ctrl-C and the clock set a `Stop` instead of raising; a second Ctrl-C raises.

    Where SIGINT is ignored (`nohup`, a job in the background of a script), it stays ignored.

    Args:
        seconds: time limit [s].
        within: see `Stop`; through it a forked process learns that its parent was interrupted.
    """
    stop, pressed = Stop(time.perf_counter() + seconds, within=within), False
    in_main_thread = threading.current_thread() is threading.main_thread()  # the only thread that receives signals
    if not in_main_thread or signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield stop
        return

    def on_interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal pressed
        if pressed:
            raise KeyboardInterrupt
        pressed = True
        stop.interrupt()
        abandon()

    before = signal.signal(signal.SIGINT, on_interrupt)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)
