"""The command `armdyn export`: writes a motion in another format."""

from __future__ import annotations

from inspect import signature
from pathlib import Path
from typing import Annotated

import typer

from armdyn.arguments import one_of
from armdyn.cli.console import answering, console, escape
from armdyn.cli.options.results import Json
from armdyn.errors import ProblemError
from armdyn.files import probe_folder, write_whole
from armdyn.parsing.numbers import number
from armdyn.trajectory.formats import FORMATS


def export(
    file: Annotated[Path, typer.Argument(metavar="FILE.npz", help="A trajectory.npz that mintime or pid wrote.")],
    format: Annotated[  # noqa: A002  # the option's name
        str,
        typer.Option(
            metavar="|".join(FORMATS), help=" ".join(f"{name}: {kind.summary}." for name, kind in FORMATS.items())
        ),
    ] = "csv",
    rate: Annotated[
        str, typer.Option(metavar="HZ", help="Rows per second; own: at the motion's own samples instead.")
    ] = "1000",
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the written file. By default that of FILE.")
    ] = None,
    motors: Annotated[
        bool,
        typer.Option(
            "--motors/--no-motors",
            help="mujoco: write a motor per joint, too; --no-motors for a model that has its own.",
        ),
    ] = True,
    json: Json = False,
) -> None:
    """A motion as a table, as ROS 2's message, or as MuJoCo's keyframes.

    Each row has a time, q, v, a and tau. Rows are 1 / rate apart, the first at 0, the last at the motion's end. Torques
    and accelerations are means over the step that begins there: what a controller holds until the next row.

    ROS 2's message (trajectory_msgs/msg/JointTrajectory) is JSON, which is YAML, too; joints have the URDF's names.

    MuJoCo's file goes into a model of the same joints in the same order, by <include file="trajectory.xml"/>. Set time,
    qpos and qvel of the first keyframe; then hold each keyframe's ctrl until the next one's time.

    [dim]armdyn mintime rr --payload 0.1006 --reserve 0.1 --out results
    armdyn export results/trajectory.npz --rate 1000
    armdyn export results/trajectory.npz --format ros2 --rate 250
    ros2 topic pub --once /joint_trajectory_controller/joint_trajectory trajectory_msgs/msg/JointTrajectory \
--yaml-file results/trajectory.json
    armdyn export results/trajectory.npz --format mujoco --rate 1000[/]
    """
    with answering(json) as answer:
        from armdyn.trajectory import Trajectory

        kind = FORMATS[one_of(format, tuple(FORMATS), "--format")]
        options = {"motors": motors} if "motors" in signature(kind).parameters else {}
        ticks = None if rate.strip() == "own" else number(rate, "--rate")
        if file.suffix.lower() != ".npz":
            raise ProblemError(f"{file} is no .npz file; armdyn export takes the trajectory.npz that armdyn wrote")
        motion = Trajectory.load(file)
        name = file.with_suffix(kind.suffix).name
        target = probe_folder(out or file.parent, name) / name
        samples = motion.resample(ticks)
        content = kind(**options).text(samples)
        target.parent.mkdir(parents=True, exist_ok=True)
        write_whole(target, content.encode())
        rows = samples.t.size
        facts = {"format": format, "rate": ticks, "samples": rows, "duration": motion.duration}
        answer.done("written", facts, [target])
        even = "its own samples" if ticks is None else f"{ticks:g} Hz"
        console.print(f"{escape(str(target))}  ({rows} rows at {even}, {motion.duration:.6f} s)")
