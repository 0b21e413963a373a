"""Costates of a motion, whatever method found it: their checks, and the derivatives of the minimum time.

The checks are Pontryagin's conditions and the adjoint equations. The derivatives, by payload mass, limits and goal,
give the limits' shares in the time.

ρ̇ = −∂H/∂x = −(∂f/∂x)ᵀρ, with ∂f/∂x from Pinocchio's derivatives of forward dynamics, integrated from the goal back to
the start. Integrated backwards a difference grows as fast as the motion diverges, ten thousandfold on a heavily laden
arm. Therefore the costates are compared with the solution of the equations that is nearest to all of them: shadowing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import pinocchio as pin

from armdyn.arguments import Checked, checked, number, text
from armdyn.arrays import Array
from armdyn.dynamics.numeric import forward_dynamics, joint_inertia
from armdyn.dynamics.symbolic import Dynamics
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.reaching import GoalPose, free_directions
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.verify.arc import Arc
from armdyn.optimal.verify.rollout import replay_torques, scales_of, transitions
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

RATE_LIMITS = {1: "velocity limit", 2: "acceleration limit", 3: "jerk limit"}
"""Names of the limits of the positions' derivatives in a `Share`, by order."""
MORE = 0.01
"""Part by which a limit is raised for the time that this saves."""


@dataclass(frozen=True, eq=False)
class Costates:
    """Costates of an optimum, and their integrals over parts of its time with one point of the motion in each.

    Attributes:
        t: knots [s], shape (K + 1,).
        q: positions at the knots, shape (K + 1, nv).
        v: velocities at the knots, shape (K + 1, nv).
        tau: torques at start and end of the intervals [N m or N], linear between, shape (K, 2, nv).
        costate: ρ = ∂(cost to go)/∂(q, v) at the knots, shape (K + 1, 2 nv).
        points: positions, velocities and torques at the points, shape (3, P, nv).
        pushed: ∫ρ_v dt over each point's part, the derivatives by the accelerations there [s²/rad], shape (P, nv).
        switched: ∫S dt, the derivatives by the torques there [s/(N m)], shape (P, nv): negative on the upper limit,
            positive on the lower one; 0 of a joint without a motor.
        velocity: ∂cost/∂(velocity limit) [s²/rad], shape (nv,); not positive.
    """

    t: Array
    q: Array
    v: Array
    tau: Array
    costate: Array
    points: Array
    pushed: Array
    switched: Array
    velocity: Array

    @property
    def duration(self) -> float:
        """t_f [s]."""
        return float(self.t[-1])

    @property
    def effort_upper(self) -> Array:
        """∂cost/∂(upper torque limit) [s/(N m)], shape (nv,); not positive."""
        return np.asarray(np.minimum(self.switched, 0.0).sum(axis=0))

    @property
    def effort_lower(self) -> Array:
        """∂cost/∂(lower torque limit) [s/(N m)], shape (nv,); not negative."""
        return np.asarray(np.maximum(self.switched, 0.0).sum(axis=0))


@brief
@dataclass(frozen=True, eq=False)
class Phases(Costates):
    """Costates of exact bang arcs, whose intervals are the segments of multiple shooting.

    Attributes:
        arcs: arcs with their exact durations.
        torques: the motion's torques, for `replay_torques`; states between the knots are interpolated.
    """

    arcs: tuple[Arc, ...]
    torques: Trajectory


