"""The command `armdyn identify`: the arm from a log of it, and motions to log."""

from __future__ import annotations

import shlex
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import armdyn as ad
from armdyn.arguments import whole
from armdyn.cli.console import DONE, Answer, Shown, done, escape, facts_table, judged, table, working
from armdyn.cli.invocation import flag_of, invocation, is_given
from armdyn.cli.options.groups import argument, flag, given, group, option
from armdyn.cli.options.path_constraints import PresetOptions, SceneOptions
from armdyn.cli.options.results import OutputOptions
from armdyn.cli.options.robot import PayloadOptions, RobotArgument
from armdyn.errors import ProblemError
from armdyn.files import attributes, write_whole
from armdyn.reprs import joint_unit

if TYPE_CHECKING:
    from armdyn.identification.equations import What

_FILE, _MOTION, _REPORT = "identified.toml", "exciting.npz", "report.html"
_MOST_ROWS = 40
"""Rows of the table of numbers on the terminal; --json has all."""
_OF_LOGS = ("held_out", "likely", "confidence")
"""Options that a motion to log does not depend on."""
_MOST_LIKELY = 100
"""Most arms in a file; fewer where the file would be too large to be read."""


@group()
class IdentifyCommandOptions:
    """Unknowns to identify, or the motion to log."""

    payload_only: bool = flag("Identify the payload and friction; the links are as the robot's file says.")
    friction_only: bool = flag("Identify friction alone.")
    held_out: float = option(
        "PART", "End of each log on which a fit of its beginning is judged; the result is of all.", default=0.25
    )
    likely: int = option(
        "N",
        "Arms that fit the logs, written into identified.toml for mintime --for-tracking, monte-carlo, tune and track "
        "--plant-likely; at most 100.",
        default=_MOST_LIKELY,
    )
    confidence: float = option(
        "PART", "Probability that the region of the likely arms holds the one that moved.", default=0.95
    )
    exciting: float | None = option(
        "SECONDS", "Read no log: write a motion whose log identifies the arm well, exciting.npz."
    )

    then: str | None = option(
        "COMMAND …",
        "Run another command with the identified arm as ROBOT, by the rest of the line: --then mintime --q-goal …",
    )

    @property
    def what(self) -> What:
        """Unknowns of the identification.

        Raises:
            ProblemError: two of them are requested.
        """
        if self.payload_only and self.friction_only:
            raise ProblemError("--payload-only and --friction-only: give one of them; a payload comes with friction")
        return "payload" if self.payload_only else "friction" if self.friction_only else "all"


def identify(
    *,
    robot: RobotArgument,
    logs: list[str] | None = argument(
        "LOG",
        "Tables .csv with columns t, q1, …, tau1, … and perhaps v1, …; .npz of arrays t, q, v, tau; ROS bags.",
        default=None,
        show_default=False,
    ),
    options: IdentifyCommandOptions,
    payload: PayloadOptions,
    scene: SceneOptions,
    controller: PresetOptions,
    output: OutputOptions,
) -> Answer:
    """Inertias, friction or payload of an arm from logs of its motions.

    The result is always physical, and keeps the file's numbers that the logs do not determine. It is written as
    identified.toml, which mintime, track and the other commands take as ROBOT, with arms that fit the logs as well:
    mintime --for-tracking chooses the reserve with which all of them settle.

    A log that does not fit this arm is refused: degrees, another order of joints, currents, gaps, dead channels. Exit
    code 3: the result should not be used; the torques do not fit the motion, or the robot's payload is far from the
    one that moved.

    [dim]armdyn identify panda --exciting 10 --out log
    armdyn identify ur5 --exciting 10 --obstacle plane:0,0,1@0,0,-0.05 --self-collision --preset ur5
    armdyn export log/exciting.npz --format ros2
    armdyn identify panda log.csv --payload-only
    armdyn identify rrr log.csv --payload-only --then mintime --q-start 0,0,0 --q-goal 1,0,0 --for-tracking
    armdyn mintime results/identify-panda/identified.toml --q-start ready --q-goal 1,0.2,0.5,-1.5,0.3,2,-0.5[/]
    """
    what, arm, then = options.what, robot.read(payload.carried()), shlex.split(options.then or "")
    if (options.exciting is None) == (not logs):
        raise ProblemError("give one LOG or several, or --exciting SECONDS for a motion to log")
    about = list(given(scene, controller))
    if about and options.exciting is None:
        raise ProblemError(f"{flag_of(about[0])} is of a motion to log: give --exciting SECONDS")
    if options.exciting is not None:
        if then:
            raise ProblemError("--then needs an identified arm: give a LOG instead of --exciting")
        if of_logs := [name for name in _OF_LOGS if is_given(name)]:
            raise ProblemError(f"{flag_of(of_logs[0])} is of an identification: give a LOG")
        scene.expect_bodies()
        sought = ad.ExcitingOptions(what=what, **scene.scene_arguments(arm), preset=controller.read())
        return _write_motion(arm, options.exciting, sought, output.file("identify", robot.robot, _MOTION))
    folder = output.folder("identify", robot.robot, [_FILE, _REPORT, "result.json"])
    made = _identify(arm, logs or (), options, folder)
    return replace(made, then=[then[0], str(folder / _FILE), *then[1:]]) if then and made.code == DONE else made


