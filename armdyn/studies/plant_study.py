"""Study of one controller along one reference on many random arms: its cases, and their work."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from typing import Any, Self

import numpy as np

from armdyn.arguments import Checked, checked, expect, number, shown, whole
from armdyn.control.laws.lqr import Lqr
from armdyn.control.loop.loop import Controller, Loop
from armdyn.control.tracking.run import Run
from armdyn.control.tracking.track import Setup, expect_own_payload
from armdyn.errors import ResultError
from armdyn.files import attributes
from armdyn.locks import cached_property
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.values.actuator_limits import torque_speed_entry
from armdyn.studies.plants import MAX_ARMS, Plants, PlantSample
from armdyn.studies.rows import StudyRow, Value
from armdyn.studies.study import OwnTask
from armdyn.studies.tasks.task import CaseResult
from armdyn.trajectory import Trajectory

FORMAT = "armdyn-monte-carlo-4"
_MOST = float(np.finfo(float).max)
"""Stands for infinity, which JSON does not have."""
_NUMBERS = ("settled_time", "error_at_end", "peak_error", "peak_velocity", "saturated", "failed_time")


@dataclass(frozen=True, kw_only=True)
class MonteCarloOptions(Checked):
    """Number of arms, and how each is watched.

    Attributes:
        count: number of arms, at most a million.
        duration: time for which each is watched [s]; see `track`.
        tolerance: of a joint's distance from the goal, to be settled [rad or m].
        workers: threads; None: one per core. The loop runs in C, without the interpreter's lock.

    Raises:
        ProblemError: a number is not positive or not finite.
    """

    count: int = checked(whole, 1000, least=1, most=MAX_ARMS)
    duration: float = checked(number, 1.0, unit="s", sign="positive")
    tolerance: float = checked(number, 0.005, unit="rad or m", sign="positive")
    workers: int | None = checked(whole, None, least=1)


@dataclass(frozen=True)
class PlantRow:
    """Result of one arm; the numbers are those of `Run`, None where there is none.

    Attributes:
        k: number of the arm.
        sample: its differences from the model.
        status: see `Run`.
        settled_time: [s].
        error_at_end: [rad or m].
        peak_error: [rad or m].
        peak_velocity: [-].
        saturated: [-].
        failed_time: [s].
        overshoot: [rad or m], shape (nv,).
        limits_exceeded: in words, see `Run`.
    """

    k: int
    sample: PlantSample
    status: str
    settled_time: float | None
    error_at_end: float | None
    peak_error: float | None
    peak_velocity: float | None
    saturated: float | None
    failed_time: float | None
    overshoot: tuple[float, ...]
    limits_exceeded: tuple[str, ...] = ()

    @classmethod
    def of(cls, row: StudyRow, sample: PlantSample) -> Self:
        """The arm's row of the study."""
        facts: dict[str, Any] = {name: row.facts[name] for name in _NUMBERS}
        facts |= {name: tuple(row.facts[name]) for name in ("overshoot", "limits_exceeded")}
        return cls(k=row.k, sample=sample, status=row.status, **facts)


@dataclass(frozen=True, eq=False)
class PlantStudy(OwnTask):
    """A controller along a reference on random arms; also the task of its cases.

    Attributes:
        robot: the controller's model.
        reference: motion to follow.
        controller: of the loop.
        plants: ranges that the arms are drawn from.
        loop: connection of controller and arm.
        options: number of arms, and how each is watched.

    Raises:
        ProblemError: an argument does not fit the robot.
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
        self.setup  # noqa: B018  # made now: wrong arguments are refused before there is a file
        expect_own_payload(self.robot, self.reference)

    def __len__(self) -> int:
        return self.options.count

    @cached_property
    def setup(self) -> Setup:
        """The controller, ready for its reference."""
        options = self.options
        return Setup.of(
            self.robot, self.reference, self.controller, self.loop,
            duration=options.duration, tolerance=options.tolerance,
        )  # fmt: skip

    def sample(self, k: int) -> PlantSample:
        """Differences of arm k from the model."""
        return self.plants.sample(k, self.robot.nv)

    def plant(self, k: int) -> Robot:
        """Arm number k."""
        return self.sample(k).arm(self.robot, self.plants.likely)

    def run(self, k: int) -> Run:
        """Run arm number k; threads may call this at the same time."""
        return self._run(self.sample(k), f"plant {k}")

    def parameters(self, k: int) -> dict[str, Value]:
        """Differences of arm k from the model, as JSON."""
        return {name: list(x) if isinstance(x, tuple) else x for name, x in asdict(self.sample(k)).items()}

    def work(self, settings: Mapping[str, Value], guess: bytes = b"", revisit: bool = False) -> CaseResult:
        """Run one arm."""
        given: Any = {name: tuple(x) if isinstance(x, list) else x for name, x in settings.items()}
        run = self._run(PlantSample(**given), "plant")
        facts = attributes(run, *_NUMBERS, "limits_exceeded")
        facts["overshoot"] = np.nan_to_num(run.overshoot, nan=_MOST, posinf=_MOST).tolist()
        return CaseResult(status=str(run.status), good=run.settled, message=run.message, facts=facts)

    def description(self) -> dict[str, object]:
        """The inputs of a row, besides its number, as JSON.

        Raises:
            ResultError: the controller is no dataclass of numbers.
        """
        return {
            "format": FORMAT,
            "armdyn": version("armdyn"),
            "robot": identity(self.robot),
            "reference": digest(self.reference),
            "controller": named(self.controller),
            "loop": asdict(self.loop),
            "plants": named(replace(self.plants, likely=())),
            "likely": [one.model_hash for one in self.plants.likely],
            "duration": self.options.duration,
            "tolerance": self.options.tolerance,
        }

    def _run(self, sample: PlantSample, name: str) -> Run:
        offset = np.concatenate([sample.start, np.zeros(self.robot.nv)])
        setup = replace(self.setup, start=self.setup.start + offset)
        return setup.run(sample.arm(self.robot, self.plants.likely), sample.noise, name)


def identity(robot: Robot) -> dict[str, object]:
    """The robot's identity in a study's file: name, model hash, torque limits, as JSON values."""
    effort = np.concatenate([robot.limits.effort_lower, robot.limits.effort_upper])
    falling = torque_speed_entry(robot.limits.actuators)
    facts = {"name": robot.name, "model": robot.model_hash, "effort": [f"{x:g}" for x in effort]}
    return facts | ({"torque_speed": falling} if falling else {})


def digest(motion: Trajectory) -> str:
    """Checksum of a motion's samples."""
    found = hashlib.sha256(b"" if motion.hold == "linear" else motion.hold.encode())
    for array in (motion.t, motion.q, motion.v, motion.tau):
        found.update(repr(array.shape).encode() + array.tobytes())
    return found.hexdigest()


def named(value: object) -> dict[str, object]:
    """A dataclass as JSON: its class and its fields.

    Raises:
        ResultError: the value has no JSON form that distinguishes it from others of its class.
    """
    if not hasattr(value, "__dataclass_fields__"):
        raise ResultError(
            f"rows on disk say which {type(value).__name__} they are of: make it a dataclass, or give no file"
        )
    own = {field: getattr(value, field) for field in value.__dataclass_fields__}
    plain = json.loads(json.dumps(own, default=_plain))
    return {"class": type(value).__name__, **plain}


def _plain(value: object) -> object:
    if hasattr(value, "__dataclass_fields__"):
        return named(value)
    array = np.asarray(value)
    if array.dtype == object:
        raise ResultError(f"rows on disk describe their study in numbers, unlike {shown(value)}: give no file")
    return array.tolist()
