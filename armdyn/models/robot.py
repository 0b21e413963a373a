"""A robot arm: Pinocchio's model and the limits of its joints."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from armdyn.errors import SpecError
from armdyn.models.friction import FRICTION_WIDTH, FrictionValue, JointFriction
from armdyn.models.identity import model_hash
from armdyn.models.library import library_arm
from armdyn.models.limits import JointLimits
from armdyn.models.meshes import mesh_folders
from armdyn.models.per_joint import per_joint
from armdyn.models.reading import check_inertia, configuration, joint_limits, read_arm
from armdyn.models.spec import ArmSpec, Payload
from armdyn.models.urdf import TIP, positive_tensor, urdf_from_spec
from armdyn.models.urdf_xml import read_urdf

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
        friction: in its joints; the model itself, and so `pin.aba`, knows nothing of it.
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
    friction: JointFriction = field(default_factory=JointFriction)

    @property
    def nv(self) -> int:
        """Number of joints."""
        return int(self.model.nv)

    @property
    def model_hash(self) -> str:
        """SHA-256 of its equations of motion, payload and friction included; see `models.identity`."""
        return model_hash(self.model, self.friction)

    @classmethod
    def from_spec(cls, spec: ArmSpec, payload: Payload | None = None) -> Self:
        """A generated planar arm, its payload a link of its own at the tip or at another of its links."""
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
        damping: FrictionValue = "urdf",
        friction: FrictionValue = "urdf",
        friction_width: float = FRICTION_WIDTH,
        arm: tuple[str, str] | None = None,
    ) -> Self:
        """An arm from a URDF file.

        Args:
            path: the file.
            payload: fixed to `payload.frame`, by default the end of the longest chain.
            lock: joints to fix, name to position [rad or m].
            effort_limit: instead of the URDF's: one number, or one per joint [N m or N].
            velocity_limit: instead of the URDF's: one number, or one per joint [rad/s or m/s].
            armature: reflected rotor inertia: one number, or one per joint [kg m² or kg].
            package_dirs: where `package://` meshes are, besides the file's own folder and ROS package; not looked
                at for dynamics, for which no mesh need be there.
            damping: viscous friction of the joints: one number, or one per joint [N m s/rad or N s/m]; "urdf":
                what its `<dynamics damping=…>` says; 0 for none.
            friction: Coulomb friction [N m or N], likewise; "urdf": its `<dynamics friction=…>`.
            friction_width: speed over which Coulomb friction turns its sign, see `JointFriction` [rad/s or m/s].
            arm: (first, last), each a joint or a link: the joints on the way from one to the other move, all
                others of the robot are locked, at zero or at the bound nearest to it unless `lock` says where.
                A last link is the tip. None: all joints move but those of `lock`, and a `<mimic>` joint whose
                leader is locked, which follows it.

        Raises:
            UrdfError: the file cannot be read or is not physical.
            UnsupportedJointError: a moving joint is not of the kinds above, or mimics another that moves.
            SpecError: a limit, a lock, the arm or the payload does not fit the robot.
        """
        path = Path(path)
        text = read_urdf(path)
        folders = mesh_folders(path, package_dirs)
        robot = cls._from_text(text, source=str(path), lock=lock, arm=arm, package_dirs=folders)
        robot = robot._carrying(payload).with_limits(effort_limit, velocity_limit).with_armature(armature)
        check_inertia(robot.model, robot.source)
        return robot.with_friction(damping, friction, friction_width)

    @classmethod
    def from_library(
        cls,
        name: str,
        payload: Payload | None = None,
        lock: Mapping[str, float] | None = None,
        effort_limit: ArrayLike | None = None,
        velocity_limit: ArrayLike | None = None,
        armature: ArrayLike | None = None,
        damping: FrictionValue = 0.0,
        friction: FrictionValue = 0.0,
        friction_width: float = FRICTION_WIDTH,
        arm: tuple[str, str] | None = None,
    ) -> Self:
        """An arm of example-robot-data, such as "panda", "ur5", "talos_arm", or one of `LIBRARY_ARMS`.

        Args:
            name: the library's name for it, or that of an arm inside a bigger robot, such as "baxter_left".
            payload: see `from_urdf`.
            lock: see `from_urdf`; besides what is locked already, such as a hand's fingers.
            effort_limit: see `from_urdf`.
            velocity_limit: see `from_urdf`.
            armature: see `from_urdf`.
            damping: see `from_urdf`. None by default, for the library's numbers are there to calm simulators:
                z1 and talos_arm have 1 for every joint, xarm7 up to 10, panda 0.003 beside `mu_viscous="16"`.
            friction: see `from_urdf`; none by default, for the same reason.
            friction_width: see `from_urdf`.
            arm: see `from_urdf`; None: that of `LIBRARY_ARMS`, or all joints of a robot that is not there. A
                robot that could walk or fly stands with its base fixed.

        Raises:
            UnknownRobotError: the library has no such robot.
            UrdfError: its URDF is no fixed-base arm.
        """
        path, shared, part = library_arm(name)
        if arm is None and part is not None:
            arm = part.first, part.last
        return cls.from_urdf(
            path, payload, lock, effort_limit, velocity_limit, armature, (shared,), damping, friction, friction_width,
            arm,
        )  # fmt: skip

    @classmethod
    def _from_text(
        cls,
        text: str,
        source: str,
        lock: Mapping[str, float] | None = None,
        arm: tuple[str, str] | None = None,
        package_dirs: tuple[str, ...] = (),
    ) -> Self:
        reading = read_arm(text, source, lock, arm)
        return cls(
            name=str(reading.model.name),
            model=reading.model,
            limits=joint_limits(reading.model),
            joint_names=tuple(list(reading.model.names)[1:]),
            urdf=text,
            source=source,
            package_dirs=package_dirs,
            locked=reading.locked,
            tip=reading.tip,
        )

    def with_limits(self, effort_limit: ArrayLike | None, velocity_limit: ArrayLike | None) -> Self:
        """This robot with other limits: one number, or one per joint; None keeps its own.

        Raises:
            SpecError: wrong length, NaN, or negative.
        """
        limits = self.limits
        if effort_limit is not None:
            effort = self._read(effort_limit, "effort_limit", "N m or N", finite=False)
            limits = replace(limits, effort_lower=-effort, effort_upper=effort)
        if velocity_limit is not None:
            velocity = self._read(velocity_limit, "velocity_limit", "rad/s or m/s", finite=False)
            limits = replace(limits, velocity=velocity)
        return replace(self, limits=limits)

    def with_friction(
        self,
        damping: FrictionValue | None = None,
        friction: FrictionValue | None = None,
        width: float | None = None,
    ) -> Self:
        """This robot with other friction in its joints; None keeps its own.

        Args:
            damping: viscous [N m s/rad or N s/m]: one number, one per joint, or "urdf" for what the URDF says.
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
            return self._read(urdf, f"the URDF's {what}") if isinstance(value, str) else self._read(value, what)

        own = self.friction
        return replace(
            self,
            friction=JointFriction(
                damping=chosen(damping, own.damping, self.model.damping, "damping"),
                coulomb=chosen(friction, own.coulomb, self.model.upperDryFrictionLimit, "friction"),
                width=own.width if width is None else width,
            ),
        )

    def with_armature(self, armature: ArrayLike | None) -> Self:
        """This robot with reflected rotor inertia [kg m² or kg]: one number, or one per joint; None keeps its own.

        Raises:
            SpecError: wrong length, NaN, negative or infinite.
        """
        if armature is None:
            return self
        model = self.model.copy()
        model.armature = self._read(armature, "armature", "kg m² or kg")
        return replace(self, model=model)

    def _carrying(self, payload: Payload | None) -> Self:
        """This robot carrying something; the model is copied before it is changed."""
        model = self.model.copy()
        if payload is not None and payload.mass > 0:
            frame_name = payload.frame or self.tip
            frame = self.frame(frame_name)
            if frame.parentJoint == 0:
                raise SpecError(f"frame {frame_name!r} of {self.source} does not move: no payload can be there")
            model.appendBodyToJoint(frame.parentJoint, payload_inertia(payload), frame.placement)
        return replace(self, model=model, payload=payload)

    def _read(self, value: ArrayLike, what: str, unit: str = "", *, finite: bool = True) -> Array:
        """One number, or one per joint, that is not negative, as an array of shape (nv,)."""
        return per_joint(value, self.joint_names, what, unit=unit, finite=finite, sign="not negative")

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


def payload_inertia(payload: Payload) -> pin.Inertia:
    """Pinocchio's inertia of a payload, in the frame that it is fixed to."""
    return pin.Inertia(payload.mass, np.array(payload.com), positive_tensor(payload))
