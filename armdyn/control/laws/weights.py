"""Weights of a linear-quadratic regulator's errors and torques, per tick and per joint."""

from typing import NamedTuple

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.control.laws.linear import Steps
from armdyn.control.loop.loop import Loop
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot


class ErrorWeights(NamedTuple):
    """Weights of errors, one number per joint each, shape (nv,)."""

    position: Array
    """Error that is worth half of the torque range [rad or m]."""
    velocity: Array
    """Weight of a velocity error relative to a position error [s]."""
    integral: Array
    """Weight of the error's integral relative to a position error [1/s]."""


def half_range(robot: Robot) -> Array:
    """Half of each joint's torque range [N m or N], shape (nv,).

    Raises:
        ProblemError: a joint has no limit of torque.
    """
    limits = robot.limits
    half = limits.actuators.half_range
    if not np.all(np.isfinite(half)):
        raise ProblemError(
            f"a linear-quadratic regulator weighs errors against the limits of torque; {robot.name} has none at "
            f"{', '.join(np.array(robot.joint_names)[~np.isfinite(half)])}: give `effort_limit`"
        )
    return np.asarray(half)


def lag(loop: Loop) -> float:
    """Mean delay from a velocity to the torque that answers it [s].

    The delay and half a tick of hold; with a filter also half a tick of the difference and the mean age of the
    filter's memory, pole/(1 - pole) ticks. An observer that knows the arm does not lag.
    """
    if loop.hold == "continuous":
        return 0.0
    ticks = loop.delay + 0.5
    if loop.velocity == "filtered":
        ticks += 0.5 + loop.pole / (1 - loop.pole)
    return ticks * loop.period


def bearable(weights: ErrorWeights, half: Array, plant: Steps, loop: Loop, phase: float) -> ErrorWeights:
    """Enlarge the weights' position errors until the loop's lag costs no joint more phase than allowed.

    The regulator of one joint of mobility b = ∂a/∂tau, a double integrator, has k_p = f/p and
    k_d = √((T f/p)² + 2 f/(p b)), with f half the torque range, p and T the weights of position and velocity (Anderson
    and Moore, Optimal Control: Linear Quadratic Methods, section 3.2). Such a joint swings at ω = √(b f/p), and its
    velocity loop crosses over at about T ω². The least p is that at which the lag costs neither ω more than `phase`
    nor T ω² more than three times that.

    Args:
        weights: the requested ones.
        half: torque range [N m or N], shape (nv,).
        plant: from tick to tick along the reference: the largest mobility there counts.
        loop: loop that lags.
        phase: largest phase loss [rad].
    """
    late, nv = lag(loop), half.size
    if not late:
        return weights
    joint = np.arange(nv)
    mobility = plant.B[:, nv + joint, joint].max(axis=0) * loop.rate
    fastest = phase / late
    stiffest = fastest**2 / np.maximum(1.0, weights.velocity * fastest / 3)
    return weights._replace(position=np.maximum(weights.position, half * mobility / stiffest))


def diagonals(weights: ErrorWeights, delay: int, share: tuple[float, float], moving: Flags) -> Array:
    """Diagonals of Q at each tick, for x = (e, ė, ∫e dt, torques decided and not yet felt).

    Args:
        weights: at the goal.
        delay: ticks from a reading to its torque.
        share: factors of the errors of position and of velocity while the reference moves.
        moving: whether it does, at each tick, shape (n,).

    Returns:
        Shape (n, (3 + delay) nv).
    """
    unit = 1 / weights.position
    pending = np.zeros(delay * unit.size)
    at_goal = np.concatenate([unit, weights.velocity * unit, weights.integral * unit, pending])
    still = np.zeros_like(unit)
    on_the_way = np.concatenate([share[0] * unit, share[1] * weights.velocity * unit, still, pending])
    return np.asarray(np.where(moving[:, None], on_the_way, at_goal) ** 2)
