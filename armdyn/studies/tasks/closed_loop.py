"""Settings that all study tasks with a controller share: the controller, its loop, and the motion that it follows."""

import inspect
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self, TypeVar

from armdyn.arguments import Checked, checked, expect, number, one_of
from armdyn.control.laws.registry import CONTROLLERS
from armdyn.control.loop.loop import Controller, Loop
from armdyn.control.loop.references import ramp
from armdyn.errors import ProblemError
from armdyn.files import attributes
from armdyn.models.robots.robot import Robot
from armdyn.optimal import MinimumTimeOptions, Status, solve_minimum_time
from armdyn.parsing.toml import Table
from armdyn.studies.plants import Plants
from armdyn.studies.problems import ArmProblems
from armdyn.studies.rows import Value
from armdyn.studies.settings import SIGNS
from armdyn.studies.tasks.task import INTERRUPTED, CaseResult, Neighbours
from armdyn.trajectory import Trajectory

_REMEMBERED = 16
"""References that a process keeps."""
_references: dict[str, Trajectory] = {}

_WITHOUT = {"ramp": ("reserve", "velocity_reserve"), "minimum-time": ("ramp",)}
"""Settings without a meaning for each reference."""
Options = TypeVar("Options")
REFERENCES = tuple(_WITHOUT)


