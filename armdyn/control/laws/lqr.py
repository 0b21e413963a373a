"""A linear-quadratic regulator that varies along the reference."""

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from armdyn.arguments import Checked, checked, number
from armdyn.arrays import Array, Flags
from armdyn.control.laws.linear import Steps, best_gains, loop_steps, plant_steps
from armdyn.control.laws.readings import Readings, extended, law_function, reference_of, table
from armdyn.control.loop.loop import Law, Loop, expect_motors
from armdyn.control.loop.references import Ticks
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.values.per_joint import PerJoint, expect_one_count, one_or_each, per_joint


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
    """Mean delay from a velocity to the torque computed from it [s].

    The delay and half a tick of hold; with a filter also half a tick of the difference and the mean age of the
    filter's memory, pole/(1 - pole) ticks. An observer with the right model does not lag.
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
    """Diagonals of Q at each tick, for x = (e, ė, ∫e dt, torques computed and not yet applied).

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


@dataclass(frozen=True)
class Lqr(Checked):
    """tau = tau_ref + K (e, ė, ∫e dt, tau_ref - tau of torques decided and not yet applied), K of each tick.

    K makes least Σ (|e|² + |velocity ė|² + |integral ∫e dt|²)/position² + |u|²/(half the torque range)² over the ticks,
    of an arm that is linear about the reference and of a loop with its delay. Until the reference ends, errors of
    position and velocity count less, by the two shares below, and the integral stands still.

    The defaults are for least settled time, and one rule for every arm: tuned on random motions of two and three
    joints. An error on the way costs nothing by itself, and a fast motion leaves little torque against it: gains that
    are as high there as at the goal clip the torque, and a joint short of torque disturbs the others. Where speed is
    limited rather than torque, unmodelled friction is compensated late: a Panda is then up to 14 %
    faster than its limit, and 3 % with both shares at 1.

    The regulator models the delay, not the lag of a filtered velocity. A joint of little inertia would be given gains
    that this lag makes unstable; its `position` is taken as large as `phase` needs.

    Attributes:
        position: error that is worth half of a joint's torque range, [rad] of a revolute joint and [m] of a prismatic
            one: one number, or one per joint.
        velocity: weight of a velocity error relative to a position error [s], likewise.
        integral: likewise, of the error's integral [1/s]; 0: the integral is not used.
        position_on_the_way: factor of position errors before the reference ends.
        velocity_on_the_way: likewise of velocity.
        phase: that the loop's lag may cost where a joint swings by itself [rad], see `weights.bearable`. Arms of
            example-robot-data with light wrists become unstable in some loops beyond 1.05.

    Raises:
        ProblemError: position or phase not positive, others negative, something not finite; counts that do not agree.
    """

    position: PerJoint = checked(one_or_each, 0.03, sign="positive")
    velocity: PerJoint = checked(one_or_each, 0.008, sign="not negative")
    integral: PerJoint = checked(one_or_each, 0.5, sign="not negative")
    position_on_the_way: float = checked(number, 0.07, sign="not negative")
    velocity_on_the_way: float = checked(number, 0.4, sign="not negative")
    phase: float = checked(number, 1.0, unit="rad", sign="positive")

    def __post_init__(self) -> None:
        super().__post_init__()
        expect_one_count("weights", self.position, self.velocity, self.integral)

    def law(self, robot: Robot, ticks: Ticks, loop: Loop) -> Law:
        """The law along a reference; see `Controller`.

        Raises:
            ProblemError: the weights or the reference are for another number of joints; a joint has no motor, or no
                limit of torque; the Riccati equation has no solution.
        """
        expect_motors(expect_robot(robot), "a linear-quadratic regulator")
        nv, reference, delay = robot.nv, reference_of(robot, ticks, loop), loop.delay
        half, plant = half_range(robot), plant_steps(robot, ticks)
        given = [(getattr(self, name), name) for name in ErrorWeights._fields]
        weights = ErrorWeights(*(per_joint(one, robot.joint_names, name, error=ProblemError) for one, name in given))
        moving = np.arange(len(ticks.q)) / ticks.rate < ticks.duration
        moving[-1] = False
        weights = bearable(weights, half, plant, loop, self.phase)
        share = self.position_on_the_way, self.velocity_on_the_way
        steps = loop_steps(plant, delay, np.where(moving, 0.0, loop.period))
        gains = _along(steps, diagonals(weights, delay, share, moving), 1 / half**2)
        more = len(reference.q) - len(gains)
        pending = np.hstack([np.empty((len(reference.q), 0)), *(extended(ticks.ahead(i), more) for i in range(delay))])
        columns = {"q": reference.q, "v": reference.v, "tau": reference.tau, "pending": pending}
        columns["K"] = extended(gains.reshape(len(gains), -1), more)

        def torque(given: Readings) -> ca.SX:
            row = given.row
            x = ca.vertcat(row["q"] - given.q, row["v"] - given.v, given.integral, row["pending"] - given.pending)
            return row["tau"] + ca.reshape(row["K"], x.numel(), nv).T @ x

        at_goal = np.diag(gains[-1][:, 2 * nv : 3 * nv]).clip(min=0.0)
        return Law(law_function(nv, delay, columns, torque), table(columns), at_goal, ticks.duration)


def _along(steps: Steps, weights: Array, effort: Array) -> Array:
    """Gains, shape (n, nv, m); zero for integrals of weight zero, which nothing could lead to rest."""
    nv, m = effort.size, weights.shape[1]
    unused = 2 * nv + np.flatnonzero(weights[-1, 2 * nv : 3 * nv] == 0)
    used = np.setdiff1d(np.arange(m), unused)
    part = Steps(steps.A[:, used[:, None], used], steps.B[:, used])
    gains = np.zeros((len(steps.A), nv, m))
    gains[:, :, used] = best_gains(part, weights[:, used], effort)
    return gains
