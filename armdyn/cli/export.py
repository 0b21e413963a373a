"""The command `armdyn export`: writes a motion in another format."""

from __future__ import annotations

import warnings
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING

import armdyn as ad
from armdyn.arguments import one_of
from armdyn.cli.console import Answer, done, escape, judged
from armdyn.cli.invocation import flag_of, is_given
from armdyn.cli.motion.check import check_shown
from armdyn.cli.options.groups import Numbers, argument, flag, given, group, option
from armdyn.cli.options.path_constraints import PresetOptions
from armdyn.cli.options.results import ALIKE, probed_file
from armdyn.cli.options.robot import PartOptions
from armdyn.errors import ArmdynWarning, ProblemError
from armdyn.files import write_whole
from armdyn.trajectory.formats import FORMATS, Mujoco, OutputFormat, Ros2
from armdyn.trajectory.formats.streams import Stream

if TYPE_CHECKING:
    from armdyn.cli.reports.saved import Saved

KINDS = "|".join(FORMATS)
_ABOUT_KINDS = " ".join(f"{name}: {kind.summary}." for name, kind in FORMATS.items())
_MODEL_RATE = 4000.0
"""Keyframes per second of a complete model [Hz]: torques and targets are held between them."""


@group()
class RowOptions:
    """The format, its rate, and its folder."""

    format: str = option(KINDS, _ABOUT_KINDS, default="csv")
    rate: str | None = option(
        "HZ|own",
        "Rows per second; own: the motion's own samples. By default the preset's; else 500 of urscript and ur-rtde, "
        "4000 with --model, and 1000 otherwise.",
    )
    out: Path | None = option("FILE|DIR", "The written file, or its folder. By default the folder of FILE.")
    piece: int | None = option("N", "Only this piece of a motion of several pieces, from 1 on.")

    @property
    def kind(self) -> type[OutputFormat]:
        """The format: --format, else that of the ending of --out, else a table.

        Raises:
            ProblemError: no format has that name.
        """
        own = self.out.suffix.lower() if self.out and not is_given("format") else ""
        named = [kind for kind in FORMATS.values() if kind.suffix in (own, ALIKE.get(own))]
        return named[0] if len(named) == 1 else FORMATS[one_of(self.format, tuple(FORMATS), "--format")]

    def read(self, file: Path) -> tuple[Saved, ad.Trajectory]:
        """The motion of a file with its result, and the part of it to write: all, or the piece of a number.

        Raises:
            ArmdynError: it is no file of armdyn's, or there is no piece of that number.
        """
        if file.suffix.lower() != ".npz":
            raise ProblemError(f"{file} is no .npz file; armdyn export takes the trajectory.npz that armdyn wrote")
        from armdyn.cli.reports.saved import read_saved

        saved = read_saved(file)
        count = len(saved.motion.own_pieces)
        if self.piece is not None and not 1 <= self.piece <= count:
            raise ProblemError(f"--piece is {self.piece}; the motion has {count} piece{'s' if count > 1 else ''}")
        return saved, saved.motion if self.piece is None else saved.motion.split()[self.piece - 1]

    def target(self, file: Path) -> Path:
        """The written file.

        Raises:
            ArmdynError: it cannot be written.
        """
        name = file.with_suffix(self.kind.suffix).name
        return probed_file(self.out, file.parent, name)


@group()
class FormatOptions:
    """Fields of some formats: see `armdyn.trajectory.formats`."""

    motors: bool = option(
        "",
        "mujoco: write a motor per joint, too; --no-motors for a model that has its own.",
        default=True,
        name="--motors/--no-motors",
    )
    tolerance: float | None = option(
        "RAD",
        "ros2: distance of ros2_control's spline from the motion at most, by default 1e-3; the rate is raised for it "
        "unless --rate is given, too. ur-rtde, panda-python: distance from the start at most, by default 0.01.",
    )
    effort: bool = option(
        "",
        "ros2: write efforts; --no-effort for a controller without an effort command interface, which refuses them.",
        default=True,
        name="--effort/--no-effort",
    )
    payload: float | None = option(
        "KG", "urscript, ur-rtde, panda-python: mass of the payload for the controller \\[kg]."
    )
    payload_com: Numbers = option("X,Y,Z", "Centre of mass of --payload from the flange \\[m]; by default 0,0,0.")
    transition: float | None = option(
        "S", "urscript: time over which the controller applies a payload that changes \\[s]; by default at once."
    )

    def fill(self, kind: type[OutputFormat]) -> OutputFormat:
        """A format with the given options.

        Raises:
            ProblemError: an option is given that the format does not have.
        """
        options = given(self)
        for name in options:
            if name not in signature(kind).parameters:
                those = ", ".join(other for other, each in FORMATS.items() if name in signature(each).parameters)
                raise ProblemError(f"{flag_of(name)} is of the formats {those}; {kind.name} has none")
        return kind(**options)


