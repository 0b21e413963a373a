"""Interface of controllers: a law of the loop's readings and of a row of numbers per tick."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import casadi as ca

from armdyn.arguments import expect, shown
from armdyn.arrays import Array
from armdyn.control.loop.loop import Loop
from armdyn.control.loop.references import Ticks
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot

_SUCH_AS = "Lqr(), ComputedTorque() or Pid(gains)"


@dataclass(frozen=True, eq=False)
class Law:
    """tau = function(q, v, integral, pending, row), before it is clipped.

    Attributes:
        function: a casadi Function of these five columns, the output [N m or N] of shape (nv,): the readings q, v; the
            integral of the error q_reference - q [rad s or m s]; the torques [N m or N] that are decided but not yet
            applied, the next first, shape (delay nv,); and this tick's row.
        rows: numbers that the law reads at each tick, shape (n, m); the last for good. Gains and torques of a row
            depend on the reference; the torques are those of `delay` ticks later.
        integral_gain: ∂tau/∂integral, about [N m/(rad s)], shape (nv,); 0: that joint's integral is unused.
        integrate_from: when the integrals begin to run [s].
    """

    function: ca.Function
    rows: Array
    integral_gain: Array
    integrate_from: float = 0.0


@runtime_checkable
class Controller(Protocol):
    """Protocol of controllers: parameters and a control law for a robot, a reference and a loop."""

    def law(self, robot: Robot, ticks: Ticks, loop: Loop) -> Law:
        """The law along a reference.

        Args:
            robot: the controller's model of the arm.
            ticks: the reference, at the loop's rate.
            loop: connection to the arm.

        Raises:
            ProblemError: it does not fit the robot, or the loop.
        """


def expect_controller(controller: object, name: str = "controller") -> Controller:
    """The argument, if it is a controller.

    Raises:
        ProblemError: the value is no controller, or a controller's class.
    """
    if isinstance(controller, type):  # whose law is a function, too, but takes the controller first
        raise ProblemError(f"{name} is {shown(controller)}; it must be a value, {_SUCH_AS}")
    return expect(controller, Controller, name, _SUCH_AS)  # type: ignore[type-abstract]


def law_of(controller: Controller, robot: Robot, ticks: Ticks, loop: Loop) -> Law:
    """A controller's law, with the sizes that the loop expects.

    Args:
        controller: the controller.
        robot: its model of the arm.
        ticks: the reference.
        loop: connection to the arm.

    Raises:
        ProblemError: the controller does not fit, or its law has other sizes.
    """
    name, law = f"{type(controller).__name__}.law", controller.law(robot, ticks, loop)
    if not isinstance(law, Law):
        raise ProblemError(f"{name} returned {shown(law)}; it must return a Law")
    nv, width = robot.nv, law.rows.shape[-1]
    sizes = {"q": nv, "v": nv, "integral": nv, "pending": loop.delay * nv, "row": width, "tau": nv, "integral_gain": nv}
    function = law.function
    found = [*map(function.numel_in, range(function.n_in())), function.numel_out(0), law.integral_gain.size]
    if found != [*sizes.values()]:
        raise ProblemError(f"{name}: sizes of {', '.join(sizes)} are {found}; they must be {[*sizes.values()]}")
    return law


def expect_motors(robot: Robot, what: str) -> None:
    """Raise unless every joint has a motor.

    Raises:
        ProblemError: some have none.
    """
    if robot.passive:
        raise ProblemError(
            f"{what} needs a motor at every joint of {robot.name}; there is none at {', '.join(robot.passive)}: "
            "minimum time moves such arms"
        )
