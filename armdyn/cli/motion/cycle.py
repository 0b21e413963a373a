"""The command `armdyn cycle`: the fastest cycle of steps, such as pick and place."""

from __future__ import annotations

import warnings
from dataclasses import replace
from importlib.resources import files as package_files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import armdyn as ad
from armdyn.arguments import one_of
from armdyn.cli.console import Answer, cut_short, done, escape, facts_table, judged, table, working
from armdyn.cli.export import KINDS
from armdyn.cli.invocation import invocation
from armdyn.cli.motion.mintime import CurveOptions
from armdyn.cli.motion.require import largest_gap, missing_words
from armdyn.cli.options.groups import OUTPUT, SOLVER, TASK, argument, flag, group, option
from armdyn.cli.options.results import ResultOptions, Written
from armdyn.errors import ArmdynWarning, FileError, ProblemError
from armdyn.files import csv_text, write_whole
from armdyn.trajectory.formats import FORMATS, OutputFormat
from armdyn.trajectory.formats.streams import Stream

if TYPE_CHECKING:
    from armdyn.models.scene.obstacles import Obstacle

_EXAMPLE = "cell.toml"
_STEPS = "steps.csv"
_HEADS = (">step", "what", "carries", ">time [s]", ">share", "decided by", "what would help")
_MOST_COSTS = 8


@group()
class CycleSearchOptions(CurveOptions):
    """Extent of the search, and of the proof."""

    bound_programs: int | None = option(
        "N",
        "Linear programs that the lower bound of the whole cycle may take where a stop is a goal pose, 0.02 to 0.1 s "
        "each on one core; more may prove a smaller gap. By default 600.",
    )


def _largest_gap(text: str, option: str) -> float:
    """The gap of --require, as a part of the lower bound."""
    if not text.startswith("gap:"):
        raise ProblemError(f"{option} {text}: of a cycle the gap can be required, such as gap:1%")
    return largest_gap(text)


@group()
class CycleOptions:
    """The cycle, the requirement on it, and its files."""

    file: str | None = argument("FILE.toml", "The cycle. With --example: the file to write.", default=None)
    example: bool = flag(
        f"Write a commented cycle file that runs, {_EXAMPLE} if no other name is given, and solve nothing.",
        rich_help_panel=TASK,
    )
    require: Annotated[float | None, _largest_gap] = option(
        "gap:X",
        "Proven to be at most X above the least time, such as gap:1%, else exit code 4.",
        rich_help_panel=TASK,
    )
    costs: bool = flag(
        "Solve again without each way point, straight segment, speed limit and stop, and report its cost.",
        rich_help_panel=SOLVER,
    )
    search: CycleSearchOptions
    format: list[str] | None = option(  # the option's name
        KINDS,
        "Format of the motion for a controller or a simulator, as of armdyn export; may be given again. By default "
        "csv.",
        rich_help_panel=OUTPUT,
    )
    results: ResultOptions

    def kinds(self) -> list[type[OutputFormat]]:
        """Formats of the motion, each once.

        Raises:
            ProblemError: one is unknown.
        """
        names = self.format or ["csv"]
        return list(dict.fromkeys(FORMATS[one_of(name, tuple(FORMATS), "--format")] for name in names))


def cycle(options: CycleOptions) -> Answer:
    """Fastest cycle of a robot: moves, grasps, releases and waits in order, from a file.

    Each move takes the arm with its payload from rest to rest, past its way points and along its straight
    segments without a stop. Where a place can be reached by several joint positions, the best of them are chosen for
    the whole cycle. The lower bound is proven over all of them.

    The table has the deciding limit of each step's time, and a remedy: at most, to first order, 10 % more of the limit
    that decides most; with --costs, also the cost of each condition.

    Written are the motion with its payloads (trajectory.npz, and the files of --format), the table (steps.csv), a
    report, and result.json.

    Exit code 0: every move is usable. 3: one is not, and the output says which step, and why. 4: they are, but
    --require is not met.

    [dim]armdyn cycle --example
    armdyn cycle cell.toml
    armdyn cycle cell.toml --costs --require gap:3%
    armdyn cycle cell.toml --format panda-python --format ros2 --out results/cell[/]
    """
    if options.example:
        return _write_example(Path(options.file or _EXAMPLE))
    if options.file is None:
        raise ProblemError("armdyn cycle takes a cycle file; armdyn cycle --example writes one")
    return _solve(options.file, options)


