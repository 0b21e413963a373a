"""The command that moves one robot with many payloads."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from armdyn.cli.arguments import (
    Armature,
    Damping,
    EffortLimit,
    Friction,
    FrictionWidth,
    Json,
    Lock,
    Out,
    Part,
    PayloadCom,
    PayloadFrame,
    QGoal,
    QStart,
    RobotName,
    VelocityLimit,
    carried,
    load_robot,
    numbers,
    poses,
    slug,
)
from armdyn.cli.console import INTERRUPTED, NOT_CERTIFIED, answering, console, errors, working
from armdyn.errors import ProblemError
from armdyn.models import PAPER_ARMS, PAPER_PAYLOADS


def sweep(
    robot: RobotName,
    payload: Annotated[
        str | None,
        typer.Option(metavar="KG,KG,…", help="Point masses that the arm carries \\[kg]. r, rr, rrr: the paper's ten."),
    ] = None,
    q_start: QStart = None,
    q_goal: QGoal = None,
    payload_frame: PayloadFrame = None,
    payload_com: PayloadCom = None,
    lock: Lock = None,
    part: Part = None,
    effort_limit: EffortLimit = None,
    velocity_limit: VelocityLimit = None,
    damping: Damping = None,
    friction: Friction = None,
    friction_width: FrictionWidth = None,
    armature: Armature = None,
    starts: Annotated[
        int | None, typer.Option(help="Guesses of every search; by default the first has mintime's, the others few.")
    ] = None,
    time_limit: Annotated[float, typer.Option(metavar="S", help="For each payload \\[s].")] = 300.0,
    out: Out = None,
    json: Json = False,
) -> None:
    """Minimum time over payload: how much each gram costs, and which limit counts.

    Each optimum is where the search for the next payload's begins; what a heavier payload's search finds is
    tried on the lighter one, too. A payload that is solved is on disk at once. Exit code 0: all landed.

    [dim]armdyn sweep rr
    armdyn sweep panda --payload 0,1,2,3 --q-start 0,-0.785,0,-2.356,0,1.571,0.785 --q-goal 1,0.2,0.5,-1.5,0.3,2,-0.5[/]
    """
    with answering(json) as answer:
        from armdyn.optimal import MinimumTimeOptions, MinimumTimeProblem, Solution, Status
        from armdyn.show.sweeps import sweep_row, write_motion, write_sweep
        from armdyn.studies.sweep import sweep as solve_all

        if payload is None and robot not in PAPER_ARMS:
            raise ProblemError(f"give --payload with the masses [kg] that {robot} is to carry, such as 0,0.5,1")
        masses = sorted(set(PAPER_PAYLOADS if payload is None else numbers(payload, "--payload")))
        arms = [
            load_robot(
                robot,
                carried(mass, payload_frame, payload_com),
                lock,
                effort_limit,
                velocity_limit,
                damping,
                friction,
                friction_width,
                armature,
                part,
            )
            for mass in masses
        ]
        start, goal = poses(arms[0], robot, "minimum_time", q_start, q_goal)
        problems = [MinimumTimeProblem(arm, q_start=start, q_goal=goal) for arm in arms]
        folder = out or Path("results") / f"sweep-{slug(robot)}"
        folder.mkdir(parents=True, exist_ok=True)

        motions: dict[int, Path] = {}

        def keep(k: int, solution: Solution) -> None:
            if solution.success:
                motions[k] = write_motion(folder, masses[k], solution)

        with working(f"minimum times of {arms[0].name}", json) as progress:
            options = MinimumTimeOptions(starts=starts, time_limit=time_limit)
            solutions = solve_all(problems, options, progress, keep)
            rows = [sweep_row(*pair) for pair in zip(masses, solutions, strict=False)]  # fewer after Ctrl-C
            title = f"{arms[0].name}: minimum time over payload"
            files = write_sweep(folder, solutions, rows, [motions[k] for k in sorted(motions)], title)
        broken = any(solution.status is Status.INTERRUPTED for solution in solutions)
        success = len(solutions) == len(problems) and all(solution.success for solution in solutions)
        answer.facts |= {
            "success": success,
            "status": "interrupted" if broken else "done" if success else "not_landed",
            "robot": arms[0].name,
            "rows": rows,
            "files": [str(file) for file in files],
        }
        answer.code = INTERRUPTED if broken else 0 if success else NOT_CERTIFIED
        if broken:
            answer.facts["message"] = f"interrupted; what was solved is in {folder}"
        if not json:
            console.print(_table(arms[0].name, rows))
            console.print(f"results in {escape(str(folder))}")
            if not success and not broken:
                errors.print("some payloads did not land: their messages are in sweep.csv")


def _table(name: str, rows: list[dict[str, object]]) -> Table:
    """For people."""
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