@group()
class ModelOptions:
    """MuJoCo's model of the arm that moved."""

    model: bool = flag(
        "mujoco: one complete model with the keyframes in it, of the arm of FILE's result or of --robot: locked joints "
        "welded, friction and payload as it moved."
    )
    robot: str | None = option("ROBOT", "With --model: the arm that moved, as mintime takes it.")
    geometry: bool = option(
        "",
        "With --model: convex parts of the arm's meshes, in the file.",
        default=True,
        name="--geometry/--no-geometry",
    )
    feedback: bool = option(
        "",
        "With --model: servos that hold each joint on the motion, besides the torques; --no-feedback: torques alone, "
        "open loop.",
        default=True,
        name="--feedback/--no-feedback",
    )
    part: PartOptions

    def expect_format(self, kind: type[OutputFormat]) -> None:
        """Refuse --model with another format, and its options without it.

        Raises:
            ProblemError: there are such options.
        """
        if self.model and kind is not Mujoco:
            raise ProblemError(f"--model is of the format mujoco; {kind.name} has none")
        if not self.model and given(self):
            raise ProblemError(
                "--robot, --no-geometry, --no-feedback, --lock, --arm, --tool and --package-dir need --model"
            )

    def content(self, saved: Saved, motion: ad.Trajectory, samples: ad.Samples, motors: bool) -> str:
        """The model of the arm of a saved motion, with the samples of the motion, or of a piece, as keyframes.

        Raises:
            ArmdynError: the arm cannot be read, or another one moved.
        """
        from armdyn.cli.reports.subject import SubjectSpec, subject_of
        from armdyn.models.robots.loads import is_motion_of, robots_of

        arm = subject_of(saved, SubjectSpec(robot=self.robot, part=self.part)).robot
        if arm is None:
            raise ProblemError(f"--model: the arm of {saved.path} was not found; give --robot")
        if saved.motion.model_hashes and not is_motion_of(arm, saved.motion):
            raise ProblemError(
                f"--model: {saved.path} is a motion of another arm, payload or friction than {arm.name}; its result's "
                "folder knows which, or name the robot with the --lock, --arm and --tool of its run"
            )
        return ad.mujoco_model(
            robots_of(arm, motion)[0], samples, geometry=self.geometry, motors=motors, feedback=self.feedback
        )


