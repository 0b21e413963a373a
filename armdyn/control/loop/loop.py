"""Loops and controllers: connection to an arm, with its delay, encoders and velocity estimate, and the laws for it."""

from dataclasses import dataclass
from typing import Literal, Protocol, Self, runtime_checkable

import casadi as ca
import numpy as np

from armdyn.arguments import Checked, checked, expect, flag, number, one_of, shown, whole
from armdyn.arrays import Array
from armdyn.control.loop.references import Ticks
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot

Velocity = Literal["filtered", "observer", "exact"]
"""Where the controller's velocity comes from:

- "filtered": differences of the encoder's readings through a first-order low-pass.
- "observer": a Luenberger observer on the controller's model of the arm, both poles of every joint at `Loop.pole`.
- "exact": the joint's own, which no arm gives away.
"""
VELOCITIES: tuple[Velocity, ...] = ("filtered", "observer", "exact")

Antiwindup = Literal["conditional", "back_calculation", "none"]
"""Integral while a torque is clipped:

- "conditional": it halts for a joint whose error would increase it (conditional integration).
- "back_calculation": it is led back in 10 ms to where the torque is at its limit (Åström and Murray, Feedback
  Systems, 2nd ed., section 11.4).
- "none": it continues.
"""
ANTIWINDUPS: tuple[Antiwindup, ...] = ("conditional", "back_calculation", "none")

Hold = Literal["zoh", "continuous"]
"""Torque between two ticks: held ("zoh"), or the controller is a differential equation ("continuous")."""
HOLDS: tuple[Hold, ...] = ("zoh", "continuous")

_SUCH_AS = "Lqr(), ComputedTorque() or Pid(gains)"
_MOST_DELAY = 100
_MOST_SEED = 2**64 - 1
LEAST_RATE, MOST_RATE = 1.0, 1e6
"""Largest rate of a loop [Hz]."""


@dataclass(frozen=True, kw_only=True)
class Loop(Checked):
    """A sampled loop: the reading at t = k / rate decides the torque that is held for one tick, `delay` ticks later.

    Attributes:
        rate: samples per second [Hz].
        delay: ticks from a reading to its torque.
        encoder: step of the encoders [rad or m]; 0: none.
        velocity: see `Velocity`.
        cutoff: of the velocity's filter, or of the observer [Hz].
        noise: standard deviation of the readings' noise, added before rounding [rad or m].
        seed: of the noise.
        saturate: clip torques at the effort limits; with torque-speed curves the arm gets the torque allowed at
            its speed, which the integral's anti-windup ignores.
        antiwindup: see `Antiwindup`.
        hold: see `Hold`; a continuous loop has no other imperfections.

    Raises:
        ProblemError: something is not finite, out of range or unknown; a continuous loop with imperfections.
    """

    rate: float = checked(number, 1000.0, unit="Hz", least=LEAST_RATE, most=MOST_RATE)
    delay: int = checked(whole, 1, least=0, most=_MOST_DELAY)
    encoder: float = checked(number, 1e-4, unit="rad or m", sign="not negative")
    velocity: Velocity = checked(one_of, "filtered", known=VELOCITIES)
    cutoff: float = checked(number, 80.0, unit="Hz", sign="positive")
    noise: float = checked(number, 0.0, unit="rad or m", sign="not negative")
    seed: int = checked(whole, 0, least=0, most=_MOST_SEED)
    saturate: bool = checked(flag, True)
    antiwindup: Antiwindup = checked(one_of, "conditional", known=ANTIWINDUPS)
    hold: Hold = checked(one_of, "zoh", known=HOLDS)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.hold == "continuous" and (self.delay or self.encoder or self.noise or self.velocity != "exact"):
            raise ProblemError(
                'a loop with hold="continuous" has no imperfections: delay=0, encoder=0, noise=0, velocity="exact", '
                "as Loop.ideal() has"
            )

    @classmethod
    def ideal(cls, saturate: bool = False) -> Self:
        """Continuous, all imperfections off; torques beyond the limits, unless saturate."""
        return cls(delay=0, encoder=0.0, velocity="exact", saturate=saturate, hold="continuous")

    @property
    def period(self) -> float:
        """Time from one tick of the controller to the next [s]."""
        return 1.0 / self.rate

    @property
    def pole(self) -> float:
        """Pole of the velocity's filter, double pole of the observer, in the z plane: exp(-2π cutoff / rate)."""
        return float(np.exp(-2 * np.pi * self.cutoff / self.rate))

    @property
    def observer_gains(self) -> tuple[float, float]:
        """Luenberger gains of position [-] and velocity [1/s], with which both poles are at `pole`.

        The error of a double integrator under (1 - l₁, …) has the characteristic polynomial
        z² - (2 - l₁ - h l₂) z + 1 - l₁ = (z - pole)².
        """
        return 1 - self.pole**2, (1 - self.pole) ** 2 * self.rate


def expect_loop(loop: object, default: Loop | None = None) -> Loop:
    """Check the argument `loop`.

    Args:
        loop: the argument.
        default: value in place of None; None: None is refused.

    Raises:
        ProblemError: the value is no loop.
    """
    return default if loop is None and default is not None else expect(loop, Loop, "loop", "Loop(rate=1000.0, delay=1)")


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
