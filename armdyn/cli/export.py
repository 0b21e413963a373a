"""The command `armdyn export`: writes a motion in another format."""

from __future__ import annotations

import warnings
from dataclasses import replace
from inspect import signature
from pathlib import Path

import armdyn as ad
from armdyn.arguments import one_of, shown
from armdyn.cli.console import Answer, done, escape, judged
from armdyn.cli.invocation import flag_of
from armdyn.cli.motion.check import check_shown
from armdyn.cli.options.groups import Numbers, argument, flag, given, group, option
from armdyn.cli.options.path_constraints import PresetOptions
from armdyn.cli.options.robot import PartOptions
from armdyn.errors import ArmdynWarning, ProblemError, TrajectoryError
from armdyn.files import probe_folder, write_whole
from armdyn.parsing.numbers import number
from armdyn.trajectory.formats import FORMATS, Mujoco, OutputFormat, Ros2

KINDS = "|".join(FORMATS)
_ABOUT_KINDS = " ".join(f"{name}: {kind.summary}." for name, kind in FORMATS.items())
_DEFAULT_RATE = 1000.0
"""Rows per second of a table or message [Hz]."""
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
    out: Path | None = option("DIR", "Folder for the written file. By default that of FILE.")
    piece: int | None = option("N", "Only this piece of a motion of several pieces, from 1 on.")

    @property
    def kind(self) -> type[OutputFormat]:
        """The format.

        Raises:
            ProblemError: no format has that name.
        """
        return FORMATS[one_of(self.format, tuple(FORMATS), "--format")]

    def motion(self, file: Path) -> ad.Trajectory:
        """The motion of a file, or the piece of a number.

        Raises:
            ArmdynError: it is no file of armdyn's, or there is no piece of that number.
        """
        if file.suffix.lower() != ".npz":
            raise ProblemError(f"{file} is no .npz file; armdyn export takes the trajectory.npz that armdyn wrote")
        motion = ad.Trajectory.load(file)
        count = len(motion.own_pieces)
        if self.piece is not None and not 1 <= self.piece <= count:
            raise ProblemError(f"--piece is {self.piece}; the motion has {count} piece{'s' if count > 1 else ''}")
        return motion if self.piece is None else motion.split()[self.piece - 1]

    def target(self, file: Path) -> Path:
        """The written file.

        Raises:
            ArmdynError: it cannot be written.
        """
        name = file.with_suffix(self.kind.suffix).name
        return probe_folder(self.out or file.parent, name) / name


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
        "unless --rate is given. ur-rtde, panda-python: distance from the start at most, by default 0.01.",
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

    def content(self, file: Path, motion: ad.Trajectory, samples: ad.Samples, motors: bool) -> str:
        """The model of the arm of a motion's file, with the samples of the motion, or of a piece, as keyframes.

        Raises:
            ArmdynError: the arm cannot be read, or another one moved.
        """
        from armdyn.cli.reports.saved import read_saved
        from armdyn.cli.reports.subject import SubjectSpec, subject_of
        from armdyn.models.robots.loads import is_motion_of, robots_of

        saved = read_saved(file)
        arm = subject_of(saved, SubjectSpec(robot=self.robot, part=self.part)).robot
        if arm is None:
            raise ProblemError(f"--model: the arm of {file} was not found; give --robot")
        if saved.motion.model_hashes and not is_motion_of(arm, saved.motion):
            raise ProblemError(
                f"--model: {file} is a motion of another arm, payload or friction than {arm.name}; its result's folder "
                "knows which, or name the robot with the --lock, --arm and --tool of its run"
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

    ROS 2's message (trajectory_msgs/msg/JointTrajectory) is JSON, which is YAML, too; joints have the URDF's names.

    MuJoCo's file goes into a model of the same joints in the same order, by <include file="trajectory.xml"/>. Set time,
    qpos and qvel of the first keyframe; then hold each keyframe's ctrl until the next one's time.

    The programs for Universal Robots' and Franka's arms go to the start slowly, or refuse to run elsewhere. They were
    planned on a model: try them in simulation or at reduced speed first. Of a motion whose payload changes they set the
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
    kind = rows.kind
    output_format = fields.fill(kind)
    mujoco.expect_format(kind)
    if kind is Mujoco and controller.read() is not None:
        raise ProblemError("--preset checks commands for a controller; the format mujoco has none")
    motion, target = rows.motion(file), rows.target(file)
    preset = None if kind is Mujoco else preset_of(file, controller)
    default_rate = _MODEL_RATE if mujoco.model else usual_rate(kind)
    samples, ticks, deviation = sampled(
        output_format, motion, rows.rate, default_rate if preset is None else preset.chosen.rate
    )
    found = None if preset is None else check_samples(preset, samples, isinstance(output_format, Ros2))
    facts: dict[str, object]
    if found is not None and not found.ok and controller.preset is not None:
        more = "[red]not written[/]; without --preset it is, for simulations and figures"
        facts = {"success": False, "status": "refused", "message": f"not written: {found}", "controller": found.facts()}
        return judged(facts, *check_shown(found, target.name), more, usable=False)
    holds = None
    if kind is Ros2:
        samples, holds = with_holding_torque(samples, file, motion)
    content = mujoco.content(file, motion, samples, fields.motors) if mujoco.model else output_format.text(samples)
    target.parent.mkdir(parents=True, exist_ok=True)
    write_whole(target, content.encode())
    count, duration = samples.t.size, motion.duration
    facts = {"format": kind.name, "rate": ticks, "samples": count, "duration": duration, "deviation": deviation}
    facts |= {} if holds is None else {"holds": holds}
    facts |= {} if found is None else {"controller": found.facts()}
    even = "its own samples" if ticks is None else f"{ticks:g} Hz"
    said = [f"{escape(str(target))}  ({count} rows at {even}, {duration:.6f} s)"]
    if found is not None:
        said.append(escape(str(found)))
        if not found.ok:
            warnings.warn(f"the controller would refuse {target.name}: {found}", ArmdynWarning, stacklevel=2)
    if deviation is not None:
        said.append(f"ros2_control's spline between the points is at most {deviation:.2g} rad or m off the motion")
    if holds is False:
        said.append("the last effort is not the torque that holds the arm: no result next to the file says the arm")
    return done("written", facts, *said, files=[target])


def preset_of(file: Path, given: PresetOptions) -> ad.ControllerPreset | None:
    """The preset of the options, or else the built-in one under which the motion of a file was planned."""
    chosen, result = given.read(), file.parent / "result.json"
    if chosen is not None or file.name != "trajectory.npz" or not result.is_file():
        return chosen
    from armdyn.show.results import load_result

    planned = load_result(result).get("controller")
    name, interface = (planned.get(key) for key in ("preset", "interface")) if isinstance(planned, dict) else ("", "")
    if name and name not in ad.ControllerPreset.names():
        note = f"the motion was planned under a preset of your own, {shown(name)}: not checked; give --preset its file"
        warnings.warn(note, ad.ArmdynWarning, stacklevel=2)
    return ad.ControllerPreset.named(name, str(interface)) if name in ad.ControllerPreset.names() else None


def check_samples(preset: ad.ControllerPreset, samples: ad.Samples, accelerations: bool) -> ad.ControllerCheck:
    """Check samples that are exported.

    Args:
        preset: preset of the controller.
        samples: the exported rows.
        accelerations: whether the controller receives accelerations, too, and interpolates by quintics.

    Raises:
        ArmdynError: see `ControllerPreset.check`.
    """
    from armdyn.trajectory.planned import Planned

    if accelerations:
        return preset.check(Planned(samples.t, samples.q, samples.v, samples.a, samples.tau), samples.joint_names)
    return preset.check(
        ad.Trajectory(samples.t, samples.q, samples.v, samples.tau, samples.joint_names, hold="zero-order")
    )


def with_holding_torque(samples: ad.Samples, file: Path, motion: ad.Trajectory) -> tuple[ad.Samples, bool]:
    """Samples whose last torques hold the arm where the motion ends, and whether they do: the arm must be known.

    Args:
        samples: of the motion; ros2_control repeats their last row for good.
        file: the motion's file, or that of a sum of which the motion is a piece; a result next to it says the arm.
        motion: the motion.
    """
    import numpy as np

    from armdyn.cli.reports.saved import read_saved
    from armdyn.cli.reports.subject import SubjectSpec, subject_of
    from armdyn.models.robots.loads import is_motion_of, robots_of

    beside = file.with_name("result.json")
    saved = read_saved(file.parent if file.name == "reference.npz" and beside.is_file() else file)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of an arm that is not drawn
        arm = subject_of(saved, SubjectSpec()).robot
    if arm is None or not is_motion_of(arm, motion):
        return samples, False
    torque = robots_of(arm, motion)[-1].holding_torque(samples.q[-1])
    return replace(samples, tau=np.vstack([samples.tau[:-1], torque])), True


def usual_rate(kind: type[OutputFormat]) -> float:
    """Default rows per second of a format [Hz]."""
    return float(getattr(kind, "rate", _DEFAULT_RATE))


def sampled(
    output_format: OutputFormat, motion: ad.Trajectory, rate: str | None, default_rate: float
) -> tuple[ad.Samples, float | None, float | None]:
    """Samples at a rate, the rate [Hz] (None: the motion's own), and the spline's deviation where the format knows it.

    Args:
        output_format: the format.
        motion: the motion.
        rate: value of --rate.
        default_rate: rate without --rate [Hz].

    Raises:
        TrajectoryError: the deviation is above the tolerance, and the rate was given.
    """
    ticks = default_rate if rate is None else number(rate, "--rate") if rate.strip() != "own" else None
    while True:
        samples = motion.resample(ticks)
        deviation = getattr(output_format, "deviation", None)
        try:
            return samples, ticks, None if deviation is None else deviation(samples, motion)
        except TrajectoryError:
            if rate is not None or ticks is None:
                raise
            ticks *= 2  # `resample` refuses too many
