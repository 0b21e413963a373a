"""From an MJCF to Pinocchio's model of an arm, by Pinocchio's own parser."""

import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from armdyn.errors import ArmdynWarning, UrdfError
from armdyn.models.mjcf.bare import Bare, check_moving
from armdyn.models.mjcf.classes import ACTUATORS, Classes, Values
from armdyn.models.mjcf.compiler import Compiler, gravity
from armdyn.models.reading.from_pinocchio import Reading, read_model, rename
from armdyn.models.reading.urdf_xml import clipped


def read_mjcf_arm(root: Element, source: str, lock: Mapping[str, float], arm: tuple[str, str] | None) -> Reading:
    """Pinocchio's model of the arm that an MJCF describes; torque limits are the actuators', velocity limits infinite.

    Args:
        root: of `parse_mjcf`.
        source: name of the file or text, in messages.
        lock: joints to fix, name to position [rad or m].
        arm: first and last joint, body or site; see `Robot.from_urdf`.

    Raises:
        UrdfError: the MJCF is not physical, or uses elements that armdyn does not support.
        UnsupportedJointError: a joint that moves is of no known kind, has a spring, or is coupled.
        SpecError: a lock or the arm does not fit it.
    """
    classes, compiler = Classes.of(root, source), Compiler.of(root, source)
    bare = Bare(classes, compiler, None if arm is not None else frozenset(lock))
    model = _parsed(bare.text(root), source)
    model.name = root.get("model") or "MuJoCo Model"
    rename(model, _own_names(bare.called))
    model.gravity.linear = gravity(root, source)
    limits = effort_limits(root, classes, bare.joints, compiler.automatic)
    reading = read_model(model, source, {joint: at for joint, at in lock.items() if joint not in bare.free}, arm)
    moving = list(reading.model.names)[1:]
    check_moving(bare.joints, moving, root, source)
    _refuse_loops(reading.model, root, source)
    if any(body.get("gravcomp", "0") not in ("0", "0.0") for body in root.iter("body")):
        what = "gravcomp is left out: gravity acts in full, and the motors hold it"
        warnings.warn(f"{source}: {what}", ArmdynWarning, stacklevel=4)
    lower, upper = np.array([limits[name] for name in moving]).T
    return replace(reading, limits=replace(reading.limits, effort_lower=lower, effort_upper=upper))


def read_keyframes(root: Element, source: str, most: int) -> dict[str, dict[str, float]]:
    """The poses that an MJCF's `<keyframe>` names: to each joint that turns or slides its position [rad or m].

    A key without a name, or whose qpos has not a finite number for each joint, is passed over.

    Args:
        root: of `parse_mjcf`; the MJCF has been read as an arm.
        source: name of the file or text, in messages.
        most: largest number of keys that are read.

    Raises:
        UrdfError: the MJCF is not supported.
    """
    bare = Bare(Classes.of(root, source), Compiler.of(root, source), None)
    bare.text(root)
    at, poses = np.cumsum([0, *bare.widths.values()]), {}
    for key in islice(root.iterfind("keyframe/key"), most):
        try:
            qpos = Values(key.attrib, source, "<key>").numbers("qpos", int(at[-1]))
        except UrdfError:  # poses are optional
            continue
        if qpos and (name := key.get("name")):
            poses[name] = {
                joint: qpos[i] for i, (joint, width) in zip(at, bare.widths.items(), strict=False) if width == 1
            }
    return poses


def _parsed(text: str, source: str) -> pin.Model:
    """Pinocchio's reading of a checked MJCF; its parser takes files only."""
    if not hasattr(pin, "buildModelFromMJCF"):
        raise UrdfError(source, f"is MJCF, which this pinocchio {pin.__version__} was built without; give a URDF")
    with tempfile.TemporaryDirectory(prefix="armdyn-mjcf-") as folder:
        file = Path(folder, "arm.xml")
        file.write_text(text, encoding="utf-8")
        try:
            return pin.buildModelFromMJCF(str(file))
        except Exception as error:  # any C++ exception
            raise UrdfError(source, f"Pinocchio cannot read it ({clipped(str(error).strip())})") from None


