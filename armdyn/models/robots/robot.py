"""Readers of robot arms: from a URDF, an MJCF, a library, Pinocchio's model, or numbers."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from armdyn.arguments import each, expect, text
from armdyn.errors import SpecError
from armdyn.models.mjcf.reading import parse_mjcf, read_mjcf, read_mjcf_arm
from armdyn.models.reading.from_pinocchio import Reading, read_model
from armdyn.models.reading.meshes import mesh_folders
from armdyn.models.reading.urdf_arm import read_arm
from armdyn.models.reading.urdf_xml import check_text, file_path, read_urdf
from armdyn.models.robots.arm import READERS, Arm
from armdyn.models.robots.library import BENCHMARKS, library_arm
from armdyn.models.robots.source import RobotKeywords, RobotOptions, RobotSource, robot_options
from armdyn.models.values.friction import FRICTION_WIDTH
from armdyn.models.values.joint_limits import JointLimits
from armdyn.models.values.spec import ArmSpec, Payload
from armdyn.models.values.urdf import urdf_from_spec
from armdyn.reprs import brief

UNNAMED = "model"
"""Name of a robot whose model has none."""


@brief
@dataclass(frozen=True, kw_only=True, eq=False)
class Robot(Arm):
    """An arm of revolute, continuous and prismatic joints; its attributes are those of `Arm`.

    It is read, not made: by `from_library`, `from_urdf`, `from_urdf_string`, `from_mjcf`, `from_mjcf_string`,
    `from_model`, `from_description` or `from_spec`. Each takes the fields of `RobotOptions` as keywords, or
    `options=RobotOptions(…)`, and raises a `SpecError` if a limit, a lock, the arm or the payload does not fit.
    """

    @classmethod
    def from_source(cls, source: RobotSource, options: RobotOptions | None = None) -> Self:
        """An arm from any source.

        Raises:
            ArmdynError: see the reader of that source.
        """
        expect(source, RobotSource, "source", 'such as RobotSource.named("panda")', error=SpecError)
        given = robot_options(None, {"options": options})
        reading, own_friction = _reading(source, given), None if source.format in ("library", "spec") else "urdf"
        if given.tool is not None and given.tool.frame is None:
            given = replace(given, tool=replace(given.tool, frame=reading.tip))
        if source.limits is not None:
            reading = replace(reading, limits=source.limits)
        if given.mount is not None:
            reading = replace(reading, model=_mounted(reading.model, pin.SE3(np.array(given.mount))))
        name = source.name if source.format == "model" else str(reading.model.name)
        robot = cls(
            name=name, joint_names=tuple(list(reading.model.names)[1:]), origin=source, options=given, **vars(reading)
        )
        robot = replace(robot, name=robot.marked(robot.name))
        if _payload_is_link(source, given):
            robot = replace(robot, payload=given.payload)
        else:
            robot = robot._with_body(given.tool)._with_inertias(given.inertias)._with_body(given.payload)
        idle = BENCHMARKS.get(source.name, ()) if source.format == "library" else ()
        robot = robot.with_passive([joint for joint in idle if joint in robot.joint_names])
        robot = robot.with_limits(given.effort_limit, given.velocity_limit).with_torque_speed(given.torque_speed)
        robot = robot.with_armature(given.armature, given.rotor_inertia, given.gear_ratio)
        return robot.with_passive(given.passive).with_friction(
            own_friction if given.damping is None else given.damping,
            own_friction if given.friction is None else given.friction,
            FRICTION_WIDTH if given.friction_width is None else given.friction_width,
        )

    def with_payload(self, payload: Payload | None) -> Self:
        """This robot carrying something else, or nothing; it is read again, limits, friction and rotors stay.

        Raises:
            SpecError: the payload does not fit, or the robot was put together by hand.
            ArmdynError: its file is not there any more.
        """
        return self._read_with(replace(self.options, payload=payload))

    def with_inertias(self, inertias: Mapping[str, ArrayLike] | None) -> Self:
        """This robot with other inertias of its bodies, see `RobotOptions.inertias`; None: the file's.

        It is read again; payload, limits, friction and rotors stay.

        Raises:
            SpecError: there is no such joint, no body has such an inertia, or the robot was put together by hand.
            ArmdynError: its file is not there any more.
        """
        return self._read_with(replace(self.options, payload=self.payload, inertias=inertias))

    def _read_with(self, options: RobotOptions) -> Self:
        """This robot read again with other options; its name, limits, rotors, friction and tip stay."""
        if self.origin is None:
            raise SpecError(f"{self.source} was put together by hand: it cannot be read again with another load")
        limits: dict[str, Any] = {"effort_limit": self.limits.effort_upper, "velocity_limit": self.limits.velocity}
        given = {name: row for name, row in limits.items() if getattr(options, name) is not None}  # warned of once
        read = type(self).from_source(self.origin, replace(options, **given)).with_armature(self.model.armature)
        return replace(read, name=self.name, limits=self.limits, friction=self.friction, tip=self.tip)

    @classmethod
    def from_spec(cls, spec: ArmSpec, payload: Payload | None = None, **keywords: Unpack[RobotKeywords]) -> Self:
        """A generated planar arm, its payload a link of its own at the tip or at another of its links."""
        expect(spec, ArmSpec, "spec", 'such as ArmSpec.paper("rr")', error=SpecError)
        return cls.from_source(RobotSource.of_spec(spec), robot_options(payload, keywords))

    @classmethod
    def from_urdf(
        cls, path: str | os.PathLike[str], payload: Payload | None = None, **keywords: Unpack[RobotKeywords]
    ) -> Self:
        """An arm from a URDF file.

        Args:
            path: the file.
            payload: fixed to `payload.frame`, by default the tip.
            keywords: the other fields of `RobotOptions`: tool, lock, arm, mount, effort_limit, velocity_limit,
                torque_speed, armature, rotor_inertia, gear_ratio, damping, friction, friction_width, passive, inertias,
                package_dirs; or `options`, a whole `RobotOptions`.

        Raises:
            UrdfError: the file cannot be read or is not physical.
            UnsupportedJointError: a moving joint is none of revolute, continuous and prismatic, or mimics another that
                moves.
        """
        source = RobotSource(format="urdf", name=str(file_path(path)))
        return cls.from_source(source, robot_options(payload, keywords)).noted()

    @classmethod
    def from_urdf_string(
        cls, text: str, payload: Payload | None = None, source: str = "URDF text", **keywords: Unpack[RobotKeywords]
    ) -> Self:
        """An arm from a URDF's text, read, bounded and checked as a file is; else see `from_urdf`.

        Args:
            text: the URDF, such as `open("arm.urdf").read()` or the output of xacro.
            payload: see `from_urdf`.
            source: its name in messages.
            keywords: see `from_urdf`; package_dirs has all meshes: a text has no folder of its own.

        Raises:
            UrdfError: it is no text, too long, or not physical.
            UnsupportedJointError: see `from_urdf`.
        """
        check_text(text, source, "URDF")
        own = RobotSource(format="urdf", name=source, text=text)
        return cls.from_source(own, robot_options(payload, keywords)).noted()

    @classmethod
    def from_library(cls, name: str, payload: Payload | None = None, **keywords: Unpack[RobotKeywords]) -> Self:
        """An arm of example-robot-data, such as "panda", "ur5", "talos_arm", one of `LIBRARY_ARMS`, or a benchmark.

        The base of a walking or flying robot is fixed.

        Args:
            name: the library's name for it, that of an arm inside a bigger robot, such as "baxter_left", or
                "acrobot", "cart_pole", "furuta_pendulum", "pendubot", which come with armdyn, with a mark which of
                their joints have no motor.
            payload: see `from_urdf`.
            keywords: see `from_urdf`; `lock` adds to the joints that are locked already, such as a hand's fingers.

        Raises:
            UnknownRobotError: the library has no such robot.
            UrdfError: its URDF is no fixed-base arm.
        """
        source = RobotSource(format="library", name=text(name, "name of a robot", error=SpecError))
        return cls.from_source(source, robot_options(payload, keywords))

    @classmethod
    def from_description(cls, name: str, payload: Payload | None = None, **keywords: Unpack[RobotKeywords]) -> Self:
        """A robot of the package robot_descriptions, where that is installed: its URDF, or its MJCF.

        The package clones the robot's repository from the internet the first time.

        Args:
            name: such as "ur5_description", "panda_mj_description"; "robot_descriptions:" may stand before it.
            payload: see `from_urdf`.
            keywords: see `from_urdf`.

        Raises:
            UnknownRobotError: robot_descriptions has no such robot, or is not installed.
            UrdfError: it cannot be had, or is no fixed-base arm.
        """
        return cls.from_source(RobotSource.of_description(name), robot_options(payload, keywords)).noted()

    @classmethod
    def from_mjcf(
        cls, path: str | os.PathLike[str], payload: Payload | None = None, **keywords: Unpack[RobotKeywords]
    ) -> Self:
        """An arm from a file in MuJoCo's format, read by Pinocchio's own parser.

        Torque limits are those of the actuators, see `mjcf.actuators.effort_limits`. MJCF has no velocity limits:
        they are infinite unless `velocity_limit` or the problem gives some. Friction and armature are the file's.
        Tendons, contacts and the dynamics of actuators are left out.

        Args:
            path: the file; its includes are in its folder or below.
            payload: see `from_urdf`.
            keywords: see `from_urdf`; `lock` also free joints, and with an `arm` all of them: their bodies stand still.

        Raises:
            UrdfError: the file cannot be read, is not physical, or has elements unknown to armdyn or to this Pinocchio.
            UnsupportedJointError: a moving joint is free, a ball, has a spring, or is coupled with another.
        """
        file = file_path(path, "MJCF", "Robot.from_mjcf_string")
        source = RobotSource(format="mjcf", name=str(file))
        return cls.from_source(source, robot_options(payload, keywords)).noted()

    @classmethod
    def from_mjcf_string(
        cls, text: str, payload: Payload | None = None, source: str = "MJCF text", **keywords: Unpack[RobotKeywords]
    ) -> Self:
        """An arm from the text of an MJCF, which includes nothing; else as `from_mjcf`.

        Args:
            text: the MJCF.
            payload: see `from_urdf`.
            source: its name in messages.
            keywords: see `from_mjcf`.

        Raises:
            UrdfError: see `from_mjcf`.
            UnsupportedJointError: see `from_mjcf`.
        """
        check_text(text, source, "MJCF")
        own = RobotSource(format="mjcf", name=source, text=text)
        return cls.from_source(own, robot_options(payload, keywords)).noted()

    @classmethod
    def from_model(
        cls,
        model: pin.Model,
        limits: JointLimits | None = None,
        name: str | None = None,
        payload: Payload | None = None,
        **keywords: Unpack[RobotKeywords],
    ) -> Self:
        """An arm from a Pinocchio model that was built or loaded elsewhere, and stays unchanged.

        Its friction is that of the model. Its geometry is unknown: it is drawn as rods, and obstacles cannot
        be given.

        Args:
            model: with joints that turn or slide along one axis; others are locked, or not in `arm`.
            limits: of the joints that move, in the model's order; None: the model's own.
            name: of the robot; None: the model's.
            payload: see `from_urdf`.
            keywords: see `from_urdf`; `lock` joints of several coordinates at 0, their neutral; in `arm` a frame stands
                for a link.

        Raises:
            UnsupportedJointError: a moving joint is none of those; names it.
            UrdfError: the model is not physical.
        """
        expect(model, pin.Model, "model", error=SpecError)
        if limits is not None:
            expect(limits, JointLimits, "limits", error=SpecError)
        called = str(model.name) or UNNAMED if name is None else text(name, "name of a robot", error=SpecError)
        return cls.from_source(
            RobotSource(format="model", name=called, model=model, limits=limits), robot_options(payload, keywords)
        )


def _payload_is_link(source: RobotSource, options: RobotOptions) -> bool:
    """Whether the payload is a link of the generated URDF, and so in the model that is read."""
    return source.spec is not None and options.tool is None and options.inertias is None


def _reading(source: RobotSource, options: RobotOptions) -> Reading:
    """The reading of a source, of any format."""
    lock, arm, folders, name = options.lock or {}, options.arm, tuple(map(str, options.package_dirs)), source.name
    if source.format == "model":
        called = f"Pinocchio model {name!r}"
        return read_model(source.model, called, lock, arm)
    if source.format == "mjcf":
        root = read_mjcf(Path(name)) if source.text is None else parse_mjcf(source.text, name)
        return read_mjcf_arm(root, name, lock, arm)
    if source.spec is not None:
        urdf = urdf_from_spec(source.spec, options.payload if _payload_is_link(source, options) else None)
        return read_arm(urdf, name, lock, arm)
    file, folders = source.file, (*source.package_dirs, *folders)
    if source.format == "library":
        file, shared, part = library_arm(name)
        folders = (shared, *folders)
        if arm is None and part is not None:
            arm = part.first, part.last
    if file is None:
        return replace(read_arm(source.text or "", name, lock, arm), package_dirs=folders)
    return replace(read_arm(read_urdf(file), str(file), lock, arm), package_dirs=mesh_folders(Path(file), folders))


def _mounted(model: pin.Model, mount: pin.SE3) -> pin.Model:
    """The model with its base placed in the world: joints and frames on the base move with it."""
    model = model.copy()
    for joint in range(1, model.njoints):
        if model.parents[joint] == 0:
            model.jointPlacements[joint] = mount * model.jointPlacements[joint]
    for frame in list(model.frames)[1:]:  # the first is the world itself
        if frame.parentJoint == 0:
            frame.placement = mount * frame.placement
    return model


def expect_robot(robot: object, name: str = "robot") -> Robot:
    """Return the argument if it is a `Robot`; raise otherwise.

    Raises:
        ProblemError: the value is no robot; the message names the readers.
    """
    return expect(robot, Robot, name, f"use {READERS}")


def expect_robots(robots: object, name: str) -> tuple[Robot, ...]:
    """The robots of a list.

    Raises:
        ProblemError: it is no list, or has something else in it.
    """
    return each(robots, name, expect_robot)
