"""The command that moves one robot with many payloads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import armdyn as ad
from armdyn.cli.console import (
    DONE,
    INTERRUPTED,
    NOT_AS_REQUIRED,
    NOT_USABLE,
    answering,
    console,
    errors,
    escape,
    working,
)
from armdyn.cli.motion.requirements import Require, missing_of, requirements_of
from armdyn.cli.motion.words import options_of
from armdyn.cli.options.joints import FastJointOptions, reserve_words
from armdyn.cli.options.poses import PoseOptions
from armdyn.cli.parsing.positions import degrees_are_on
from armdyn.cli.parsing.problem_file import is_problem_file, is_study_file, problem_file, refuse_beside_a_file
from armdyn.cli.sweeps.options import PayloadsOptions, SweepOptions, SweptOptions
from armdyn.cli.sweeps.study import StudyOptions, SweepResults, run_file
from armdyn.errors import ProblemError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from rich.table import Table

    from armdyn.cli.motion.requirements import Requirement

_CODES = {"done": DONE, "not_landed": NOT_USABLE, "interrupted": INTERRUPTED}


def sweep(
    poses: PoseOptions,
    payloads: PayloadsOptions,
    robot: SweptOptions,
    joints: FastJointOptions,
    search: SweepOptions,
    study: StudyOptions,
    results: SweepResults,
    require: Require = None,
) -> None:
    r"""Minimum time over payload, of a robot; or a study file's many cases over limits, gains, poses, reserve, arms.

    Of a ROBOT: how much each gram costs, and which limit counts. Each optimum is where the search for the next
    payload's begins; what a heavier payload's search finds is tried on the lighter one, too. A payload that is solved
    is on disk at once. Exit code 0: all motions are usable; 3: some are not; 4: all are, but some are not what
    --require asks for.

    A STUDY.toml says all of its motions itself: options of task, robot, limits and solver are for a ROBOT. Its cases
    are done side by side, on this machine or on a Dask cluster. Each row is on disk as soon as it has ended. Ctrl-C
    leaves the tables of the rows that there are; the same command goes on where it was stopped or killed.
    Exit code 3: some cases were refused, are not usable, or ended in an error; their rows say why.

    [dim]armdyn sweep rr
    armdyn sweep panda --payload 0,1,2,3 --q-start ready --q-goal 1,0.2,0.5,-1.5,0.3,2,-0.5
    armdyn sweep problem.toml --payload 0,0.5,1
    armdyn sweep study.toml --workers 8 --parquet
    armdyn sweep study.toml --scheduler node1:8786
      [dim]A study.toml of 30 cases; docs/sweeps.md says what else may vary:[/dim]
      \[arms.rr]
      q_start = \["-90deg", 0]
      q_goal = \["9deg", 0]
      \[vary]
      payload = { from = 0.05, to = 0.25, count = 10 }   # kg
      reserve = \[0.0, 0.1, 0.2]                          # part of the torque limits[/]
    """
    output, no_figure = results.output, results.no_figure
    with answering(output.json) as answer:
        if is_problem_file(robot.robot) and is_study_file(robot.robot):
            _refuse_others(poses, payloads, robot, joints, search, require)
            run_file(robot.robot, study, results, answer)
            return
        if study != StudyOptions():
            raise ProblemError("--workers, --scheduler, --again, --sync and --parquet are for a study file, STUDY.toml")
        required = requirements_of(require or ())
        from armdyn.optimal.answer.summary import reserve_summary
        from armdyn.show.figures.payload_sweep import motion_name, sweep_row, table_names, write_motion, write_sweep

        masses = payloads.masses(robot.robot)
        problems, options = _problems(masses, poses, payloads, robot, joints)
        arms = [problem.robot for problem in problems]
        folder = output.folder("sweep", robot.robot, [*map(motion_name, masses), *table_names(figure=not no_figure)])
        folder.mkdir(parents=True, exist_ok=True)
        motions: dict[int, Path] = {}

        def keep(k: int, solution: ad.Solution) -> None:
            if solution.success:
                motions[k] = write_motion(folder, masses[k], solution)

        with working(f"minimum times of {arms[0].name}", output.json) as progress:
            solutions = search.solve(problems, options, progress, keep)
            rows = [sweep_row(*pair) for pair in zip(masses, solutions, strict=False)]  # fewer after Ctrl-C
            title = f"{arms[0].name}: minimum time over payload"
            status = _status(solutions, len(problems))
            figure = not no_figure and status != "interrupted"  # who pressed Ctrl-C does not wait for it
            progress("writing the table and the figure" if figure else "writing the table")
            written = [motions[k] for k in sorted(motions)]
            files = write_sweep(folder, solutions, rows, written, title, figure=figure)
        missing = _missing(required, masses, solutions)
        answer.facts |= {
            "success": status == "done",
            "status": status,
            "robot": arms[0].name,
            "reserve": reserve_summary(problems[0]),
            "rows": rows,
            "missing": missing,
            "files": [str(file) for file in files],
        }
        answer.code = NOT_AS_REQUIRED if status == "done" and missing else _CODES[status]
        if status == "interrupted":
            answer.facts["message"] = f"interrupted; what was solved is in {folder}"
        if not output.json:
            console.print(_table(arms[0].name, rows))
            for what, parts in reserve_words(problems[0]).items():
                console.print(f"{what}: {parts}")
            console.print(f"results in {escape(str(folder))}")
            _complain(status, missing)


def _problems(
    masses: Sequence[float],
    poses: PoseOptions,
    payloads: PayloadsOptions,
    robot: SweptOptions,
    joints: FastJointOptions,
) -> tuple[list[ad.MinimumTimeProblem], Mapping[str, Any]]:
    """A problem for each mass [kg], and the solver's options that a problem file has.

    Raises:
        ArmdynError: there is no such problem; or the command line says again what a file says.
    """
    if is_problem_file(robot.robot):
        refuse_beside_a_file(robot.robot, poses, payloads.place, robot.part, joints)
        file = problem_file(robot.robot)
        return [file.made(mass) for mass in masses], file.options
    arms = [joints.fit(robot.read(payloads.place.carried(mass))) for mass in masses]
    start, goal = (read(arms[0], robot.robot, "minimum_time") for read in (poses.start, poses.goal))
    return [ad.MinimumTimeProblem(arm, q_start=start, q_goal=goal, **joints.kept()) for arm in arms], {}


def _refuse_others(
    poses: PoseOptions,
    payloads: PayloadsOptions,
    robot: SweptOptions,
    joints: FastJointOptions,
    search: SweepOptions,
    require: Sequence[str] | None,
) -> None:
    """Refuse what a study file says itself.

    Raises:
        ProblemError: it was given.
    """
    if degrees_are_on():
        raise ProblemError("--degrees: a study file says units itself: 1.57, or '90deg'")
    given = (
        (poses, "--q-start and --q-goal"),
        (payloads, "--payload and its place"),
        (robot.part, "--lock and --arm"),
        (joints, "limits, reserves and friction"),
    )
    for group, what in (*given, (search, "--starts and --time-limit")):
        if group != type(group)():
            raise ProblemError(f"a study file says all of its motions itself: leave out {what}, write them in it")
    if require:
        raise ProblemError("--require is for a robot's sweep; a study's rows say what is certified")


def _complain(status: str, missing: Sequence[str]) -> None:
    """Say what is not as it should be."""
    if status == "not_landed":
        errors.print("some motions are not usable: their messages are in sweep.csv")
    for text in missing:
        errors.print(f"required: {escape(options_of(text))}")


def _status(solutions: tuple[ad.Solution, ...], wanted: int) -> str:
    """What came of it, in a word."""
    if any(solution.status is ad.Status.INTERRUPTED for solution in solutions):
        return "interrupted"
    landed = len(solutions) == wanted and all(solution.success for solution in solutions)
    return "done" if landed else "not_landed"


def _missing(required: Sequence[Requirement], masses: Sequence[float], solutions: Sequence[ad.Solution]) -> list[str]:
    """What is required and missing, payload by payload."""
    return [
        f"{1e3 * mass:g} g: {text}"
        for mass, solution in zip(masses, solutions, strict=False)  # fewer after Ctrl-C
        for text in missing_of(required, solution)
    ]


def _table(name: str, rows: list[dict[str, object]]) -> Table:
    """For people."""
    from rich.table import Table

    table = Table(title=f"{escape(name)}: minimum time over payload", title_justify="left")
    for column in ("payload", "minimum time", "certified", "1 g costs", "limited most by", "1 % saves"):
        table.add_column(column, justify="left" if column in ("certified", "limited most by") else "right")
    for row in rows:
        gram, most, saved = row["ms_per_gram"], row["limited_most_by"], row["ms_saved_by_one_per_cent"]
        table.add_row(
            f"{1e3 * float(str(row['payload_kg'])):g} g",
            f"{float(str(row['duration_s'])):.6f} s" if row["success"] else "-",
            "yes" if row["certified"] else "no",
            "-" if gram is None else f"{gram:.3f} ms",
            "-" if most is None else escape(str(most)),
            "-" if saved is None else f"{saved:.2f} ms",
        )
    return table
