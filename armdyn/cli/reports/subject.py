"""The robot of a result, rebuilt from the result's description or from its name; motions of it side by side.

A result may be untrusted: a robot is made from a name that comes with armdyn, and from a file that a result
names only if it makes the very arm that moved.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from armdyn.cli.options.robot import PartOptions, ends_of, kind_of_file
from armdyn.cli.reports.saved import Saved, is_planners, read_saved
from armdyn.errors import ArmdynError, ArmdynWarning, FileError, ProblemError, TrajectoryError
from armdyn.models import PLANAR_ARMS, JointLimits, Payload, Robot
from armdyn.models.robots.loads import is_motion_of
from armdyn.models.scene.obstacles import Obstacle, obstacle_from, payload_from, tool_from
from armdyn.models.values.actuator_limits import TorqueSpeed
from armdyn.models.values.placement import pose_from, pose_rows
from armdyn.reprs import joint_unit
from armdyn.show.page.facts import Facts, as_number
from armdyn.show.page.motions import ShownMotion, Subject

_NAME = re.compile(r"[a-z0-9_]{1,80}")
_OURS = ("example-robot-data: ", "armdyn: ", "ArmSpec ")
"""Beginnings of the sources of arms that are made by their names alone."""
_ROBOT_FILES = (".urdf", ".xml", ".mjcf")
_MOST_OBSTACLES, _MOST_LOCKS = 200, 400


@dataclass(frozen=True, kw_only=True)
class SubjectSpec:
    """The robot as the user names it.

    Attributes:
        robot: its name or file; None: a result says it.
        part: which of its joints move; where nothing is said, as in the result.
        payload: that it carries; None: the result's.
    """

    robot: str | None = None
    part: PartOptions = field(default_factory=PartOptions)
    payload: Payload | None = None

    def __post_init__(self) -> None:
        given = {"--lock": self.part.lock, "--arm": self.part.part, "--mount": self.part.mount}
        if self.robot is None and any(given.values()):
            raise ProblemError(f"{next(filter(given.get, given))} is of a robot that --robot names: give both")


def subject_of(saved: Saved, spec: SubjectSpec) -> Subject:
    """The arm of a result.

    Args:
        saved: the result.
        spec: the robot as a user names it; else the one that the result names, if it comes with armdyn, or is a
            file here that makes the very arm that moved.

    Raises:
        ArmdynError: the robot that the user named cannot be read, or has other joints.

    Warns:
        ArmdynWarning: the robot is not at hand.
    """
    model, said = saved.facts.part("model"), saved.facts.part("request").part("options").text("robot")
    named = spec.robot or _robot_of(saved, said, model)
    bare, count = bare_subject(saved, named), saved.motion.v.shape[1]
    limits = _limits(model, bare.joints)
    if named is None:
        _warn(f"{saved.path}: the robot was not found and is not drawn: give --robot")
        return bare
    try:
        arm = _built(named, saved.facts, spec)
        if arm.nv != count:
            raise TrajectoryError(f"{saved.path}: moves {count} joints, {arm.name} has {arm.nv}")
    except (ArmdynError, ValueError, TypeError) as error:
        if spec.robot is not None:
            raise
        _warn(f"{saved.path}: the robot {named} cannot be made again, so that it is not drawn ({error})")
        return bare
    arm = arm if limits is None else replace(arm, limits=limits)
    if spec.robot is None and (named != said or _is_file(named)) and not is_motion_of(arm, saved.motion):
        _warn(f"{saved.path}: {named} is not the arm that moved, so that it is not drawn: name the robot by --robot")
        return bare
    return Subject.of(arm, obstacles_in(saved.facts))


def bare_subject(saved: Saved, named: str | None = None) -> Subject:
    """The arm as far as a result says it, without its model; infinite limits are unknown."""
    model, count = saved.facts.part("model"), saved.motion.v.shape[1]
    joints = saved.motion.joint_names or tuple(model.texts("joints")) or tuple(f"joint{k + 1}" for k in range(count))
    said: Any = model.values.get("sliding")
    known = isinstance(said, list) and len(said) == count and all(isinstance(one, bool) for one in said)
    sliding = tuple(said) if known else (False,) * count
    wide = np.full(count, np.inf)
    unknown = JointLimits(
        position_lower=-wide, position_upper=wide, velocity=wide, effort_lower=-wide, effort_upper=wide
    )
    name = model.text("name") or named or saved.path.stem
    return Subject(name, joints, _limits(model, joints) or unknown, sliding)


def _robot_of(saved: Saved, said: str, model: Facts) -> str | None:
    """The robot that a result names: a name, or a file that exists; None: neither.

    Args:
        saved: the result.
        said: as the user named the robot, perhaps in another working folder; or a file of a problem or a cycle with it.
        model: the result's: its files, from the result's folder, or the name of an arm that comes with armdyn.
    """
    if _NAME.fullmatch(said):
        return said
    folder = (saved.path if saved.path.is_dir() else saved.path.parent).resolve()
    files = (*(os.path.normpath(folder / model.text(one)) for one in ("table", "file")), said)
    name, comes_along = model.text("name"), model.text("source").startswith(_OURS)
    own = name if comes_along and _NAME.fullmatch(name) else None
    return next((file for file in files if _is_file(file)), own)


def _is_file(name: str) -> bool:
    """Whether the name is that of a robot's file that exists, a table [robot] alone among them."""
    if name.lower().endswith(_ROBOT_FILES):
        return Path(name).is_file()
    with suppress(ArmdynError):
        return kind_of_file(name) == "robot"
    return False


