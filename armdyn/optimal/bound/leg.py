"""Leg of a motion: from one set of joint positions to the next, within limits."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix

from armdyn.arrays import Array
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import cached_property
from armdyn.models.values.friction import JointFriction
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.bound.enclosure import Affine, terms_over
from armdyn.optimal.bound.interval import Interval, down, joined, rounding
from armdyn.optimal.bound.linear_program import marginals_in_boxes
from armdyn.optimal.constraints.registry import path_constraints_of
from armdyn.optimal.problem.planning_limits import Profiles
from armdyn.optimal.problem.policy.bound import BoundPolicy
from armdyn.optimal.problem.problem import MinimumTimeProblem

_CONVERGED = 1e-9
"""Tolerance of the best combination of an end's equations, relative to the largest weight."""

_ROUNDED = 1e-12
"""Part by which a time in closed form is reduced: its twenty operations err by 1e-15 each."""


@dataclass(frozen=True, eq=False)
class LegEnd:
    """Set of joint positions, and velocities, at an end of a leg.

    Attributes:
        q: box of joint positions [rad or m], each end of shape (nv,): a point, or a set that brings a frame to a pose.
        v: velocities [rad/s or m/s], shape (nv,); None: any within the limits, as at a via point.
        equations: affine forms over the box, shape (m, 1), that contain zero at every joint position of the end; None:
            the whole box.
    """

    q: Interval
    v: Array | None
    equations: Affine | None = None

    @property
    def at_rest(self) -> bool:
        """Whether the arm is at rest at the end."""
        return self.v is not None and not np.any(self.v)

    def least(self, weights: Array, combination: Array | None = None) -> float:
        """Smallest λᵀ q over all joint positions of the end, rounded down, λ of shape (nv,).

        Where equations d + S ε ± r = 0 hold, with q = c + ρ ε in the box, so do their combinations: for any w,
        λᵀ q = λᵀ c + (λ ρ − Sᵀ w)ᵀ ε − wᵀ (d ± r). A small linear program finds the best w; any other is valid.

        Args:
            weights: λ.
            combination: w, shape (m,); None: the best one.
        """
        least = (Interval.at(weights) * self.q).sum(0).lower
        if self.equations is None or not np.any(weights):
            return float(least)
        centre, gradient, rest = (part[..., 0] for part in self.equations.parts)
        scaled = Interval.at(weights) * Interval.at(self.q.radius)
        w = _combination(scaled.centre, centre, gradient, rest) if combination is None else combination
        left = (scaled - Interval.at(gradient.T).times(w[:, None])[:, 0]).magnitude
        shift = Interval.at(left).sum(0) + (Interval.at(w) * Interval(centre - rest, centre + rest).outward()).sum(0)
        middle = (Interval.at(weights) * Interval.at(self.q.centre)).sum(0)
        return float(np.maximum(least, (middle - shift).lower))


def _combination(sought: Array, centre: Array, gradient: Array, rest: Array) -> Array:
    """The minimiser w of Σ |sought − Sᵀ w| + wᵀ centre + Σ rest |w|, shape (m,).

    It consists of the marginals of S ε + r = −centre at the least soughtᵀ ε over |ε| ≤ 1, |r| ≤ rest.
    """
    size, most = float(np.max(np.abs(sought))), np.concatenate([np.ones(len(sought)), rest])
    if size == 0:
        return np.zeros_like(centre)
    matrix, cost = csc_matrix(np.hstack([gradient, np.eye(len(rest))])), np.append(sought / size, np.zeros(len(rest)))
    found, w = marginals_in_boxes(matrix, -centre, cost, np.stack([-most, most], axis=1), _CONVERGED)
    return size * w if found else np.zeros_like(centre)


