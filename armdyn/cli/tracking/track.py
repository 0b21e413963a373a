"""The command that has a controller move an arm along a motion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import typer

import armdyn as ad
from armdyn.cli.console import INTERRUPTED, NOT_USABLE, answering, console, facts_table, working
from armdyn.cli.options.joints import FastJointOptions, friction_words
from armdyn.cli.options.poses import PoseOptions
from armdyn.cli.options.results import ResultOptions
from armdyn.cli.options.robot import PayloadOptions, RobotOptions
from armdyn.cli.tracking.controllers import ControllerOptions, LoopOptions, PlantOptions
from armdyn.errors import ProblemError


@dataclass(frozen=True, kw_only=True)
class ReferenceOptions:
    """What the arm is to follow, and how long it is watched."""

    panel: ClassVar[str] = "Reference"

    reference: Annotated[
        Path | None,
        typer.Option(metavar="FILE.npz", help="A motion that was saved; by default the fastest one is searched."),
    ] = None
    ramp: Annotated[
        float | None,
        typer.Option(metavar="S", help="Instead of the fastest motion a quintic ramp that takes so long \\[s]."),
    ] = None
    duration: Annotated[float, typer.Option(metavar="S", help="How long the arm is watched \\[s].")] = 2.0
    tolerance: Annotated[float, typer.Option(metavar="RAD", help="From the goal, to be settled \\[rad].")] = 0.005


def track(
    poses: PoseOptions,
    payload: PayloadOptions,
    robot: RobotOptions,
    joints: FastJointOptions,
    reference: ReferenceOptions,
    controller: ControllerOptions,
    loop: LoopOptions,
    plant: PlantOptions,
    results: ResultOptions,
) -> None:
    """What a controller makes of a motion on a real arm: sampled, delayed, saturated, with the wrong payload.

    The fastest motion leaves feedback no torque; --reserve 0.1 keeps some for it. The controller knows the arm with
    --payload; the one that moves may carry --plant-payload and rub. Exit code 0: it settled at the goal; 3: it did
    not, and the output says why, also where the loop is unstable for its sampling.

    [dim]armdyn track rrr --payload 0.1006 --reserve 0.1 --plant-payload 0.12
    armdyn track rr --ramp 0.4 --controller pid --gains 30,50,1
    armdyn track ur5 --reference results/mintime-ur5/trajectory.npz --controller computed-torque[/]
    """
    json = results.output.json
    with answering(json) as answer:
        arm = joints.fit(robot.read(payload.carried()))
        law, joined, real = controller.chosen(), loop.joined(), plant.real(robot, payload, joints)
        folder = results.folder("track", robot.robot, ("trajectory", "reference"))
        with working(f"tracking with {arm.name}", json) as progress:
            asked, found = _asked(reference, arm, poses, robot.robot, joints)
            if asked is None:
                answer.facts |= {"success": False, "status": "no_reference", "message": found}
                answer.code = INTERRUPTED if found == "interrupted" else NOT_USABLE
                return
            progress("the loop")
            run = ad.track(
                arm, asked, law, real, joined, reference.duration, tolerance=reference.tolerance,
            )  # fmt: skip
            summary = {"robot": arm.name, "reference_duration": asked.duration, **run.summary()}
            title = f"{arm.name}: {controller.controller}, {_outcome(run)}"
            motions = {"trajectory": run.trajectory, "reference": asked}
            written = results.write(folder, real, motions, summary, title, tell=progress)
        answer.facts |= {**summary, **written.facts}
        answer.code = 0 if run.settled else NOT_USABLE
        if not json:
            words = {"reference": found} | friction_words(real) | _words(run) | written.words
            console.print(facts_table(f"{arm.name}: tracking with {controller.controller}", words))