def _own_names(called: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Names in the MJCF, by those that joints and frames were written with."""
    own = {written: name for names in called.values() for name, written in names.items()}
    return own | {f"{written}_fixed": f"{name}_fixed" for name, written in called["body"].items()}


def _refuse_loops(model: pin.Model, root: Element, source: str) -> None:
    """Refuse an `<equality>` that ties one moving body to another, or to the world."""
    carriers = {str(frame.name): int(frame.parentJoint) for frame in model.frames}
    for tie in (*root.findall("equality/connect"), *root.findall("equality/weld")):
        ends = [tie.get(f"{kind}{i}") for kind in ("body", "site") for i in (1, 2)]
        tied = {carriers.get(end, 0) for end in ends if end}
        if len([end for end in ends if end]) == 1:
            tied.add(0)
        if tie.get("active") != "false" and len(tied) > 1:
            names = ", ".join(clipped(end) for end in ends if end)
            raise UrdfError(source, f"<equality> ties {names} together; armdyn supports no closed loops: lock joints")


Range = tuple[float, float]

_UNLIMITED: Range = (-np.inf, np.inf)


def effort_limits(root: Element, classes: Classes, joints: Mapping[str, Values], automatic: bool) -> dict[str, Range]:
    """Lower and upper torque limit of every joint [N m or N]; infinite where no actuator limits it.

    The torque of an actuator is its gear times its force; force is within `forcerange`, and of a motor, which passes
    its control on, within gain times `ctrlrange`. Torques of several actuators of one joint add up, and the joint's own
    `actuatorfrcrange` bounds the sum.

    Args:
        root: of the whole MJCF.
        classes: its default classes.
        joints: name to attributes.
        automatic: see `Compiler`.

    Raises:
        UrdfError: an attribute is no number.
    """
    sums: dict[str, Range] = {}
    for element in root.iterfind("actuator/*"):
        if element.tag not in ACTUATORS:
            continue
        called = f"actuator {clipped(element.get('name', element.tag))!r}"
        values = Values(classes.attributes(element), classes.source, called)
        joint = values.given.get("joint") or values.given.get("jointinparent", "")
        if joint not in joints:
            continue  # a tendon's, a site's, or of a joint that is not written
        gear = (values.numbers("gear", 1, 6) or [1.0])[0]
        ends = [gear * end if gear else 0.0 for end in _force(element.tag, values, automatic)]
        lower, upper = sums.get(joint, (0.0, 0.0))
        sums[joint] = lower + min(ends), upper + max(ends)
    limits = {}
    for name, values in joints.items():
        own = values.bounds("actuatorfrcrange", "actuatorfrclimited", automatic)
        limits[name] = _both(sums.get(name, _UNLIMITED), own or _UNLIMITED)
    return limits


def _force(kind: str, values: Values, automatic: bool) -> Range:
    """Least and largest force of an actuator, before its gear."""
    force = values.bounds("forcerange", "forcelimited", automatic) or _UNLIMITED
    given = values.given
    plain = kind == "motor" or (
        kind == "general"
        and given.get("gaintype", "fixed") == "fixed"
        and given.get("biastype", "none") == "none"
        and given.get("dyntype", "none") in ("none", "filter", "filterexact")
    )
    control = values.bounds("ctrlrange", "ctrllimited", automatic) if plain else None
    if control is None:
        return force
    gain = (values.numbers("gainprm", 1, 10) or [1.0])[0] if kind == "general" else 1.0
    ends = [gain * end for end in control]
    return _both(force, (min(ends), max(ends)))


def _both(one: Range, other: Range) -> Range:
    return max(one[0], other[0]), min(one[1], other[1])
