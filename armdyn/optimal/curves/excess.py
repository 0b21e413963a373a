"""Torques between a curve's points: their excess over the limits, margins that remove it, samples that follow them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.dynamics.numeric import forward_dynamics, inverse_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.models.values.actuator_limits import ActuatorLimits
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve import Curve, CurveLeg
from armdyn.optimal.curves.curve_program import Iterate
from armdyn.optimal.curves.layout import POINTS, CurveSpec, TorqueMargin, curve_layout, torque_rates
from armdyn.optimal.problem.policy.curves import CurvePolicy
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.within_limits import FASTER, PER_SAMPLE, can_be_slowed, fastest_rate
from armdyn.trajectory import Trajectory

_MOST = 0.95
"""Largest torque margin, as a part of half the torque's range."""


def excesses_of(task: Task, curve: Curve) -> tuple[TorqueMargin, ...]:
    """Excess of torques and torque rates over their limits near every point of every leg, as parts of the limits.

    Args:
        task: task with the limits, and the number of places to check.
        curve: the curve.
    """
    problem, checks = task.problem, task.policy.curves.checks
    limit, found = torque_rates(task, TightenedConstraints.of(task)), []
    for leg in curve.legs:
        s, (q, v, a) = _at_places(leg, checks + 1)
        tau = inverse_dynamics(problem.robot)(q, v, a)
        rates = -1.0 if limit is None else _rate_excess(leg, s, tau, limit)
        found.append(TorqueMargin(*torque_excess(problem.limits.actuators, q, v, tau, POINTS), rates))
    return tuple(found)


def _at_places(leg: CurveLeg, count: int) -> tuple[Array, list[Array]]:
    """Even places of every interval, ends included, shape (intervals, count), and the motion there as `CurveLeg.at`."""
    breaks = leg.basis.breaks
    s = breaks[:-1, None] + np.diff(breaks)[:, None] * np.linspace(0, 1, count)
    return s, [x.reshape(*s.shape, -1) for x in leg.at(s.ravel())]


def torque_excess(limits: ActuatorLimits, q: Array, v: Array, tau: Array, parts: int) -> tuple[Array, Array]:
    """Largest excess of torques over their upper and lower limits in each part of every interval.

    Args:
        limits: the limits.
        q: positions at places of every interval, including its ends [rad or m], shape (intervals, places, nv).
        v: velocities there [rad/s or m/s], likewise.
        tau: torques there [N m or N], likewise.
        parts: number of equal parts of an interval.

    Returns:
        Excesses as parts of half the ranges, negative: slack, each of shape (intervals * parts, nv). The maximum of the
        parabola through three places counts.
    """
    marks, half = np.linspace(0, tau.shape[1] - 1, parts + 1).astype(int), limits.half_range
    weakest, strongest = limits.range(q, v)
    upper, lower = (
        np.stack([np.max(beyond[:, a : b + 1], axis=1) for a, b in pairwise(marks)], axis=1).reshape(-1, half.size)
        for beyond in (peaks((tau - strongest) / half), peaks((weakest - tau) / half))
    )
    return upper, lower


def peaks(tau: Array) -> Array:
    """Torques in an interval, raised to the maximum of the parabola through three of them where that lies between.

    Args:
        tau: torques, shape (intervals, places, nv).
    """
    first, second = tau[:, 2:] - tau[:, :-2], tau[:, 2:] - 2 * tau[:, 1:-1] + tau[:, :-2]
    near = np.abs(first) < -2 * second  # the maximum is no farther than the next place
    raised = tau.copy()
    raised[:, 1:-1] += np.where(near, first**2, 0.0) / (8 * np.where(near, -second, 1.0))
    return raised


def _rate_excess(leg: CurveLeg, s: Array, tau: Array, limit: Array) -> Array:
    """Excess of torque rates between a leg's points, as parts of the limits, shape (points + 1, nv).

    Args:
        leg: leg with its points and duration.
        s: places of every interval, shape (intervals, places).
        tau: torques at s [N m or N], shape (intervals, places, nv).
        limit: limits of the rates [N m/s or N/s], shape (nv,).
    """
    rates = np.abs(np.diff(tau, axis=1)) / (leg.duration * np.diff(s, axis=1)[..., None]) / limit - 1
    middle = (s[:, 1:] + s[:, :-1]).ravel() / 2
    which = np.searchsorted(leg.basis.gauss(POINTS)[0].ravel(), middle)
    over = -np.ones((leg.basis.intervals * POINTS + 1, limit.size))
    rates = rates.reshape(-1, limit.size)
    for offset in (-1, 0, 1):  # a step with a full margin leaves the excess to its neighbours
        np.maximum.at(over, np.clip(which + offset, 0, len(over) - 1), rates)
    return over


