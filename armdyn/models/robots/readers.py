"""Arms from what is no URDF: Pinocchio's models, and MJCF."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import pinocchio as pin

from armdyn.arguments import expect, path, several, shown, text
from armdyn.errors import SpecError
from armdyn.models.mjcf.document import check_mjcf_text, parse_mjcf, read_mjcf
from armdyn.models.mjcf.reading import read_mjcf_arm
from armdyn.models.reading.from_pinocchio import read_model
from armdyn.models.reading.urdf_arm import Reading, check_inertia, joint_limits
from armdyn.models.reading.urdf_xml import file_path
from armdyn.models.robots.arm import Arm
from armdyn.models.values.joint_limits import JointLimits
from armdyn.models.values.spec import Payload

UNNAMED = "model"
"""What a robot is called whose model has no name."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelReaders(Arm):
    """An arm that may come from a model: it then has no URDF, so no geometry, and is drawn as rods."""

    @classmethod
    def from_model(
        cls,
        model: pin.Model,
        limits: JointLimits | None = None,
        name: str | None = None,
        payload: Payload | None = None,
        lock: Mapping[str, float] | None = None,
        arm: tuple[str, str] | None = None,
    ) -> Self:
        """An arm from a Pinocchio model that was built or loaded elsewhere, and stays as it is.

        Its friction is what the model has; `with_friction(0, 0)` takes it away. Nothing is known of its geometry: it
        is drawn as rods, and obstacles cannot be given.

        Args:
            model: with joints that turn or slide along one axis; others are locked, or not in `arm`.
            limits: of the joints that move, in the model's order; None: the model's own.
            name: of the robot; None: the model's.
            payload: see `Robot.from_urdf`.
            lock: see `Robot.from_urdf`; a joint of several coordinates at 0, which is its neutral.
            arm: see `Robot.from_urdf`; a frame of the model stands for a link.

        Raises:
            UnsupportedJointError: a moving joint is none of those; names it.
            UrdfError: the model is not physical.
            SpecError: a limit, a lock, the arm or the payload does not fit it.
        """
        expect(model, pin.Model, "model", error=SpecError)
        if limits is not None:
            expect(limits, JointLimits, "limits", error=SpecError)
        called = str(model.name) or UNNAMED if name is None else text(name, "name of a robot", error=SpecError)
        source = f"Pinocchio model {called!r}"
        reading = read_model(model, source, expect_locks(lock), expect_ends(arm))
        return cls._of_reading(reading, limits or joint_limits(reading.model), called, source, payload)

    @classmethod
    def from_mjcf(
        cls,
        path: str | os.PathLike[str],
        payload: Payload | None = None,
        lock: Mapping[str, float] | None = None,
        arm: tuple[str, str] | None = None,
    ) -> Self:
        """An arm from a file in MuJoCo's format, read by Pinocchio's own parser.

        Torque limits are those of the actuators, see `mjcf.actuators.effort_limits`. MJCF has no velocity limits:
        they are infinite unless `with_limits` or the problem gives some. Friction and armature are the file's.
        Tendons, contacts and what actuators do with their controls are left out.

        Args:
            path: the file; what it includes is in its folder or below.
            payload: see `Robot.from_urdf`.
            lock: see `Robot.from_urdf`; also free joints, whose bodies then stand where they are.
            arm: see `Robot.from_urdf`; bodies and sites are its links. Bodies with a free joint then stand still.

        Raises:
            UrdfError: the file cannot be read, is not physical, or needs what armdyn or this Pinocchio does not know.
            UnsupportedJointError: a moving joint is free, a ball, has a spring, or is coupled with another.
            SpecError: a lock, the arm or the payload does not fit the robot.
        """
        file = file_path(path, "MJCF", "Robot.from_mjcf_string")
        reading = read_mjcf_arm(read_mjcf(file), str(file), expect_locks(lock), expect_ends(arm))
        return cls._of_reading(reading.arm, reading.limits, str(reading.arm.model.name), str(file), payload)

    @classmethod
    def from_mjcf_string(
        cls,
        text: str,
        payload: Payload | None = None,
        lock: Mapping[str, float] | None = None,
        arm: tuple[str, str] | None = None,
        source: str = "MJCF text",
    ) -> Self:
        """An arm from the text of an MJCF, which includes nothing; else as `from_mjcf`.

        Args:
            text: the MJCF.
            payload: see `Robot.from_urdf`.
            lock: see `from_mjcf`.
            arm: see `from_mjcf`.
            source: what messages call it.

        Raises:
            UrdfError: see `from_mjcf`.
            UnsupportedJointError: see `from_mjcf`.
            SpecError: see `from_mjcf`.
        """
        check_mjcf_text(text, source)
        reading = read_mjcf_arm(parse_mjcf(text, source), source, expect_locks(lock), expect_ends(arm))
        return cls._of_reading(reading.arm, reading.limits, str(reading.arm.model.name), source, payload)

    @classmethod
    def _of_reading(
        cls, reading: Reading, limits: JointLimits, name: str, source: str, payload: Payload | None
    ) -> Self:
        """The robot of a model whose friction is its own."""
        robot = cls(
            name=name,
            model=reading.model,
            limits=limits,
            joint_names=tuple(list(reading.model.names)[1:]),
            urdf="",
            source=source,
            locked=reading.locked,
            tip=reading.tip,
        )
        robot = robot._carrying(payload)
        check_inertia(robot.model, source)
        return robot.with_friction("urdf", "urdf")


def expect_locks(lock: Mapping[str, float] | None) -> Mapping[str, float]:
    """Joints to lock, and where; who knows the joints knows whether there are such."""
    if lock is None:
        return {}
    return expect(lock, Mapping, "lock", "joint name to position [rad or m]", error=SpecError)  # type: ignore[type-abstract]


def expect_ends(arm: tuple[str, str] | None) -> tuple[str, str] | None:
    """First and last joint or link of an arm."""
    if arm is None:
        return None
    ends = several(arm, "arm", error=SpecError)
    if len(ends) != 2 or not all(isinstance(end, str) for end in ends):
        raise SpecError(f"arm is {shown(arm)}; it must be (first, last), each the name of a joint or a link")
    return str(ends[0]), str(ends[1])


def expect_folders(package_dirs: Sequence[str | os.PathLike[str]]) -> tuple[str, ...]:
    """Where meshes are."""
    given = several(package_dirs, "package_dirs", error=SpecError)
    return tuple(path(folder, f"package_dirs[{i}]", error=SpecError) for i, folder in enumerate(given))
