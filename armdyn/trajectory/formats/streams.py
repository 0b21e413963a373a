"""Programs that send one target per tick: checks of their numbers, and the head of those in Python.

A program has numbers and quoted texts of the motion only; the rest of it is here and in `programs/`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from armdyn.arguments import Checked, checked, each, number
from armdyn.errors import TrajectoryError
from armdyn.files import as_json

if TYPE_CHECKING:
    from armdyn.trajectory.pieces import Load
    from armdyn.trajectory.samples import Samples

_EVEN = 1e-6
"""Part of a tick by which stamps may be off even ones."""


class PieceStart(NamedTuple):
    """Start of a piece, as a program has it."""

    row: int
    """Of the samples; -1: before the way to the start, of a load that the arm carries there already."""
    kind: str
    """`Piece.event`."""
    name: str
    """`Piece.name`."""
    load: tuple[float, list[float], list[float]] | None
    """Mass [kg], centre of mass [m] and Ixx, Iyy, Izz, Ixy, Ixz, Iyz [kg m²] in the flange's frame; None: it stays."""


def _centre(value: object, name: str) -> tuple[float, ...]:
    """Centre of mass of a payload, three numbers."""
    com = each(value, name, number, unit="m", error=TrajectoryError)
    if len(com) != 3:
        raise TrajectoryError(f"{name} has {len(com)} numbers; it is x, y, z [m]")
    return com


@dataclass(frozen=True)
class Stream(Checked):
    """A program that sends one row of samples per tick. The last step is as long as the others.

    Of a motion of several pieces the program adds their loads to the payload that is set on the robot, such as its
    gripper's, and calls a function at each event, into which the user writes the gripper's commands.

    Attributes:
        payload: mass set in the controller [kg]; None: the controller's own setting stays.
        payload_com: its centre of mass from the flange, in the flange's axes [m].

    Raises:
        TrajectoryError: a field is no such number, or out of its range.
    """

    name: ClassVar[str]
    flange: ClassVar[str]
    """End of the name of the flange's frame, in whose axes the controller takes loads."""
    arm: ClassVar[str]
    """The arms whose controllers run the program, in words."""
    joints: ClassVar[int]
    """Number of joints of the arms whose controllers run the program."""
    own: ClassVar[tuple[str, ...]]
    """Regular expressions for the ends of their joints' names."""
    fastest: ClassVar[float]
    """Largest speed of a joint of any of these arms [rad/s]."""

    payload: float | None = checked(number, None, unit="kg", sign="not negative", error=TrajectoryError)
    payload_com: tuple[float, ...] = checked(_centre, (0.0, 0.0, 0.0))

    def load(self) -> tuple[float, list[float]] | None:
        """Mass [kg] and centre of mass [m] of the payload, if one is given."""
        return None if self.payload is None else (self.payload, list(self.payload_com))

    def events(self, samples: Samples) -> list[PieceStart]:
        """The pieces at whose start something occurs: an event, or a change of the load.

        Raises:
            TrajectoryError: a load is not known in the flange's frame.
        """
        found, before = [], None
        for row, piece in zip(samples.piece_rows, samples.pieces, strict=True):
            load = piece.load
            changes = load is not None and load != before and (load.mass > 0 or before is not None)
            if changes or piece.event:
                row = row if row or piece.event else -1
                note = self._about_flange(load) if load is not None and changes else None
                found.append(PieceStart(row, piece.event, piece.name, note))
            before = load or before
        return found

    def _about_flange(self, load: Load) -> tuple[float, list[float], list[float]]:
        own = load.at_flange or load
        if own.mass and not (own.frame == self.flange or own.frame.endswith(f"_{self.flange}")):
            raise TrajectoryError(
                f"a load of {load.mass:g} kg is in the frame {own.frame!r}; {self.name} takes it in that of the "
                f"flange, {self.flange}: load_of(robot) gives both where the robot's model has that frame"
            )
        return own.mass, as_json(own.com), as_json(own.inertia)

    @classmethod
    def check_joints(cls, count: int) -> None:
        """Refuse motions of arms with another number of joints.

        Raises:
            TrajectoryError: the rate is another one.
        """
        if count != cls.joints:
            raise TrajectoryError(f"the motion has {count} joints; {cls.name} is for arms of {cls.joints}")

    @classmethod
    def check_arm(cls, samples: Samples) -> None:
        """Refuse motions that are hardly those of such an arm: by names of their joints, and speeds.

        Raises:
            TrajectoryError: there are such names, or speeds.
        """
        cls.check_joints(samples.q.shape[1])
        for name, own, speed in zip(samples.joint_names, cls.own, abs(samples.v).max(axis=0), strict=False):
            why = f"moves at {speed:.3g} rad/s, and no joint of one is faster than {cls.fastest:.3g}"
            if (foreign := re.fullmatch(f".*{own}", name) is None) or speed > cls.fastest:
                why = "is no name of one's" if foreign else why
                raise TrajectoryError(
                    f"{cls.name} is a program for {cls.arm}, and joint {name!r} {why}; --preset checks the motion "
                    "against the arm's own limits, whatever its joints are called"
                )

    def rate_of(self, samples: Samples, rates: Sequence[float]) -> float:
        """Ticks per second of the samples [Hz].

        Args:
            samples: the motion.
            rates: rates that the controller takes [Hz].

        Raises:
            TrajectoryError: another number of joints, or other ticks.
        """
        self.check_joints(samples.q.shape[1])
        for rate in rates:
            if abs(samples.t[:-1] * rate - range(samples.t.size - 1)).max() < _EVEN:
                return rate
        raise TrajectoryError(
            f"samples are not {' or '.join(f'{one:g}' for one in rates)} per second; {self.name} takes these"
        )


EVENT_REMARK = "tick, kind, name; mass [kg], centre of mass from the flange [m], inertia [kg m^2] of the load"
"""Of `PieceStart` in a program."""


def program(name: str) -> str:
    """A file of `programs/`: the parts of programs that no motion changes."""
    return Path(__file__).with_name("programs").joinpath(f"{name}.txt").read_text("utf-8")


def python_program(
    name: str, arm: str, package: str, samples: Samples, constants: Mapping[str, tuple[object, str]]
) -> str:
    """A Python program: docstring, motion and constants as literals of ASCII, the way to the start, and the rest.

    Args:
        name: of the rest in `programs/`.
        arm: name of the arm, in words.
        package: Python package of the robot's interface, to be installed by pip.
        samples: the motion.
        constants: value and remark of each constant, by name.
    """
    head = program("python_head").format(
        duration=samples.t[-1],
        arm=arm,
        package=package,
        name=samples.name,
        joints=list(samples.joint_names),
        constants="\n".join(f"{key} = {value!a}  # {remark}" for key, (value, remark) in constants.items()),
        rows="\n".join(f"    {row}," for row in samples.q.tolist()),
    )
    return "\n\n\n".join([head.rstrip(), program("python_start").rstrip(), program(name)])
