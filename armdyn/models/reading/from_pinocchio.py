"""From a Pinocchio model that somebody else built or loaded to that of an arm."""

import re
from collections.abc import Mapping

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from armdyn.arguments import shown as told
from armdyn.errors import SpecError, UnsupportedJointError, UrdfError, did_you_mean
from armdyn.models.reading.joints import in_bounds
from armdyn.models.reading.urdf_arm import Reading, call_again, joint_limits
from armdyn.models.reading.urdf_check import LARGEST, inertia_fault
from armdyn.models.reading.urdf_xml import shown
from armdyn.models.values.urdf import TIP

Array = NDArray[np.float64]

_KNOWN = re.compile(r"JointModel(R[XYZ]|RUB[XYZ]|Revolute(Unbounded)?Unaligned|P[XYZ]|PrismaticUnaligned)")
"""Pinocchio's names of joints that turn or slide along one axis."""

_SHARED = (pin.FrameType.BODY, pin.FrameType.OP_FRAME, pin.FrameType.FIXED_JOINT, pin.FrameType.SENSOR)
"""Frames that may be called like a joint."""


def read_model(
    model: pin.Model, source: str, lock: Mapping[str, float] | None = None, arm: tuple[str, str] | None = None
) -> Reading:
    """The arm inside a model; the model itself is left as it is.

    Args:
        model: any of Pinocchio's.
        source: what to call it in messages.
        lock: joints to fix, name to position [rad or m]; a joint of several coordinates at 0, its neutral.
        arm: first and last joint or frame; see `Robot.from_urdf`.

    Raises:
        UnsupportedJointError: a joint that moves neither turns nor slides along one axis.
        UrdfError: the model has numbers that no arm has, or nothing moves.
        SpecError: a lock or the arm does not fit it.
    """
    locked = _locked(model, source, lock or {}, arm)
    for name, joint in _joints(model).items():
        kind = model.joints[joint].shortname()
        if name not in locked and not _KNOWN.fullmatch(kind):
            what = f"is a {kind}; armdyn knows joints that turn or slide along one axis: lock it, or choose an arm"
            raise UnsupportedJointError(source, what, f"joint {shown(name)!r}")
    reduced = _reduced(model.copy(), locked, source)
    if reduced.nv == 0:
        raise UrdfError(source, "has no moving joint")
    _check(reduced, source)
    return Reading(model=reduced, locked=locked, tip=_tip(reduced, arm), limits=joint_limits(reduced))


def _joints(model: pin.Model) -> dict[str, int]:
    """The names of a model's joints to their indices."""
    return {str(name): i for i, name in enumerate(model.names) if i}


def _frame(model: pin.Model, name: str) -> pin.Frame | None:
    """A frame that is no joint, by name."""
    return next((frame for frame in model.frames if frame.name == name and frame.type in _SHARED), None)


def _locked(model: pin.Model, source: str, lock: Mapping[str, float], arm: tuple[str, str] | None) -> dict[str, float]:
    """Where every joint is locked that does not move [rad or m]."""
    joints = _joints(model)
    for name, value in lock.items():
        if name not in joints:
            hint, names = did_you_mean(str(name), joints), ", ".join(map(shown, list(joints)[:20]))
            raise SpecError(f"cannot lock {shown(name)!r}: {source} has joints {names}{hint}")
        if not in_bounds(value) or (model.joints[joints[name]].nv != 1 and value):
            right = "one number [rad or m]; 0 for a joint of several coordinates"
            raise SpecError(f"cannot lock {name!r} at {told(value)}: it must be {right}")
    free = set(joints if arm is None else _chain(model, *arm, source)) - set(lock)
    return {name: float(lock.get(name, _rest(model, i))) for name, i in joints.items() if name not in free}


def _rest(model: pin.Model, joint: int) -> float:
    """Zero, or the bound nearest to it [rad or m]."""
    if model.joints[joint].nq != 1:
        return 0.0
    i = model.joints[joint].idx_q
    return float(np.clip(0.0, model.lowerPositionLimit[i], model.upperPositionLimit[i]))


