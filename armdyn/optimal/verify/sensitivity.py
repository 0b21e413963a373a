"""Derivatives of the minimum time with respect to payload mass, limits and goal; the limits' shares in the time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pinocchio as pin

from armdyn.arguments import Checked, checked, number, text
from armdyn.arrays import Array
from armdyn.dynamics.symbolic import Dynamics
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.reaching import GoalPose, free_directions
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.verify.costates import Costates
from armdyn.reprs import brief

RATE_LIMITS = {1: "velocity limit", 2: "acceleration limit", 3: "jerk limit"}
"""Names of the limits of the positions' derivatives in a `Share`, by order."""
MORE = 0.01
"""Part by which a limit is raised for the time that this saves."""


@brief
@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of t_f (or of the cost, with an effort weight) at a certified optimum.

    Attributes:
        payload_mass: ∂t_f/∂m of a point mass at the tip [s/kg].
        effort_upper: ∂t_f/∂(upper torque limit) [s/(N m)], shape (nv,); not positive.
        effort_lower: ∂t_f/∂(lower torque limit) [s/(N m)], shape (nv,); not negative.
        velocity: ∂t_f/∂(velocity limit) [s²/rad], shape (nv,); not positive.
    """

    payload_mass: float
    effort_upper: Array
    effort_lower: Array
    velocity: Array

    def effort(self) -> Array:
        """∂t_f/∂(symmetric torque limit) [s/(N m)], shape (nv,)."""
        return self.effort_upper - self.effort_lower


def sensitivities(problem: MinimumTimeProblem, costates: Costates) -> Sensitivities:
    """Sensitivities of an optimum.

    By the envelope theorem they are the partial derivatives of the Lagrangian: active limits, and rates by the
    costates.

    Args:
        problem: the minimum-time problem.
        costates: costates of its optimum.
    """
    robot, n = problem.robot, problem.robot.nv
    dynamics = Dynamics(robot, payload_frame=robot.tip)
    per_kg = dynamics.payload_parameters(pin.Inertia(1.0, np.zeros(3), np.zeros((3, 3))))
    q, v, tau, m = (ca.SX.sym(name, size) for name, size in (("q", n), ("v", n), ("tau", n), ("m", 1)))
    a = dynamics.aba(q, v, tau, m * ca.DM(per_kg))
    rate = ca.Function("by_mass", [q, v, tau], [ca.substitute(ca.jacobian(a, m), m, 0)])
    da = np.array(rate.map(len(costates.pushed))(*(each.T for each in costates.points))).T
    by_mass = float(np.sum(costates.pushed * da))
    return Sensitivities(by_mass, costates.effort_upper, costates.effort_lower, costates.velocity)


@dataclass(frozen=True)
class Share(Checked):
    """A limit's share in the duration: −∂ln t_f/∂ln(limit). Raising the limit by 1 % saves at most that share of 1 %.

    A speed limit's share is the whole time of cruising at it. Without gravity and speed limits the shares of all torque
    limits sum to one half, as the time is inverse to the root of torques.

    Attributes:
        limit: "torque limit" or "velocity limit".
        joint: name of the joint.
        part: share of the time.
        saved: time saved by `MORE` of this limit alone, solved again [s]; None: it was not.
        ties: names of limits without which more of this limit hardly helps, if it was solved again.

    Raises:
        ProblemError: a name is no text, or the share no number.
    """

    limit: str = checked(text)
    joint: str = checked(text)
    part: float = checked(number)
    saved: float | None = None
    ties: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the limit in messages."""
        return f"{self.joint}'s {self.limit}"


def deciding(problem: MinimumTimeProblem, costates: Costates, least: float) -> tuple[Share, ...]:
    """Limits that decide the time of an optimum, largest share first; none with an effort weight.

    Args:
        problem: the minimum-time problem.
        costates: costates of its optimum.
        least: least share.
    """
    if problem.effort_weight > 0:  # multipliers are derivatives of the cost, not of the time
        return ()
    names, limits = problem.robot.joint_names, problem.limits
    upper, lower, velocity = costates.effort_upper, costates.effort_lower, costates.velocity
    torque = -(upper * limits.actuators.upper + lower * limits.actuators.lower) / costates.t[-1]
    speed = -velocity * np.where(velocity == 0, 0.0, limits.velocity) / costates.t[-1]
    return shares_of({"torque limit": torque, "velocity limit": speed}, names, least)


def shares_of(parts: Mapping[str, Array], joints: Sequence[str], least: float) -> tuple[Share, ...]:
    """Shares, largest first.

    Args:
        parts: share of every joint's limit by the limit's name, each of shape (joints,).
        joints: names of the joints.
        least: least share.
    """
    each = (
        (limit, joint, float(part)) for limit, own in parts.items() for joint, part in zip(joints, own, strict=True)
    )
    return tuple(sorted((Share(*one) for one in each if one[2] > least), key=lambda share: -share.part))


def end_gradient(robot: Robot, goal: GoalPose, q: Array, costates: Costates) -> Array:
    """Gradient of the duration with respect to the goal, along the joint positions that reach the pose [s/rad], (nv,).

    Args:
        robot: the arm.
        goal: goal pose of a frame.
        q: joint positions at the goal [rad or m], shape (nv,).
        costates: costates of the motion to q.
    """
    free = free_directions(robot, goal, q)
    return np.asarray(-free @ (free.T @ costates.costate[-1, : robot.nv]))


def transversality(
    problem: MinimumTimeProblem, goal: GoalPose | None, q: Array, costates: Costates | None
) -> float | None:
    """Transversality error of the costates at the end; see `Certificate.transversality`.

    The costates at the end are the derivatives with respect to the goal, ∂t_f/∂q = −ρ_q(t_f). If a continuum of joint
    positions reaches a pose, an optimum has ρ_q(t_f) orthogonal to it (Bryson and Ho, Applied Optimal Control, section
    2.8).

    Args:
        problem: problem of the motion.
        goal: goal pose of a frame; None: the goal is a point.
        q: joint positions at the goal [rad or m], shape (nv,).
        costates: costates of the motion to q; None: unknown.

    Returns:
        inf if unknown, as in a region with tolerances; None: the joint positions are isolated.
    """
    if goal is None:
        return None
    if any(goal.tolerance):  # multipliers of its bounds are not checked
        return float("inf")
    if not free_directions(problem.robot, goal, q).size:
        return None
    if costates is None:
        return float("inf")
    way = np.linalg.norm(q - problem.poses[-2])
    return float(np.linalg.norm(end_gradient(problem.robot, goal, q, costates)) * way / costates.t[-1])