def _write_motion(arm: ad.Robot, duration: float, sought: ad.ExcitingOptions, target: Path) -> Answer:
    with working(f"exciting motion of {arm.name}"):
        motion = ad.exciting_motion(arm, duration, sought)
    target.parent.mkdir(parents=True, exist_ok=True)
    file = motion.save(target)
    said = f"{escape(str(file))}  ({motion.duration:g} s, from rest to rest)"
    return done("written", {"robot": arm.name, "duration": motion.duration}, said, files=[file])


def _identify(arm: ad.Robot, logs: Sequence[str], options: IdentifyCommandOptions, folder: Path) -> Answer:
    """Identify an arm, and write the identified robot with its likely arms, the report and the facts."""
    from armdyn.show.identification import write_identification
    from armdyn.show.page.facts import Facts
    from armdyn.show.results import result_head, save_results

    whole(options.likely, "likely", 0, _MOST_LIKELY)
    settings = ad.IdentifyOptions(held_out=options.held_out)
    with working(f"identification of {arm.name}"):
        estimate = ad.identify(arm, [ad.Log.load(log, arm) for log in logs], options.what, settings)
        likely = estimate.likely(options.likely, options.confidence) if options.likely else ()
        text, count = _robot_file(estimate, likely, folder)
        unfit = estimate.unfit
        facts: dict[str, object] = {"success": not unfit, "status": "unfit" if unfit else "identified"}
        facts |= _facts(estimate) | {"likely": count}
        made = invocation()
        file = write_whole(folder / _FILE, text.encode())
        report = write_identification(estimate, folder / _REPORT, Facts(result_head(estimate.robot) | made))
        files = save_results(folder, estimate.robot, {**facts, **made}, [file, report])
    for warning in (f"do not use this result: {unfit}",) if unfit else estimate.warnings:
        warnings.warn(warning, ad.ArmdynWarning, stacklevel=2)
    return judged(facts, *_shown(estimate, files[0]), usable=not unfit, files=files)


def _robot_file(estimate: ad.Estimate, likely: Sequence[ad.Robot], folder: Path) -> tuple[str, int]:
    """Text of identified.toml, and the number of likely arms in it, bounded by the size that can be read."""
    from armdyn.models.tables import likely_tables, robot_table
    from armdyn.parsing.toml import MAX_BYTES, to_toml

    folder.mkdir(parents=True, exist_ok=True)
    table = robot_table(estimate.robot, folder)
    arms = likely_tables(table, likely)
    while arms and len(to_toml({"robot": table | {"likely": arms}}).encode()) > MAX_BYTES:
        arms = arms[: len(arms) // 2]
    return to_toml({"robot": table | ({"likely": arms} if arms else {})}), len(arms)


def _facts(estimate: ad.Estimate) -> dict[str, object]:
    held_out, own = estimate.judged, ("name", "unit", "prior", "value", "deviation", "measured")
    whole = ("noise", "offset", "combinations", "measured_combinations", "condition", "weight", "unmoved", "warnings")
    return {
        "robot": estimate.robot.name,
        "joints": list(estimate.robot.joint_names),
        "torque_errors": {} if held_out is None else attributes(held_out, "measured", "before", "after"),
        "parameters": [attributes(one, *own) for one in estimate.parameters],
        **attributes(estimate, *whole),
    }


def _shown(estimate: ad.Estimate, file: Path) -> list[Shown]:
    words = {
        "combinations measured": f"{estimate.measured_combinations} of {estimate.combinations}",
        "condition number": f"{estimate.condition:.3g}",
        "results": str(file),
    }
    if estimate.unmoved:
        words["not moved"] = ", ".join(estimate.unmoved)
    shown: list[Shown] = [facts_table(f"{estimate.robot.name}: identified", words)]
    if estimate.judged is not None:
        errors = (estimate.judged.measured, estimate.judged.before, estimate.judged.after)
        rows = [
            (joint, *(f"{value:.3g}" for value in row))
            for joint, *row in zip(estimate.robot.joint_names, *errors, strict=True)
        ]
        title = f"root mean square on the end of the logs [{joint_unit(estimate.robot.slides, 'N m', 'N')}]"
        shown.append(table(title, ("joint", ">torque", ">error before", ">after"), rows))
    measured = [one for one in estimate.parameters if one.measured]
    rows = [
        (one.name, f"{one.prior:.4g}", f"{one.value:.4g}", f"{one.interval[1] - one.value:.2g}", one.unit)
        for one in measured[:_MOST_ROWS]
    ]
    shown.append(table("", ("measured", ">before", ">value", ">± (95 %)", "unit"), rows))
    left, count = len(estimate.parameters) - len(measured), len(estimate.parameters)
    return [*shown, f"{left} numbers are the robot's rather than the logs'; --json lists all {count}"]