def export(
    *,
    file: Path = argument("FILE.npz", "A trajectory.npz that mintime or pid wrote."),
    rows: RowOptions,
    fields: FormatOptions,
    mujoco: ModelOptions,
    controller: PresetOptions,
) -> Answer:
    """A motion as a table, ROS 2's message, MuJoCo's model or keyframes, or a program for a robot's controller.

    Each row has a time, q, v, a and tau. Rows are 1 / rate apart, the first at 0, the last at the motion's end. Torques
    are means over the step that begins there: a controller holds them until the next row. A motion that was to rest at
    an end does so exactly in its rows.

    ROS 2's message (trajectory_msgs/msg/JointTrajectory) is JSON, which is YAML, too; joints have the URDF's names. It
    is checked as ros2_control's joint_trajectory_controller runs it (preset ros2-jtc): where the splines between its
    points would exceed a limit of the arm or the tolerance, the rate is doubled until they do not; where --rate and
    --tolerance are both given, nothing is written (exit code 3), and the rate that would do is said.

    MuJoCo's file goes into a model of the same joints in the same order, by <include file="trajectory.xml"/>. Set time,
    qpos and qvel of the first keyframe; then hold each keyframe's ctrl until the next one's time.

    The programs for Universal Robots' and Franka's arms go to the start slowly, or refuse to run elsewhere. They were
    planned on a model: try them in simulation or at reduced speed first. Joints of other names than those arms', or
    faster than theirs, are refused unless --preset checks the motion. Of a motion whose payload changes they set the
    controller's payload, and have a function for the gripper's commands.

    With --preset the export is checked as the robot's controller sees it; a refused one is not written (exit code 3). A
    motion that was planned under a built-in preset is checked by that one; a refused export is written with a warning.

    [dim]armdyn mintime rr --payload 0.1006 --reserve 0.1 --out results
    armdyn export results/trajectory.npz --rate 1000
    armdyn export results/trajectory.npz --format ros2 --rate 250
    ros2 topic pub --once /joint_trajectory_controller/joint_trajectory trajectory_msgs/msg/JointTrajectory \
--yaml-file results/trajectory.json
    armdyn export results/trajectory.npz --format mujoco --rate 1000
    armdyn export results/mintime-ur5/trajectory.npz --format mujoco --model
    armdyn export results/trajectory.npz --format urscript --payload 2.5 --payload-com 0,0,0.08
    armdyn export results/trajectory.npz --format panda-python --preset franka-panda[/]
    """
    from armdyn.cli.sampling import check_rows, preset_of, sampled, subject_in, usual_rate, with_holding_torque

    kind = rows.kind
    output_format = fields.fill(kind)
    mujoco.expect_format(kind)
    if kind is Mujoco and controller.read() is not None:
        raise ProblemError("--preset checks commands for a controller; the format mujoco has none")
    (saved, motion), target = rows.read(file), rows.target(file)
    powered = bool(motion.tau.any())
    if isinstance(output_format, Ros2) and not powered:
        output_format, fields = replace(output_format, effort=False), replace(fields, effort=False)
    preset = None if kind is Mujoco else preset_of(saved, controller)
    default_rate = _MODEL_RATE if mujoco.model else usual_rate(kind)
    default_rate = default_rate if preset is None else preset.chosen.rate
    subject = subject_in(saved, kind)
    made = sampled(output_format, motion, rows.rate, default_rate, subject, strict=fields.tolerance is not None)
    samples, facts = made.samples, made.facts()
    if preset is None and isinstance(output_format, Stream):
        output_format.check_arm(samples)
    if made.broken and kind is Ros2:
        facts |= {"success": False, "status": "refused", "message": f"not written: {made.broken}"}
        return judged(facts, f"[red]refused[/], not written: {escape(made.broken)}", usable=False)
    if made.broken:
        warnings.warn(f"{target.name}: {made.broken}", ArmdynWarning, stacklevel=2)
    if preset is not None and subject is not None:
        preset = preset.fitted(subject.limits, subject.joints)
    found = None if preset is None else check_rows(preset, samples, kind)
    facts |= {} if found is None else {"controller": found.facts()}
    if found is not None and not found.ok and controller.preset is not None:
        more = "[red]not written[/]; without --preset it is, for simulations and figures"
        facts |= {"success": False, "status": "refused", "message": f"not written: {found}"}
        return judged(facts, *check_shown(found, target.name), more, usable=False)
    said = made.said()
    if subject is not None and kind is Ros2:
        samples, facts["holds"] = with_holding_torque(samples, subject.robot, motion)
        unheld = _UNHELD if powered else "without efforts, since the motion has no torques"
        said += [] if facts["holds"] and powered else [unheld]
        said += [_EFFORT] if fields.effort else []
    content = mujoco.content(saved, motion, samples, fields.motors) if mujoco.model else output_format.text(samples)
    target.parent.mkdir(parents=True, exist_ok=True)
    write_whole(target, content.encode())
    facts |= {"format": kind.name, "samples": samples.t.size, "duration": motion.duration}
    even = "its own samples" if made.rate is None else f"{made.rate:g} Hz"
    said.insert(0, f"{escape(str(target))}  ({samples.t.size} rows at {even}, {motion.duration:.6f} s)")
    if found is not None:
        said.insert(1, escape(str(found)))
        if not found.ok:
            warnings.warn(f"the controller would refuse {target.name}: {found}", ArmdynWarning, stacklevel=2)
    return done("written", facts, *said, files=[target])


_UNHELD = "the last effort is not the torque that holds the arm: no result next to the file says the arm"
_EFFORT = "a controller without an effort command interface refuses points with efforts: --no-effort leaves them out"
