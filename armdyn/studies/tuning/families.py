"""Families of controllers: bounded parameters and the controller of each choice."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import Checked, checked, each, expect, flag, function, interval, number, one_of, text
from armdyn.arrays import Array
from armdyn.control.laws.computed_torque import ComputedTorque
from armdyn.control.laws.lqr import Lqr
from armdyn.control.laws.pid import FORMS, Form, Pid, PidGains
from armdyn.control.loop.loop import Controller
from armdyn.control.loop.references import ramp
from armdyn.dynamics import Dynamics
from armdyn.errors import ProblemError
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.values.per_joint import one_or_each
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

Values = Mapping[str, float]
"""Parameters by their names."""

_PID = {"kp": (100.0, 30_000.0), "ki": (1.0, 100_000.0), "kd": (10.0, 400.0)}
"""Bounds for a joint of inertia one: 10 to 170 rad/s, about the limit of 1 kHz and a tick of delay; an integral from
slow to unstable."""


@dataclass(frozen=True)
class Parameter(Checked):
    """A number to choose; its logarithm is searched.

    Attributes:
        name: of it.
        low: the least.
        high: the greatest.

    Raises:
        ProblemError: not positive, or not in order.
    """

    name: str
    low: float = checked(number, sign="positive")
    high: float = checked(number, sign="positive")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low >= self.high:
            raise ProblemError(f"low of {self.name} is {self.low:g}, high {self.high:g}; low must be the less")

    def _of_whom(self) -> str:
        return f" of {text(self.name, 'name of a parameter')}"


@brief
@dataclass(frozen=True, eq=False)
class ControllerFamily(Checked):
    """Controllers that differ in some numbers.

    Attributes:
        name: in messages.
        parameters: to be chosen.
        controller: of the tuned values, by name. It may take others, too: all that a search tunes.

    Raises:
        ProblemError: no parameters, or two of one name.
    """

    name: str = checked(text, name="name of a family")
    parameters: tuple[Parameter, ...] = checked(
        each, of=expect, kind=Parameter, hint='such as Parameter("kp", 1.0, 100.0)'
    )
    controller: Callable[[Values], Controller] = checked(function)

    def __post_init__(self) -> None:
        super().__post_init__()
        names = [one.name for one in self.parameters]
        if not names or len(set(names)) < len(names):
            raise ProblemError(f"parameters are {', '.join(names) or 'none'}; expected one or more, of different names")

    @classmethod
    def pid(
        cls,
        robot: Robot,
        q_goal: ArrayLike,
        *,
        form: Form = "computed_torque",
        feedforward: bool = True,
        gravity: bool = False,
        shared: bool = True,
    ) -> ControllerFamily:
        """PID controllers, see `Pid`.

        Bounds of the gains are those of a joint of inertia one; with the form "torque" they are multiplied by each
        joint's inertia at the goal.

        Args:
            robot: the controller's model.
            q_goal: where it ends [rad or m], shape (nv,).
            form: see `Pid`.
            feedforward: see `Pid`.
            gravity: see `Pid`.
            shared: all joints have the same gains, those of the form "torque" times each one's inertia. Gains of
                each joint take a longer search.

        Raises:
            ProblemError: something does not fit the robot, or each other.
        """
        one_of(form, FORMS, "form")
        nv = expect_robot(robot).nv
        inertia = np.diag(Dynamics(robot).crba(pose_given(robot, q_goal, "q_goal")))
        scale = inertia if form == "torque" else np.ones(nv)
        Pid(PidGains(1.0, 1.0, 1.0), form, feedforward, gravity)  # refuses arguments that contradict each other
        if flag(shared, "shared"):
            chosen = tuple(Parameter(name, *ends) for name, ends in _PID.items())
        else:
            chosen = tuple(
                Parameter(f"{name}{i + 1}", *(scale[i] * np.array(ends)))
                for name, ends in _PID.items()
                for i in range(nv)
            )

        def controller(values: Values) -> Pid:
            gains: dict[str, Any] = {
                name: [values[f"{name}{i + 1}"] for i in range(nv)] if not shared else values[name] for name in _PID
            }
            if shared and form == "torque":
                gains = {name: tuple(gain * scale) for name, gain in gains.items()}
            return Pid(PidGains(**gains), form, feedforward, gravity)

        return cls(f"PID, {form}", chosen, controller)

    @classmethod
    def computed_torque(cls) -> ControllerFamily:
        """Computed-torque controllers with an integral, see `ComputedTorque`."""
        chosen = (Parameter("bandwidth", 10.0, 200.0), Parameter("damping", 0.3, 3.0), Parameter("integral", 1.0, 1e6))
        return cls("computed torque", chosen, lambda x: ComputedTorque(x["bandwidth"], x["damping"], x["integral"]))

    @classmethod
    def lqr(cls) -> ControllerFamily:
        """Linear-quadratic regulators, the same weights for all joints, see `Lqr`."""
        chosen = (Parameter("position", 0.002, 0.5), Parameter("velocity", 1e-4, 0.1), Parameter("integral", 0.1, 50.0))
        return cls("linear-quadratic", chosen, lambda x: Lqr(x["position"], x["velocity"], x["integral"]))


@brief
@dataclass(frozen=True, eq=False)
class Ramps(Checked):
    """References along `ramp`, whose duration is chosen, too, as the parameter "ramp".

    Attributes:
        q_start: [rad or m], shape (nv,).
        q_goal: [rad or m], shape (nv,).
        duration: least and greatest [s].

    Raises:
        ProblemError: positions that are not finite; durations not positive, or not in order.
    """

    q_start: ArrayLike = checked(one_or_each, sign="any")
    q_goal: ArrayLike = checked(one_or_each, sign="any")
    duration: tuple[float, float] = checked(interval, (0.1, 1.0), unit="s", sign="positive")

    @property
    def parameter(self) -> Parameter:
        """Parameter "ramp": the duration [s]."""
        return Parameter("ramp", *self.duration)

    def reference(self, robot: Robot, values: Values) -> Trajectory:
        """The ramp of a given duration [s]."""
        duration = expect(values, Mapping, "values", '{"ramp": 0.5}').get("ramp")  # type: ignore[type-abstract]
        return ramp(robot, self.q_start, self.q_goal, number(duration, "values: ramp", unit="s", sign="positive"))


def chosen(family: ControllerFamily, reference: Trajectory | Ramps) -> tuple[Parameter, ...]:
    """Parameters of a search."""
    return (*family.parameters, *([reference.parameter] if isinstance(reference, Ramps) else []))


def by_name(parameters: Sequence[Parameter], logarithms: Array) -> dict[str, float]:
    """Parameters by name from a point of the search, shape (n,)."""
    return {one.name: float(np.exp(x)) for one, x in zip(parameters, logarithms, strict=True)}


def family_named(
    name: str, robot: Robot, q_goal: ArrayLike, *, form: Form = "computed_torque", shared: bool = True
) -> ControllerFamily:
    """Family of a controller by its name.

    Args:
        name: "pid", "computed-torque" or "lqr".
        robot: the controller's model.
        q_goal: where it ends [rad or m], shape (nv,).
        form: of "pid".
        shared: of "pid": all joints have the same gains.
    """
    if name == "pid":
        return ControllerFamily.pid(robot, q_goal, form=form, shared=shared)
    return ControllerFamily.lqr() if name == "lqr" else ControllerFamily.computed_torque()
