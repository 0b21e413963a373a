"""From any Pinocchio model to that of an arm: joints are locked, numbers checked, the tip is found."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from armdyn.arguments import shown
from armdyn.arrays import Array
from armdyn.errors import SpecError, UnsupportedJointError, UrdfError, did_you_mean
from armdyn.models.reading.ends import gripper_joints, joint_numbers, tip_of
from armdyn.models.reading.faults import repair_call
from armdyn.models.reading.urdf_check import inertia_fault
from armdyn.models.reading.urdf_xml import LARGEST, clipped
from armdyn.models.values.joint_limits import JointLimits
from armdyn.models.values.urdf import TIP
from armdyn.parsing.numbers import FREE

_KNOWN = re.compile(r"JointModel(R[XYZ]|RUB[XYZ]|Revolute(Unbounded)?Unaligned|P[XYZ]|PrismaticUnaligned)")
"""Pinocchio's names of joints that turn or slide along one axis."""

_SHARED = (pin.FrameType.BODY, pin.FrameType.OP_FRAME, pin.FrameType.FIXED_JOINT, pin.FrameType.SENSOR)
"""Frames that may be called like a joint."""


class Mimic(NamedTuple):
    """A joint that follows another: position = multiplier * leader's + offset."""

    leader: str
    """The other joint."""
    multiplier: float
    """[1, or m/rad]."""
    offset: float
    """[rad or m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """Result of reading an arm from a file or a Pinocchio model: fields of an `Arm`.

    Attributes:
        source: name of the file or text.
        model: of the moving joints only.
        locked: joint name to the position it is locked at [rad or m].
        tip: the frame at the end of the arm.
        limits: of the moving joints.
        urdf: its text; empty: it was no URDF.
        gripper: joints of a gripper that are locked by default.
        repaired: links whose inertia `armdyn doctor --repair` changed, as the file says.
        package_dirs: folders in which `package://` is looked up.
    """

    source: str
    model: pin.Model
    locked: Mapping[str, float]
    tip: str
    limits: JointLimits
    urdf: str = ""
    gripper: tuple[str, ...] = ()
    repaired: str = ""
    package_dirs: tuple[str, ...] = ()


def read_model(
    model: pin.Model,
    source: str,
    lock: Mapping[str, float | str],
    arm: tuple[str, str] | None,
    mimics: Mapping[str, Mimic] | None = None,
) -> Reading:
    """The arm inside a model; the model itself stays unchanged.

    Args:
        model: any of Pinocchio's.
        source: name of the file or text, in messages.
        lock: joints to fix, name to position [rad or m]; a joint of several coordinates at 0, its neutral.
        arm: first and last joint or frame; see `Robot.from_urdf`.
        mimics: see `locked_joints`.

    Raises:
        UnsupportedJointError: a joint that moves neither turns nor slides along one axis.
        UrdfError: the model has numbers that no arm has, or nothing moves.
        SpecError: a lock or the arm does not fit it.
    """
    reading = arm_of(model, source, locked_joints(model, source, lock, arm, mimics), arm)
    return replace(reading, gripper=default_locks(model, lock, arm, mimics))


def default_locks(
    model: pin.Model,
    lock: Mapping[str, float | str],
    arm: tuple[str, str] | None,
    mimics: Mapping[str, Mimic] | None,
) -> tuple[str, ...]:
    """Joints of a gripper that are locked by default, without those that follow them; arguments of `locked_joints`."""
    if arm is not None or mimics is None:
        return ()
    given = {*lock, *(mimic.leader for name, mimic in mimics.items() if name in lock)}  # or its follower was locked
    held = {name for name, value in lock.items() if value != FREE}
    found = gripper_joints(model, {name: mimic.leader for name, mimic in mimics.items()}, held)
    return tuple(name for name in found if name not in given)


def locked_joints(
    model: pin.Model,
    source: str,
    lock: Mapping[str, float | str],
    arm: tuple[str, str] | None,
    mimics: Mapping[str, Mimic] | None = None,
) -> dict[str, float]:
    """Positions [rad or m] of the joints that do not move, by name.

    Args:
        model: of all joints.
        source: name of the file or text, in messages.
        lock: see `read_model`.
        arm: see `read_model`.
        mimics: joints that follow others, which may be fixed ones; they do not move. None: grippers are not locked by
            default.

    Raises:
        SpecError: `lock` names no moving joint or no finite position, or `arm` does not fit.
        UnsupportedJointError: a joint mimics one that moves.
        UrdfError: a joint mimics itself, or would be locked beyond `LARGEST`.
    """
    joints = joint_numbers(model)
    opened = {name for name, value in lock.items() if isinstance(value, str) and value == FREE}
    for name, value in lock.items():
        if name not in joints:
            hint, names = did_you_mean(str(name), joints), ", ".join(map(clipped, list(joints)[:20]))
            raise SpecError(f"cannot lock {clipped(name)!r}: {source} has joints {names}{hint}")
        several = model.joints[joints[name]].nv != 1
        if name not in opened and (not _in_bounds(value) or (several and value)):
            right = f"one number [rad or m]{'; 0 for a joint of several coordinates' if several else ''}"
            raise SpecError(f"cannot lock {name!r} at {shown(value)}: it must be {right}")
    held = {name: float(value) for name, value in lock.items() if name not in opened}
    free = {*(joints if arm is None else _chain(model, *arm, source)), *opened}
    free -= {*held, *default_locks(model, lock, arm, mimics)}
    mimics = mimics or {}

    def position(name: str, followers: tuple[str, ...] = ()) -> float | None:
        """Position of a joint; None: it moves."""
        if name in held:
            return held[name]
        if name not in mimics:
            return None if name in free else rest_of(model, joints.get(name, 0))
        if name in followers:
            raise UrdfError(source, "mimics itself in the end", f"joint {clipped(name)!r}")
        leader, multiplier, offset = mimics[name]
        at = position(leader, (*followers, name))
        return None if at is None else multiplier * at + offset

    locked: dict[str, float] = {}
    for name in joints:
        if name in free and name not in mimics:
            continue
        at = position(name)
        if at is None:
            what = (
                f"mimics {clipped(mimics[name].leader)!r}, which moves; coupled joints are not supported "
                "(docs/models.md says why): lock that one, and this follows, or only this one; "
                f"{repair_call(source)} shows where"
            )
            raise UnsupportedJointError(source, what, f"joint {clipped(name)!r}")
        if not abs(at) <= LARGEST:
            raise UrdfError(source, f"would be locked at {at:g}", f"joint {clipped(name)!r}")
        locked[name] = at
    return locked


def arm_of(model: pin.Model, source: str, locked: Mapping[str, float], arm: tuple[str, str] | None) -> Reading:
    """The arm of a model with locked joints; the model itself stays unchanged.

    Raises:
        UnsupportedJointError: a joint that moves neither turns nor slides along one axis.
        UrdfError: the model has numbers that no arm has, or nothing moves.
    """
    for name, joint in joint_numbers(model).items():
        kind = model.joints[joint].shortname()
        if name not in locked and not _KNOWN.fullmatch(kind):
            what = f"is a {kind}; armdyn supports joints that turn or slide along one axis: lock it, or choose an arm"
            raise UnsupportedJointError(source, what, f"joint {clipped(name)!r}")
    reduced = _reduced(model.copy(), locked, source)
    if reduced.nv == 0:
        raise UrdfError(source, "has no moving joint")
    _check(reduced, source)
    named = None if arm is None else _frame(model, arm[1])
    if arm is not None and named is not None and named.type != pin.FrameType.FIXED_JOINT:
        tip, last = arm[1], 0
    else:
        end = None if arm is None else arm[1] if named is None else str(model.names[named.parentJoint])
        tip, last = tip_of(model, set(locked), end)
    if not tip:
        tip = TIP
        while _frame(model, tip) is not None or tip in joint_numbers(model):
            tip += "'"
        last = reduced.getJointId(str(model.names[last]))
        reduced.addFrame(pin.Frame(tip, last, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return Reading(source=source, model=reduced, locked=locked, tip=tip, limits=joint_limits(reduced))


def _in_bounds(position: Any) -> bool:
    """Whether a value is a number that a joint may be locked at [rad or m]."""
    known = isinstance(position, int | float | np.integer | np.floating) and not isinstance(position, bool)
    return known and bool(abs(position) <= LARGEST)


def _frame(model: pin.Model, name: str) -> pin.Frame | None:
    """A frame that is no joint, by name."""
    return next((frame for frame in model.frames if frame.name == name and frame.type in _SHARED), None)


def rest_of(model: pin.Model, joint: int) -> float:
    """Zero, or the bound nearest to it [rad or m]; of a fixed joint, number 0, zero."""
    if model.joints[joint].nq != 1:
        return 0.0
    i = model.joints[joint].idx_q
    return float(np.clip(0.0, model.lowerPositionLimit[i], model.upperPositionLimit[i]))


def _chain(model: pin.Model, first: str, last: str, source: str) -> list[str]:
    """The joints on the way from `first` to `last`; the frame is meant where a joint has its name."""
    joints = joint_numbers(model)
    ends = []
    for name in (first, last):
        frame = _frame(model, name)
        if frame is None and name not in joints:
            known = [*joints, *(other.name for other in model.frames)]
            raise SpecError(f"arm: {source} has no link, frame or joint {clipped(name)!r}{did_you_mean(name, known)}")
        ends.append((joints[name] if frame is None else int(frame.parentJoint), frame))
    (base, start), (end, goal) = ends
    way = [int(joint) for joint in model.supports[end]]
    goal = goal or next((frame for frame in model.frames if frame.name == last), None)
    # Frames of a model that was built by hand may lack their parents.
    branches = start is not None and goal is not None and goal.parentFrame and start not in _frames_to_base(model, goal)
    if base not in way or branches:
        raise SpecError(f"arm: {clipped(last)!r} is not behind {clipped(first)!r} in {source}")
    names = [str(model.names[joint]) for joint in way[way.index(base) + (start is not None) :] if joint]
    if not names:
        raise SpecError(f"arm: nothing moves between {clipped(first)!r} and {clipped(last)!r} of {source}")
    return names


def _reduced(model: pin.Model, locked: Mapping[str, float], source: str) -> pin.Model:
    """The model without its locked joints; it is changed on the way."""
    if not locked:
        return model
    joints = joint_numbers(model)
    at = pin.neutral(model)
    for name, position in locked.items():
        joint = model.joints[joints[name]]
        if joint.nv == 1:
            turned = (np.cos(position), np.sin(position))
            at[joint.idx_q : joint.idx_q + joint.nq] = position if joint.nq == 1 else turned
    for name, i in joints.items():  # pin 4.1 crashes where a joint that is to be locked has no frame
        if not model.existFrame(name, pin.FrameType.JOINT):
            model.addJointFrame(i, -1)
    original = _rename_uniquely(model)  # pin 4.1 cannot reduce a model in which two frames have one name
    try:
        reduced = pin.buildReducedModel(model, [joints[name] for name in locked], at)
    except (RuntimeError, ValueError) as error:
        raise UrdfError(source, f"Pinocchio cannot lock {', '.join(locked)} ({clipped(error)})") from None
    rename(reduced, original)
    return reduced


def rename(model: pin.Model, names: Mapping[str, str]) -> None:
    """Rename joints and frames of a model in place; names: from present to new ones, others stay."""
    for i, name in enumerate(model.names):
        model.names[i] = names.get(name, name)
    for frame in model.frames:
        frame.name = names.get(frame.name, frame.name)


def _rename_uniquely(model: pin.Model) -> dict[str, str]:
    """Rename joints and frames so that no name occurs twice; return the map from new to original names."""
    own = {f"joint {i}": name for name, i in joint_numbers(model).items()}
    for i, frame in enumerate(model.frames):
        name = f"joint {frame.parentJoint}"
        if frame.type != pin.FrameType.JOINT or own.get(name) != frame.name:
            name = f"frame {i}"
        if i:  # the first is the universe
            own[name], frame.name = str(frame.name), name
    for i in joint_numbers(model).values():
        model.names[i] = f"joint {i}"
    return own


def _check(model: pin.Model, source: str) -> None:
    """Refuse numbers that no arm has."""
    if not np.all(np.abs(model.gravity.vector) <= LARGEST):
        raise UrdfError(source, f"gravity is {model.gravity.linear} m/s²")
    for name, i in joint_numbers(model).items():
        where, inertia = f"joint {clipped(name)!r}", model.inertias[i]
        numbers = np.concatenate([inertia.toDynamicParameters(), model.jointPlacements[i].homogeneous.ravel()])
        if not np.all(np.abs(numbers) <= LARGEST):
            raise UrdfError(source, f"its body or its placement is not finite, or beyond {LARGEST:g}", where)
        if inertia.mass < 0:
            raise UrdfError(source, f"carries {inertia.mass} kg; it must not be negative", where)
        if fault := inertia_fault(np.array(inertia.inertia)):
            raise UrdfError(source, f"its body's {fault}", where)
        if not 0 <= model.armature[i - 1] <= LARGEST:
            raise UrdfError(source, f"armature is {model.armature[i - 1]} kg m² or kg", where)
        j = model.joints[i].idx_q
        lower, upper = model.lowerPositionLimit[j], model.upperPositionLimit[j]
        if model.joints[i].nq == 1 and not lower <= upper:
            raise UrdfError(source, f"lower limit {lower} is above upper limit {upper}", where)


def _frames_to_base(model: pin.Model, frame: pin.Frame) -> Iterator[pin.Frame]:
    """The frame and those between it and the base."""
    for _ in model.frames:
        yield frame
        if not frame.parentFrame:
            return
        frame = model.frames[frame.parentFrame]


def joint_limits(model: pin.Model) -> JointLimits:
    """The limits that a model gives. Where it has only an upper torque limit, the lower is as large."""
    first = [joint.idx_q for joint in list(model.joints)[1:]]
    lower, upper = model.lowerPositionLimit[first], model.upperPositionLimit[first]
    effort_lower, effort_upper = -_or_infinite(-model.lowerEffortLimit), _or_infinite(model.upperEffortLimit)
    one_sided = np.isinf(effort_lower) | (effort_lower >= effort_upper)
    # A range without width, a velocity limit of zero and torque limits of zero are a URDF's marks of missing limits.
    unset = (effort_upper == 0) & (one_sided | (effort_lower == 0))
    unbounded = np.array([joint.nq == 2 for joint in list(model.joints)[1:]]) | (lower == upper)
    velocity = np.minimum(*(np.abs(_or_infinite(x)) for x in (model.lowerVelocityLimit, model.upperVelocityLimit)))
    return JointLimits(
        position_lower=np.where(unbounded, -np.inf, lower),
        position_upper=np.where(unbounded, np.inf, upper),
        velocity=np.where(velocity == 0, np.inf, velocity),
        effort_lower=np.where(unset, -np.inf, np.where(one_sided, -effort_upper, effort_lower)),
        effort_upper=np.where(unset, np.inf, effort_upper),
    )


def _or_infinite(limit: Array) -> Array:
    """Replace the values by which Pinocchio marks a missing limit by infinity."""
    return np.where(np.asarray(limit) >= np.finfo(float).max, np.inf, limit)
