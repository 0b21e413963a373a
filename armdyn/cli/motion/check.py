"""The command `armdyn check`: whether a robot's controller accepts a motion."""

from __future__ import annotations

from dataclasses import MISSING, replace
from pathlib import Path
from typing import TYPE_CHECKING

import armdyn as ad
from armdyn.cli.console import Answer, Shown, escape, judged, table
from armdyn.cli.options.groups import argument, given, option
from armdyn.cli.options.path_constraints import known_presets, preset_named
from armdyn.cli.options.poses import positions
from armdyn.cli.options.robot import PartOptions, PayloadOptions, known_names
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import numbers

if TYPE_CHECKING:
    from armdyn.trajectory.planned import Planned


_NOTHING = 1e-4
"""Part of a limit up to which a value is shown as 0."""


def check(
    *,
    file: Path = argument(
        "FILE",
        "The motion: a table (.csv), arrays (.npz), ROS 2's JointTrajectory (.json, .yaml), as armdyn optimality reads "
        "them, a trajectory.npz of armdyn, or its folder.",
    ),
    payload: PayloadOptions,
    part: PartOptions,
    preset: str = option(
        "NAME|FILE.toml",
        "Conditions of the controller: armdyn presets lists them.",
        default=MISSING,
        autocompletion=known_presets,
    ),
    interface: str | None = option("NAME", "position, velocity or torque; by default the preset's first."),
    robot: str | None = option(
        "ROBOT",
        "Model of the arm: names of its joints, limits for ros2-jtc, torques by inverse dynamics where FILE has none.",
        autocompletion=known_names,
    ),
    present: str | None = option(
        "Q,Q,…|NAME", "Positions of the arm before the motion, like --q-start of mintime: whether it starts there."
    ),
) -> Answer:
    """Check whether a robot's controller accepts a motion, any planner's.

    The motion becomes commands at the controller's rate: between its points straight lines where it has positions only,
    cubics with velocities, quintics with accelerations, as in ros2_control's joint_trajectory_controller. Positions and
    velocities are checked all along; velocity, acceleration and jerk are backward differences of the commands, too, as
    in libfranka; before and after the motion the arm rests, or goes on with the velocity that a motion of armdyn was to
    have there. Each condition is checked on each joint.

    The preset ros2-jtc has the rules of joint_trajectory_controller itself, for any arm; --robot adds the arm's limits.

    Exit code 3: a necessary condition is violated: the controller would stop the motion.

    [dim]armdyn check planned.csv --preset franka-panda
    armdyn check moveit.yaml --preset ur5e --robot ur5
    armdyn check moveit.yaml --preset ros2-jtc --robot ur5 --present 0,-1.57,0,0,0,0
    armdyn check results/mintime-panda --preset franka-panda --interface torque
    armdyn check planned.csv --preset my_arm.toml --json[/]
    """
    chosen = preset_named(preset, interface)
    arm = None if robot is None else part.read(robot, payload.carried())
    if arm is None and given(payload, part):
        raise ProblemError("--payload, --lock, --arm, --tool and --package-dir need --robot")
    motion = _motion(file, chosen, arm)
    chosen = chosen if arm is None else chosen.fitted(arm.limits, arm.joint_names)
    at = None
    if present is not None:
        at = numbers(present, "--present") if arm is None else positions(present, "--present", arm)
    found = chosen.check(motion, present=at)
    facts = {"success": found.ok, "status": "accepted" if found.ok else "refused", "message": str(found)}
    return judged(facts | found.facts(), *check_shown(found, file.name), usable=found.ok)


def _motion(file: Path, preset: ad.ControllerPreset, arm: ad.Robot | None) -> ad.Trajectory | Planned:
    """The motion of a file."""
    from armdyn.cli.reports.saved import is_planners, motion_of, read_saved
    from armdyn.trajectory.planned import read_planned

    if arm is not None:
        preset.expect_joints(arm.joint_names)
    if not is_planners(file):
        return read_saved(file / "trajectory.npz" if file.is_dir() else file).motion
    planned = read_planned(file, preset.joints if arm is None else arm.joint_names, ends=arm is None)
    if arm is None and planned.tau is None and preset.interface == "torque":
        raise ProblemError(f"{file} has no torques, which the torque interface takes: --robot ROBOT computes them")
    # Accelerations are differences of three points; of an arm without inertias torques are unknown.
    if arm is not None and arm.has_dynamics and planned.tau is None and planned.t.size > 2:
        planned = replace(planned, tau=motion_of(arm, planned, file).tau)
    return planned


def check_shown(found: ad.ControllerCheck, name: str) -> list[Shown]:
    """A check for the terminal: the verdict, each condition, and the unchecked ones."""
    refused = next((row for row in found.offences if row.necessary), None)
    head = f"[bold]{escape(name)}[/]: {found.preset}, {found.interface} interface, {found.rate:g} commands per second"
    verdict = "[green]accepted[/]: all necessary conditions are kept"
    if refused is not None:
        verdict = (
            f"[red]refused[/]: {escape(refused.joint)} exceeds its {_plain(refused.condition)} limit, first at "
            f"t = {refused.first:.4g} s: {refused.first_shown} of {abs(refused.limit):.5g} {refused.unit}"
        )
    points = f"Between its points: {found.interpolation} interpolation."
    return [head, verdict, _table(found), points, *(f"Note: {escape(note)}." for note in found.notes)]


def _table(found: ad.ControllerCheck) -> Shown:
    """Table of each condition's violating joints, or of the joint nearest to its limit."""
    rows: list[tuple[str, ...]] = []
    styles: list[str | None] = []
    for necessary in (True, False):
        nearest = [row for row in found.worst if row.necessary is necessary]
        if nearest:
            rows.append(("necessary" if necessary else "recommended",))
            styles.append("dim")
        for one in nearest:
            for row in [row for row in found.offences if row.condition == one.condition] or [one]:
                first = ("", "") if row.first is None else (row.first_shown, f"{row.first:.4f}")
                value = row.value if row.share > _NOTHING else 0.0
                condition = f"  {_plain(row.condition)} [{row.unit}]"
                rows.append((condition, row.joint, f"{value:.4g}", f"{row.limit:.4g}", f"{row.time:.4f}", *first))
                styles.append(None if row.ok else "red" if row.necessary else "yellow")
    heads = ("condition", "joint", ">worst", ">limit", ">at [s]", ">first", ">at [s]")
    return table("", heads, rows, styles=styles)


def _plain(condition: str) -> str:
    return condition.replace("_", " ")
