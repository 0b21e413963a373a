"""The command `armdyn monte-carlo`: a controller on many random arms."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Annotated, TypeAlias

import armdyn as ad
from armdyn.arguments import number as checked
from armdyn.cli import interrupts
from armdyn.cli.console import Answer, facts_table, interrupted, judged, working
from armdyn.cli.options.groups import TASK, Part, group, option
from armdyn.cli.options.results import FigureOptions
from armdyn.cli.options.task import FastArmOptions
from armdyn.cli.tracking.controllers import ControllerOptions, LoopOptions
from armdyn.cli.tracking.track import ReferenceOptions, no_motion
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import numbers

ROWS, TABLE = "rows.sqlite", "rows.csv"
"""Files of the rows."""


def range_of(text: str, name: str) -> tuple[float, float]:
    """Two numbers, the least and the greatest.

    Raises:
        ProblemError: the text has another count of numbers.
    """
    ends = numbers(text, name)
    if len(ends) != 2:
        raise ProblemError(f"{name}: {text!r} is no pair of numbers; give the least and the greatest")
    return ends[0], ends[1]


Range: TypeAlias = Annotated[tuple[float, float], range_of]
"""An option of two numbers, the least and the greatest."""


@group("The arms that move, each number drawn from its range")
class ArmsOptions:
    """Ranges of the random arms, and the likely arms of a file that they are about; see `Plants`."""

    payload_range: Annotated[tuple[float, float] | None, range_of] = option(
        "A,B", "Multiples of the payload. Default 0.8,1.2 if there is one; 1,1 of likely arms."
    )
    friction_range: Range = option("A,B", "Coulomb friction of a joint \\[N m or N].", default="0,0")
    damping_range: Range = option("A,B", "Viscous friction of a joint \\[N m s/rad or N s/m].", default="0,0")
    start_error: float = option("RAD", "Greatest distance of a joint from the start \\[rad or m].", default=0.0)
    arms_seed: int = option("N", "Seed of the random arms: arm k of a seed is always the same.", default=0)

    def plants(self, robot: ad.Robot, likely: tuple[ad.Robot, ...] = ()) -> ad.Plants:
        """The ranges, for a model or the likely arms of an identification.

        Raises:
            ProblemError: a range is malformed.
        """
        carries = robot.payload is not None and robot.payload.mass > 0
        return ad.Plants(
            payload=self.payload_range or (None if carries else (1.0, 1.0)),
            coulomb=self.friction_range,
            damping=self.damping_range,
            start=self.start_error,
            likely=likely,
            seed=self.arms_seed,
        ).check(robot)


@group(TASK)
class CountOptions:
    """Number of arms, and the requirement on them."""

    count: int = option("N", "Number of random arms.", default=1000)
    within: float | None = option("S", "Time in which an arm must settle \\[s]; by default --duration.")
    at_least: Part = option("PART", "Part of the arms that must settle, such as 0.95 or 95%; else the exit code is 4.")

    def time(self, duration: float) -> float:
        """Time that an arm has to settle [s], of a simulation of `duration` [s].

        Raises:
            ProblemError: no arms can meet the requirement.
        """
        if self.at_least is not None and not 0 <= self.at_least <= 1:
            raise ProblemError(f"--at-least is {self.at_least:g}; it is a part of the arms, 0 to 1 or 0% to 100%")
        within = duration if self.within is None else checked(self.within, "--within", sign="positive")
        if within > duration:
            raise ProblemError(f"--within is {within:g} s, but arms are simulated for {duration:g} s only: --duration")
        return within


def monte_carlo(
    task: FastArmOptions,
    reference: ReferenceOptions,
    controller: ControllerOptions,
    loop: LoopOptions,
    arms: ArmsOptions,
    study: CountOptions,
    results: FigureOptions,
) -> Answer:
    """How often a controller settles on arms that differ from its model: in payload, friction and start.

    ROBOT may be identified.toml of armdyn identify: its likely arms, which fit the log, are then taken in turn.

    Each arm is drawn at random and run as `track` runs one. Its row is on disk at once: the same command continues
    where it was stopped or killed, also with a greater --count. Exit code 0: done; 4: fewer settle than --at-least.

    [dim]armdyn monte-carlo rrr --payload 0.1006 --reserve 0.1 --within 0.4
    armdyn monte-carlo problem.toml --count 200
    armdyn monte-carlo rrr --payload 0.1006 --ramp 0.5 --friction-range 0,0.06 --at-least 0.99[/]
    """
    model = task.arm
    law, joined, plants = controller.chosen(), loop.joined(), arms.plants(model, task.likely)
    options = ad.MonteCarloOptions(count=study.count, duration=reference.duration, tolerance=reference.tolerance)
    within = study.time(reference.duration)
    if _alike(plants) and not joined.noise:
        more = "--payload, --friction-range, --damping-range, --start-error or --noise"
        said = f"all {study.count} arms are the same, so that their number says nothing: give {more}"
        warnings.warn(said, ad.ArmdynWarning, stacklevel=2)
    names = [ROWS, TABLE, "reference.npz", *results.drawn("envelope"), "result.json"]
    folder = results.output.folder("monte-carlo", task.robot.robot, names)

    with working(f"many arms like {model.name}") as progress:
        motion = reference.motion(task, progress)
        if isinstance(motion, ad.Solution):
            return no_motion(motion)
        folder.mkdir(parents=True, exist_ok=True)
        interrupts.saved(f"finished rows are in {folder}: the same command does the others")
        found = ad.monte_carlo(model, motion, law, plants, joined, options, folder / ROWS, progress)
        if found.interrupted:
            return interrupted(
                f"interrupted; {len(found.rows)} rows are in {folder / ROWS}: the same command does the others"
            )
        summary = {"success": True, "status": "done", "robot": model.name, "reference_duration": motion.duration}
        summary |= found.summary(within)
        progress("drawing the figure")
        files = _write(
            folder, found, replace(motion, model_hash=model.model_hash), summary, figure=not results.no_figure
        )
    title = f"{model.name}: {options.count} arms with {controller.controller}"
    settled = found.success(within)
    enough = study.at_least is None or settled.rate >= study.at_least
    failing = {} if enough and settled.settled else controller.in_force()
    words = facts_table(title, _words(found, within, motion) | failing | {"results": str(folder)})
    return judged(summary, words, usable=True, as_required=enough, files=files)


def _alike(plants: ad.Plants) -> bool:
    """Whether no range has a width, so that all arms are the same."""
    ranges = (plants.loads, plants.coulomb, plants.damping)
    return not plants.start and len(plants.likely) < 2 and all(least == most for least, most in ranges)


def _write(
    folder: Path, found: ad.MonteCarlo, motion: ad.Trajectory, summary: dict[str, object], *, figure: bool
) -> list[Path]:
    """Write the reference, the figure and result.json next to the rows."""
    from armdyn.show.figures.loops import plot_envelope
    from armdyn.show.plots import save_figures
    from armdyn.show.results import save_results
    from armdyn.studies.rows import read_rows
    from armdyn.studies.tables import write_csv

    with read_rows(folder / ROWS) as rows:
        files = [folder / ROWS, write_csv(rows, folder / TABLE)]
    files.append(motion.save(folder / "reference.npz"))
    if figure:
        beyond = f", {len(found.beyond_limits)} beyond limits" if found.beyond_limits else ""
        title = f"{found.question.robot.name}: {len(found.rows)} arms, {found.success().settled} settle{beyond}"
        drawn = plot_envelope(found.envelope(), title)
        files += save_figures(drawn, folder / "envelope", ("png", "pdf"))
    return save_results(folder, found.question.robot, summary, files)


def _words(found: ad.MonteCarlo, within: float, reference: ad.Trajectory) -> dict[str, str]:
    """A study in words."""
    times = [f"{time:.4f} s" if time < float("inf") else "never" for time in found.quantiles()]
    parts = zip(times, ("median", "90 %", "99 %", "worst"), strict=True)
    worst, beyond = found.worst, found.beyond_limits
    limits, load = {}, "" if worst.sample.payload == 1 else f"{worst.sample.payload:.4g} times the payload, "
    if beyond:
        first = f"; most by arm {beyond[0].k}: {'; '.join(beyond[0].limits_exceeded)}"
        limits["limits exceeded"] = f"by {len(beyond)} of {len(found.rows)} arms, settled or not{first}"
    return {
        "reference": f"{reference.duration:.4f} s",
        f"settled within {within:g} s": str(found.success(within)),
        "settled time": ", ".join(f"{time} ({part})" for time, part in parts),
        "worst arm": f"{worst.k}, {load}{worst.status.replace('_', ' ')}",
        **limits,
    }
