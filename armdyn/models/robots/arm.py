"""A robot arm: Pinocchio's model and the limits of its joints."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from armdyn.arguments import Checked, checked, expect, numbers, several, shown, text
from armdyn.arrays import Array, Flags
from armdyn.errors import ArmdynWarning, SpecError, UrdfError, did_you_mean, nearest_names
from armdyn.locks import cached_property
from armdyn.models.reading.ends import chains
from armdyn.models.reading.urdf_arm import check_inertia, configuration
from armdyn.models.reading.urdf_xml import LARGEST
from armdyn.models.robots.poses import named_poses, names_of
from armdyn.models.robots.source import RobotOptions, RobotSource
from armdyn.models.values.actuator_limits import ConstantTorque, TorqueSpeed
from armdyn.models.values.friction import FrictionValue, JointFriction
from armdyn.models.values.joint_limits import JointLimits
from armdyn.models.values.per_joint import JointNumbers, expect_joint, filled, per_joint
from armdyn.models.values.spec import Payload, Tool
from armdyn.models.values.urdf import TIP, positive_tensor
from armdyn.rendering import renderer
from armdyn.reprs import brief, called, joints_of

_OTHER_FRAMES = (pin.FrameType.OP_FRAME, pin.FrameType.FIXED_JOINT, pin.FrameType.JOINT, pin.FrameType.SENSOR)

READERS = (
    "Robot.from_library(name), Robot.from_urdf(path), Robot.from_urdf_string(text), Robot.from_mjcf(path), "
    "Robot.from_model(model) or Robot.from_spec(spec)"
)
"""Readers of robots, in messages."""


@brief
@dataclass(frozen=True, kw_only=True, eq=False)
class Arm(Checked):
    """An arm of revolute, continuous and prismatic joints.

    All of armdyn speaks of *joint coordinates*: one number per joint, an angle [rad] or a
    displacement [m], also for continuous joints, which Pinocchio stores as cosine and sine.
    `configuration` leads from one to the other.

    Attributes:
        name: from the URDF, the MJCF or the model.
        model: Pinocchio's model; locked joints are gone from it, the payload is in it.
        limits: of every joint. A URDF's range without width, or velocity or torque limit of zero, counts as none
            given. Torque limits of zero that are here are those of a joint without a motor: see `passive`.
        joint_names: the moving joints, in the order of every vector.
        urdf: the text it was read from; empty if that was no URDF, and then it has no geometry.
        source: its file, or its origin in words.
        package_dirs: folders in which `package://` is looked up.
        locked: joint name to the position it is locked at [rad or m].
        gripper: joints of a gripper that are locked because nobody said otherwise.
        repaired: links whose inertia `armdyn doctor --repair` changed, with commas between; the robot's name, and so
            every result, says "repaired model".
        payload: the added one; None: none was.
        tip: the frame at the end of the arm, or of its tool.
        friction: in its joints; the model itself, and so `pin.aba`, ignores it.
        origin: where it was read from; None: it was put together otherwise.
        options: with which it was read.
    """

    name: str = checked(text, error=SpecError)
    model: pin.Model = checked(expect, kind=pin.Model, hint=f"use {READERS}", error=SpecError)
    limits: JointLimits = checked(expect, kind=JointLimits, error=SpecError)
    joint_names: tuple[str, ...] = checked(several, error=SpecError)
    urdf: str = checked(text, error=SpecError, in_repr=False)
    source: str
    package_dirs: tuple[str, ...] = checked(several, (), error=SpecError)
    locked: Mapping[str, float] = field(default_factory=dict)
    gripper: tuple[str, ...] = checked(several, (), error=SpecError, in_repr=False)
    repaired: str = ""
    payload: Payload | None = checked(expect, None, kind=Payload, hint="Payload(mass=…)", error=SpecError)
    tip: str = checked(text, TIP, error=SpecError)
    friction: JointFriction = checked(expect, JointFriction(), kind=JointFriction, error=SpecError)
    origin: RobotSource | None = checked(expect, None, kind=RobotSource, error=SpecError, in_repr=False)
    options: RobotOptions = checked(expect, RobotOptions(), kind=RobotOptions, error=SpecError, in_repr=False)

    def __new__(cls, *given: object, **fields: object) -> Self:
        """Refuse positional arguments: `Robot(model)` or `Robot("arm.urdf")` is meant for one of the readers."""
        if given:
            raise SpecError(f"Robot({shown(given[0])}) is no way to make one: use {READERS}")
        return super().__new__(cls)

    def __post_init__(self) -> None:
        super().__post_init__()
        expect(self.locked, Mapping, "locked of a robot", error=SpecError)  # type: ignore[type-abstract]
        count, limits = len(self.joint_names), self.limits.velocity.size
        if not count == limits == self.model.nv:
            raise SpecError(f"a robot of {joints_of(self.model.nv)} has {count} joint names and {limits} limits")

    def _of_whom(self) -> str:
        return " of a robot"

    def _repr_parts(self) -> list[str]:
        """Parts of the `repr`."""
        parts = [called(self.name), joints_of(self.nv), f"tip {called(self.tip)}"]
        parts += [f"payload {self.payload.mass:g} kg"] if self.payload is not None else []
        parts += ["with friction"] if self.friction.present else []
        return parts + ([f"{len(self.locked)} locked"] if self.locked else [])

    def _repr_html_(self) -> str:
        """HTML for notebooks: a table and a picture."""
        return renderer().card(self)

    @property
    def nv(self) -> int:
        """Number of joints."""
        return int(self.model.nv)

    @property
    def slides(self) -> Flags:
        """Whether each joint is prismatic, shape (nv,): its position is in metres."""
        return np.array([joint.shortname().startswith("JointModelP") for joint in list(self.model.joints)[1:]])

    def marked(self, name: str) -> str:
        """Name of a result of this robot, with a mark if its model was repaired."""
        return f"{name} (repaired model)" if self.repaired else name

    @property
    def poses(self) -> dict[str, Array]:
        """Named joint positions [rad or m], each of shape (nv,): "zero", and those of an SRDF, an MJCF or a table."""
        return named_poses(self)

    def pose(self, name: str) -> Array:
        """The joint positions of a name [rad or m], shape (nv,).

        Raises:
            SpecError: no pose has that name; the message lists all.
        """
        if text(name, "name of a pose", error=SpecError) not in (poses := self.poses):
            meant = did_you_mean(name, poses)
            raise SpecError(f"{self.name} has no pose {shown(name)} (known: {names_of(poses)}){meant}")
        return poses[name]

    @property
    def attached(self) -> tuple[Payload, ...]:
        """Tool and payload, each only if present."""
        return tuple(body for body in (self.options.tool, self.payload) if body is not None)

    @property
    def passive(self) -> tuple[str, ...]:
        """The joints without a motor, whose torque limits are zero."""
        return tuple(name for name, idle in zip(self.joint_names, self.limits.passive, strict=True) if idle)

    @property
    def notes(self) -> list[str]:
        """Choices among its joints that nobody made: a gripper that is locked, and the arms to choose from."""
        if self.origin is None or self.origin.format == "model":
            return []
        notes = []
        if self.gripper:
            held = ", ".join(f"{name} at {self.locked[name]:g}" for name in self.gripper)
            moving = f"lock={{'{self.gripper[0]}': 'free'}}"
            notes.append(f"joints of a gripper are locked: {held}; to move one: {moving}")
        arms = [f"arm=('{one[0]}', '{one[-1]}')" for one in chains(self.model) if len(one) > 1]
        if len(arms) > 1:
            notes.append(f"joints of several arms move together; one alone: {' or '.join(arms[:4])}")
        return notes

    def noted(self) -> Self:
        """This robot, after a warning with each of its `notes`."""
        for note in self.notes:
            warnings.warn(f"{self.source}: {note}", ArmdynWarning, stacklevel=3)
        return self

    @property
    def model_hash(self) -> str:
        """SHA-256 of its equations of motion, payload and friction included; see the function `model_hash`."""
        return model_hash(self.model, self.friction)

    def with_limits(self, effort_limit: JointNumbers | None, velocity_limit: JointNumbers | None) -> Self:
        """This robot with other limits: one number, one per joint, or some by joint name; None keeps its own.

        A torque limit of zero is that of a joint without a motor. One number is for all joints that have one; a warning
        names the joints whose limits, of a file, it raises.

        Raises:
            SpecError: wrong length, NaN, or negative.
        """
        limits = self.limits
        if effort_limit is not None:
            limits = limits.with_effort(effort_limit, self.joint_names, SpecError, "not negative")
        if velocity_limit is not None:
            velocity = self._read(velocity_limit, "velocity_limit", "rad/s or m/s", limits.velocity, finite=False)
            limits = replace(limits, velocity=velocity)
        for name, given, own, new in (
            ("effort_limit", effort_limit, self.limits.effort_upper, limits.effort_upper),
            ("velocity_limit", velocity_limit, self.limits.velocity, limits.velocity),
        ):
            above = np.flatnonzero((new > own) & np.isfinite(new))
            raised = ", ".join(f"{self.joint_names[i]} from {own[i]:g}" for i in above)
            if isinstance(given, int | float | np.number) and raised and not (self.origin and self.origin.spec):
                said = f"`{name}` {new.max():g} raises the file's limits of {raised}; {{'JOINT': NUMBER}} changes one"
                warnings.warn(said, ArmdynWarning, stacklevel=2)
        return replace(self, limits=limits)

    def with_torque_speed(self, torque_speed: Mapping[str, ArrayLike] | None) -> Self:
        """This robot with torque limits that fall with speed; None keeps its own limits.

        Args:
            torque_speed: curves of joints by name, each [speed [rad/s or m/s], torque [N m or N]] of two or more
                points, concave and from speed 0 on, see `TorqueSpeed`; other joints' limits are the same at all speeds.

        Raises:
            SpecError: there is no such joint, or a curve is not as `TorqueSpeed` says.
        """
        if torque_speed is None:
            return self
        limits = self.limits
        ends = limits.effort_lower, limits.effort_upper
        own = TorqueSpeed(*ends, joints=self.joint_names, curves=torque_speed)
        return replace(self, limits=replace(limits, actuators=own if own.curves else ConstantTorque(*ends)))

    def with_passive(self, joints: Iterable[str]) -> Self:
        """Copy of the robot with further joints without a motor, by name.

        Raises:
            SpecError: there is no such joint.
        """
        return replace(self, limits=self.limits.without_motors(joints, self.joint_names, SpecError))

    def with_friction(
        self,
        damping: FrictionValue | None = None,
        friction: FrictionValue | None = None,
        width: JointNumbers | None = None,
    ) -> Self:
        """This robot with other friction in its joints; None keeps its own.

        Args:
            damping: viscous [N m s/rad or N s/m]: one number, one per joint, or "urdf": that of the URDF, the
                MJCF or the model that it was read from.
            friction: Coulomb's [N m or N], likewise.
            width: see `JointFriction` [rad/s or m/s].

        Raises:
            SpecError: wrong length, NaN, negative or infinite.
        """

        def chosen(value: FrictionValue | None, own: ArrayLike, urdf: Array, what: str) -> ArrayLike:
            if value is None:
                return own
            if isinstance(value, str) and value != "urdf":
                raise SpecError(f'{what} is {value!r}; it is numbers or "urdf"')
            if isinstance(value, str):
                return self._read(urdf, f"{what} of {self.source}")
            return self._read(value, what, own=own)

        own = self.friction
        return replace(
            self,
            friction=JointFriction(
                damping=chosen(damping, own.damping, self.model.damping, "damping"),
                coulomb=chosen(friction, own.coulomb, self.model.upperDryFrictionLimit, "friction"),
                width=own.width if width is None else self._read(width, "friction_width", "rad/s", own.width),
            ),
        )

    def with_armature(
        self,
        armature: JointNumbers | None,
        rotor_inertia: JointNumbers | None = None,
        gear_ratio: JointNumbers | None = None,
    ) -> Self:
        """This robot with other rotors, each as one number or one per joint; without any it keeps its own.

        Args:
            armature: reflected rotor inertia, which the joint feels [kg m² or kg].
            rotor_inertia: about the rotor's own axis [kg m²]; the armature is then gear_ratio² × rotor_inertia.
            gear_ratio: turns of the rotor for one of the joint [-], or its angle for one metre of the joint [rad/m].

        Raises:
            SpecError: wrong length, NaN, negative, or beyond `urdf_xml.LARGEST`; or of rotor_inertia and gear_ratio one
                alone, or besides armature.
        """
        if (rotor_inertia is None) != (gear_ratio is None) or (armature is not None and rotor_inertia is not None):
            raise SpecError(
                "give `armature`, or `rotor_inertia` and `gear_ratio`: armature is gear ratio² × rotor inertia"
            )
        if rotor_inertia is not None and gear_ratio is not None:
            inertia = self._read(rotor_inertia, "rotor_inertia", "kg m²")
            armature = self._read(gear_ratio, "gear_ratio") ** 2 * inertia
            by_name = [one for one in (rotor_inertia, gear_ratio) if isinstance(one, Mapping)]
            named = [all(joint in one for one in by_name) for joint in self.joint_names]
            armature = np.where(named, armature, self.model.armature)
        if armature is None:
            return self
        model, what = self.model.copy(), "armature" if rotor_inertia is None else "armature = gear_ratio² rotor_inertia"
        model.armature = self._read(armature, "armature", "kg m² or kg", model.armature)
        if np.max(model.armature) > LARGEST:
            raise SpecError(f"{what} is {shown(armature)} kg m² or kg; it must be {LARGEST:g} at most")
        return replace(self, model=model)

    def with_unit_inertia(self) -> Self:
        """This robot without masses, friction and torque limits, and an inertia of one at every joint.

        Its torques are its accelerations, in any pose [N m as rad/s², N as m/s²].
        """
        model, none = self.model.copy(), np.full(self.nv, np.inf)
        for joint in range(1, model.njoints):
            model.inertias[joint] = pin.Inertia.Zero()
        model.armature = np.ones(self.nv)
        limits = replace(self.limits, effort_lower=-none, effort_upper=none, actuators=ConstantTorque(-none, none))
        return replace(self, model=model, limits=limits, friction=JointFriction())

    def _with_body(self, body: Payload | None) -> Self:
        """This robot with a payload or a tool; the model is copied before it is changed.

        Raises:
            SpecError: it is no payload, its frame is unknown or does not move, or its name is taken.
        """
        model, tip = self.model.copy(), self.tip
        if body is not None:
            frame = self.frame_of(body)
            if frame.parentJoint == 0:
                raise SpecError(f"frame {frame.name!r} of {self.source} does not move: no {body.name} can be there")
            if (body.shapes or isinstance(body, Tool)) and model.existFrame(body.name):
                raise SpecError(f"{self.source} has a frame {body.name!r}: give the {body.name} another name")
            if body.mass > 0:
                model.appendBodyToJoint(frame.parentJoint, payload_inertia(body), frame.placement)
            if isinstance(body, Tool):
                at, tip = frame.placement * pin.SE3(np.array(body.tip)), body.name
                model.addFrame(pin.Frame(tip, frame.parentJoint, 0, at, pin.FrameType.OP_FRAME))
        return replace(self, model=model, tip=tip, payload=self.payload if isinstance(body, Tool) else body)

    def _with_inertias(self, inertias: Mapping[str, ArrayLike] | None) -> Self:
        """This robot with other inertias, see `RobotOptions.inertias`; the model is copied before it is changed.

        Raises:
            SpecError: there is no such joint, or no body has such an inertia.
        """
        if inertias is None:
            return self
        model = self.model.copy()
        for joint, given in inertias.items():
            expect_joint(joint, self.joint_names, "inertias")
            own = numbers(given, f"inertias of {joint}", "ten finite numbers", error=SpecError)
            if own.shape != (10,) or not np.all(np.isfinite(own)) or np.max(np.abs(own)) > LARGEST:
                raise SpecError(f"inertias of {joint} are {shown(given)}; they must be ten finite numbers")
            spread = np.linalg.eigvalsh(pin.PseudoInertia.FromDynamicParameters(own).toMatrix())
            if own[0] <= 0 or spread[0] < -1e-9 * spread[-1]:
                raise SpecError(f"inertias of {joint} are {shown(given)}: no body has such an inertia")
            model.inertias[model.getJointId(joint)] = pin.Inertia.FromDynamicParameters(own)
        return replace(self, model=model)

    def _read(
        self, value: JointNumbers, what: str, unit: str = "", own: ArrayLike = 0.0, *, finite: bool = True
    ) -> Array:
        """Numbers that are not negative, as an array of shape (nv,); own: those of joints that are not named."""
        given = filled(value, self.joint_names, what, own)
        return per_joint(given, self.joint_names, what, unit=unit, finite=finite, sign="not negative")

    def frame(self, name: str) -> pin.Frame:
        """A frame of the model by name; the link where a joint has the same name.

        Raises:
            SpecError: no such frame.
        """
        text(name, "name of a frame", error=SpecError)
        for kind in (pin.FrameType.BODY, *_OTHER_FRAMES):
            if self.model.existFrame(name, kind):
                return self.model.frames[self.model.getFrameId(name, kind)]
        links = (str(one.name) for one in self.model.frames if one.type in (pin.FrameType.BODY, pin.FrameType.OP_FRAME))
        near = nearest_names(name, {*links} - {self.tip})
        raise SpecError(
            f"no frame {shown(name)} in {self.source}; the tip is {self.tip!r}, others, nearest names first: {near}"
        )

    def frame_of(self, payload: Payload) -> pin.Frame:
        """The frame that the payload or the tool is fixed to.

        Raises:
            SpecError: there is no such frame, or it is neither.
        """
        return self.frame(expect(payload, Payload, "payload", "Payload(mass=…)", error=SpecError).frame or self.tip)

    def same_place(self, one: str, other: str) -> bool:
        """Whether two frames, by name, are fixed to each other without an offset.

        Raises:
            SpecError: there is no such frame.
        """
        a, b = self.frame(one), self.frame(other)
        return bool(a.parentJoint == b.parentJoint and a.placement.isApprox(b.placement))

    @cached_property
    def has_dynamics(self) -> bool:
        """Whether torques are known: every joint moves an inertia of its own. See `expect_dynamics`."""
        try:
            check_inertia(self.model, self.source)
        except UrdfError:
            return False
        return True

    def expect_dynamics(self) -> None:
        """Refuse an arm whose torques are unknown.

        Raises:
            UrdfError: a joint moves no inertia; the message names the links without mass, and remedies.
        """
        if not self.has_dynamics:
            check_inertia(self.model, self.source)

    def holding_torque(self, q: ArrayLike) -> Array:
        """Torque that holds the arm still at joint positions q [N m or N], both of shape (nv,).

        Raises:
            SpecError: q is not one number per joint.
            UrdfError: see `expect_dynamics`.
        """
        self.expect_dynamics()
        at = self.configuration(per_joint(q, self.joint_names, "q", scalar=False))
        return np.array(pin.computeGeneralizedGravity(self.model, self.model.createData(), at))

    def configuration(self, q: ArrayLike) -> Array:
        """Pinocchio's configuration vector, shape (model.nq,), of joint coordinates q, shape (nv,).

        Raises:
            SpecError: q is not one number per joint.
        """
        if not (isinstance(q, np.ndarray) and q.dtype == float):  # no more than that: integrators come by
            q = per_joint(q, self.joint_names, "q", scalar=False)
        return configuration(self.model, q)


def payload_inertia(payload: Payload) -> pin.Inertia:
    """Pinocchio's inertia of a payload, in the frame that it is fixed to."""
    return pin.Inertia(payload.mass, np.array(payload.com), positive_tensor(payload))


