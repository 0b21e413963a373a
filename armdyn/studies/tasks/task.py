"""Work on one case of a study, its result, and how its motion is packed."""

import time
import warnings
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Protocol

import numpy as np

from armdyn.arguments import expect
from armdyn.errors import ArmdynError, ArmdynWarning, ProblemError
from armdyn.files import as_json
from armdyn.models.robots.robot import Robot
from armdyn.reprs import joints_of
from armdyn.studies.rows import Value
from armdyn.trajectory import Trajectory

INTERRUPTED = "interrupted"
"""Status of a missing result: the case is done again."""
ERROR = "error"
"""Status of a case whose work raised an unexpected exception."""

Neighbours = Literal["off", "add", "lead", "chain"]
"""Use of a neighbour's motion: none; one more initial guess; a guess next to few others; or "chain": few others, case
after case, and back with the motions of later cases."""

_MOST_BYTES = 2**26
"""Largest motion [bytes]."""


@dataclass(frozen=True, kw_only=True)
class CaseResult:
    """Result of one case.

    Attributes:
        status: one word.
        good: whether the task's aim was met: a usable motion, an arm that settled.
        message: one sentence.
        facts: columns of a table, by name; numbers that are not finite are stored as None.
        motion: packed by `motion_bytes`; empty: none is stored.
        value: the result in full, where the case is done in this process; never stored.
    """

    status: str
    good: bool = False
    message: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)
    motion: bytes = b""
    value: Any = None


class StudyTask(Protocol):
    """Work to be done in every case of a study; it is pickled and sent to workers."""

    @property
    def neighbours(self) -> Neighbours:
        """Whether a case begins with the motion of another one."""

    def work(self, settings: Mapping[str, Value], guess: bytes, revisit: bool = False) -> CaseResult:
        """Do one case.

        Args:
            settings: of the case.
            guess: motion of a neighbour; empty: none.
            revisit: the case has a row already, and only the guess is new; of neighbours "chain" alone.
        """

    def description(self) -> Mapping[str, object]:
        """All that a result depends on besides the settings, as JSON."""


def result_of(
    task: StudyTask, settings: Mapping[str, Value], guess: bytes, revisit: bool = False
) -> tuple[CaseResult, float]:
    """Run one case: its result, also for an error, and its time [s]."""
    began = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:  # thousands of cases would flood the terminal
        warnings.simplefilter("always", ArmdynWarning)
        try:
            result = expect(task.work(settings, guess, revisit), CaseResult, "result of work", "CaseResult(status=…)")
        except ArmdynError as error:
            result = CaseResult(status="refused", message=str(error))
        except Exception as error:  # the row has the error; the other cases continue
            result = CaseResult(status=ERROR, message=f"{type(error).__name__}: {error}"[:1000])
    messages = dict.fromkeys(str(one.message) for one in caught if issubclass(one.category, ArmdynWarning))
    if messages:
        result = replace(result, facts={**result.facts, "warning": "; ".join(messages)[:1000]})
    return replace(storable(result), value=None), time.perf_counter() - began


def storable(result: CaseResult) -> CaseResult:
    """Result that JSON and SQLite can store: null in place of numbers that are not finite, ? of broken letters."""
    message = result.message.encode("utf-8", "replace").decode()
    return replace(result, facts=as_json(result.facts), message=message)


def motion_bytes(motion: Trajectory) -> bytes:
    """Times, positions, velocities and torques of a motion in 64 bits, compressed."""
    rows = np.column_stack([motion.t, motion.q, motion.v, motion.tau])
    return zlib.compress(np.ascontiguousarray(rows, dtype="<f8").tobytes(), 1)


def motion_from(data: bytes, robot: Robot) -> Trajectory:
    """Motion that `motion_bytes` packed.

    Raises:
        ArmdynError: the bytes are no motion of such a robot.
    """
    columns = 1 + 3 * robot.nv
    try:
        unpacked = zlib.decompressobj().decompress(data, _MOST_BYTES)
        rows = np.frombuffer(unpacked, dtype="<f8").reshape(-1, columns)
    except (zlib.error, ValueError):
        raise ProblemError(f"a neighbour's motion is damaged, or not of {joints_of(robot.nv)}") from None
    t, q, v, tau = np.split(rows, [1, 1 + robot.nv, 1 + 2 * robot.nv], axis=1)
    return Trajectory(t=t[:, 0], q=q, v=v, tau=tau, joint_names=robot.joint_names, model_hash=robot.model_hash)