def pontryagin(problem: MinimumTimeProblem, costates: Costates) -> tuple[Array, Array, float]:
    """H, shape (K + 1,), and S, shape (K + 1, nv), at the knots; largest decrease of H by moving one torque there.

    Args:
        problem: the problem, whose cost is time alone.
        costates: costates of a motion whose torques are on their limits.
    """
    robot, n = problem.robot, problem.robot.nv
    tau, rates = np.vstack([costates.tau[:, 0], costates.tau[-1:, 1]]), costates.costate[:, n:]
    acceleration = forward_dynamics(robot)(costates.q, costates.v, tau)
    switching = np.asarray(np.linalg.solve(joint_inertia(robot)(costates.q), rates[..., None])[..., 0], float)
    hamiltonian = 1 + np.sum(costates.costate[:, :n] * costates.v + rates * acceleration, axis=1)
    lower, upper = problem.limits.actuators.range(costates.q, costates.v)
    fall = np.maximum(switching, 0) * (tau - lower) + np.maximum(-switching, 0) * (upper - tau)
    return np.asarray(hamiltonian, float), switching, float(np.max(fall[:-1]))


def idle_joints(problem: MinimumTimeProblem, costates: Costates, switching: Array, tolerance: float) -> tuple[str, ...]:
    """Joints that minimum time leaves undetermined for over half of the motion, with zero costates.

    Zero costates are the only ones that Pontryagin's conditions allow there: H does not depend on the joint's motion.

    Args:
        problem: the minimum-time problem.
        costates: costates of its optimum.
        switching: S at the knots, shape (K + 1, nv).
        tolerance: tolerance of a change of H, relative to time's 1.
    """
    if problem.effort_weight > 0:  # every torque costs
        return ()
    by_torque = np.abs(switching) * problem.limits.actuators.width
    by_position = np.abs(costates.costate[:, : problem.robot.nv]) * np.max(np.abs(costates.v), axis=0)
    zero = np.maximum(by_torque, by_position) <= tolerance
    shares = np.diff(costates.t) @ (zero[:-1] & zero[1:]) / costates.duration
    return tuple(name for name, share in zip(problem.robot.joint_names, shares, strict=True) if share > 1 / 2)


def adjoint_error(robot: Robot, replay: Trajectory, costates: Costates) -> float:
    """Residual of the costates in the adjoint equations without active limits of the state, as a change of H.

    A difference in ρ_q is weighted by the joint's largest velocity, one in ρ_v by its largest acceleration; H is
    relative to time's 1.

    Args:
        robot: the robot.
        replay: replay of the motion.
        costates: costates of the motion.

    Returns:
        The largest difference at any knot, of any joint; infinite if the replay or the integration broke off.
    """
    if abs(replay.duration - costates.duration) > 1e-12 * costates.duration:
        return float("inf")
    t = np.union1d(replay.t, np.minimum(costates.t, replay.t[-1]))
    at = replay(t)
    motion = replay_torques(robot, replace(replay, t=t, q=at.q, v=at.v, tau=at.tau))
    if motion.t[-1] != t[-1]:
        return float("inf")
    a = forward_dynamics(robot)(motion.q, motion.v, motion.tau)
    size = scales_of(*(np.max(np.abs(each), axis=0) for each in (motion.v, a)))
    x, tau = np.concatenate([motion.q, motion.v], axis=1), np.stack([motion.tau[:-1], motion.tau_end], axis=1)
    steps = transitions(robot, np.diff(t), x[:-1], tau, size)
    if steps is None:
        return float("inf")
    place = np.searchsorted(t, np.minimum(costates.t, t[-1]))
    found = np.empty((*costates.costate.shape, size.size + 1))  # a solution, and its derivatives in the goal's costates
    found[-1] = here = np.column_stack([costates.costate[-1], np.diag(1 / size)])
    for k in range(costates.t.size - 2, -1, -1):
        for step in range(place[k + 1] - 1, place[k] - 1, -1):
            here = steps[step].T @ here
        found[k] = here
    if not np.all(np.isfinite(found)):
        return float("inf")
    apart, freedom = (found[:, :, 0] - costates.costate) * size, found[:, :, 1:] * size[:, None]
    shift = np.linalg.lstsq(freedom.reshape(apart.size, -1), apart.ravel(), rcond=None)[0]
    return float(np.max(np.abs(apart - freedom @ shift)))


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
