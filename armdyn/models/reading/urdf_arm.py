"""From a URDF's text to Pinocchio's model of an arm."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from armdyn.errors import UrdfError
from armdyn.models.reading.joints import JointPlace, JointTree
from armdyn.models.reading.urdf_check import check_inertias, dynamics_urdf, parse_urdf
from armdyn.models.reading.urdf_xml import shown
from armdyn.models.values.joint_limits import JointLimits
from armdyn.models.values.urdf import TIP

Array = NDArray[np.float64]

_SINGULAR = 1e-10
"""Scaled mass matrices with a smaller eigenvalue are singular."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """What a URDF and the choice of its joints give.

    Attributes:
        model: of the moving joints only.
        locked: joint name to the position it is locked at [rad or m].
        tip: the frame at the end of the arm.
        limits: of the moving joints.
    """

    model: pin.Model
    locked: Mapping[str, float]
    tip: str
    limits: JointLimits


def read_arm(
    text: str, source: str, lock: Mapping[str, float] | None = None, arm: tuple[str, str] | None = None
) -> Reading:
    """Pinocchio's model of the arm that a URDF describes.

    Args:
        text: the URDF.
        source: what to call it in messages.
        lock: joints to fix, name to position [rad or m].
        arm: first and last joint or link; see `Robot.from_urdf`.

    Raises:
        UrdfError: the URDF is not physical.
        UnsupportedJointError: a joint that moves is of no known kind, or mimics another that moves.
        SpecError: a lock or the arm does not fit it.
    """
    root = parse_urdf(text, source)
    tree = JointTree.of(root, source)
    locked = tree.locked(lock or {}, arm)
    places = tree.places(locked)
    check_inertias(root, source, {link for link, place in places.items() if place.free})
    called = _told_apart(tree)
    try:
        whole = pin.buildModelFromXML(dynamics_urdf(root, called))
    except (RuntimeError, ValueError) as error:
        raise UrdfError(source, f"Pinocchio cannot read it ({shown(str(error).strip())})") from None
    model = whole
    if locked:
        positions = {called.get(name, name): position for name, position in locked.items()}
        at = configuration(whole, [positions.get(name, 0.0) for name in list(whole.names)[1:]])
        model = pin.buildReducedModel(whole, [whole.getJointId(name) for name in positions], at)
    call_again(model, called)
    if model.nv == 0:
        raise UrdfError(source, "has no moving joint")
    if arm is None:
        tip = TIP if model.existFrame(TIP) else _furthest(model, places)
    elif arm[1] in tree.links:
        tip = arm[1]
    else:
        carrier = places[tree.joints[arm[1]].child].carrier
        tip = _furthest(model, {link: place for link, place in places.items() if place.carrier == carrier})
    return Reading(model=model, locked=locked, tip=tip, limits=joint_limits(model))


def _told_apart(tree: JointTree) -> dict[str, str]:
    """Other names for joints that are called like a link: pin 4.1 cannot reduce a model in which some are."""
    alike, suffix = tree.links & tree.joints.keys(), " (joint)"
    while any(name + suffix in tree.links | tree.joints.keys() for name in alike):
        suffix += "'"
    return {name: name + suffix for name in alike}


def call_again(model: pin.Model, called: Mapping[str, str]) -> None:
    """Give a model's joints and frames the names back that they had.

    Args:
        model: changed in place.
        called: the name that a joint had to the one it has.
    """
    own = {other: name for name, other in called.items()}
    for i, name in enumerate(model.names):
        if name in own:
            model.names[i] = own[name]
    for frame in model.frames:
        if frame.name in own:
            frame.name = own[frame.name]


def joint_limits(model: pin.Model) -> JointLimits:
    """The limits that a model gives. Where it has only an upper torque limit, the lower is as large."""
    first = [joint.idx_q for joint in list(model.joints)[1:]]
    lower, upper = model.lowerPositionLimit[first], model.upperPositionLimit[first]
    effort_lower, effort_upper = -_or_infinite(-model.lowerEffortLimit), _or_infinite(model.upperEffortLimit)
    one_sided = np.isinf(effort_lower) | (effort_lower >= effort_upper)
    # A range without width, a velocity limit of zero and torque limits of zero are a URDF's way to say nothing.
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


def configuration(model: pin.Model, q: ArrayLike) -> Array:
    """Pinocchio's configuration of joint coordinates: (cos, sin) for a continuous joint."""
    q = np.asarray(q, dtype=float)
    if model.nq == model.nv:
        return q
    full = np.empty(model.nq)
    for joint, angle in zip(list(model.joints)[1:], q, strict=True):
        full[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
    return full


def check_inertia(model: pin.Model, source: str) -> None:
    """Every joint must move some mass of its own, or a torque gives no finite acceleration.

    Looked at in one pose, bent so that no axes are in line that need not be.

    Raises:
        UrdfError: some joint moves nothing, or two joints move the same body in the same way.
    """
    bent = configuration(model, 0.3 * np.sin(np.arange(1.0, model.nv + 1)))
    inertia = pin.crba(model, model.createData(), bent)
    inertia = np.triu(inertia) + np.triu(inertia, 1).T
    own = np.diag(inertia)
    for name, one in zip(list(model.names)[1:], own, strict=True):
        if not one > 0:
            raise UrdfError(source, f"moves no inertia ({one} kg m²); give its link a mass", f"joint {shown(name)!r}")
    # One per joint on the diagonal; a serial arm of 1 kg links comes down to some 1e-4 (planar RRR: 2e-3).
    scaled = inertia / np.sqrt(np.outer(own, own))
    values, vectors = np.linalg.eigh(scaled)
    if values[0] < _SINGULAR:
        name = list(model.names)[1:][int(np.argmax(np.abs(vectors[:, 0])))]
        what = f"moves no inertia of its own (the mass matrix is singular to {values[0]:.1e}); give every link a mass"
        raise UrdfError(source, what, f"joint {shown(name)!r}")


def _or_infinite(limit: Array) -> Array:
    """Pinocchio writes a missing limit as the largest double or as infinity."""
    return np.where(np.asarray(limit) >= np.finfo(float).max, np.inf, limit)


def _furthest(model: pin.Model, places: Mapping[str, JointPlace]) -> str:
    """The frame at the end of the arm: the link furthest from the base, in moving joints and then in all.

    Among equals the one behind the fewest locked joints: a hand rather than its fingers.

    Args:
        model: the arm.
        places: of the links that may be it.
    """

    def rank(link: str) -> tuple[int, int, int]:
        return places[link].free, places[link].joints, -places[link].locked

    links = [str(frame.name) for frame in model.frames if frame.type == pin.FrameType.BODY]
    return max((link for link in links if link in places), key=rank)