def worst_excess(over: tuple[TorqueMargin, ...]) -> float:
    """Largest excess of all legs, as a part of a limit."""
    return float(max(np.max(side) for leg in over for side in (leg.upper, leg.lower, leg.rates)))


def accepted_excess(task: Task) -> float:
    """Excess of torques that slowing down removes, as a part of half the range; 0 where no motion can be slowed."""
    return task.policy.curves.small_excess if can_be_slowed(task.problem) else 0.0


def larger_margin(margin: TorqueMargin, over: TorqueMargin, numbers: CurvePolicy) -> TorqueMargin:
    """Larger margin where a torque exceeds its limit; at a point with a full margin, both neighbours get it.

    Args:
        margin: margin so far.
        over: excess of torques.
        numbers: tuned numbers.
    """

    def more(beyond: Array | float) -> Array:
        return np.asarray(np.maximum(np.asarray(beyond) + numbers.small_excess / 2, 0) * numbers.eager)

    upper, lower, rates = more(over.upper), more(over.lower), more(over.rates)
    left = np.pad(np.maximum(upper * (margin.upper >= _MOST), lower * (margin.lower >= _MOST)), ((1, 1), (0, 0)))
    neighbours = np.maximum(left[:-2], left[2:])
    upper, lower = margin.upper + upper + neighbours, margin.lower + lower + neighbours
    return TorqueMargin(np.minimum(upper, _MOST), np.minimum(lower, _MOST), np.minimum(margin.rates + rates, _MOST))


def next_margin(
    margin: TorqueMargin, over: TorqueMargin, own: tuple[Array, Array], reduces: bool, numbers: CurvePolicy
) -> TorqueMargin:
    """Margins of the torques between steps: how far torques near a point go beyond the point's own, where they exceed.

    A point's own excess, by nonlinearity, is left to the next step.

    Args:
        margin: margins so far.
        over: excess of torques near the points.
        own: excess at the points over the upper and lower limits, each of shape (points, nv).
        reduces: whether margins fall where no limit is exceeded.
        numbers: tuned numbers.
    """
    kept = numbers.margin_kept if reduces else 1.0

    def next_(before: Array | float, beyond: Array | float, here: Array) -> Array:
        target = np.where(np.asarray(beyond) > 0, numbers.strict * (beyond - here), 0.0)
        return np.minimum(np.maximum(target, kept * np.asarray(before)), _MOST)

    return replace(margin, upper=next_(margin.upper, over.upper, own[0]), lower=next_(margin.lower, over.lower, own[1]))


def round_words(number: int, curve: Curve, over: tuple[TorqueMargin, ...]) -> str:
    """Progress of a round: the duration, and the excess for the next margins."""
    beyond = f"{100 * max(worst_excess(over), 0.0):.2g} % beyond between points"
    return f"round {number}: {curve.duration:.6f} s, torques {beyond}"


class Tightening:
    """Adapts torque margins between steps until torques satisfy their limits between the points, too.

    Attributes:
        spec: requirements of the curve, with the margins so far.
        rounds: number of changes of the margins.
    """

    def __init__(self, task: Task, guess: Curve, spec: CurveSpec):
        self.task, self.spec, self.rounds = task, spec, 0
        self._guess, self._shape = guess, curve_layout(task.problem, guess, spec.constraints)

    def __call__(self, at: Iterate, near: bool) -> tuple[Array, Array] | None:
        """Tightened bounds of the torques at the points, in half ranges; None without a change."""
        if not near:
            return None
        numbers, curve = self.task.policy.curves, self._shape.curve(self._guess, at.x)
        over, tau = excesses_of(self.task, curve), at.torques.tau
        if worst_excess(over) <= accepted_excess(self.task) or self.rounds == numbers.rounds:
            return None
        self.rounds += 1
        self.task.progress(round_words(self.rounds, curve, over))
        actuators = self.task.problem.limits.actuators
        least, most = (side / actuators.half_range for side in (actuators.lower, actuators.upper))
        early = not self.spec.least and 2 * self.rounds <= numbers.rounds
        margin = next_margin(self.spec.margin(0), over[0], (tau - most, least - tau), early, numbers)
        self.spec = replace(self.spec, margins=(margin,))
        return least + margin.lower, most - margin.upper


