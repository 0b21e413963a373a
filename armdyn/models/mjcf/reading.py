"""From an untrusted MJCF file, with its includes, to Pinocchio's model of an arm, by Pinocchio's own parser."""

import os
import re
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from armdyn.errors import ArmdynWarning, FileError, UrdfError
from armdyn.files import place_inside, read_bounded
from armdyn.models.mjcf.attributes import ACTUATORS, Classes, Compiler, Values, gravity
from armdyn.models.mjcf.bare import Bare, check_moving
from armdyn.models.reading.from_pinocchio import Reading, read_model, rename
from armdyn.models.reading.urdf_xml import MAX_BYTES, MAX_DEPTH, MAX_ELEMENTS, clipped, parse_xml, read_urdf

MAX_FILES = 100
"""An MJCF that includes more files is refused; the largest known includes some ten."""

_PASSED_OVER = ((b"<!--", b"-->"), (b"<?", b"?>"))
_ROOT = re.compile(rb"<mujoco[\s/>]")


def is_mjcf(path: str | os.PathLike[str]) -> bool:
    """Whether a file's root element is `<mujoco>`; False for a file that cannot be read."""
    try:
        data = read_bounded(path, MAX_BYTES)
    except FileError:
        return False
    at = data.find(b"<")
    while ends := [end for begin, end in _PASSED_OVER if data.startswith(begin, at)]:
        after = data.find(ends[0], at)
        at = -1 if after < 0 else data.find(b"<", after)
    return at >= 0 and _ROOT.match(data, at) is not None


def read_mjcf(file: Path) -> Element:
    """The tree of an MJCF file, each `<include>` replaced by its file.

    Raises:
        UrdfError: see `parse_mjcf`, or the file cannot be read.
    """
    return parse_mjcf(read_urdf(file), str(file), file.parent)


def parse_mjcf(text: str, source: str, folder: Path | None = None) -> Element:
    """The tree of an MJCF's text: no DTD, no entity, bounded size, includes from inside one folder only.

    Args:
        text: the MJCF.
        source: name of the file or text, in messages.
        folder: where its includes are; None: it may have none.

    Raises:
        UrdfError: not XML, no MJCF, or an include is missing, outside the folder or met twice.
    """
    root = parse_xml(text, source)
    if root.tag != "mujoco":
        hint = ": this is a URDF; use Robot.from_urdf" if root.tag == "robot" else ": this is XML but no MJCF"
        raise UrdfError(source, f"the root element is <{clipped(root.tag)}>, not <mujoco>{hint}")
    _Includes(source, folder).replace(root)
    return root


@dataclass
class _Includes:
    """Included files, each once as in MuJoCo, within bounds of number and size."""

    source: str
    folder: Path | None
    seen: set[Path] = field(default_factory=set)
    elements: int = MAX_ELEMENTS
    characters: int = MAX_BYTES

    def replace(self, element: Element, depth: int = 1) -> None:
        """Put the content of included files in the place of their `<include>`, in an element and all below it."""
        if depth > MAX_DEPTH:
            raise UrdfError(self.source, f"XML nested deeper than {MAX_DEPTH} elements")
        children = list(element)[::-1]
        element[:] = []
        while children:
            child = children.pop()
            if child.tag == "include":
                children += list(self._included(child))[::-1]
            else:
                element.append(child)
                self.replace(child, depth + 1)

    def _included(self, include: Element) -> Element:
        name = str(include.get("file", ""))
        where = f"include {clipped(name)!r}"
        if self.folder is None:
            raise UrdfError(self.source, "a text has no folder that it could include files from", where)
        try:
            file = place_inside(self.folder, name)
        except FileError as error:
            raise UrdfError(self.source, error.why, where) from None
        if file in self.seen:
            raise UrdfError(self.source, "is included twice", where)
        self.seen.add(file)
        if len(self.seen) > MAX_FILES:
            raise UrdfError(self.source, f"includes more than {MAX_FILES} files")
        try:
            text = read_urdf(file)
        except UrdfError as error:
            raise UrdfError(self.source, str(error), where) from None
        included = parse_xml(text, str(file))
        self.characters -= len(text)
        self.elements -= sum(1 for _ in included.iter())
        if self.characters < 0 or self.elements < 0:
            raise UrdfError(self.source, f"more than {MAX_BYTES} bytes or {MAX_ELEMENTS} elements, includes counted")
        return included


def read_mjcf_arm(root: Element, source: str, lock: Mapping[str, float | str], arm: tuple[str, str] | None) -> Reading:
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
    rename(model, _original_names(bare.new_names))
    model.gravity.linear = gravity(root, source)
    limits = effort_limits(root, classes, bare.joints, compiler.automatic)
    reading = read_model(model, source, {joint: at for joint, at in lock.items() if joint not in bare.free}, arm, {})
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
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", prefix="armdyn-mjcf-", suffix=".xml") as file:
        file.write(text)
        file.flush()
        try:
            return pin.buildModelFromMJCF(file.name)
        except Exception as error:  # any C++ exception
            raise UrdfError(source, f"Pinocchio cannot read it ({clipped(str(error).strip())})") from None


def _original_names(new_names: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Map from the names that Pinocchio has read to those in the MJCF: the inverse of `Bare.new_names`."""
    original = {written: name for names in new_names.values() for name, written in names.items()}
    return original | {f"{written}_fixed": f"{name}_fixed" for name, written in new_names["body"].items()}


def _refuse_loops(model: pin.Model, root: Element, source: str) -> None:
    """Refuse an `<equality>` that ties one moving body to another, or to the world."""
    carriers = {str(frame.name): int(frame.parentJoint) for frame in model.frames}
    for tie in (*root.findall("equality/connect"), *root.findall("equality/weld")):
        ends = [end for kind in ("body", "site") for i in (1, 2) if (end := tie.get(f"{kind}{i}"))]
        tied = {carriers.get(end, 0) for end in ends} | ({0} if len(ends) == 1 else set())
        if tie.get("active") != "false" and len(tied) > 1:
            names = ", ".join(map(clipped, ends))
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
    own = {name: one.bounds("actuatorfrcrange", "actuatorfrclimited", automatic) for name, one in joints.items()}
    return {name: _both(sums.get(name, _UNLIMITED), ends or _UNLIMITED) for name, ends in own.items()}


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
