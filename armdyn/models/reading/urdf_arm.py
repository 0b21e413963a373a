"""From a URDF's text to Pinocchio's model of an arm."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from armdyn.arrays import Array
from armdyn.errors import UrdfError
from armdyn.models.reading.dynamics_check import check_dynamics
from armdyn.models.reading.faults import Faults, repair_call
from armdyn.models.reading.from_pinocchio import Mimic, Reading, arm_of, default_locks, locked_joints
from armdyn.models.reading.nearest_inertia import MARK
from armdyn.models.reading.urdf_check import MOVING, dynamics_urdf, parse_urdf
from armdyn.models.reading.urdf_xml import clipped, finite_numbers
from armdyn.parsing.numbers import FREE

_SINGULAR = 1e-10
"""Scaled mass matrices with a smaller eigenvalue are singular."""

_NAMED = 10
"""Largest number of links that a message names."""


def read_arm(text: str, source: str, lock: Mapping[str, float | str], arm: tuple[str, str] | None) -> Reading:
    """Pinocchio's model of the arm that a URDF describes.

    Args:
        text: the URDF.
        source: name of the file or text, in messages.
        lock: joints to fix, name to position [rad or m].
        arm: first and last joint or link; see `Robot.from_urdf`.

    Raises:
        UrdfError: the URDF is not physical.
        UnsupportedJointError: a joint that moves is of no known kind, or mimics another that moves.
        SpecError: a lock or the arm does not fit it.
    """
    still = frozenset(name for name, value in lock.items() if value != FREE)
    root, mimics, model = whole_robot(text, source, still)
    faults = Faults(source)
    locked = faults.of(locked_joints, model, source, lock, arm, mimics) or {}
    check_dynamics(root, source, still | locked.keys(), faults)
    marks = [mark.get("repaired", "") for mark in root.findall(MARK)]
    reading = arm_of(model, source, locked, arm)
    gripper = default_locks(model, lock, arm, mimics)
    return replace(reading, urdf=text, gripper=gripper, repaired=", ".join(filter(None, marks)))


@lru_cache(maxsize=16)
def whole_robot(
    text: str, source: str, locked: frozenset[str] = frozenset()
) -> tuple[Element, dict[str, Mimic], pin.Model]:
    """The URDF, the joints that follow others, and Pinocchio's model of the whole robot; all read-only.

    A robot is read again for every payload.

    Args:
        text: the URDF.
        source: name of the file or text, in messages.
        locked: names of joints that do not move.
    """
    faults = Faults(source)
    root = parse_urdf(text, source, faults)
    mimics = faults.of(_mimics, root, source) or {}
    if faults:
        check_dynamics(root, source, locked, faults)
    try:
        return root, mimics, pin.buildModelFromXML(dynamics_urdf(root))
    except (RuntimeError, ValueError) as error:
        raise UrdfError(source, f"Pinocchio cannot read it ({clipped(str(error).strip())})") from None


def _mimics(root: Element, source: str) -> dict[str, Mimic]:
    """Joints that follow others.

    Raises:
        UrdfError: a `<mimic>` has no leader, or malformed numbers.
    """
    joints = {str(joint.get("name")): joint for joint in root.findall("joint")}
    mimics: dict[str, Mimic] = {}
    for name, joint in joints.items():
        if (mimic := joint.find("mimic")) is None or joint.get("type") not in MOVING:
            continue
        where = f"joint {clipped(name)!r}"
        numbers = [
            finite_numbers(mimic.get(key, default), f"<mimic> {key}", source, where, largest=np.inf)[0]
            for key, default in (("multiplier", "1"), ("offset", "0"))
        ]
        mimics[name] = Mimic(mimic.get("joint", ""), *numbers)
        if mimics[name].leader not in joints:
            what = f"mimics {clipped(mimics[name].leader)!r}, which is no joint"
            raise UrdfError(source, what, where)
    return mimics


def configuration(model: pin.Model, q: ArrayLike) -> Array:
    """Pinocchio's configuration of joint coordinates: (cos, sin) for a continuous joint."""
    return configurations(model)(np.asarray(q, dtype=float))


def configurations(model: pin.Model) -> Callable[[Array], Array]:
    """Function from joint coordinates q, shape (nv,), to Pinocchio's configuration, for inner loops."""
    return (lambda q: q) if model.nq == model.nv else partial(pin.integrate, model, pin.neutral(model))


def check_inertia(model: pin.Model, source: str) -> None:
    """Refuse a joint that moves no inertia of its own: a torque would give no finite acceleration.

    Checked in one pose, bent so that axes are in line only by construction.

    Raises:
        UrdfError: some joint moves nothing, or two joints move the same body in the same way.
    """
    bent = configuration(model, 0.3 * np.sin(np.arange(1.0, model.nv + 1)))
    inertia = pin.crba(model, model.createData(), bent)
    inertia = np.triu(inertia) + np.triu(inertia, 1).T
    own, what = np.diag(inertia), "moves no inertia"
    joint = int(np.argmin(own > 0))
    if np.all(own > 0):
        # One per joint on the diagonal; a serial arm of 1 kg links comes down to some 1e-4 (planar RRR: 2e-3).
        values, vectors = np.linalg.eigh(inertia / np.sqrt(np.outer(own, own)))
        if values[0] >= _SINGULAR:
            return
        joint = int(np.argmax(np.abs(vectors[:, 0])))
        what = f"moves no inertia of its own (the mass matrix is singular to {values[0]:.1e})"
    links = ", ".join(clipped(name) for name in massless_links(model)[:_NAMED])
    what += f"; links without mass: {links}" if links else ""
    remedy = (
        "Torques are unknown without it: write it into the file, give `inertias` or `armature`, or estimate it from "
        f"shapes ({repair_call(source, ', density=2700')}) and measure it (armdyn identify). Replay, compare, check "
        "and MinimumTimeProblem(…, kinematic=True) need no torques"
    )
    raise UrdfError(source, f"{what}. {remedy}", f"joint {clipped(model.names[1 + joint])!r}")


def massless_links(model: pin.Model) -> tuple[str, ...]:
    """Names of the links without mass that joints move, those fixed to them included; one per joint."""
    return tuple(link_of(model, i) for i in range(1, model.njoints) if model.inertias[i].mass == 0)


def link_of(model: pin.Model, joint: int) -> str:
    """The link that a joint moves, the first of those fixed to each other; of none the joint's name."""
    links = (one.name for one in model.frames if one.parentJoint == joint and one.type == pin.FrameType.BODY)
    return str(next(links, model.names[joint]))