def sampled(task: Task, curve: Curve, times: int = 1) -> Trajectory:
    """Samples of a curve, between which torques are linear.

    Args:
        task: the problem and its settings.
        curve: the motion.
        times: multiple of the policy's number of samples.
    """
    numbers, problem = task.policy.curves, task.problem
    jumps = not problem.continuous_torque
    if not can_be_slowed(problem):
        numbers = replace(numbers, velocity_error=numbers.velocity_error / 20)
    dry_friction = bool(np.any(np.asarray(problem.robot.friction.coulomb) > 0))
    finer = times * (numbers.finer[0] if dry_friction or not jumps or not numbers.cruises else 1)
    # As many as feedback takes to hold an arm that falls or swings during a slow motion.
    fastest = FASTER * fastest_rate(problem.robot, curve.trajectory(problem.robot, jumps=jumps))
    numbers = replace(numbers, steps=max(numbers.steps, int(np.ceil(fastest * curve.duration / PER_SAMPLE))))
    most = numbers.samples * (8 if jumps else 1)  # the feedback's corrections change fast between close samples
    counts = [finer * sample_counts(problem.robot, leg, problem.limits.velocity, numbers, most) for leg in curve.legs]
    return curve.trajectory(problem.robot, counts, jumps)


_CHECKS = 5
"""Places of an interval, including its ends, at which a torque's second derivatives are estimated."""


def sample_counts(robot: Robot, leg: CurveLeg, speed: Array, numbers: CurvePolicy, most: int) -> Index:
    """Samples per interval for which the replay's velocity error is a given part of the velocity limits.

    Between samples h apart, linear interpolation of a torque with the second derivative τ'' makes velocities oscillate
    by h³/125 M⁻¹τ''. Where τ'' jumps, between intervals, the shared sample fits neither side: velocities are then off
    by about h³/48 of the jump of M⁻¹τ'', and by twice that at the ends of a leg.

    Args:
        robot: the arm.
        leg: leg of a curve.
        speed: velocity limits [rad/s or m/s], shape (nv,); infinite ones are replaced by the leg's largest velocity.
        numbers: the part, and the least number of samples.
        most: largest number of samples, but for a leg's least.

    Returns:
        Number of samples, shape (intervals,).
    """
    lengths, snap = np.diff(leg.basis.breaks), forced_snap(robot, leg)
    padded = np.concatenate([-snap[:1], snap, -snap[-1:]])
    jumps = np.abs(padded[1:, 0] - padded[:-1, -1])
    worst = np.maximum(np.maximum(jumps[:-1], jumps[1:]), np.max(np.abs(snap), axis=1))
    allowed = 48 * numbers.velocity_error * np.where(np.isfinite(speed), speed, leg.fastest + np.finfo(float).tiny)
    needed = leg.duration * lengths * np.cbrt(np.max(worst / allowed, axis=1))
    needed = np.maximum(np.clip(needed, numbers.samples, most), numbers.steps * lengths)
    return np.asarray(np.ceil(needed), dtype=int)


def forced_snap(robot: Robot, leg: CurveLeg) -> Array:
    """M⁻¹τ'' of the torques of a leg, without friction [rad/s⁴ or m/s⁴].

    Args:
        robot: the arm.
        leg: leg of a curve.

    Returns:
        Values at inner places of every interval, shape (intervals, 3, nv).
    """
    _, (q, v, a) = _at_places(leg, _CHECKS)
    tau = inverse_dynamics(robot)(q, v, a) - robot.friction.torque(v)
    step = leg.duration * np.diff(leg.basis.breaks)[:, None, None] / (_CHECKS - 1)
    inner, acceleration = (q[:, 1:-1], v[:, 1:-1]), forward_dynamics(robot)
    tau, second_difference = tau[:, 1:-1], np.diff(tau, 2, axis=1) / step**2
    return acceleration(*inner, tau + second_difference) - acceleration(*inner, tau)
