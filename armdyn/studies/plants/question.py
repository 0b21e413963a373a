"""What is asked of many arms: one controller along one reference, and how long each is watched."""

import hashlib
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import expect, number, whole
from armdyn.control.laws.lqr import Lqr
from armdyn.control.loop.law import Controller
from armdyn.control.loop.loop import Loop
from armdyn.control.tracking.run import Run
from armdyn.control.tracking.setup import Setup
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.studies.plants.plants import MAX_ARMS, Plants
from armdyn.studies.plants.rows import RunRow, named
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

FORMAT = "armdyn-monte-carlo-1"


@dataclass(frozen=True, kw_only=True)
class MonteCarloOptions:
    """How many arms, and how each is watched.

    Attributes:
        count: of arms; at most a million.
        duration: how long each is watched [s]; see `track`.
        tolerance: of a joint's distance from the goal, to be settled [rad or m].
        workers: threads; None: one per core. The loop runs in C, without the interpreter's lock.

    Raises:
        ProblemError: something is not positive or not finite.
    """

    count: int = 1000
    duration: float = 1.0
    tolerance: float = 0.005
    workers: int | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "count", whole(self.count, "count", least=1, most=MAX_ARMS))
        object.__setattr__(self, "duration", number(self.duration, "duration", unit="s", sign="positive"))
        object.__setattr__(self, "tolerance", number(self.tolerance, "tolerance", unit="rad", sign="positive"))
        if self.workers is not None:
            object.__setattr__(self, "workers", whole(self.workers, "workers", least=1))


@dataclass(frozen=True, eq=False)
class Question:
    """A controller along a reference, and the arms that it meets.

    Attributes:
        robot: the controller's model.
        reference: the motion that is asked for.
        controller: of the loop.
        plants: what the arms are drawn from.
        loop: how controller and arm are joined.
        options: how many arms, and how each is watched.

    Raises:
        ProblemError: something does not fit the robot.
    """

    robot: Robot
    reference: Trajectory
    controller: Controller = field(default_factory=Lqr)
    plants: Plants = field(default_factory=Plants)
    loop: Loop = field(default_factory=Loop)
    options: MonteCarloOptions = field(default_factory=MonteCarloOptions)

    def __post_init__(self) -> None:
        expect(self.plants, Plants, "plants", "Plants(payload=(0.8, 1.2))").check(expect_robot(self.robot))
        expect(self.options, MonteCarloOptions, "options", "MonteCarloOptions(count=1000)")
        self.setup  # noqa: B018  # made now: what does not fit is refused before there is a file

    @cached_property
    def setup(self) -> Setup:
        """The controller, ready for its reference."""
        options = self.options
        return Setup.of(
            self.robot, self.reference, self.controller, self.loop,
            duration=options.duration, tolerance=options.tolerance,
        )  # fmt: skip

    def plant(self, k: int) -> Robot:
        """Arm number k."""
        return self.plants.draw(k, self.robot.nv).arm(self.robot)

    def run(self, k: int) -> Run:
        """What arm number k does; threads may ask side by side."""
        draw = self.plants.draw(k, self.robot.nv)
        beside = np.concatenate([draw.start, np.zeros(self.robot.nv)])
        setup = replace(self.setup, start=self.setup.start + beside)
        return setup.run(draw.arm(self.robot), draw.noise, f"plant {k}")

    def row(self, k: int) -> RunRow:
        """The same as a row."""
        return RunRow.of(k, self.plants.draw(k, self.robot.nv), self.run(k))

    def description(self) -> dict[str, object]:
        """All that a row depends on, besides its number, as JSON says it.

        Raises:
            ResultError: the controller is no dataclass of numbers.
        """
        limits = self.robot.limits
        effort = np.concatenate([limits.effort_lower, limits.effort_upper])
        options = self.options
        return {
            "format": FORMAT,
            "armdyn": version("armdyn"),
            "robot": {"name": self.robot.name, "model": self.robot.model_hash, "effort": [f"{x:g}" for x in effort]},
            "reference": _digest(self.reference),
            "controller": named(self.controller),
            "loop": asdict(self.loop),
            "plants": named(self.plants),
            "duration": options.duration,
            "tolerance": options.tolerance,
        }


def _digest(motion: Trajectory) -> str:
    """A hash of a motion's samples."""
    digest = hashlib.sha256(b"" if motion.hold == "linear" else motion.hold.encode())
    for array in (motion.t, motion.q, motion.v, motion.tau):
        digest.update(repr(array.shape).encode() + array.tobytes())
    return digest.hexdigest()
