"""Work that takes no time, and work that kills who does it."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armdyn.errors import FileError, ProblemError, ResultError
from armdyn.studies.rows import read_rows
from armdyn.studies.study import Axis, Study
from armdyn.studies.tasks.task import CaseResult


@dataclass(frozen=True)
class Square:
    """x², after some time; some numbers are refused, are errors, or kill their worker: once, or always."""

    seconds: float = 0.0
    refused: tuple[int, ...] = ()
    error: tuple[int, ...] = ()
    deadly: tuple[int, ...] = ()
    once: tuple[int, ...] = ()
    marks: str = ""
    neighbours: str = "off"

    def work(self, settings, guess, revisit=False):
        x = round(settings["x"])
        time.sleep(self.seconds)
        if x in self.deadly or (x in self.once and not self._marked(x)):
            os.kill(os.getpid(), signal.SIGKILL)
        if x in self.refused:
            raise ProblemError(f"x is {x}")
        if x in self.error:
            raise ZeroDivisionError("one over nothing")
        motion = np.array([settings["x"]]).tobytes() if self.neighbours != "off" else b""
        begun = float(np.frombuffer(guess)[0]) if guess else None
        return CaseResult(status="squared", good=True, facts={"square": x * x, "begun": begun}, motion=motion)

    def _marked(self, x):
        mark = Path(self.marks) / f"{x}"
        if mark.exists():
            return True
        mark.touch()
        return False

    def description(self):
        return {"task": "square"}


def squares(n, **options):
    """A study of n cases, case k is of the number k."""
    return Study(task=Square(**options), axes=(Axis(name="x", values=tuple(float(k) for k in range(n))),))


def row_count(file):
    """Number of rows in a study's file."""
    try:
        with read_rows(file) as rows:
            return len(rows.numbers())
    except (FileError, ResultError):  # there is none yet, or it is being begun
        return 0
