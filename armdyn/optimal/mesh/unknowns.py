"""Conversion between trajectories and the scaled unknowns of an NLP."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.mesh.layout import Layout, Parameters
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.trajectory import Trajectory


@dataclass(frozen=True)
class Scales:
    """Units of the scaled problem.

    Attributes:
        time: scale of time [s].
        length: scale of positions [rad or m].
        speed: scale of velocities [rad/s or m/s].
        effort: scales of torques [N m or N], shape (nv,).
    """

    time: float
    length: float
    speed: float
    effort: Array

    @classmethod
    def of(cls, problem: MinimumTimeProblem, guess: Trajectory) -> Self:
        """Scales from the limits and a guess's size."""
        return cls.sized(guess.duration, float(np.max(np.ptp(guess.q, axis=0))), cls.efforts(problem))

    @classmethod
    def sized(cls, duration: float, way: float, effort: Array) -> Self:
        """Scales from a guess's duration [s], its longest way [rad or m] and the scales of torques."""
        length = float(max(way, 0.1))
        return cls(float(duration), length, float(length / duration), effort)

    @staticmethod
    def efforts(problem: MinimumTimeProblem) -> Array:
        """Scales of torques [N m or N], shape (nv,)."""
        limits = problem.limits
        return np.where(limits.passive, limits.actuators.scale, limits.actuators.strongest)

    def parameters(self, fractions: Array, weights: Array, last_body: Array) -> Array:
        """Scales as the program's parameter vector.

        Args:
            fractions: interval lengths over duration, shape (N,).
            weights: weights of the squared scaled torques, shape (nv,).
            last_body: dynamic parameters of the last joint's body, shape (10,).
        """
        return Parameters(fractions, self.time, self.length, self.speed, weights, self.effort, last_body).packed()

    def weights(self, effort_weight: float, tie: float = 0.0) -> Array:
        """Weights of the squared scaled torques, shape (nv,).

        Args:
            effort_weight: the problem's w [1/(N m)²].
            tie: cost of all torques at their limits relative to time's 1, in equal parts for all joints: it determines
                joints that time leaves idle.
        """
        return effort_weight * self.effort**2 + 2 * tie / self.effort.size


def _states(q: Array, v: Array, scales: Scales) -> Array:
    return np.concatenate([q / scales.length, v / scales.speed], axis=-1)


def to_unknowns(guess: Trajectory, layout: Layout, fractions: Array, scales: Scales) -> Array:
    """Unknowns of a trajectory's motion.

    Args:
        guess: any trajectory; its times are used as they are.
        layout: layout of the unknowns.
        fractions: interval lengths over duration, shape (N,).
        scales: scales of the unknowns.
    """
    N = fractions.size
    duration = guess.duration
    knots = guess.t[0] + duration * np.concatenate([[0], np.cumsum(fractions)])
    middles = (knots[:-1] + knots[1:]) / 2
    at = guess(np.concatenate([knots, middles]))  # in one call, whose overhead dominates
    states = _states(at.q, at.v, scales)
    knot = [states[: N + 1], np.full((N + 1, 1), duration / scales.time)]
    if layout.linear:
        knot.append(at.tau[: N + 1] / scales.effort)
    inner = [states[N + 1 :]]
    if not layout.linear:
        inner.append(at.tau[N + 1 :] / scales.effort)
    x = np.empty(layout.size(N))
    x[layout.knots(N)], x[layout.inners(N)] = np.concatenate(knot, axis=1), np.concatenate(inner, axis=1)
    return x


def to_trajectory(
    x: Array,
    layout: Layout,
    fractions: Array,
    scales: Scales,
    joint_names: tuple[str, ...],
    legs: Sequence[int] = (),
) -> Trajectory:
    """Trajectory of the unknowns: samples at the knots and at the stages between.

    Args:
        x: the unknowns.
        layout: layout of the unknowns.
        fractions: interval lengths over the leg's duration, shape (N,).
        scales: scales of the unknowns.
        joint_names: names of the joints.
        legs: number of intervals per leg; by default one leg.
    """
    N = fractions.size
    states, middles, tau, T = (x[at(N)] for at in (layout.states, layout.middles, layout.torques, layout.times))
    times, first = np.zeros(N + 1), 0
    for length in legs or (N,):
        last = first + length
        duration = max(float(T[first]) * scales.time, 1e-9)
        times[first + 1 : last + 1] = times[first] + duration * np.cumsum(fractions[first:last])
        first = last
    left, right = (tau[:-1], tau[1:]) if layout.linear else (tau, tau)
    t = np.stack([times[:-1], (times[:-1] + times[1:]) / 2, np.nextafter(times[1:], 0)], axis=1)
    t[-1, 2], kept = times[N], np.ones((N, 3), bool)
    kept[:-1, 2] = not layout.linear  # where torques jump, one ulp before the next knot
    at = np.stack([states[:-1], middles, states[1:]], axis=1)[kept]
    torques = np.stack([left, (left + right) / 2, right], axis=1)[kept] * scales.effort
    q, v = at[:, layout.knot.q] * scales.length, at[:, layout.knot.v] * scales.speed
    return Trajectory(t[kept], q, v, torques, joint_names, "minimum time")


def bounds(problem: MinimumTimeProblem, layout: Layout, intervals: int, scales: Scales) -> tuple[Array, Array]:
    """Lower and upper bounds of the scaled unknowns; start and goal are equal bounds."""
    limits, N, sides = problem.limits, intervals, []
    states = layout.states(N)
    for position, speed, effort, end in (
        (limits.position_lower, -limits.velocity, limits.actuators.lower, -1),
        (limits.position_upper, limits.velocity, limits.actuators.upper, 1),
    ):
        state, torque = _states(position, speed, scales), effort / scales.effort
        side = np.full(layout.size(N), end * np.inf)
        side[states] = state
        side[layout.times(N)] = max(problem.duration_bound() / scales.time, 1e-3) if end < 0 else 1e3
        side[layout.middles(N)] = state
        side[layout.torques(N)] = torque
        side[states[0]] = _states(np.asarray(problem.q_start), np.asarray(problem.v_start), scales)
        side[states[-1]] = _states(np.asarray(problem.q_goal), np.asarray(problem.v_goal), scales)
        sides.append(side)
    return sides[0], sides[1]


def doubled(intervals: int, finest: int) -> int | None:
    """Number of intervals of the next finer mesh; None: it would exceed the finest."""
    return 2 * intervals if 2 * intervals <= finest else None


def mesh(intervals: int) -> Array:
    """Knots as parts of the duration, shape (intervals + 1,)."""
    return np.linspace(0, 1, intervals + 1)


def worst_defect(
    problem: MinimumTimeProblem, layout: Layout, x: Array, defects: Array, fractions: Array, scales: Scales
) -> Violation:
    """The most violated equation of motion; bounds are never violated, as IPOPT satisfies them.

    Args:
        problem: the minimum-time problem.
        layout: layout of the unknowns.
        x: the unknowns.
        defects: violation of every equation, interval by interval.
        fractions: interval lengths over duration.
        scales: scales of the unknowns.
    """
    defects = np.abs(defects)
    interval, row = np.unravel_index(np.argmax(np.nan_to_num(defects, nan=np.inf)), defects.shape)
    time = float(x[layout.knot.time]) * scales.time * float(np.sum(fractions[:interval]))
    constraint, joint = layout.equation(int(row))
    return Violation(constraint, problem.robot.joint_names[joint], time, float(defects[interval, row]))
