"""A PID controller and an arm as one differential equation, and its integration."""

import warnings
from dataclasses import dataclass
from typing import Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import LSODA, OdeSolution

from armdyn.control.pid.gains import ContinuousPid, Form
from armdyn.control.pid.motion import Motion
from armdyn.errors import ProblemError
from armdyn.models import Robot

Array = NDArray[np.float64]

Status = Literal["settled", "not_settled", "diverged", "failed"]
"""What became of a run, see `PidRun`."""

_RTOL, _ATOL = 1e-9, 1e-10
"""Of the integrator, per component. Arrival times then move by less than 1e-6 s when both shrink tenfold."""
_MAX_STEPS = 30_000
"""Integrator steps after which a run is given up, in seconds: a settling 10 s run takes about a thousand."""
_POSITION_BOUND, _VELOCITY_BOUND = 100.0, 1000.0
"""Distance from the goal [rad or m] and speed [rad/s or m/s] beyond which a run counts as diverged:
sixteen turns and ten times the fastest robot. A start beyond a tenth of them moves them out."""
_CLAMP_BAND = 0.01
"""Excess torque, as a part of the effort limit, over which the integral fades from running to halted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PidLoop:
    """ContinuousPid and arm as one differential equation in x = (∫e, q, v), shape (3 nv,).

    Attributes:
        motion: the arm's equations of motion.
        goal: [rad or m], shape (nv,).
        kp, ki, damping: of u = kp e + ki ∫e dt - damping v, shape (nv,) each.
        form: what u is.
        lower, upper: between which the torque is clipped [N m or N], shape (nv,); infinite: it is not.
    """

    motion: Motion
    goal: Array
    kp: Array
    ki: Array
    damping: Array
    form: Form
    lower: Array
    upper: Array

    @classmethod
    def of(cls, robot: Robot, motion: Motion, controller: ContinuousPid, goal: Array) -> Self:
        """A controller around an arm.

        Args:
            robot: whose effort limits there are to saturate at.
            motion: its equations of motion.
            controller: what moves it.
            goal: [rad or m], shape (nv,).

        Raises:
            ProblemError: the gains are for another number of joints, or a joint has no motor.
        """
        expect_motors(robot, "a PID controller")
        kp, ki, damping = controller.coefficients(robot.nv)
        lower, upper = robot.limits.effort_lower, robot.limits.effort_upper
        if not controller.saturates:
            lower, upper = np.full(robot.nv, -np.inf), np.full(robot.nv, np.inf)
        return cls(
            motion=motion, goal=goal, kp=kp, ki=ki, damping=damping, form=controller.form, lower=lower, upper=upper
        )

    def wanted(self, x: Array) -> Array:
        """Torque that the controller asks for [N m], before saturation."""
        nv = self.goal.size
        integral, q, v = x[:nv], x[nv : 2 * nv], x[2 * nv :]
        u = self.kp * (self.goal - q) + self.ki * integral - self.damping * v
        if self.form == "torque":
            return np.asarray(u)
        tau = self.motion.inertia(q) @ u
        return np.asarray(tau if self.form == "acceleration" else tau + self.motion.bias(q, v))

    def torque(self, x: Array) -> Array:
        """Torque that the arm gets [N m]."""
        return np.minimum(np.maximum(self.wanted(x), self.lower), self.upper)

    def rate(self, _: float, x: Array) -> Array:
        """ẋ."""
        nv = self.goal.size
        q, v = x[nv : 2 * nv], x[2 * nv :]
        wanted = self.wanted(x)
        tau = np.minimum(np.maximum(wanted, self.lower), self.upper)
        error = self.goal - q
        excess = wanted - tau
        if excess.any():
            error = error * self._running(excess, error)
        return np.concatenate([error, v, self.motion.acceleration(q, v, tau)])

    def _running(self, excess: Array, error: Array) -> Array:
        """1 where the integral runs, 0 where it is halted, shape (nv,).

        A plain switch would make the equations slide along the limit, and an integrator of any order crawl.
        """
        band = _CLAMP_BAND * np.maximum(0.5 * (self.upper - self.lower), 1e-6)
        fade = np.clip(1.0 - np.abs(excess) / band, 0.0, 1.0)
        return np.where(excess * error > 0, fade, 1.0)

    def unholdable(self, robot: Robot) -> list[str]:
        """Joints that gravity at the goal loads beyond what saturation leaves them."""
        hold = self.motion.bias(self.goal, np.zeros(self.goal.size))
        beyond = (hold < self.lower) | (hold > self.upper)
        return [name for name, bad in zip(robot.joint_names, beyond, strict=True) if bad]


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


def diverged_beyond(x: Array, goal: Array) -> tuple[float, float]:
    """Distance from the goal [rad or m] and speed [rad/s or m/s] beyond which a run from a state has diverged.

    Args:
        x: start (q, v), shape (2 nv,).
        goal: [rad or m], shape (nv,).
    """
    start = 10 * float(np.abs(x - np.concatenate([goal, np.zeros(goal.size)])).max())
    return max(_POSITION_BOUND, start), max(_VELOCITY_BOUND, start)


class Followed(NamedTuple):
    """A loop's motion, as far as it could be followed."""

    solution: OdeSolution
    """x over time, shape (3 nv,) at one time."""
    stopped: tuple[Status, str] | None
    """What broke it off before its time, and in words; None if nothing did."""


def integrate(loop: PidLoop, x0: Array, duration: float) -> Followed:
    """Follow a loop from a state.

    Args:
        loop: what is integrated.
        x0: state at t = 0, shape (3 nv,).
        duration: until when [s].

    Raises:
        ProblemError: not even a first step can be made.
    """
    nv = loop.goal.size
    away_bound, speed_bound = diverged_beyond(x0[nv:], loop.goal)
    solver = LSODA(loop.rate, 0.0, x0, duration, rtol=_RTOL, atol=_ATOL)
    times, pieces = [0.0], []
    stopped: tuple[Status, str] | None = None
    with warnings.catch_warnings():
        # LSODA warns of what its status says as well.
        warnings.simplefilter("ignore")
        while solver.status == "running" and stopped is None:
            reason = solver.step()
            finite = bool(np.all(np.isfinite(solver.y)))
            if solver.status == "failed" or not finite:
                stopped = ("failed", f"the integrator gave up at t = {times[-1]:.6g} s ({reason})")
                break
            if solver.t == times[-1]:  # numbers so large, or a duration so short, that time does not pass
                stopped = ("failed", f"the integrator's steps have no length at t = {times[-1]:.6g} s")
                break
            times.append(solver.t)
            pieces.append(solver.dense_output())
            away = np.abs(solver.y[nv : 2 * nv] - loop.goal).max()
            speed = np.abs(solver.y[2 * nv :]).max()
            if away > away_bound or speed > speed_bound:
                where = f"a joint is {away:.4g} off its goal, at speed {speed:.4g}"
                stopped = ("diverged", f"diverged at t = {solver.t:.6g} s: {where}")
            elif len(pieces) >= _MAX_STEPS and solver.status == "running":
                stopped = ("failed", f"gave up at t = {solver.t:.6g} s after {_MAX_STEPS} integrator steps")
    if not pieces:
        raise ProblemError(f"the motion cannot be started: {stopped[1] if stopped else 'no step'}")
    return Followed(OdeSolution(times, pieces), stopped)
