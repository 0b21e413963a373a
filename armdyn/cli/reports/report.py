"""The commands that write pages of results that were saved: of one, of several side by side, of the arm alone."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from armdyn.cli.console import Answer, Shown, done, escape, table, working
from armdyn.cli.options.groups import argument, group, option
from armdyn.cli.options.results import OutputOptions
from armdyn.cli.options.robot import PartOptions, PayloadOptions, RobotArgument
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import number

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from armdyn.show.page.joints import Compared
    from armdyn.show.page.motions import ShownMotion, Subject


def _end(text: str, option: str) -> float:
    """Drawn duration of each motion [s].

    Raises:
        ProblemError: no positive number.
    """
    end = number(text, option)
    if not end > 0:
        raise ProblemError(f"{option} is {text}; it must be positive [s]")
    return end


@group("Contents")
class ShownOptions:
    """Results, the robot that moved, and the drawn part of its motions."""

    results: list[Path] = argument(
        "RESULT",
        "Folders that mintime, cycle, pid or track wrote, trajectories (npz), or files of other planners, as "
        "optimality reads them: .csv, .npz, ROS 2's .json and .yaml.",
    )
    robot: str | None = option("ROBOT", "Robot of the motions: a name or a URDF. By default that of the first result.")
    until: Annotated[float | None, _end] = option("S", "Only the first S seconds of each motion; by default all of it.")
    part: PartOptions
    payload: PayloadOptions

    def read(self) -> tuple[Subject, list[ShownMotion]]:
        """The robot and the motions, whole.

        Raises:
            ArmdynError: a result cannot be read, or they do not fit together.
        """
        from armdyn.cli.reports.subject import SubjectSpec, read_moves, warn_of_other_tasks

        spec = SubjectSpec(robot=self.robot, part=self.part, payload=self.payload.carried())
        subject, moves = read_moves(self.results, spec)
        warn_of_other_tasks(moves[: len(self.results)], subject.sliding)
        return subject, moves


def report(shown: ShownOptions, output: OutputOptions) -> Answer:
    """One HTML page of saved results: the arm, its curves, its verdict and numbers.

    mintime, cycle, pid and track write it by themselves. Of several results the first is judged, and the others are its
    ghosts. It is written next to a single result, else to results/report-ROBOT. Nothing in a result is executed. A
    robot's file that a result names is drawn where it is here and makes the very arm that moved; else give --robot.

    [dim]armdyn report results/mintime-rr
    armdyn report results/mintime-rr results/pid-rr --until 0.5 --out results/both[/]
    """
    results, end = shown.results, shown.until
    subject, moves = shown.read()
    title = moves[0].facts.text("title") if len(results) == 1 else ""
    folder = results[0] if results[0].is_dir() else results[0].parent
    several = len(results) > 1 or output.out
    target = output.file("report", subject.name, "report.html") if several else folder / "report.html"
    from armdyn.show.page.report import report_of, write_page

    with working(f"report of {subject.name}"):
        target.parent.mkdir(parents=True, exist_ok=True)
        page = write_page(target, report_of(subject, moves, title, end))
    return _page_answer(page, {"robot": subject.name})


def replay(
    *,
    robot: RobotArgument,
    trajectories: list[Path] = argument(
        "RESULT",
        "Folders or trajectory.npz that mintime, pid or track wrote; or files of other planners, as optimality reads "
        "them.",
    ),
    payload: PayloadOptions,
    output: OutputOptions,
    slow_motion: Annotated[float | None, number] = option(
        "X", "Seconds shown per second of motion; by default it is chosen."
    ),
) -> Answer:
    """One self-contained HTML page in which the robot moves; several files move side by side.

    If a result.json lies next to a motion, the page shows its verdict, such as locally optimal, and its obstacles
    around the arm.

    [dim]armdyn replay rr results/mintime-rr/trajectory.npz results/pid-rr/trajectory.npz --payload 0.1006[/]
    """
    from armdyn.cli.reports.subject import SubjectSpec, read_moves
    from armdyn.show.page.report import Replay, report_of, write_page

    spec = SubjectSpec(robot=robot.robot, part=robot.part, payload=payload.carried())
    subject, moves = read_moves(trajectories, spec)
    target = output.file("replay", robot.robot, "replay.html")
    target.parent.mkdir(parents=True, exist_ok=True)
    with working(f"replay of {subject.name}"):
        shown = report_of(subject, moves[: len(trajectories)], replay=Replay(slow_motion=slow_motion))
        page = write_page(target, shown)
    return _page_answer(page, {})


def _page_answer(page: Path, facts: Mapping[str, object]) -> Answer:
    said = f"{escape(str(page))}  ({page.stat().st_size / 1e6:.1f} MB, opens in any browser)"
    return done("written", facts, said, files=[page])


def compare(shown: ShownOptions, output: OutputOptions) -> Answer:
    """Several motions of one arm side by side: a table, one report, and one figure for a paper.

    The others are compared with the first. The report has the first solid and the others as ghosts, all curves
    under one time; figure.pdf and figure.svg have a colour for each joint and a line style for each motion. Motions of
    other planners are read as armdyn optimality reads them: torques that a file does not have come from inverse
    dynamics. Their limits are checked; the robot is that of the first result, or --robot with its payload.

    [dim]armdyn compare results/mintime-rr results/pid-rr --until 0.5
    armdyn compare results/mintime-rr results/track-rr toppra.npz --out results/three
    armdyn compare toppra.csv ruckig.csv moveit.yaml --robot ur5 --payload 1[/]
    """
    if len(shown.results) < 2:
        raise ProblemError("compare takes two results or more; armdyn report shows a single one")
    subject, moves = shown.read()
    folder = output.folder("compare", subject.name, ["report.html", "figure.pdf", "figure.svg"])
    from armdyn.show.page.joints import compared, initial_span
    from armdyn.show.page.motions import until
    from armdyn.show.page.report import report_of, write_page
    from armdyn.show.plots import plot_trajectories, save_figures

    with working(f"comparison of {subject.name}") as progress:
        rows = compared(moves, subject.limits)
        title = f"{subject.name}: {len(moves)} motions side by side"
        folder.mkdir(parents=True, exist_ok=True)
        page = write_page(folder / "report.html", report_of(subject, moves, title, shown.until))
        progress("drawing the figure")
        unresolved = [k for k, move in enumerate(moves) if move.facts.unresolved]
        shown_until = initial_span(moves, shown.until) or shown.until
        drawn = [replace(until(move.motion, shown_until), name=move.name) for move in moves]
        figure = plot_trajectories(
            drawn,
            limits=subject.limits,
            title=title,
            unresolved=unresolved,
            sliding=subject.sliding,
            captions=[f"{row.name}, {'not at the goal' if row.there is None else _arrival(row)}" for row in rows],
        )
        files = [page, *save_figures(figure, folder / "figure", ("pdf", "svg"))]
    said = f"results in {escape(str(folder))}: {', '.join(file.name for file in files)}"
    facts = {"robot": subject.name, "motions": [asdict(row) for row in rows]}
    return done("written", facts, _table(title, rows), said, files=files)


def _table(title: str, rows: Sequence[Compared]) -> Shown:
    cells = [
        (
            row.name,
            _arrival(row),
            "-" if k == 0 or row.later is None else f"{100 * row.later:+.1f} %",
            "no torques" if row.work is None else f"{row.work:.4g} J",
            *("-" if part is None else f"{100 * part:.3g} %" for part in (row.speed, row.torque)),
            row.verdict,
        )
        for k, row in enumerate(rows)
    ]
    heads = ("motion", ">arrival", ">slower", ">work", ">speed", ">torque", "verdict")
    caption = "slower: than the first motion; speed, torque: largest share of a joint's limit that is used"
    return table(title, heads, cells, caption=caption)


def _arrival(row: Compared) -> str:
    return "-" if row.there is None else f"{row.there:.4f} s"