def _built(name: str, facts: Facts, spec: SubjectSpec) -> Robot:
    """Robot of a saved motion, with its payload and options; without --robot it is searched in the library only."""
    options, model = facts.part("request").part("options"), facts.part("model")
    payload, tool = (model.part(part).given() for part in ("payload", "tool"))
    carried = spec.payload or (payload_from(payload) if payload else None)
    locked = [
        f"{joint}={q!r}rad"  # a unit, as --degrees may be on; of a joint that slides it is not looked at
        for joint, q in list(model.part("locked").values.items())[:_MOST_LOCKS]
        if as_number(q) is not None
    ]
    part, ends = spec.part, options.text("part")
    if not (part.lock or part.part or name.lower().endswith(".toml")):  # a file says it itself
        part = replace(part, lock=locked or None, part=ends_of(ends) if ends else None)
    if (mount := model.part("mount").given()) and not (part.mount or name.lower().endswith(".toml")):
        part = replace(part, mount=pose_rows(pose_from(mount, "mount"), "mount"))
    held = tool_from(tool) if tool else None
    if spec.robot is not None:
        try:
            arm = part.read(name, carried, held)
        except ArmdynError:
            if part is spec.part:
                raise
            arm = spec.part.read(name, spec.payload)  # without the joints and frames of the result's arm
    elif name in PLANAR_ARMS or _is_file(name):
        arm = part.read(name, carried, held)
    else:
        arm = Robot.from_library(name, carried, tool=held, lock=part.locks(), arm=part.part, mount=part.mount)
    armature, friction = model.numbers("armature"), model.part("friction")
    if len(armature) == arm.nv and None not in armature:
        arm = arm.with_armature([x or 0.0 for x in armature])
    damping, coulomb = friction.numbers("damping"), friction.numbers("coulomb")
    if len(damping) == len(coulomb) == arm.nv and None not in (*damping, *coulomb):
        arm = arm.with_friction([x or 0.0 for x in damping], [x or 0.0 for x in coulomb], friction.number("width"))
    return arm


def _limits(model: Facts, joints: tuple[str, ...]) -> JointLimits | None:
    """Joint limits that a result contains; None if it contains none."""
    curves, given, columns = model.part("torque_speed").values, model.part("limits"), dict[str, Any]()
    for name in ("position_lower", "position_upper", "velocity", "effort_lower", "effort_upper"):
        values, none = given.numbers(name), -np.inf if name.endswith("lower") else np.inf
        if name not in given or len(values) != len(joints):
            return None
        columns[name] = np.array([none if x is None else x for x in values])
    found = JointLimits(**columns)
    with suppress(ArmdynError):  # curves written by others may be malformed
        if curves:
            own = TorqueSpeed(found.effort_lower, found.effort_upper, joints=joints, curves=curves)
            return replace(found, actuators=own)
    return found


def obstacles_in(facts: Facts) -> tuple[Obstacle, ...]:
    """The obstacles of a result; none where one is malformed, and none of its command, which may name files."""
    entries = facts.parts("obstacles")[:_MOST_OBSTACLES]
    try:
        return tuple(obstacle_from(one.values, f"obstacle {i}") for i, one in enumerate(entries, 1))
    except ArmdynError:
        return ()


NEAR = 1e-3
"""Largest distance between the poses of the same task [rad or m]: text has three digits at least."""


