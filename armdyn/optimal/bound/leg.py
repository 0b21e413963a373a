"""Leg of a motion, from one set of joint positions to the next within limits, and the forces on the way.

Forces are those of the rate of momentum, enclosed over boxes of positions and velocities, also within torque-speed
curves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix

from armdyn.arrays import Array, Flags
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import cached_property
from armdyn.models.values.actuator_limits import ActuatorLimits
from armdyn.models.values.friction import JointFriction
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.bound.enclosure import (
    ROUNDED,
    TURN,
    Affine,
    Indices,
    Interval,
    Terms,
    down,
    joined,
    rounding,
    terms_over,
    up,
)
from armdyn.optimal.bound.linear_program import marginals_in_boxes
from armdyn.optimal.constraints.registry import TightenedConstraints, path_constraints_of
from armdyn.optimal.problem.planning_limits import Profiles
from armdyn.optimal.problem.policy.bound import BoundPolicy
from armdyn.optimal.problem.problem import MinimumTimeProblem

MOST_CORNERS = 9
"""Largest number of joints for which all 2ⁿ corners are evaluated; beyond, every product has its largest size."""


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces over boxes of positions and velocities.

    Attributes:
        terms: inertia and gravity over the boxes of positions.
        v: velocities [rad/s or m/s], shape (boxes, nv).
        torque: torques [N m or N], shape (boxes, nv).
        friction: joint friction.
    """

    terms: Terms
    v: Interval
    torque: Interval
    friction: JointFriction

    def __getitem__(self, boxes: slice | Indices) -> Forces:
        return Forces(self.terms[boxes], self.v[boxes], self.torque[boxes], self.friction)

    def rate(self, w: Array, way: Interval | None = None, steps: Interval | None = None) -> Interval:
        """Enclosure of λᵀ v + ẇᵀ M(q) v + wᵀ (τ + e(q, v)), shape (boxes, m).

        Args:
            w: multipliers, shape (nv, m) or (boxes, nv, m).
            way: λ, shape (nv, m) or (boxes, nv, m); None: zero.
            steps: ẇ, likewise.
        """
        boxes, nv = self.v.lower.shape
        damping, coulomb = self.friction.per_joint(nv)
        shape, turning = (boxes, nv, w.shape[-1]), None
        linear = (-Interval.at(damping[:, None]) * Interval.at(w)).spread(shape)
        if way is not None:
            linear = linear + way
        if steps is not None:
            steps = steps.spread(shape)
            linear = linear + self.terms.inertia.dot(steps)
            turning = self.terms.inertia_gradient.dot(steps[:, None]).spread((boxes, nv, *shape[1:]))
        constant = self.torque - self.terms.gravity - self._tanh * Interval.at(coulomb)
        weight = self.terms.gravity_gradient.times(w)
        found = range_of(self.v, linear, self._squares(w), turning, -weight)
        return found + constant[:, None].times(w)[:, 0]

    @cached_property
    def _tanh(self) -> Interval:
        return (self.v / Interval.at(self.friction.width)).tanh()

    def _squares(self, w: Array) -> Interval:
        """Coefficients of v_a v_b, a ≥ b, in ½ vᵀ (Σ w_k ∂M/∂q_k) v, shape (boxes, pairs, m)."""
        rows, columns = np.tril_indices(self.v.lower.shape[1])
        sums, part = self.terms.inertia_derivatives.times(w), np.where(rows == columns, 0.5, 1.0)[:, None]
        return Interval(sums.lower * part, sums.upper * part)  # exact


def range_of(v: Interval, linear: Interval, squares: Interval, turning: Interval | None, weight: Interval) -> Interval:
    """The range of linearᵀ v + Σ squares_ab v_a v_b + Σ_k ε_k (turning_kᵀ v + weight_k) over |ε_k| ≤ 1, (boxes, m).

    Args:
        v: boxes of velocities, shape (boxes, nv).
        linear: shape (boxes, nv, m).
        squares: for a ≥ b, row by row, shape (boxes, pairs, m).
        turning: indexed by k, then by v, shape (boxes, nv, nv, m); None: zero.
        weight: shape (boxes, nv, m).
    """
    import _armdyn_enclosure as enclosure

    corners, many = v.lower.shape[1] <= MOST_CORNERS, weight.lower.shape[-1]
    ends = np.ascontiguousarray(v.lower), np.ascontiguousarray(v.upper)
    tables = (
        None if each is None else (np.ascontiguousarray(each.lower), np.ascontiguousarray(each.upper))
        for each in (linear, squares, turning, weight)
    )
    return Interval(*enclosure.range_of(*ends, many, *tables, corners))


@dataclass(frozen=True, eq=False)
class Line:
    """One line of all joints' torque-speed curves: |τ + s v| ≤ c is a torque of at most c with a damping s.

    For w ≥ 0 a torque's w τ is at most w (c - s v), for w < 0 at most -w (c + s v). So is any average over a joint's
    lines, including the limits that are the same at all speeds. Near the speed limit this is less than the largest
    torque, in the parts of the proof that price velocity.

    Attributes:
        slope: s [N m s/rad or N s/m], shape (nv,).
        torque: τ + s v of all torques in the boxes [N m or N], shape (boxes, nv).
        given: whether each joint has such a line, shape (nv,); otherwise s is 0.
    """

    slope: Array
    torque: Interval
    given: Flags


