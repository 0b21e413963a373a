"""The tasks that a study file may name. To add one: its class in a file of this folder, and its line here."""

from armdyn.studies.tasks.cycle import CycleTask
from armdyn.studies.tasks.minimum_time import MinimumTimeTask
from armdyn.studies.tasks.tracking import MonteCarloTask, ReserveTask, TrackTask, TuneTask

TASKS = {task.name: task for task in (MinimumTimeTask, TrackTask, MonteCarloTask, TuneTask, ReserveTask, CycleTask)}


def section_of(task: str) -> str:
    """Table of a study file with the options of a task: of the task's name, but [search] of the default one."""
    return "search" if task == MinimumTimeTask.name else task
