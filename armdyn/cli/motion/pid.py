"""The command that closes a PID loop around an arm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import typer

import armdyn as ad
from armdyn.cli.console import NOT_CERTIFIED, answering, console, facts_table, working
from armdyn.cli.options.joints import JointOptions, friction_facts, friction_words
from armdyn.cli.options.poses import PoseOptions
from armdyn.cli.options.results import ResultOptions
from armdyn.cli.options.robot import PayloadOptions, RobotOptions
from armdyn.cli.options.text import numbers
from armdyn.errors import ProblemError


@dataclass(frozen=True, kw_only=True)
class LoopOptions:
    """The controller, and how long it is watched; see `simulate_pid`."""

    panel: ClassVar[str] = "Loop"

    gains: Annotated[str, typer.Option(metavar="KP,KI,KD", help="The same for every joint.")] = "30,50,10"
    form: Annotated[
        str, typer.Option(help="acceleration (the paper's), torque (a real controller, saturated), or computed_torque.")
    ] = "acceleration"
    duration: Annotated[float, typer.Option(metavar="S", help="How long to simulate \\[s].")] = 10.0

    def run(self, arm: ad.Robot, start: list[float], goal: list[float]) -> ad.PidRun:
        """Close the loop between two poses [rad or m], each of shape (nv,).

        Raises:
            ProblemError: the gains are not three numbers, or something does not fit the arm.
        """
        values = numbers(self.gains, "--gains")
        if len(values) != 3:
            raise ProblemError(f"--gains: {self.gains!r} has {len(values)} numbers; give three, KP,KI,KD")
        return ad.simulate_pid(
            arm,
            q_start=start,
            q_goal=goal,
            gains=ad.PidGains(kp=values[0], ki=values[1], kd=values[2]),
            duration=self.duration,
            form=self.form,  # type: ignore[arg-type]  # simulate_pid refuses what it does not know
        )


def pid(
    poses: PoseOptions,
    payload: PayloadOptions,
    robot: RobotOptions,
    joints: JointOptions,
    loop: LoopOptions,
    results: ResultOptions,
) -> None:
    """What a PID loop does between two poses.

    [dim]armdyn pid rr --payload 0.1006
    armdyn pid rr --form torque --gains 30,50,3[/]
    """
    json = results.output.json
    with answering(json) as answer:
        from armdyn.show.report import pid_summary

        arm = joints.fit(robot.read(payload.carried()))
        start, goal = poses.start(arm, robot.robot, "pid"), poses.goal(arm, robot.robot, "pid")
        with working(f"PID loop of {arm.name}", json) as progress:
            run = loop.run(arm, start, goal)
            summary = pid_summary(run)
            title = f"{arm.name}, {1000 * payload.payload:g} g: PID loop"
            folder = results.output.folder("pid", robot.robot)
            written = results.write(folder, arm, run.trajectory, summary, title, tell=progress)
        answer.facts |= {"robot": arm.name, **friction_facts(arm), **summary, **written.facts}
        answer.code = 0 if run.arrival_time is not None else NOT_CERTIFIED
        if not json:
            words = friction_words(arm) | _words(run) | written.words
            console.print(facts_table(f"{arm.name}: PID loop", words))


def _words(run: ad.PidRun) -> dict[str, str]:
    """A run in words."""
    return {
        "status": f"{run.status}: {run.message}",
        "arrival": "-" if run.arrival_time is None else f"{run.arrival_time:.4f} s",
        "overshoot": ", ".join(f"{x:.4f}" for x in run.overshoot) + " rad",
        "max Re λ": f"{run.max_real_eigenvalue:.4f} 1/s",
    }