def _solve(file: str, chosen: CycleOptions) -> Answer:
    """Solve the cycle of a file, and write its files."""
    from armdyn.cycle.cycle_files import OPTIONS, locating_steps, read_cycle_file
    from armdyn.cycle.summary import cycle_summary

    formats, read = chosen.kinds(), read_cycle_file(file)
    robot, options = read.cycle.robot, chosen.search.options({name: getattr(read.options, name) for name in OPTIONS})
    name = Path(file).stem
    folder = chosen.results.folder("cycle", name)
    for kind in formats:
        if issubclass(kind, Stream):  # at once, not after the solve
            kind.check_joints(robot.nv)
    with working(f"cycle of {robot.name}") as progress, locating_steps(read.table):
        solution = ad.solve_cycle(read.cycle, options, progress)
        priced = chosen.costs and solution.usable and solution.status is not ad.Status.INTERRUPTED
        found = ad.cycle_costs(solution, None, progress) if priced else ()
        summary = cut_short(cycle_summary(solution, read.cycle, found))
        written = _write(folder, name, solution, summary, chosen, progress)
    missing = _missing(solution, chosen.require)
    words = facts_table("", _words(solution, summary) | missing_words(missing) | written.words)
    steps = table(f"{name}: cycle of {robot.name}", _HEADS, map(_cells, summary["steps"]))
    shown = [steps, words] if summary["steps"] else [words]
    facts = {"robot": robot.name, **summary, "missing": missing}
    return judged(facts, *shown, usable=solution.usable, as_required=not missing, files=written.files)


def _write_example(path: Path) -> Answer:
    """Write the example; an existing file is not overwritten.

    Raises:
        FileError: there is such a file.
    """
    if path.exists():
        raise FileError(path, "is there already; armdyn cycle --example OTHER.toml writes to another name")
    content = package_files("armdyn.cycle").joinpath(_EXAMPLE).read_bytes()
    path.parent.mkdir(parents=True, exist_ok=True)
    said = f"{escape(str(path))}  (armdyn cycle {escape(str(path))} solves it)"
    return done("written", {}, said, files=[write_whole(path, content)])


def _missing(solution: ad.CycleSolution, most: float | None) -> list[str]:
    """The requirement that is not met, with the reason."""
    if most is None or (solution.gap is not None and solution.gap <= most):
        return []
    why = "the cycle is not usable" if not solution.usable else solution.verdict
    return [f"gap:{100 * most:g}% is missing: {why}"]


def _write(
    folder: Path,
    name: str,
    solution: ad.CycleSolution,
    summary: dict[str, Any],
    options: CycleOptions,
    progress: Any,
) -> Written:
    """The files of a cycle, of its solved moves."""
    from armdyn.show.page.motions import Subject

    robot = solution.cycle.robot
    title = f"{name}: {f'{solution.duration:.3f} s, ' if solution.usable else ''}{solution.verdict}"
    folder.mkdir(parents=True, exist_ok=True)
    if not solution.legs:
        from armdyn.show.results import save_results

        return Written(files=save_results(folder, robot, {"title": title, **summary, **invocation()}, []), seconds=0.0)
    from armdyn.cli.sampling import sampled

    motion, obstacles, formats = replace(solution.trajectory, name=name), _obstacles(solution), options.kinds()
    motions = {"trajectory": motion}
    written = options.results.write(folder, robot, motions, summary, title, obstacles, progress=progress)
    heads = [head.removeprefix(">") for head in _HEADS]
    files = [write_whole(folder / _STEPS, csv_text([heads, *map(_cells, summary["steps"])]).encode())]
    suffixes = [kind.suffix for kind in formats]
    for kind in formats:
        made = sampled(kind(), motion, None, rate_of(kind, motion.duration, folder), Subject.of(robot), strict=False)
        if made.broken:
            warnings.warn(f"{kind.name}: {made.broken}", ArmdynWarning, stacklevel=2)
        own = f"trajectory{'' if suffixes.count(kind.suffix) == 1 else f'-{kind.name}'}{kind.suffix}"
        files.append(write_whole(folder / own, kind().text(made.samples).encode()))
    return written.with_files(files)


