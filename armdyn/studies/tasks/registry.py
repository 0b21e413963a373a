"""The tasks that a study file may name. To add one: its class in a file of its own, and its line here."""

from armdyn.studies.tasks.cycle import CycleTask
from armdyn.studies.tasks.minimum_time import MinimumTimeTask
from armdyn.studies.tasks.random_plants import MonteCarloTask
from armdyn.studies.tasks.reserve import ReserveTask
from armdyn.studies.tasks.tracking import TrackTask
from armdyn.studies.tasks.tuned_gains import TuneTask

TASKS = {task.name: task for task in (MinimumTimeTask, TrackTask, MonteCarloTask, TuneTask, ReserveTask, CycleTask)}