def read_moves(paths: Sequence[Path], spec: SubjectSpec) -> tuple[Subject, list[ShownMotion]]:
    """Read motions with unique names, and their robot, from saved results; of a single result also its reference.

    The robot is the user's, else that of the first result that says one. The limits of a motion without a result are
    checked, where the robot is at hand.

    Args:
        paths: results of armdyn, and motions as other planners leave them.
        spec: the robot as a user names it, if not as a result does.

    Raises:
        ArmdynError: a file cannot be read, they do not fit together, or no robot is known for a file that needs it.

    Warns:
        ArmdynWarning: a motion is of another arm or payload.
    """
    if missing := [path for path in paths if not path.exists()]:
        raise FileError(missing[0], "no such file")
    own = {path: read_saved(path) for path in paths if not is_planners(path)}
    subject = _subject(paths, list(own.values()), spec)
    results = [own[path] if path in own else read_saved(path, subject.robot) for path in paths]
    moves = _named(results)
    if (robot := subject.robot) is not None:
        from armdyn.optimal.gap import check_motion

        moves = [
            move if one.facts.values else replace(move, facts=Facts(check_motion(robot, one.motion, a=one.a).facts()))
            for move, one in zip(moves, results, strict=True)
        ]
        first, arms = _arms(results[0]), {robot.model_hash}
        arms |= first if is_motion_of(robot, results[0].motion) or robot.model_hash in first else set()
        for one in results:
            if one.motion.model_hashes and not arms & _arms(one) and not is_motion_of(robot, one.motion):
                _warn(f"{one.path}: was computed for another arm, payload or friction than {subject.name}'s")
    if len(results) == 1 and results[0].reference is not None:
        return subject, [*moves, ShownMotion(results[0].reference.name or "reference", results[0].reference, Facts())]
    return subject, moves


def _arms(one: Saved) -> frozenset[str]:
    """`Robot.model_hash` of the arm that moved, and of the controller's model of it."""
    return one.motion.model_hashes | (one.reference.model_hashes if one.reference else frozenset())


def _subject(paths: Sequence[Path], own: Sequence[Saved], spec: SubjectSpec) -> Subject:
    """The arm of the motions."""
    known = next((one for one in own if one.facts.values), own[0] if own else None)
    if known is not None:
        return subject_of(known, spec)
    if spec.robot is None:
        raise ProblemError(
            f"{paths[0]} does not say of which robot it is: name it by --robot, or add a result of armdyn"
        )
    return Subject.of(_built(spec.robot, Facts(), spec))


def _named(results: Sequence[Saved]) -> list[ShownMotion]:
    """The motions, each with a name of its own.

    Raises:
        TrajectoryError: they have not the same joints.
    """
    joints = [one.motion.joint_names for one in results]
    for one, names in zip(results, joints, strict=True):
        if one.motion.v.shape[1] != results[0].motion.v.shape[1] or (names and joints[0] and names != joints[0]):
            raise TrajectoryError(
                f"{one.path}: moves {', '.join(names) or f'{one.motion.v.shape[1]} joints'}; {results[0].path} moves "
                f"{', '.join(joints[0]) or f'{results[0].motion.v.shape[1]} joints'}: only motions of one arm "
                "can be compared"
            )
    called = [one.motion.name or one.path.stem for one in results]
    return [
        ShownMotion(name if called.count(name) == 1 else f"{name} ({one.path.resolve().name})", one.motion, one.facts)
        for name, one in zip(called, results, strict=True)
    ]


def warn_of_other_tasks(moves: Sequence[ShownMotion], sliding: Sequence[bool]) -> None:
    """Warn of motions whose times are not comparable with the first's: they begin, or end, elsewhere.

    Args:
        moves: the motions.
        sliding: which joints slide instead of turning.
    """
    first = moves[0].motion
    for move in moves[1:]:
        ends = [("begins", 0)]
        if not ({"settled_time", "arrival_time"} & {*move.facts.values, *moves[0].facts.values}):
            ends.append(("ends", -1))  # a closed loop comes near by its own rule
        for word, k in ends:
            apart = float(np.max(np.abs(move.motion.q[k] - first.q[k])))
            if apart > NEAR:
                _warn(
                    f"{move.name} {word} {apart:.3g} {joint_unit(sliding)} from where {moves[0].name} {word}: "
                    "their times are not of the same task"
                )


def _warn(what: str) -> None:
    warnings.warn(what, ArmdynWarning, stacklevel=4)