def model_hash(model: pin.Model, friction: JointFriction) -> str:
    """SHA-256 of an arm's equations of motion, in hexadecimal.

    Joints, placements, inertias with the payload, armature, gravity and friction, each number to 1e-12 of its SI
    unit, so that the last bit of another machine's sine does not matter. Names of links, shapes and limits are
    not in it.

    Args:
        model: the arm.
        friction: in its joints.
    """
    numbers, words = [model.gravity.vector, model.armature], []
    each = (model.names, model.parents, model.joints, model.jointPlacements, model.inertias)
    for name, parent, joint, place, inertia in zip(*(list(one)[1:] for one in each), strict=True):
        words += [f"{name} of {parent}", joint.shortname()]
        numbers += [place.homogeneous.ravel(), inertia.toDynamicParameters()]
        if "Unaligned" in joint.shortname():
            numbers.append(np.ravel(joint.createData().S))
    numbers += friction.per_joint(model.nv)
    numbers.append(np.atleast_1d(friction.width if np.any(friction.coulomb) else 0.0))
    # Plus zero: minus zero becomes zero.
    rounded = (np.round(np.concatenate(numbers), 12) + 0.0).astype("<f8")
    return hashlib.sha256("\n".join(words).encode() + rounded.tobytes()).hexdigest()
