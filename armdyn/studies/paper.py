"""The paper's six worked examples."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from armdyn.control import PidRun, simulate_pid
from armdyn.models.robot import Robot
from armdyn.models.spec import ArmSpec, PaperArm, Payload
from armdyn.optimal import MinimumTimeOptions, MinimumTimeProblem, Solution, solve_minimum_time
from armdyn.show.report import minimum_time_summary, pid_summary, write_run

PAYLOAD = 0.1006
"""The payload of the paper's figures [kg]."""

Kind = Literal["mintime", "pid"]

_TURN = np.pi / 84


@dataclass(frozen=True)
class Example:
    """One of section 5's worked examples.

    Attributes:
        number: 1 to 6.
        arm: its arm.
        kind: minimum time (section 3) or PID (section 4).
        q_start: joint positions at the start [rad].
        q_goal: joint positions at the end [rad].
        figure: the paper's figure of it.
    """

    number: int
    arm: PaperArm
    kind: Kind
    q_start: tuple[float, ...]
    q_goal: tuple[float, ...]
    figure: int

    @property
    def name(self) -> str:
        """Of its folder and in tables."""
        return f"example{self.number}_{self.arm}_{self.kind}"


_POSES: dict[PaperArm, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "r": ((-np.pi / 2,), (np.pi / 20,)),
    "rr": ((-np.pi / 2, _TURN), (np.pi / 20, -_TURN)),
    "rrr": ((-np.pi / 2, _TURN, -_TURN), (np.pi / 20, -_TURN, _TURN)),
}

EXAMPLES = (
    Example(1, "r", "mintime", *_POSES["r"], 2),
    Example(2, "rr", "mintime", *_POSES["rr"], 4),
    Example(3, "rrr", "mintime", *_POSES["rrr"], 6),
    Example(4, "r", "pid", *_POSES["r"], 3),
    # Example 5 is printed with other states than Example 2.
    Example(5, "rr", "pid", (-_TURN, _TURN), (_TURN, -_TURN), 5),
    Example(6, "rrr", "pid", *_POSES["rrr"], 7),
)
"""Examples 1 to 6, with the states that the paper prints."""


def example(arm: str, kind: Kind) -> Example:
    """The example of an arm."""
    return next(e for e in EXAMPLES if e.arm == arm and e.kind == kind)


def run_example(
    one: Example,
    payload: float,
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[Robot, Solution | PidRun]:
    """Solve or simulate an example.

    Args:
        one: the example.
        payload: point mass at the tip [kg].
        options: of the minimum-time solve.
        progress: told in words what is being tried.
    """
    robot = Robot.from_spec(ArmSpec.paper(one.arm), payload=Payload(mass=payload))
    if one.kind == "pid":
        return robot, simulate_pid(robot, q_start=one.q_start, q_goal=one.q_goal)
    problem = MinimumTimeProblem(robot, q_start=one.q_start, q_goal=one.q_goal)
    return robot, solve_minimum_time(problem, options, progress)


def reproduce(
    folder: Path,
    payload: float = PAYLOAD,
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> Iterator[tuple[Example, dict[str, object]]]:
    """All six examples with one payload, a folder each with trajectory, figure and replay.

    Args:
        folder: where the examples' folders are made.
        payload: point mass at the tip [kg].
        options: of the minimum-time solves.
        progress: told in words what is being tried.

    Yields:
        Each example as it is done, with its summary (see `show.report`).
    """
    for one in EXAMPLES:
        if progress:
            progress(f"example {one.number}: {one.arm} {one.kind}")
        robot, result = run_example(one, payload, options, progress)
        summary = minimum_time_summary(result) if isinstance(result, Solution) else pid_summary(result)
        title = f"Example {one.number} (Figure {one.figure}): {one.arm.upper()}, {1000 * payload:g} g, " + (
            "minimum time" if one.kind == "mintime" else "PID"
        )
        files = write_run(folder / one.name, robot, result.trajectory, summary, title)
        yield one, {**summary, "files": [str(path) for path in files]}
