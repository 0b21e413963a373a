"""A robot arm: Pinocchio's model and the limits of its joints."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from armdyn.errors import SpecError, UnsupportedJointError, UrdfError
from armdyn.models.library import LIBRARY_LOCKS, library_urdf
from armdyn.models.limits import JointLimits
from armdyn.models.spec import ArmSpec, Payload
from armdyn.models.urdf import POINT_INERTIA, TIP, urdf_from_spec
from armdyn.models.urdf_check import parse_urdf, read_urdf

Array = NDArray[np.float64]

_OTHER_FRAMES = (pin.FrameType.OP_FRAME, pin.FrameType.FIXED_JOINT, pin.FrameType.JOINT, pin.FrameType.SENSOR)


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot:
    """An arm of revolute, continuous and prismatic joints.

    All of armdyn speaks of *joint coordinates*: one number per joint, an angle [rad] or a
    displacement [m], also for continuous joints, which Pinocchio stores as cosine and sine.
    `configuration` leads from one to the other.

    Attributes:
        name: from the URDF.
        model: Pinocchio's model; locked joints are gone from it, the payload is in it.
        limits: of every joint. A URDF's range without width, or velocity limit of zero, counts as none
            given; a torque limit of zero stays, and minimum time then asks for `effort_limit`.
        joint_names: the moving joints, in the order of every vector.
        urdf: the text it was read from.
        source: the file it came from, or what made it.
        package_dirs: folders in which `package://` is looked up.
        locked: joint name to the position it is locked at [rad or m].
        payload: what it carries, None if nothing was added.
        tip: the frame at the end of the arm.
    """

    name: str
    model: pin.Model
    limits: JointLimits
    joint_names: tuple[str, ...]
    urdf: str = field(repr=False)
    source: str
    package_dirs: tuple[str, ...] = ()
    locked: Mapping[str, float] = field(default_factory=dict)
    payload: Payload | None = None
    tip: str = TIP

    @property
    def nv(self) -> int:
        """Number of joints."""
        return int(self.model.nv)

    @classmethod
    def from_spec(cls, spec: ArmSpec, payload: Payload | None = None) -> Self:
        """A generated planar arm, its payload a link of its own at the tip."""
        if payload is not None and payload.frame not in (None, TIP):
            raise SpecError(f"a generated arm carries its payload at {TIP!r}, not {payload.frame!r}")
        robot = cls._from_text(urdf_from_spec(spec, payload), source=f"ArmSpec {spec.name!r}")
        return replace(robot, payload=payload)

    @classmethod
    def from_urdf(
        cls,
        path: str | os.PathLike[str],
        payload: Payload | None = None,
        lock: Mapping[str, float] | None = None,
        effort_limit: ArrayLike | None = None,
        velocity_limit: ArrayLike | None = None,
        armature: ArrayLike | None = None,
        package_dirs: Sequence[str | os.PathLike[str]] = (),
    ) -> Self:
        """An arm from a URDF file.

        Args:
            path: the file.
            payload: fixed to `payload.frame`, by default the end of the longest chain.
            lock: joints to fix, name to position [rad or m].
            effort_limit: instead of the URDF's: one number, or one per joint [N m or N].
            velocity_limit: instead of the URDF's: one number, or one per joint [rad/s or m/s].
            armature: reflected rotor inertia: one number, or one per joint [kg m² or kg].
            package_dirs: where `package://` meshes are; only looked at to draw.

        Raises:
            UrdfError: the file cannot be read or is not physical.
            SpecError: a limit, a lock or the payload does not fit the robot.
        """
        path = Path(path)
        text = read_urdf(path)
        folders = (*map(str, package_dirs), str(path.parent))
        robot = cls._from_text(text, source=str(path), lock=lock, package_dirs=folders)
        return robot._with_inertia(payload, armature).with_limits(effort_limit, velocity_limit)

    @classmethod
    def from_library(
        cls,
        name: str,
        payload: Payload | None = None,
        lock: Mapping[str, float] | None = None,
        effort_limit: ArrayLike | None = None,
        velocity_limit: ArrayLike | None = None,
        armature: ArrayLike | None = None,
    ) -> Self:
        """An arm of example-robot-data, such as "panda", "ur5", "talos_arm", "z1".

        Args:
            name: the library's name for it.
            payload: see `from_urdf`.
            lock: see `from_urdf`; None locks what `LIBRARY_LOCKS` names (a hand's fingers).
            effort_limit: see `from_urdf`.
            velocity_limit: see `from_urdf`.
            armature: see `from_urdf`.

        Raises:
            UnknownRobotError: the library has no such robot.
            UrdfError: its URDF is no fixed-base arm.
        """
        path, shared = library_urdf(name)
        if lock is None:
            lock = LIBRARY_LOCKS.get(name, {})
        return cls.from_urdf(path, payload, lock, effort_limit, velocity_limit, armature, (shared,))

    @classmethod
    def _from_text(
        cls,
        text: str,
        source: str,
        lock: Mapping[str, float] | None = None,
        package_dirs: tuple[str, ...] = (),
    ) -> Self:
        parse_urdf(text, source)
        try:
            model = pin.buildModelFromXML(text)
        except (RuntimeError, ValueError) as error:
            raise UrdfError(source, f"Pinocchio cannot read it ({str(error).strip()})") from None
        lock = dict(lock or {})
        for name, value in lock.items():
            if name not in list(model.names)[1:]:
                raise SpecError(f"cannot lock {name!r}: {source} has joints {', '.join(list(model.names)[1:])}")
            if not np.isfinite(value):
                raise SpecError(f"cannot lock {name!r} at {value}")
        whole = model
        if lock:
            at = configuration(model, [lock.get(name, 0.0) for name in list(model.names)[1:]])
            model = pin.buildReducedModel(model, [model.getJointId(name) for name in lock], at)
        if model.nv == 0:
            raise UrdfError(source, "has no moving joint")
        for joint, name in zip(list(model.joints)[1:], list(model.names)[1:], strict=True):
            if joint.nv != 1 or "Mimic" in joint.shortname() or "Helical" in joint.shortname():
                raise UnsupportedJointError(source, f"{joint.shortname()} is not supported", f"joint {name!r}")
        _check_inertia(model, source)
        first = [joint.idx_q for joint in list(model.joints)[1:]]
        lower, upper = model.lowerPositionLimit[first], model.upperPositionLimit[first]
        # A range without width and a velocity limit of zero are a URDF's way to say nothing.
        unbounded = np.array([joint.nq == 2 for joint in list(model.joints)[1:]]) | (lower == upper)
        velocity = _or_infinite(model.upperVelocityLimit)
        limits = JointLimits(
            position_lower=np.where(unbounded, -np.inf, lower),
            position_upper=np.where(unbounded, np.inf, upper),
            velocity=np.where(velocity == 0, np.inf, velocity),
            effort_lower=-_or_infinite(model.upperEffortLimit),
            effort_upper=_or_infinite(model.upperEffortLimit),
        )
        return cls(
            name=str(model.name),
            model=model,
            limits=limits,
            joint_names=tuple(list(model.names)[1:]),
            urdf=text,
            source=source,
            package_dirs=package_dirs,
            locked=lock,
            tip=_tip(model, whole),
        )

    def with_limits(self, effort_limit: ArrayLike | None, velocity_limit: ArrayLike | None) -> Self:
        """This robot with other limits: one number, or one per joint; None keeps its own.

        Raises:
            SpecError: wrong length, NaN, or negative.
        """
        limits = self.limits
        if effort_limit is not None:
            effort = self.per_joint(effort_limit, "effort_limit")
            limits = replace(limits, effort_lower=-effort, effort_upper=effort)
        if velocity_limit is not None:
            limits = replace(limits, velocity=self.per_joint(velocity_limit, "velocity_limit"))
        return replace(self, limits=limits)

    def _with_inertia(self, payload: Payload | None, armature: ArrayLike | None) -> Self:
        """This robot carrying something; the model is copied before it is changed."""
        model = self.model.copy()
        if armature is not None:
            model.armature = self.per_joint(armature, "armature")
            if not np.all(np.isfinite(model.armature)):
                raise SpecError(f"armature is {armature}; it must be finite")
        if payload is not None and payload.mass > 0:
            frame_name = payload.frame or self.tip
            frame = self.frame(frame_name)
            if frame.parentJoint == 0:
                raise SpecError(f"frame {frame_name!r} of {self.source} does not move: no payload can be there")
            model.appendBodyToJoint(frame.parentJoint, payload_inertia(payload), frame.placement)
        return replace(self, model=model, payload=payload)

    def per_joint(self, value: ArrayLike, what: str) -> Array:
        """One number, or one per joint, as an array of shape (nv,).

        Raises:
            SpecError: wrong length, NaN, or negative.
        """
        array = np.asarray(value, dtype=float)
        if array.shape not in ((), (self.nv,)):
            raise SpecError(f"{what} has shape {array.shape}; expected one number or {self.nv}, one per joint")
        array = np.broadcast_to(array, (self.nv,)).copy()
        for name, number in zip(self.joint_names, array, strict=True):
            if not number >= 0:
                raise SpecError(f"{what} of joint {name!r} is {number}; it must not be negative")
        return array

    def frame(self, name: str) -> pin.Frame:
        """A frame of the model by name; the link where a joint has the same name.

        Raises:
            SpecError: no such frame.
        """
        for kind in (pin.FrameType.BODY, *_OTHER_FRAMES):
            if self.model.existFrame(name, kind):
                return self.model.frames[self.model.getFrameId(name, kind)]
        raise SpecError(f"no frame {name!r} in {self.source}")

    def configuration(self, q: ArrayLike) -> Array:
        """Pinocchio's configuration vector, shape (model.nq,), of joint coordinates q, shape (nv,)."""
        return configuration(self.model, q)


def configuration(model: pin.Model, q: ArrayLike) -> Array:
    """Pinocchio's configuration of joint coordinates: (cos, sin) for a continuous joint."""
    q = np.asarray(q, dtype=float)
    if model.nq == model.nv:
        return q
    full = np.empty(model.nq)
    for joint, angle in zip(list(model.joints)[1:], q, strict=True):
        full[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
    return full


def payload_inertia(payload: Payload) -> pin.Inertia:
    """Pinocchio's inertia of a payload, in the frame that it is fixed to."""
    moments = np.maximum(payload.inertia, POINT_INERTIA)
    return pin.Inertia(payload.mass, np.array(payload.offset), np.diag(moments))


def _or_infinite(limit: Array) -> Array:
    """Pinocchio writes a missing limit as the largest double or as infinity."""
    return np.where(np.asarray(limit) >= np.finfo(float).max, np.inf, limit)


def _tip(model: pin.Model, whole: pin.Model) -> str:
    """The frame at the end of the arm: the link furthest from the base, in joints and then in frames.

    Among equals the one behind the fewest locked joints: a hand rather than its fingers.

    Args:
        model: the arm.
        whole: the same before joints were locked; pin 4.1's reduced models lose the way from a locked
            joint's frame to the base (it becomes its own parent).
    """
    if model.existFrame(TIP):
        return TIP

    def rank(body: pin.Frame) -> tuple[int, int, int]:
        moving = len(model.supports[body.parentJoint])
        frame = whole.frames[whole.getFrameId(body.name, pin.FrameType.BODY)]
        joints, frames = len(whole.supports[frame.parentJoint]), 0
        while frame.parentFrame:
            frame, frames = whole.frames[frame.parentFrame], frames + 1
        return moving, frames, moving - joints

    return str(max((f for f in model.frames if f.type == pin.FrameType.BODY), key=rank).name)


def _check_inertia(model: pin.Model, source: str) -> None:
    """Every joint must move some mass, or no torque gives a finite acceleration."""
    inertia = pin.crba(model, model.createData(), pin.neutral(model))
    for name, own in zip(list(model.names)[1:], np.diag(inertia), strict=True):
        if not own > 0:
            raise UrdfError(source, f"moves no inertia ({own} kg m²); give its link a mass", f"joint {name!r}")
