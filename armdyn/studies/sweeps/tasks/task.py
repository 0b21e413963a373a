"""What a case's work is, what comes of it, and how its motion is packed."""

from __future__ import annotations

import time
import warnings
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from armdyn.errors import ArmdynError, ArmdynWarning, ProblemError
from armdyn.models.robots.robot import Robot
from armdyn.studies.sweeps.tasks.settings import Value
from armdyn.trajectory import Trajectory

INTERRUPTED = "interrupted"
"""Status of an outcome that is none: the case is to be done again."""

_MOST_BYTES = 2**26
"""Of a motion [bytes]."""


@dataclass(frozen=True, kw_only=True)
class CaseOutcome:
    """What came of a case.

    Attributes:
        status: in a word.
        good: it is what was wanted: a usable motion, an arm that settled.
        message: in a sentence.
        facts: numbers and words for the columns of a table.
        motion: for `motion_of`; empty: none is kept.
    """

    status: str
    good: bool = False
    message: str = ""
    facts: Mapping[str, float | bool | str | None] = field(default_factory=dict)
    motion: bytes = b""


class StudyTask(Protocol):
    """What is done in every case, where it is done and by whom: it is pickled."""

    @property
    def uses_neighbours(self) -> bool:
        """A case may begin with the motion of another."""

    def work(self, settings: Mapping[str, Value], guess: bytes) -> CaseOutcome:
        """Do it.

        Args:
            settings: of the case.
            guess: the motion of a neighbour; empty: none.
        """

    def description(self) -> Mapping[str, object]:
        """What it is, as JSON says it."""


def outcome_of(task: StudyTask, settings: Mapping[str, Value], guess: bytes) -> tuple[CaseOutcome, float]:
    """What comes of a case, whatever is raised, and how long that took [s]."""
    began = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:  # thousands of cases would flood the terminal
        warnings.simplefilter("always", ArmdynWarning)
        try:
            outcome = task.work(settings, guess)
        except ArmdynError as error:
            outcome = CaseOutcome(status="refused", message=str(error))
        except Exception as error:  # a row says so; the others go on
            outcome = CaseOutcome(status="error", message=f"{type(error).__name__}: {error}"[:1000])
    told = dict.fromkeys(str(one.message) for one in caught if issubclass(one.category, ArmdynWarning))
    if told:
        outcome = replace(outcome, facts={**outcome.facts, "warning": "; ".join(told)[:1000]})
    return _writable(outcome), time.perf_counter() - began


def _writable(outcome: CaseOutcome) -> CaseOutcome:
    """The same as a row bears it: one odd number or letter must not end the whole study."""
    facts = {name: value.item() if isinstance(value, np.generic) else value for name, value in outcome.facts.items()}
    finite_facts = {name: finite(value) if isinstance(value, float) else value for name, value in facts.items()}
    return replace(outcome, facts=finite_facts, message=outcome.message.encode("utf-8", "replace").decode())


def motion_bytes(motion: Trajectory) -> bytes:
    """A motion's arrays, in 64 bits, packed."""
    rows = np.column_stack([motion.t, motion.q, motion.v, motion.tau])
    return zlib.compress(np.ascontiguousarray(rows, dtype="<f8").tobytes(), 1)


def motion_from(data: bytes, robot: Robot) -> Trajectory:
    """What `motion_bytes` packed.

    Raises:
        ArmdynError: it is no motion of such a robot.
    """
    columns = 1 + 3 * robot.nv
    try:
        unpacked = zlib.decompressobj().decompress(data, _MOST_BYTES)
        rows = np.frombuffer(unpacked, dtype="<f8").reshape(-1, columns)
    except (zlib.error, ValueError):
        raise ProblemError(f"a neighbour's motion is damaged, or not of {robot.nv} joints") from None
    t, q, v, tau = np.split(rows, [1, 1 + robot.nv, 1 + 2 * robot.nv], axis=1)
    return Trajectory(t=t[:, 0], q=q, v=v, tau=tau, joint_names=robot.joint_names)


def finite(value: float | None) -> float | None:
    """A number that JSON has, else None."""
    return None if value is None or not np.isfinite(value) else float(value)