@dataclass(frozen=True, eq=False)
class BoundLeg:
    """Motion between two sets of joint positions.

    Attributes:
        dynamics: dynamics of the arm.
        start: start of the leg.
        goal: goal of the leg.
        velocity: velocity limits [rad/s or m/s], at least the velocities at the ends, shape (nv,).
        acceleration: acceleration limits [rad/s² or m/s²], shape (nv,); infinite: no limit.
        jerk: jerk limits [rad/s³ or m/s³], likewise; accelerations are zero where velocities are given.
        torque_rate: torque-rate limits [N m/s or N/s], likewise; at rest the torques hold the arm.
        position: position limits, widened to both ends, each end of shape (nv,).
        torque: torque limits.
        policy: tuned numbers of the bound.
    """

    dynamics: Dynamics
    start: LegEnd
    goal: LegEnd
    velocity: Array
    acceleration: Array
    jerk: Array
    torque_rate: Array
    position: Interval
    torque: JointLimits
    policy: BoundPolicy

    @property
    def friction(self) -> JointFriction:
        """Friction in the joints."""
        return self.dynamics.robot.friction

    @property
    def has_momentum(self) -> bool:
        """Whether its momentum is bounded: by velocity limits of all joints, of which there are not too many."""
        return bool(np.all(np.isfinite(self.velocity))) and len(self.velocity) <= self.policy.momentum_joints

    @cached_property
    def inertia(self) -> Interval:
        """M at the start and at the goal [kg m²], enclosed over their boxes, shape (2, nv, nv)."""
        terms = terms_over(self.dynamics, joined([self.start.q[None], self.goal.q[None]]))
        open_ = terms.inertia_gradient.magnitude
        radius = np.sum(open_, axis=1) + rounding(open_.shape[1], np.sum(open_, axis=1))
        return terms.inertia + Interval(-radius, radius)

    @property
    def away(self) -> Interval:
        """Displacement from start to goal [rad or m], shape (nv,)."""
        return self.goal.q - self.start.q

    @property
    def kinematic(self) -> Array:
        """Time of every joint at its greatest speed [s], rounded down, shape (nv,); 0 without a limit."""
        return np.maximum(down(self.away.mignitude / self.velocity), 0.0)

    @property
    def shortest(self) -> float:
        """Shortest duration within the velocity limits [s]."""
        return float(np.max(self.kinematic))

    def alone(self, away: Interval) -> Array:
        """Times of every joint by its own limits for a displacement [s], rounded down, shape (…, nv)."""
        times = np.maximum(down(away.mignitude / self.velocity), 0.0)
        if not (self.start.at_rest and self.goal.at_rest):
            return times
        profiles = Profiles.of(away.mignitude, self.velocity, self.acceleration, self.jerk)
        return np.maximum(times, profiles.durations * (1 - _ROUNDED))


def legs_of(problem: MinimumTimeProblem, policy: BoundPolicy) -> tuple[BoundLeg, ...]:
    """The legs of a problem, in order, without its via regions, which only make motions slower.

    Poses and velocities may be slightly beyond the limits as given; the limits are widened to contain them.
    """
    nv, poses, limits = problem.robot.nv, problem.fixed_poses, problem.limits
    v_start, v_goal = problem.x_start[nv:], problem.x_goal[nv:]
    rates = _rates(problem)
    lower, upper = limits.position_lower, limits.position_upper
    position = Interval(np.minimum(lower, poses.min(axis=0)), np.maximum(upper, poses.max(axis=0)))
    dynamics = Dynamics(problem.robot)
    last = len(poses) - 2
    return tuple(
        BoundLeg(
            dynamics=dynamics,
            start=LegEnd(Interval.at(poses[i]), v_start if i == 0 else None),
            goal=LegEnd(Interval.at(poses[i + 1]), v_goal if i == last else None),
            velocity=np.max([limits.velocity, np.abs(v_start), np.abs(v_goal)], axis=0),
            acceleration=rates["acceleration"],
            jerk=rates["jerk"],
            torque_rate=rates["torque"],
            position=position,
            torque=limits,
            policy=policy,
        )
        for i in range(last + 1)
    )


def _rates(problem: MinimumTimeProblem) -> dict[str, Array]:
    """Limits of accelerations, jerks and torque rates by the path constraints; infinite: no limit."""
    names = {2: "acceleration", 3: "jerk"}
    found = dict.fromkeys((*names.values(), "torque"), np.full(problem.robot.nv, np.inf))
    for each in path_constraints_of(problem):
        limit, torque_rate = each.derivative_limit(problem), each.torque_rate_limit(problem)
        if limit is not None:
            found[names[limit[0]]] = np.minimum(found[names[limit[0]]], limit[1])
        if torque_rate is not None:
            found["torque"] = np.minimum(found["torque"], torque_rate)
    return found
