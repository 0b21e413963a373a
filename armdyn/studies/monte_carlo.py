"""Monte Carlo over plants: how often one controller settles on random arms, and how long that takes."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from armdyn.arguments import listener
from armdyn.control.laws.lqr import Lqr
from armdyn.control.loop.law import Controller
from armdyn.control.loop.loop import Loop
from armdyn.errors import ResultError
from armdyn.models.robots.robot import Robot
from armdyn.optimal.problem.stop import stopping
from armdyn.studies.executors.in_process import in_process
from armdyn.studies.monte_carlo_result import MonteCarlo
from armdyn.studies.plant_study import MonteCarloOptions, PlantRow, PlantStudy
from armdyn.studies.plants import Plants
from armdyn.studies.rows import row_store
from armdyn.studies.run import Progress, run_cases
from armdyn.trajectory import Trajectory

_CONTROLLER = Lqr()
_PLANTS = Plants()
_LOOP = Loop()
_OPTIONS = MonteCarloOptions()


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
    """Run a controller along a reference on many arms that differ from its model.

    Arm k of a seed is the same whatever the number of workers and the order. With a file each row is written as it
    ends; a study that was stopped or killed goes on with the rows that are missing, also with a greater count.

    Args:
        robot: the controller's model of the arm, with the payload that it counts on.
        reference: motion to follow, such as a minimum-time solution's trajectory.
        controller: of the loop; with a file a dataclass of numbers, as armdyn's own are.
        plants: ranges that the arms are drawn from.
        loop: connection of controller and arm.
        options: number of arms, and how each is watched.
        file: SQLite, for the rows; `study_table` reads it; None: no file.
        progress: called with the progress in words.

    Returns:
        The result; after Ctrl-C of the rows that there are.

    Raises:
        ProblemError: an argument does not fit the robot.
        ResultError: the file's rows belong to another study, it is damaged, or another process writes to it.
        FileError: the file cannot be read or written.
        DiskFullError: the disk is full.
    """
    progress = listener(progress)
    study = PlantStudy(robot, reference, controller, plants, loop, options)

    def told(now: Progress) -> None:
        left = "" if now.left is None else f", {now.left[1]:.0f} s left"
        progress(f"{now.done} of {now.cases} arms{left}")

    with row_store(file, study.description, "normal") as rows, stopping(np.inf) as stop:
        with in_process(study, options.workers) as executor:
            run_cases(study, rows, executor, stop, told)
        found = list[PlantRow]()
        for row in rows.rows():
            if row.k >= options.count:
                break
            if row.settings != study.parameters(row.k):
                raise ResultError(f"{rows.path}: row {row.k} is not of the arm that this seed draws; it was changed")
            found.append(PlantRow.of(row, study.sample(row.k)))
    return MonteCarlo(study, tuple(found), None if file is None else Path(os.fsdecode(file)))