def rate_of(kind: type[OutputFormat], duration: float, folder: Path) -> float:
    """Rows per second of a motion's file [Hz]: halved while there are too many, if no controller asks for the rate.

    Args:
        kind: the format.
        duration: of the motion [s].
        folder: with its trajectory.npz.

    Raises:
        ProblemError: there are too many at the controller's rate.
    """
    from armdyn.cli.sampling import usual_rate
    from armdyn.trajectory.samples import MOST_SAMPLES

    rate = usual_rate(kind)
    while duration * rate + 1 > MOST_SAMPLES:
        if issubclass(kind, Stream):
            raise ProblemError(
                f"--format {kind.name}: {duration:.4g} s at {rate:g} Hz are more than {MOST_SAMPLES} rows; the motion "
                f"is written: armdyn export {folder / 'trajectory.npz'} --format {kind.name} --piece N for each piece"
            )
        rate /= 2
    return rate


def _obstacles(solution: ad.CycleSolution) -> list[Obstacle]:
    """Obstacles of all moves, each once."""
    from armdyn.models.scene.obstacles import obstacle_entry

    every = (one for leg in solution.legs for one in leg.solution.problem.obstacles)
    return list({str(obstacle_entry(one)): one for one in every}.values())


def _cells(step: dict[str, Any]) -> list[str]:
    part = step["carries"]
    return [
        str(step["number"]),
        step["name"],
        "" if part is None else f"{part['name']}, {part['mass']:g} kg",
        f"{step['duration']:.3f}",
        f"{100 * step['share']:.0f} %",
        step["decided_by"],
        step["would_help"],
    ]


def _words(solution: ad.CycleSolution, summary: dict[str, Any]) -> dict[str, str]:
    """The whole cycle as `facts_table` shows it."""
    from armdyn.reprs import gap_words

    words = {}
    if not solution.success:
        words["status"] = solution.message
    if (duration := summary["duration"]) is not None:
        rests = summary["dwell"]
        often = f"; {3600 / duration:.0f} cycles an hour" if solution.cycle.closed else ""
        words["cycle"] = f"{duration:.6f} s, {rests:g} s of it at rest{often}"
    if solution.gap is not None:
        words["verdict"] = f"executable, {gap_words(solution.gap)}"
    else:
        words["verdict"] = "executable; no bound is known" if solution.usable else "not executable"
    if solution.cycle.conditions.get("kinematic"):
        words["verdict"] += "; torques are left out"
    if solution.lower_bound is not None:
        words["lower bound"] = f"no cycle through these steps takes less than {solution.lower_bound:.6f} s"
    if summary["order"] != sorted(summary["order"]):
        words["order"] = ", ".join(map(str, summary["order"]))
    words |= {one["name"]: one["said"] for one in summary["checks"] if one["name"] == "clear of obstacles"}
    if costs := summary["costs"]:
        words["without it"] = "\n".join(cost["said"] for cost in costs[:_MOST_COSTS])
    words["solved in"] = f"{solution.solve_time:.1f} s, {solution.branches} motions"
    return words
