"""Python programs for Franka's arms, by panda-python."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from armdyn.errors import TrajectoryError
from armdyn.trajectory.formats.streams import EVENT_REMARK, Stream, python_program, start_tolerance

if TYPE_CHECKING:
    from armdyn.trajectory.samples import Samples

_REST = 0.01
"""Speed of a joint at which an arm counts as at rest [rad/s]: a sample may be a tick off a stop."""


@dataclass(frozen=True)
class PandaPython(Stream):
    """A Python program that follows a motion by panda-python: https://jeanelsner.github.io/panda-py.

    Positions and velocities go to its `JointPosition` controller, a PD controller at 1 kHz over the arm's gravity
    compensation. It refuses an arm with an error or not at the start, and targets outside the arm's joint limits.

    The robot takes a new load without a controller only: of a motion of several pieces the arm settles and pauses at
    each event and each change of the load, where it must be at rest. Loads are added to the end effector that Franka's
    Desk knows.

    Attributes:
        tolerance: largest distance of a joint from the start [rad].
    """

    name: ClassVar[str] = "panda-python"
    suffix: ClassVar[str] = ".py"
    summary: ClassVar[str] = "a Python program for panda-python, 1 kHz"
    rate: ClassVar[float] = 1000.0
    flange: ClassVar[str] = "link8"
    joints: ClassVar[int] = 7

    tolerance: float = 0.01

    def text(self, samples: Samples) -> str:
        """Text of the program.

        Raises:
            TrajectoryError: the motion has not seven joints, is not sampled at 1 kHz, or a field is wrong; or an event
                occurs in motion.
        """
        events = self.events(samples)
        for event in events:
            near = samples.v[max(event.row - 1, 0) : max(event.row, 0) + 1]  # a rest may be between two rows
            if (speed := abs(near).max(axis=1).min()) > _REST:
                raise TrajectoryError(
                    f"{event.kind or 'a new load'} occurs at {samples.t[event.row]:.4g} s, where a joint moves by "
                    f"{speed:.3g} rad/s; a Franka arm takes a new load at rest only"
                )
        constants = {
            "RATE": (self.rate_of(samples, (self.rate,)), "[Hz]"),
            "TOLERANCE": (start_tolerance(self.tolerance), "[rad]"),
            "APPROACH_SPEED": (0.1, "part of the arm's velocity limits"),
            "MOST_LATE": (20, "ticks"),
            "MOST_OFF": (0.1, "[rad]"),
            "SETTLING": (500, "ticks"),
            "EVENTS": ([tuple(one) for one in events], EVENT_REMARK),
            "PAYLOAD": (self.load(), "mass [kg], centre of mass from the flange [m]"),
            "V": (samples.v.tolist(), "joint velocities [rad/s], one row per tick"),
        }
        return python_program("panda_python", "a Franka arm", "panda-python", samples, constants)
