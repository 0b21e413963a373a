"""The command `sweep`: one robot with several payloads, or the cases of a study file."""

from __future__ import annotations

from collections.abc import Collection
from typing import ClassVar

from armdyn import models
from armdyn.cli.console import Answer
from armdyn.cli.motion.mintime import ToMinimumTimeOptions
from armdyn.cli.motion.require import REQUIRE, requirements_of
from armdyn.cli.options.groups import ROBOT, SOLVER, Numbers, argument, given, group, option
from armdyn.cli.options.results import FigureOptions
from armdyn.cli.options.robot import PayloadPlace, RobotArgument, kind_of_file, known_names
from armdyn.cli.options.task import FastArmOptions, refuse_with_a_file
from armdyn.cli.sweeps.study import StudyOptions, run_file
from armdyn.errors import ProblemError


@group(ROBOT)
class PayloadsOptions:
    """Payloads, one after the other, and their place.

    Attributes:
        payload: the masses [kg]; None: the paper's.
        place: where each is.
    """

    payload: Numbers = option("KG,KG,…", "Point masses that the arm carries \\[kg]. r, rr, rrr: the paper's ten.")
    place: PayloadPlace

    def masses(self, robot: str) -> list[float]:
        """The masses [kg] that a robot is to carry, each once, increasing.

        Raises:
            ProblemError: no mass is given for a robot that is not the paper's.
        """
        if self.payload is not None:
            return sorted(set(self.payload))
        if robot not in models.PLANAR_ARMS:
            raise ProblemError(f"give --payload with the masses [kg] that {robot} is to carry, such as 0,0.5,1")
        from armdyn.paper import PAYLOADS

        return sorted(PAYLOADS)


@group(SOLVER)
class SweepOptions(ToMinimumTimeOptions):
    """Extent of the search for each payload; see `MinimumTimeOptions`."""

    starts: int | None = option("N", "Guesses of every search; by default the first has mintime's, the others few.")
    time_limit: float = option("S", "Time limit for each payload \\[s].", default=300.0)


@group()
class SweptOptions(RobotArgument):
    """A robot, or a study file."""

    robot: str = argument(
        "ROBOT|STUDY.toml",
        "A robot or a problem file, as mintime takes them, or a study file (docs/sweeps.md).",
        show_default=False,
        autocompletion=known_names,
    )


@group()
class SweptTask(FastArmOptions):
    """A motion with several payloads, or a study file instead of its robot."""

    besides_a_file: ClassVar[Collection[str]] = ("payload",)

    payload: PayloadsOptions  # type: ignore[assignment]  # one mass after the other
    robot: SweptOptions


def sweep(
    task: SweptTask,
    search: SweepOptions,
    study: StudyOptions,
    results: FigureOptions,
    require: list[str] | None = REQUIRE,
) -> Answer:
    r"""Minimum time over payload, of a robot; or a study file's many cases over limits, gains, poses, reserve, arms.

    Of a ROBOT: the time that each gram costs, and the limit that decides. Each optimum is where the search for the next
    payload's begins; the optimum of a heavier payload is tried on the lighter one, too. A payload that is solved
    is on disk at once, and the same command solves the others. Exit code 0: all motions are usable; 3: some are
    not; 4: all are, but some do not meet --require.

    A STUDY.toml says all of its motions itself: options of task, robot, limits and solver are for a ROBOT. Its cases
    are done side by side, on this machine or on a Dask cluster. Each row is on disk as soon as it has ended. Ctrl-C
    leaves the tables of the rows that there are; the same command continues where it was stopped or killed.
    Exit code 3: some cases were refused, are not usable, or ended in an error; their rows say why.

    [dim]armdyn sweep rr
    armdyn sweep panda --payload 0,1,2,3 --q-start ready --q-goal 1,0.2,0.5,-1.5,0.3,2,-0.5
    armdyn sweep problem.toml --payload 0,0.5,1
    armdyn sweep study.toml --workers 8 --parquet
    armdyn sweep study.toml --scheduler node1:8786
      [dim]A study.toml of 30 cases; docs/sweeps.md lists all fields that may vary:[/dim]
      \[arms.rr]
      q_start = \["-90deg", 0]
      q_goal = \["9deg", 0]
      \[vary]
      payload = { from = 0.05, to = 0.25, count = 10 }   # kg
      reserve = \[0.0, 0.1, 0.2]                          # part of the torque limits[/]
    """
    name = task.robot.robot
    if kind_of_file(name) == "study":
        refuse_with_a_file(name, task, search)
        if require:
            raise ProblemError("--require is for a robot's sweep; a study's rows say which motions are certified")
        return run_file(name, study, results)
    if given(study):
        raise ProblemError("--workers, --scheduler, --again, --sync and --parquet are for a study file, STUDY.toml")
    from armdyn.cli.sweeps.payloads import run_payloads  # the studies take time to load

    required = requirements_of(require)
    problems = {mass: task.problem(mass) for mass in task.payload.masses(name)}
    return run_payloads(name, problems, search.options(task.solver_options), required, results)