def _chain(model: pin.Model, first: str, last: str, source: str) -> list[str]:
    """The joints on the way from `first` to `last`; the frame is meant where a joint has its name."""
    joints = _joints(model)
    ends = []
    for name in (first, last):
        frame = _frame(model, name)
        if frame is None and name not in joints:
            known = [*joints, *(other.name for other in model.frames)]
            raise SpecError(f"arm: {source} has no frame or joint {shown(name)!r}{did_you_mean(name, known)}")
        ends.append(joints[name] if frame is None else int(frame.parentJoint))
    base, end = ends
    way = [int(joint) for joint in model.supports[end]]
    if base not in way:
        raise SpecError(f"arm: {shown(last)!r} is not behind {shown(first)!r} in {source}")
    after = way[way.index(base) + (_frame(model, first) is not None) :]
    names = [str(model.names[joint]) for joint in after if joint]
    if not names:
        raise SpecError(f"arm: nothing moves between {shown(first)!r} and {shown(last)!r} of {source}")
    return names


def _reduced(model: pin.Model, locked: Mapping[str, float], source: str) -> pin.Model:
    """The model without its locked joints; it is changed on the way."""
    if not locked:
        return model
    joints = _joints(model)
    at = pin.neutral(model)
    for name, position in locked.items():
        joint = model.joints[joints[name]]
        if joint.nv == 1:
            turned = (np.cos(position), np.sin(position))
            at[joint.idx_q : joint.idx_q + joint.nq] = position if joint.nq == 1 else turned
    for name, i in joints.items():  # pin 4.1 crashes where a joint that is to be locked has no frame
        if not model.existFrame(name, pin.FrameType.JOINT):
            model.addJointFrame(i, -1)
    # pin 4.1 cannot reduce a model in which a joint is called like another frame
    suffix = " (joint)"
    while any(name + suffix in joints or _frame(model, name + suffix) for name in joints):
        suffix += "'"
    called = {name: name + suffix for name in joints if _frame(model, name)}
    for name, other in called.items():
        model.names[joints[name]] = other
    for frame in model.frames:
        if frame.type == pin.FrameType.JOINT:
            frame.name = called.get(frame.name, frame.name)
    try:
        reduced = pin.buildReducedModel(model, [joints[name] for name in locked], at)
    except (RuntimeError, ValueError) as error:
        raise UrdfError(source, f"Pinocchio cannot lock {', '.join(locked)} ({shown(error)})") from None
    call_again(reduced, called)
    return reduced


def _check(model: pin.Model, source: str) -> None:
    """Refuse numbers that no arm has."""
    if not np.all(np.abs(model.gravity.vector) <= LARGEST):
        raise UrdfError(source, f"gravity is {model.gravity.linear} m/s²")
    for name, i in _joints(model).items():
        where, inertia = f"joint {shown(name)!r}", model.inertias[i]
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


def _tip(model: pin.Model, arm: tuple[str, str] | None) -> str:
    """The frame at the end of the arm, furthest from the base; one more is made where the last joint has none."""
    if arm is not None and _frame(model, arm[1]) is not None:
        return arm[1]
    if arm is None and _frame(model, TIP) is not None:
        return TIP
    joints = _joints(model)
    last = joints[arm[1]] if arm is not None else max(joints.values(), key=lambda i: len(model.supports[i]))
    for kind in (pin.FrameType.BODY, pin.FrameType.OP_FRAME, pin.FrameType.JOINT):
        there = [frame for frame in model.frames if frame.parentJoint == last and frame.type == kind]
        if there:
            return str(max(there, key=lambda frame: _depth(model, frame)).name)
    name = TIP
    while _frame(model, name) is not None or name in joints:
        name += "'"
    model.addFrame(pin.Frame(name, last, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return name


def _depth(model: pin.Model, frame: pin.Frame) -> int:
    """Frames between the base and this one."""
    depth = 0
    while frame.parentFrame and depth < len(model.frames):
        frame, depth = model.frames[frame.parentFrame], depth + 1
    return depth
