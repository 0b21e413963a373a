"""A case's work: a controller that has an arm follow a motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from armdyn.arguments import number, one_of
from armdyn.control.laws.computed_torque import ComputedTorque
from armdyn.control.laws.lqr import Lqr
from armdyn.control.laws.pid import Pid, PidGains
from armdyn.control.loop.law import Controller
from armdyn.control.loop.loop import Loop
from armdyn.control.loop.references import ramp
from armdyn.control.tracking.track import track
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot
from armdyn.optimal import MinimumTimeOptions, MinimumTimeProblem, Solution, Status, solve_minimum_time
from armdyn.studies.sweeps.tasks.minimum_time import MinimumTime
from armdyn.studies.sweeps.tasks.settings import SIGNS, ArmRecipe, Value, arm_of, asked_of, kept
from armdyn.studies.sweeps.tasks.task import INTERRUPTED, Outcome, finite
from armdyn.trajectory import Trajectory

_REMEMBERED = 16
"""References that a process keeps."""
_references: dict[tuple[object, ...], Trajectory] = {}

_OWN = {"pid": ("kp", "ki", "kd"), "computed-torque": ("bandwidth",), "lqr": ("position", "velocity", "integral")}
"""Settings of each controller."""
_REFERENCES = {"ramp": ("reserve", "velocity_reserve"), "minimum-time": ("ramp",)}
"""Settings that say nothing of a reference."""


@dataclass(frozen=True, kw_only=True)
class Tracking:
    """A controller that has an arm follow a motion.

    Attributes:
        arms: of the study, at least one.
        fixed: settings that do not vary.
        controller: "pid" (settings kp, ki, kd), "computed-torque" (bandwidth) or "lqr" (position, velocity, integral).
        reference: "ramp" (setting ramp [s]) or "minimum-time" (settings as `MinimumTime` has them).
        duration: how long the arm is watched [s].
        tolerance: of a joint's distance from the goal, to be settled [rad or m].
    """

    signs = SIGNS | {
        "kp": "any", "ki": "any", "kd": "any", "bandwidth": "positive", "position": "positive",
        "velocity": "not negative", "integral": "not negative", "ramp": "positive", "rate": "positive",
        "delay": "not negative", "cutoff": "positive", "noise": "not negative", "plant_payload": "not negative",
        "plant_damping": "not negative", "plant_friction": "not negative",
    }  # fmt: skip
    """Its settings."""

    arms: tuple[ArmRecipe, ...]
    fixed: Mapping[str, Value] = field(default_factory=dict)
    controller: str = "lqr"
    reference: str = "minimum-time"
    duration: float = 2.0
    tolerance: float = 0.005

    uses_neighbours = False

    def __post_init__(self) -> None:
        one_of(self.controller, tuple(_OWN), "controller")
        one_of(self.reference, ("ramp", "minimum-time"), "reference")
        number(self.duration, "duration", unit="s", sign="positive")
        number(self.tolerance, "tolerance", unit="rad", sign="positive")

    def work(self, settings: Mapping[str, Value], guess: bytes) -> Outcome:
        """Run it."""
        own = {**self.fixed, **settings}
        _check_own(self.controller, self.reference, own)
        recipe = arm_of(self.arms, own)
        robot = recipe.fitted(own)
        motion = self._reference(recipe, robot, own)
        if not isinstance(motion, Trajectory):
            status = INTERRUPTED if motion.status is Status.INTERRUPTED else "no_reference"
            return Outcome(status=status, message=f"no motion to follow: {motion.message}")
        joined: dict[str, Any] = {name: float(own[name]) for name in ("rate", "cutoff", "noise") if name in own}
        if "delay" in own:
            joined["delay"] = round(float(own["delay"]))
        run = track(
            robot, motion, _controller(self.controller, own), self._plant(recipe, robot, own), Loop(**joined),
            self.duration, tolerance=self.tolerance,
        )  # fmt: skip
        facts: dict[str, Any] = {"reference_s": motion.duration}
        facts |= {f"{name}_s": finite(getattr(run, name)) for name in ("settled_time", "went_wrong")}
        facts |= {name: finite(getattr(run, name)) for name in ("error_at_end", "peak_error", "saturated")}
        facts["overshoot"] = finite(float(np.max(run.overshoot)))
        return Outcome(status=str(run.status), good=run.settled, message=run.message, facts=facts)

    def _reference(self, recipe: ArmRecipe, robot: Robot, own: Mapping[str, Value]) -> Trajectory | Solution:
        poses = recipe.poses(own, robot.joint_names)
        if self.reference == "ramp":
            if "ramp" not in own:
                raise ProblemError("a ramp takes how long? Fix or vary the setting ramp [s]")
            return ramp(robot, poses["q_start"], poses["q_goal"], float(own["ramp"]))
        says = tuple(sorted((name, value) for name, value in own.items() if name in MinimumTime.signs))
        # A process may work on several studies, whose arms and poses may have the same names.
        asked = (recipe.source, recipe.text, *map(tuple, poses.values()), says)
        if asked not in _references:  # gains vary, the motion stays: it is solved once by everyone who works
            problem = MinimumTimeProblem(robot, **poses, **kept(own))
            solution = solve_minimum_time(problem, MinimumTimeOptions(workers=1))
            if not solution.usable:
                return solution
            if len(_references) >= _REMEMBERED:
                _references.clear()
            _references[asked] = solution.trajectory
        return _references[asked]

    def _plant(self, recipe: ArmRecipe, robot: Robot, own: Mapping[str, Value]) -> Robot:
        """The arm that moves: the model, unless a setting says otherwise."""
        told = {name: f"plant_{name}" for name in ("payload", "damping", "friction") if f"plant_{name}" in own}
        return recipe.fitted({**own, **{name: own[other] for name, other in told.items()}}) if told else robot

    def asked(self) -> dict[str, object]:
        """What it is, as JSON says it."""
        names = ("controller", "reference", "duration", "tolerance")
        return asked_of("track", self.arms, self.fixed) | {name: getattr(self, name) for name in names}


def check_settings(controller: str, reference: str, names: Sequence[str]) -> None:
    """Refuse a setting that says nothing: of another controller, or of another reference.

    Raises:
        ProblemError: one is.
    """
    for name in _REFERENCES[reference]:
        if name in names:
            raise ProblemError(f"{name} says nothing of reference {reference!r}")
    for other, own in _OWN.items():
        for name in own:
            if name in names and other != controller:
                raise ProblemError(f"{name} is a setting of controller {other!r}, not of {controller!r}")


def _check_own(controller: str, reference: str, own: Mapping[str, Value]) -> None:
    check_settings(controller, reference, list(own))
    if controller == "pid" and (missing := [name for name in _OWN["pid"] if name not in own]):
        raise ProblemError(f"controller 'pid' needs {', '.join(missing)}: fix or vary them")


def _controller(name: str, own: Mapping[str, Value]) -> Controller:
    given = {setting: float(own[setting]) for setting in _OWN[name] if setting in own}
    if name == "pid":
        return Pid(PidGains(**given))
    return Lqr(**given) if name == "lqr" else ComputedTorque(**given)
