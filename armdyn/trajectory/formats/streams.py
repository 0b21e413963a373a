"""Programs that send one target per tick: checks of their numbers, and the head of those in Python.

A program has numbers and quoted texts of the motion only; the rest of it is written here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from armdyn.arguments import number, several
from armdyn.errors import TrajectoryError

if TYPE_CHECKING:
    from armdyn.trajectory.samples import Samples

_EVEN = 1e-6
"""Part of a tick by which stamps may be off even ones."""


@dataclass(frozen=True)
class Stream:
    """A program that sends one row of samples per tick. The last step is as long as the others.

    Attributes:
        payload: mass that the controller is to know [kg]; None: the one that is set on the robot stays.
        payload_com: its centre of mass from the flange, in the flange's axes [m].
    """

    name: ClassVar[str]

    payload: float | None = None
    payload_com: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def load(self) -> tuple[float, list[float]] | None:
        """Mass [kg] and centre of mass [m] of the payload, if one is given.

        Raises:
            TrajectoryError: they are not one number and three.
        """
        if self.payload is None:
            return None
        mass = number(self.payload, "payload", unit="kg", sign="not negative", error=TrajectoryError)
        com = several(self.payload_com, "payload_com", error=TrajectoryError)
        if len(com) != 3:
            raise TrajectoryError(f"payload_com has {len(com)} numbers; it is x, y, z [m]")
        return mass, [number(x, f"payload_com[{i}]", unit="m", error=TrajectoryError) for i, x in enumerate(com)]

    def rate_of(self, samples: Samples, joints: int, rates: Sequence[float]) -> float:
        """Ticks per second of the samples [Hz].

        Args:
            samples: the motion.
            joints: number of the arm's joints.
            rates: rates that the controller takes [Hz].

        Raises:
            TrajectoryError: another number of joints, or other ticks.
        """
        if samples.q.shape[1] != joints:
            raise TrajectoryError(f"the motion has {samples.q.shape[1]} joints; {self.name} is for arms of {joints}")
        for rate in rates:
            if abs(samples.t[:-1] * rate - range(samples.t.size - 1)).max() < _EVEN:
                return rate
        raise TrajectoryError(
            f"samples are not {' or '.join(f'{one:g}' for one in rates)} per second; {self.name} takes these"
        )


def start_tolerance(value: object) -> float:
    """The field `tolerance` of a program: the largest distance of a joint from the start [rad].

    Raises:
        TrajectoryError: it is no positive number.
    """
    return number(value, "tolerance", unit="rad", sign="positive", error=TrajectoryError)


_DISTANCE = '''

def distance(actual, wanted):
    """Largest distance of a joint [rad]."""
    return max(abs(a - b) for a, b in zip(actual, wanted))
'''


def python_head(arm: str, package: str, samples: Samples, constants: Mapping[str, tuple[object, str]]) -> str:
    """Beginning of a Python program: docstring, motion and constants as literals of ASCII, distance of two poses.

    Args:
        arm: name of the arm, in words.
        package: Python package of the robot's interface, to be installed by pip.
        samples: the motion.
        constants: value and remark of each constant, by name.
    """
    lines = [
        f'"""Motion of {samples.t[-1]:.6f} s for {arm}, written by armdyn.',
        "",
        f"    pip install {package}",
        "    python THIS_FILE ROBOT_IP             # refuses unless the arm stands at the start",
        "    python THIS_FILE ROBOT_IP --to-start  # moves there slowly first: that way is not planned",
        "",
        "It was planned on a model. Try it in simulation or at reduced speed first, an emergency stop at hand.",
        '"""',
        "",
        "import argparse",
        "",
        f"NAME = {samples.name!a}",
        f"JOINTS = {list(samples.joint_names)!a}",
        *(f"{name} = {value!r}  # {remark}" for name, (value, remark) in constants.items()),
        "Q = [  # joint positions [rad], one row per tick",
        *(f"    {row}," for row in samples.q.tolist()),
        "]",
    ]
    return "\n".join(lines) + "\n" + _DISTANCE
