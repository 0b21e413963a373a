"""A robot arm, from where one comes: a URDF, a library, or numbers."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

from numpy.typing import ArrayLike

from armdyn.arguments import expect, several
from armdyn.models.reading.meshes import mesh_folders
from armdyn.models.reading.urdf_arm import check_inertia, joint_limits, read_arm
from armdyn.models.reading.urdf_xml import check_urdf_text, file_path, read_urdf
from armdyn.models.robots.arm import READERS
from armdyn.models.robots.descriptions import described
from armdyn.models.robots.library import BENCHMARKS, library_arm
from armdyn.models.robots.readers import ModelReaders, expect_ends, expect_folders, expect_locks
from armdyn.models.values.friction import FRICTION_WIDTH, FrictionValue
from armdyn.models.values.spec import ArmSpec, Payload
from armdyn.models.values.urdf import urdf_from_spec
from armdyn.reprs import brief


@brief
@dataclass(frozen=True, kw_only=True, eq=False)
class Robot(ModelReaders):
    """An arm of revolute, continuous and prismatic joints; `Arm` says what it has.

    It is read, not made: by `from_library`, `from_urdf`, `from_urdf_string`, `from_mjcf`, `from_mjcf_string`,
    `from_model`, `from_description` or `from_spec`.
    """

    @classmethod
    def from_spec(cls, spec: ArmSpec, payload: Payload | None = None) -> Self:
        """A generated planar arm, its payload a link of its own at the tip or at another of its links."""
        text = urdf_from_spec(spec, payload)
        robot = cls._from_text(text, source=f"ArmSpec {spec.name!r}")
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
        file = file_path(path)
        return cls.from_urdf_string(
            read_urdf(file), payload, lock, effort_limit, velocity_limit, armature,
            mesh_folders(file, expect_folders(package_dirs)), damping, friction, friction_width, arm, str(file),
        )  # fmt: skip

    @classmethod
    def from_urdf_string(
        cls,
        text: str,
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
        source: str = "URDF text",
    ) -> Self:
        """An arm from a URDF's text, read, bounded and checked as a file is.

        Args:
            text: the URDF, such as `open("arm.urdf").read()` or what xacro printed.
            payload: see `from_urdf`.
            lock: see `from_urdf`.
            effort_limit: see `from_urdf`.
            velocity_limit: see `from_urdf`.
            armature: see `from_urdf`.
            package_dirs: where meshes are, `package://` or not: a text has no folder of its own.
            damping: see `from_urdf`.
            friction: see `from_urdf`.
            friction_width: see `from_urdf`.
            arm: see `from_urdf`.
            source: what messages call it.

        Raises:
            UrdfError: it is no text, too long, or not physical.
            UnsupportedJointError: see `from_urdf`.
            SpecError: see `from_urdf`.
        """
        check_urdf_text(text, source)
        robot = cls._from_text(text, source, expect_locks(lock), expect_ends(arm), expect_folders(package_dirs))
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
        """An arm of example-robot-data, such as "panda", "ur5", "talos_arm", one of `LIBRARY_ARMS`, or a benchmark.

        Args:
            name: the library's name for it, that of an arm inside a bigger robot, such as "baxter_left", or
                "acrobot", "cart_pole", "furuta_pendulum", "pendubot", which come with armdyn: they know which of
                their joints have no motor.
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
        robot = cls.from_urdf(
            path, payload, lock, None, velocity_limit, armature, (shared,), damping, friction, friction_width, arm,
        )  # fmt: skip
        passive = [joint for joint in BENCHMARKS.get(name, ()) if joint in robot.joint_names]
        return robot.with_passive(passive).with_limits(effort_limit, None)

    @classmethod
    def from_description(
        cls,
        name: str,
        payload: Payload | None = None,
        lock: Mapping[str, float] | None = None,
        arm: tuple[str, str] | None = None,
    ) -> Self:
        """A robot of the package robot_descriptions, where that is installed: its URDF, or its MJCF.

        The package clones the robot's repository from the internet the first time.

        Args:
            name: such as "ur5_description", "panda_mj_description"; "robot_descriptions:" may stand before it.
            payload: see `from_urdf`.
            lock: see `from_urdf`.
            arm: see `from_urdf`.

        Raises:
            UnknownRobotError: robot_descriptions has no such robot, or is not installed.
            UrdfError: it cannot be had, or is no fixed-base arm.
        """
        found = described(name)
        if found.mjcf:
            return cls.from_mjcf(found.path, payload, lock, arm)
        return cls.from_urdf(found.path, payload, lock, package_dirs=found.folders, arm=arm)

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


def expect_robot(robot: object, name: str = "robot") -> Robot:
    """The robot.

    Raises:
        ProblemError: it is none; with how to come by one.
    """
    return expect(robot, Robot, name, f"use {READERS}")


def expect_robots(robots: object, name: str) -> tuple[Robot, ...]:
    """The robots of a list.

    Raises:
        ProblemError: it is no list, or has something else in it.
    """
    return tuple(expect_robot(robot, f"{name}[{i}]") for i, robot in enumerate(several(robots, name)))