def lines_of(actuators: ActuatorLimits, forces: Forces) -> tuple[Line, ...]:
    """Lines of the torque-speed curves over boxes of velocities; empty if torque limits are the same at all speeds.

    Raises:
        SpecError: the actuators have no lines, see `ActuatorLimits.lines`.
    """
    found, same, v = [], forces.torque, forces.v
    for slope, rest in zip(*actuators.lines, strict=True):
        given = np.isfinite(rest)
        # Beyond its no-load speed a joint brakes with at most its whole torque.
        upper = np.maximum(rest, up(actuators.lower + up(slope * v.upper)))
        lower = np.minimum(-rest, down(actuators.upper + down(slope * v.lower)))
        torque = Interval(np.where(given, lower, same.lower), np.where(given, upper, same.upper))
        found.append(Line(np.where(given, slope, 0.0), torque, given))
    return tuple(found)


def line_shares(lines: Array, whole: Array) -> Array:
    """Shares of the lines in multipliers w, shape (lines, nodes, nv); over the lines they sum up to at most 1.

    Args:
        lines: multipliers of the lines, shape (lines, nodes, nv).
        whole: w, shape (nodes, nv).
    """
    shares = np.clip(lines / np.where(whole == 0, 1.0, whole), 0.0, 1.0)
    return np.asarray(shares * (1 - ROUNDED) / np.maximum(np.sum(shares, axis=0), 1.0))


def rate_by_lines(
    actuators: ActuatorLimits, forces: Forces, w: Array, shares: Array, way: Interval, steps: Interval | None = None
) -> Interval:
    """Enclosure of the largest value of `Forces.rate`, with torques within torque-speed curves.

    Args:
        actuators: actuators with the curves.
        forces: forces over boxes.
        w: multipliers, shape (boxes, nv, m).
        shares: shares of the lines in the multipliers, shape (lines, boxes, nv, m).
        way: see `Forces.rate`.
        steps: see `Forces.rate`.
    """
    if not shares.size:
        return forces.rate(w, way, steps)
    rest = Interval.at(np.zeros(w[:, 0].shape))
    for line, share in zip(lines_of(actuators, forces), shares, strict=True):
        part = Interval.at(w) * Interval.at(np.where(line.given[:, None], share, 0.0))
        above = (line.torque - Interval.at(forces.torque.upper)).upper[..., None]
        below = (line.torque - Interval.at(forces.torque.lower)).lower[..., None]
        rest = rest + (part * Interval.at(np.where(w > 0, above, below))).sum(1)
        way = way - part * Interval.at(line.slope[:, None])
    return forces.rate(w, way, steps) + rest


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
    found, w = marginals_in_boxes(matrix, -centre, cost, np.stack([-most, most], axis=1))
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
    def shortest(self) -> float:
        """Shortest duration within the velocity limits [s]."""
        return float(least_time(self.start.q, self.goal.q, self.velocity))

    def alone(self, away: Interval) -> Array:
        """Times of every joint by its own limits for a displacement [s], rounded down, shape (…, nv)."""
        times = np.maximum(down(away.mignitude / self.velocity), 0.0)
        if not (self.start.at_rest and self.goal.at_rest):
            return times
        profiles = Profiles.of(away.mignitude, self.velocity, self.acceleration, self.jerk)
        return np.maximum(times, profiles.durations * (1 - ROUNDED))


def bound_legs(problem: MinimumTimeProblem, policy: BoundPolicy) -> tuple[BoundLeg, ...]:
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
            position=position,
            torque=limits,
            policy=policy,
            **rates,
        )
        for i in range(last + 1)
    )


def _rates(problem: MinimumTimeProblem) -> dict[str, Array]:
    """Limits of accelerations, jerks and torque rates, as of `BoundLeg`."""
    (acceleration, jerk), none = problem.rates, np.full(problem.robot.nv, np.inf)
    rated = TightenedConstraints(path_constraints_of(problem)).torque_rates(problem)
    return {"acceleration": acceleration, "jerk": jerk, "torque_rate": none if rated is None else rated}


def least_time(starts: Interval, goals: Interval, velocity: Array, turning: Flags | None = None) -> Array:
    """Times by velocity limits from boxes to boxes [s], rounded down, of their broadcast shape without nv.

    Args:
        starts: shape (…, nv).
        goals: likewise.
        velocity: velocity limits [rad/s or m/s], shape (nv,); infinite: no limit.
        turning: whether a joint's positions are meant modulo 2π, less than two turns apart, shape (nv,); None: none.
    """
    found: Array = np.zeros(())
    for joint, most in enumerate(velocity):  # joint by joint: there may be millions of pairs
        way = goals[..., joint] - starts[..., joint]
        away = way.mignitude
        if turning is not None and turning[joint]:
            away = np.minimum(away, np.minimum((way + TURN).mignitude, (way - TURN).mignitude))
        found = np.maximum(found, down(away / most))
    return found
