"""Options of a closed loop: the controller, how it is joined to the arm, and the arm that moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer

import armdyn as ad
from armdyn.arguments import one_of
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import numbers, one_or_more

if TYPE_CHECKING:
    from armdyn.cli.parsing.requests import ArmRequest
    from armdyn.control.loop.law import Controller

_OPTIONS = {"lqr": "weights", "computed-torque": "bandwidth"}
"""Options of controllers that have one of their own; the numbers of others are `gains`."""


@dataclass(frozen=True, kw_only=True)
class ControllerOptions:
    """The controller; see `Lqr`, `ComputedTorque` and `Pid`."""

    panel: ClassVar[str] = "Controller"

    controller: Annotated[
        str, typer.Option(metavar="NAME", help="lqr (linear-quadratic along the motion), computed-torque or pid.")
    ] = "lqr"
    weights: Annotated[
        str | None,
        typer.Option(
            metavar="E,T,I",
            help="Of lqr: error worth half the torque range \\[rad], what a velocity error counts beside it \\[s], and "
            "its integral \\[1/s].",
        ),
    ] = None
    bandwidth: Annotated[
        str | None, typer.Option(metavar="W", help="Of computed-torque: its natural frequency \\[rad/s].")
    ] = None
    gains: Annotated[
        str | None,
        typer.Option(metavar="KP,KI,KD", help="Of pid and others, the same for every joint \\[N m/rad and so on]."),
    ] = None

    def chosen(self) -> Controller:
        """The controller.

        Raises:
            ProblemError: unknown; an option is another controller's, or is not what it takes.
        """
        from armdyn.control.laws.registry import CONTROLLERS

        own = _OPTIONS.get(one_of(self.controller, tuple(CONTROLLERS), "--controller"), "gains")
        for name in ("weights", "bandwidth", "gains"):
            if getattr(self, name) is not None and name != own:
                of = next((kind for kind, option in _OPTIONS.items() if option == name), "pid")
                raise ProblemError(f"--{name} is an option of --controller {of}, not of {self.controller}")
        kind, given = CONTROLLERS[self.controller], getattr(self, own)
        if given is None and kind.required:
            wanted = ",".join(kind.settings).upper()
            raise ProblemError(f"--controller {self.controller} needs --{own} {wanted}, such as 30,50,1 for pid")
        return kind.make() if given is None else kind.of(numbers(given, f"--{own}"), f"--{own}")


@dataclass(frozen=True, kw_only=True)
class LoopOptions:
    """Connection of controller and arm; see `Loop`."""

    panel: ClassVar[str] = "Loop"

    rate: Annotated[float, typer.Option(metavar="HZ", help="Samples per second \\[Hz].")] = 1000.0
    delay: Annotated[int, typer.Option(metavar="TICKS", help="From a reading to its torque \\[ticks].")] = 1
    encoder: Annotated[float, typer.Option(metavar="RAD", help="Step of the encoders \\[rad]; 0: none.")] = 1e-4
    velocity: Annotated[
        str, typer.Option(metavar="HOW", help="filtered (differences of readings), observer (Luenberger) or exact.")
    ] = "filtered"
    cutoff: Annotated[float, typer.Option(metavar="HZ", help="Of the filter or the observer \\[Hz].")] = 80.0
    noise: Annotated[float, typer.Option(metavar="RAD", help="Standard deviation of each reading \\[rad].")] = 0.0
    seed: Annotated[int, typer.Option(metavar="N", help="Of the noise.")] = 0
    antiwindup: Annotated[
        str, typer.Option(metavar="HOW", help="conditional, back_calculation or none: the integral at a torque limit.")
    ] = "conditional"
    ideal: Annotated[
        bool, typer.Option("--ideal", help="A continuous loop without imperfections; torques are clipped.")
    ] = False

    def joined(self) -> ad.Loop:
        """The loop.

        Raises:
            ProblemError: something is out of range or unknown.
        """
        if self.ideal:
            return ad.Loop.ideal(saturate=True)
        given: dict[str, Any] = {name: value for name, value in vars(self).items() if name != "ideal"}
        return ad.Loop(**given)


@dataclass(frozen=True, kw_only=True)
class PlantOptions:
    """How the arm that moves differs from the controller's model."""

    panel: ClassVar[str] = "The arm that moves, where it differs from the model"

    plant_payload: Annotated[
        float | None, typer.Option(metavar="KG", help="Payload that the arm carries \\[kg], instead of --payload.")
    ] = None
    plant_damping: Annotated[
        str | None, typer.Option(metavar="D[,D…]", help="Viscous friction of its joints \\[N m s/rad].")
    ] = None
    plant_friction: Annotated[
        str | None, typer.Option(metavar="F[,F…]", help="Coulomb friction of its joints \\[N m].")
    ] = None

    def real(self, request: ArmRequest) -> ad.Robot:
        """The arm that moves.

        Args:
            request: the controller's model.

        Raises:
            ArmdynError: a value does not fit the robot.
        """
        arm = request.carrying(self.plant_payload)
        damping, friction = (
            one_or_more(text, f"--plant-{name}")
            for text, name in ((self.plant_damping, "damping"), (self.plant_friction, "friction"))
        )
        return arm.with_friction(damping, friction, None)