@dataclass(frozen=True, kw_only=True)
class ClosedLoopTask(Checked):
    """A controller along a reference.

    Attributes:
        problems: problem of each case.
        controller: "pid" (settings kp, ki, kd), "computed-torque" (bandwidth) or "lqr" (position, velocity, integral).
        form: meaning of the output of "pid": "torque", "computed_torque" or "acceleration"; None: the task's default.
        reference: "ramp" (setting ramp [s]) or "minimum-time".
        duration: time for which an arm is watched [s].
        tolerance: of a joint's distance from the goal, to be settled [rad or m].
    """

    name: ClassVar[str]
    signs: ClassVar = SIGNS | {
        **{name: sign for kind in CONTROLLERS.values() for name, sign in kind.settings.items()},
        "ramp": "positive", "rate": "positive", "delay": "not negative", "cutoff": "positive", "noise": "not negative",
    }  # fmt: skip
    outcomes: ClassVar[tuple[str, str]] = ("settled_time_s", "peak_error")
    neighbours: ClassVar[Neighbours] = "off"
    keys: ClassVar[tuple[str, ...]] = ("controller", "form", "reference", "duration", "tolerance")
    """Keys of the task's table."""

    problems: ArmProblems
    controller: str = checked(one_of, "lqr", known=tuple(CONTROLLERS))
    form: str | None = None
    reference: str = checked(one_of, "minimum-time", known=REFERENCES)
    duration: float = checked(number, 2.0, unit="s", sign="positive")
    tolerance: float = checked(number, 0.005, unit="rad or m", sign="positive")

    def __post_init__(self) -> None:
        super().__post_init__()
        CONTROLLERS[self.controller].with_form(self.form, "form")

    @classmethod
    def read(cls, table: Table, problems: ArmProblems, names: Mapping[str, Table]) -> Self:
        """The task that its table of a study file describes.

        Args:
            table: of the task.
            problems: of the cases.
            names: tables of the settings that are fixed or vary, by their names.

        Raises:
            ProblemError: a key is unknown or wrong, or a setting without a meaning; with the line.
        """
        table.only(cls.keys)
        given: dict[str, Any] = dict(table.values)
        with table.locating_errors():
            task = cls(problems=problems, **given)
        for name, where in names.items():
            with where.locating_errors():
                task.check([name])
        with table.locating_errors():
            task.check_complete(names)
        return task

    def description(self) -> dict[str, object]:
        """The task as JSON."""
        return {"task": self.name, **self.problems.description(), **attributes(self, *self.keys)}

    def work(self, settings: Mapping[str, Value], guess: bytes = b"", revisit: bool = False) -> CaseResult:
        """Do one case: check its settings, and run it."""
        settings = self.problems.with_fixed(settings)
        self.check(settings)
        self.check_complete(settings)
        motion = self.reference_of(settings)
        return motion if isinstance(motion, CaseResult) else self.run(settings, motion)

    def run(self, settings: Mapping[str, Value], motion: Any) -> CaseResult:
        """Work on a case with all of its settings, and the motion of `reference_of`."""
        raise NotImplementedError

    @property
    def chosen(self) -> tuple[str, ...]:
        """Settings that the task chooses itself."""
        return ()

    @property
    def required(self) -> tuple[str, ...]:
        """Settings that every case must have."""
        kind = CONTROLLERS[self.controller]
        return (*(kind.settings if kind.required else ()), *(("ramp",) if self.reference == "ramp" else ()))

    def check_complete(self, names: Collection[str]) -> None:
        """Refuse settings of which a required one is missing.

        Raises:
            ProblemError: one is.
        """
        if missing := [name for name in self.required if name not in names]:
            task = f"controller {self.controller!r} with reference {self.reference!r}"
            raise ProblemError(f"{task} needs {', '.join(missing)}, in [fixed] or [vary]")

    def check(self, names: Collection[str]) -> None:
        """Refuse settings of another controller or another reference, and those that the task chooses.

        Raises:
            ProblemError: there is one.
        """
        for name in self.chosen:
            if name in names:
                raise ProblemError(f"{name} is chosen by task {self.name!r}: leave it out")
        for name in _WITHOUT[self.reference]:
            if name in names:
                raise ProblemError(f"{name} does not apply to reference {self.reference!r}")
        known = CONTROLLERS[self.controller].settings
        for other, kind in CONTROLLERS.items():
            for name in kind.settings:
                if name in names and name not in known:
                    raise ProblemError(f"{name} is a setting of controller {other!r}, not of {self.controller!r}")

    def controller_of(self, settings: Mapping[str, Value]) -> Controller:
        """The controller with the gains of a case."""
        kind = CONTROLLERS[self.controller].with_form(self.form, "form")
        return kind.make(**{name: float(settings[name]) for name in kind.settings if name in settings})

    def loop_of(self, settings: Mapping[str, Value]) -> Loop:
        """The loop of a case."""
        kinds: dict[str, Callable[[Any], Any]] = {"rate": float, "cutoff": float, "noise": float, "delay": round}
        return Loop(**{name: kind(float(settings[name])) for name, kind in kinds.items() if name in settings})

    def reference_of(self, settings: Mapping[str, Value]) -> Any:
        """The motion to follow, or the result of a case that has none; each process solves a fastest one once."""
        if self.reference == "ramp":
            return ramp(self.problems.robot(settings), *self.problems.ends(settings), float(settings["ramp"]))
        key = self.problems.key({name: settings[name] for name in settings if name not in self.signs or name in SIGNS})
        if key not in _references:
            solution = solve_minimum_time(self.problems.problem(settings), MinimumTimeOptions(workers=1))
            if not solution.usable:
                status = INTERRUPTED if solution.status is Status.INTERRUPTED else "no_reference"
                return CaseResult(status=status, message=f"no motion to follow: {solution.message}")
            if len(_references) >= _REMEMBERED:
                _references.clear()
            _references[key] = solution.trajectory
        return _references[key]


def options_of(kind: Callable[..., Options], given: Mapping[str, Any], name: str, **others: Any) -> Options:
    """A value of options from a table of a study file.

    Raises:
        ProblemError: an option is unknown or wrong.
    """
    known = set(inspect.signature(kind).parameters) - others.keys()
    if unknown := expect(given, dict, name).keys() - known:
        raise ProblemError(f"{name}: no option {min(unknown)!r}; known: {', '.join(sorted(known))}")
    return kind(**given, **others)


def plants_of(given: Mapping[str, Any], robot: Robot) -> Plants:
    """Ranges of random arms; the payload of a robot without one does not vary by default."""
    loaded = robot.payload is not None and robot.payload.mass > 0
    return options_of(Plants, given if loaded else {"payload": (1.0, 1.0), **given}, "plants").check(robot)
