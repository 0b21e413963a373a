"""One controller on many arms, drawn at random: how often it settles, and how long that takes."""

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import numpy as np

from armdyn.arguments import listener
from armdyn.arguments import path as path_of
from armdyn.control.laws.lqr import Lqr
from armdyn.control.loop.law import Controller
from armdyn.control.loop.loop import Loop
from armdyn.errors import ResultError
from armdyn.models.robots.robot import Robot
from armdyn.optimal.problem.stop import Stop, stopping
from armdyn.studies.plants.plants import Plants
from armdyn.studies.plants.question import MonteCarloOptions, Question
from armdyn.studies.plants.result import MonteCarlo
from armdyn.studies.plants.rows import RowFile, RunRow, row_file
from armdyn.trajectory import Trajectory

_CONTROLLER = Lqr()
_PLANTS = Plants()
_LOOP = Loop()
_OPTIONS = MonteCarloOptions()
_TOLD_EVERY = 0.5
"""How often progress is told [s]."""
_AHEAD = 4
"""Rows per worker that are asked for before the first of them ends."""


def monte_carlo(
    robot: Robot,
    reference: Trajectory,
    controller: Controller = _CONTROLLER,
    plants: Plants = _PLANTS,
    loop: Loop = _LOOP,
    options: MonteCarloOptions = _OPTIONS,
    file: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> MonteCarlo:
    """Have a controller move many arms along a reference, each other than its model.

    Arm k of a seed is the same whatever the number of workers and the order. With a file each row is written as it
    ends; a study that was stopped or killed goes on with the rows that are missing, also with a greater count.

    Args:
        robot: the controller's model of the arm, with the payload that it counts on.
        reference: the motion that is asked for, such as a minimum-time solution's trajectory.
        controller: of the loop; with a file a dataclass of numbers, as armdyn's own are.
        plants: what the arms are drawn from.
        loop: how controller and arm are joined.
        options: how many arms, and how each is watched.
        file: JSON lines, the first says what was asked; None: nothing is kept.
        progress: called with a line of text on how far it is.

    Returns:
        What came of it; after Ctrl-C of the rows that there are.

    Raises:
        ProblemError: something does not fit the robot.
        ResultError: the file's rows answer another question, it is damaged, or another process is at it.
        FileError: it cannot be read or written.
        DiskFullError: there is no room for a row.
    """
    progress = listener(progress)
    question = Question(robot, reference, controller, plants, loop, options)
    kept: AbstractContextManager[RowFile | None] = nullcontext(None)
    if file is not None:
        file = path_of(file, "file", error=ResultError)
        kept = row_file(file, question.description())
    with kept as rows, stopping(np.inf) as stop:
        known = {} if rows is None else _known(question, rows)
        count = options.count - sum(k < options.count for k in known)
        missing = (k for k in range(options.count) if k not in known)
        began, told = time.monotonic(), -np.inf
        for done, row in enumerate(_rows(question, missing, stop), start=1):
            if rows is not None:
                rows.append(row)
            known[row.k] = row
            if time.monotonic() - told > _TOLD_EVERY:
                told = time.monotonic()
                left = (told - began) * (count - done) / done
                progress(f"{len(known)} of {options.count} arms, {left:.0f} s left")
    there = tuple(known[k] for k in sorted(known) if k < options.count)
    return MonteCarlo(question, there, None if file is None else Path(file))


def _known(question: Question, rows: RowFile) -> dict[int, RunRow]:
    """Rows of a file, each of the arm that its number has.

    Raises:
        ResultError: one is of another.
    """
    for row in rows.rows:
        if row.k < 0 or row.draw != question.plants.draw(row.k, question.robot.nv):
            raise ResultError(f"{rows.path}: row {row.k} is not of the arm that this seed draws; it was changed")
    return {row.k: row for row in rows.rows}


def _rows(question: Question, numbers: Iterator[int], stop: Stop) -> Iterator[RunRow]:
    """Rows as they end, in threads; none is begun after a stop."""
    workers = question.options.workers or os.cpu_count() or 1
    under_way = set[Future[RunRow]]()
    with ThreadPoolExecutor(workers) as pool:
        while True:
            while not stop and len(under_way) < _AHEAD * workers and (k := next(numbers, None)) is not None:
                under_way.add(pool.submit(question.row, k))
            if not under_way:
                return
            ended, under_way = wait(under_way, return_when=FIRST_COMPLETED)
            for future in ended:
                yield future.result()
