"""Options of a closed loop: the controller, how it is joined to the arm, and the arm that moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import armdyn as ad
from armdyn.arguments import one_of, whole
from armdyn.cli.options.groups import Numbers, PerJoint, flag, group, option
from armdyn.cli.options.task import FastArmOptions
from armdyn.errors import ProblemError

if TYPE_CHECKING:
    from armdyn.control.loop.loop import Controller

_OPTIONS = {"lqr": "weights", "computed-torque": "bandwidth"}
"""Options of controllers that have one of their own; see `option_of`."""


def option_of(controller: str) -> str:
    """Name of the option with the numbers of a controller."""
    return _OPTIONS.get(controller, "gains")


def in_force(controller: str, numbers: Sequence[float], form: str | None) -> dict[str, str]:
    """Row of a table of a loop that failed: its controller's numbers, and the command that searches for others."""
    forms = f" --form {form}" if form else ""
    given = f"--{option_of(controller)} {','.join(f'{x:g}' for x in numbers)}{forms}"
    return {"in force": f"{given}; armdyn tune ROBOT --controller {controller}{forms} searches for others"}


@group("Controller")
class ControllerOptions:
    """The controller; see `Lqr`, `ComputedTorque` and `Pid`."""

    controller: str = option("NAME", "lqr (linear-quadratic along the motion), computed-torque or pid.", default="lqr")
    weights: Numbers = option(
        "E,T,I",
        "For lqr: error worth half the torque range \\[rad or m], weight of a velocity error against it \\[s], and "
        "its integral \\[1/s].",
    )
    bandwidth: Numbers = option("W", "For computed-torque: natural frequency of the error \\[rad/s].")
    gains: Numbers = option("KP,KI,KD", "For pid and others: gains, the same for every joint \\[N m/rad and so on].")
    form: str | None = option(
        "FORM",
        "For pid: torque (default), computed_torque or acceleration; gains have the units of armdyn tune --form FORM.",
    )

    def chosen(self) -> Controller:
        """Controller that the options name.

        Raises:
            ProblemError: unknown; an option of another controller, or of wrong numbers.
        """
        from armdyn.control.laws.registry import CONTROLLERS

        own = option_of(one_of(self.controller, tuple(CONTROLLERS), "--controller"))
        for name in ("weights", "bandwidth", "gains"):
            if getattr(self, name) is not None and name != own:
                of = next((kind for kind, option in _OPTIONS.items() if option == name), "pid")
                raise ProblemError(f"--{name} is an option of --controller {of}, not of {self.controller}")
        kind, given = CONTROLLERS[self.controller].with_form(self.form, "--form"), getattr(self, own)
        if given is None and kind.required:
            expected = ",".join(kind.settings).upper()
            raise ProblemError(f"--controller {self.controller} needs --{own} {expected}, such as 30,50,1 for pid")
        return kind.make() if given is None else kind.of(given, f"--{own}")

    def in_force(self) -> dict[str, str]:
        """Row of a table, of a run that did not settle."""
        from armdyn.control.laws.registry import CONTROLLERS

        kind, numbers = CONTROLLERS[self.controller], getattr(self, option_of(self.controller))
        numbers = numbers or [getattr(kind.make(), name) for name in kind.settings]
        return in_force(self.controller, numbers, self.form or ("torque" if kind.forms else None))


@group("Loop")
class LoopOptions:
    """Connection of controller and arm; see `Loop`."""

    rate: float = option("HZ", "Samples per second \\[Hz].", default=1000.0)
    delay: int = option("TICKS", "Delay from a reading to its torque \\[ticks].", default=1)
    encoder: float = option("RAD", "Step of the encoders \\[rad or m]; 0: none.", default=1e-4)
    velocity: str = option(
        "HOW",
        "Velocity of the law: filtered (differences of readings), observer (Luenberger) or exact.",
        default="filtered",
    )
    cutoff: float = option("HZ", "Cutoff frequency of the filter or the observer \\[Hz].", default=80.0)
    noise: float = option("RAD", "Standard deviation of each reading \\[rad or m].", default=0.0)
    seed: int = option("N", "Seed of the noise.", default=0)
    antiwindup: str = option(
        "HOW", "Integral at a torque limit: conditional, back_calculation or none.", default="conditional"
    )
    ideal: bool = flag("A continuous loop without imperfections; torques are clipped.")

    def joined(self) -> ad.Loop:
        """Loop that the options describe.

        Raises:
            ProblemError: something is out of range or unknown.
        """
        if self.ideal:
            return ad.Loop.ideal(saturate=True)
        given: dict[str, Any] = {name: value for name, value in vars(self).items() if name != "ideal"}
        return ad.Loop(**given)


@group("The arm that moves, where it differs from the model")
class PlantOptions:
    """Differences of the simulated arm from the controller's model."""

    plant_payload: float | None = option("KG", "Payload that the arm carries \\[kg], instead of --payload.")
    plant_likely: int | None = option("K", "Likely arm number K, from 0, of identified.toml of armdyn identify.")
    plant_damping: PerJoint = option("D[,D…]", "Viscous friction of its joints \\[N m s/rad or N s/m].")
    plant_friction: PerJoint = option("F[,F…]", "Coulomb friction of its joints \\[N m or N].")

    def real(self, task: FastArmOptions) -> ad.Robot:
        """Simulated arm: the controller's model changed by these options.

        Args:
            task: the controller's model.

        Raises:
            ArmdynError: a value does not fit the robot.
        """
        arm = task.carrying(self.plant_payload) if self.plant_likely is None else self._likely(task.likely)
        return arm.with_friction(self.plant_damping, self.plant_friction, None)

    def _likely(self, arms: Sequence[ad.Robot]) -> ad.Robot:
        """Likely arm selected by the option's number."""
        if self.plant_payload is not None:
            raise ProblemError("--plant-likely and --plant-payload: give one of them; a likely arm has its own payload")
        if not arms:
            raise ProblemError("--plant-likely needs the file of armdyn identify as ROBOT: this one has no likely arms")
        return arms[whole(self.plant_likely, "--plant-likely", 0, len(arms) - 1)]
