"""Between trajectories and the scaled unknowns of an NLP."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.program.assembly import Layout
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scales:
    """What is one in the scaled problem.

    Attributes:
        time: [s].
        length: [rad or m].
        speed: [rad/s or m/s].
        effort: [N m or N], shape (nv,).
    """

    time: float
    length: float
    speed: float
    effort: Array

    @classmethod
    def of(cls, problem: MinimumTimeProblem, guess: Trajectory) -> Self:
        """Scales from the limits and the size of a guess."""
        length = float(max(np.max(np.ptp(guess.q, axis=0)), 0.1))
        limits = problem.limits
        effort = np.maximum(np.abs(limits.effort_lower), np.abs(limits.effort_upper))
        return cls(guess.duration, length, length / guess.duration, effort)

    def parameters(self, weights: Array, last_body: Array) -> Array:
        """The NLP's parameters after the interval fractions.

        Args:
            weights: of the squares of scaled torques, shape (nv,).
            last_body: dynamic parameters of the last joint's body, shape (10,).
        """
        return np.array([self.time, self.length, self.speed, *weights, *self.effort, *last_body])

    def weights(self, effort_weight: float, tie: float = 0.0) -> Array:
        """Of the squares of scaled torques, shape (nv,).

        Args:
            effort_weight: the problem's w [1/(N m)²].
            tie: what all torques at their limits shall cost beside the 1 of time, an equal part for every joint
                however strong: it decides between equals where one joint alone determines the time.
        """
        return effort_weight * self.effort**2 + 2 * tie / self.effort.size


def _states(q: Array, v: Array, scales: Scales) -> Array:
    return np.concatenate([q / scales.length, v / scales.speed], axis=-1)


def to_unknowns(guess: Trajectory, layout: Layout, fractions: Array, scales: Scales) -> Array:
    """The unknowns of a motion that is read off a trajectory.

    Args:
        guess: any trajectory; its times are used as they are.
        layout: of the unknowns.
        fractions: interval lengths over duration, shape (N,).
        scales: of the unknowns.
    """
    tableau, scheme, N = layout.scheme.tableau, layout.scheme, fractions.size
    duration = guess.duration
    knots = guess.t[0] + duration * np.concatenate([[0], np.cumsum(fractions)])
    at_knots = guess(knots)
    knot = [_states(at_knots.q, at_knots.v, scales), np.full((N + 1, 1), duration / scales.time)]
    if scheme.control == "linear":
        knot.append(at_knots.tau / scales.effort)
    stage_times = knots[:-1, None] + duration * fractions[:, None] * tableau.c
    inner_times = stage_times[:, tableau.inner.start : tableau.inner.stop]
    at_inner = guess(inner_times)
    inner = [_states(at_inner.q, at_inner.v, scales).reshape(N, -1)]
    if scheme.control == "constant":
        inner.append(guess((knots[:-1] + knots[1:]) / 2).tau / scales.effort)
    if scheme.control == "stage":
        inner.append((guess(stage_times).tau / scales.effort).reshape(N, -1))
    if scheme.dynamics == "inverse":
        step = 1e-3 * duration / N
        before = np.maximum(stage_times - step, guess.t[0])
        after = np.minimum(stage_times + step, guess.t[-1])
        a = (guess(after).v - guess(before).v) / (after - before)[..., None]
        inner.append((a * scales.time / scales.speed).reshape(N, -1))
    blocks = np.concatenate([*(k[:-1] for k in knot), *inner], axis=1)
    return np.concatenate([blocks.ravel(), *(k[-1] for k in knot)])


def split(x: Array, layout: Layout, intervals: int) -> tuple[Array, Array]:
    """Knot blocks, shape (N + 1, knot), and inner blocks, shape (N, inner), of the unknowns."""
    blocks = x[: -layout.knot].reshape(intervals, -1)
    knots = np.vstack([blocks[:, : layout.knot], x[-layout.knot :]])
    return knots, blocks[:, layout.knot :]


def to_trajectory(
    x: Array,
    layout: Layout,
    fractions: Array,
    scales: Scales,
    joint_names: tuple[str, ...],
    legs: Sequence[int] = (),
) -> Trajectory:
    """The motion that unknowns stand for: samples at the knots and at the stages between them.

    Args:
        x: the unknowns.
        layout: of them.
        fractions: of every interval in its leg, shape (N,).
        scales: of the unknowns.
        joint_names: of the arm.
        legs: intervals of every leg; by default there is one.
    """
    n, N, tableau = layout.nv, fractions.size, layout.scheme.tableau
    knots, inner = split(x, layout, N)
    times, first = np.zeros(N + 1), 0
    for length in legs or (N,):
        last = first + length
        duration = max(float(knots[first, 2 * n]) * scales.time, 1e-9)
        times[first + 1 : last + 1] = times[first] + duration * np.cumsum(fractions[first:last])
        first = last
    stages = list(tableau.inner)
    rows: list[tuple[float, Array, Array]] = []
    for k in range(N):
        if layout.scheme.control == "linear":
            left, right = knots[k, 2 * n + 1 :], knots[k + 1, 2 * n + 1 :]
        else:
            left = right = inner[k, layout.stages : layout.stages + n]
        rows.append((times[k], knots[k, : 2 * n], left))
        for i, stage in enumerate(stages):
            c = tableau.c[stage]
            state = inner[k, 2 * n * i : 2 * n * (i + 1)]
            rows.append((times[k] + c * (times[k + 1] - times[k]), state, (1 - c) * left + c * right))
        if layout.scheme.control == "constant" and k < N - 1:  # the jump: one ulp before the next knot
            rows.append((np.nextafter(times[k + 1], 0), knots[k + 1, : 2 * n], right))
    rows.append((times[N], knots[N, : 2 * n], right))
    t, states, tau = (np.array(part) for part in zip(*rows, strict=True))
    q, v = states[:, :n] * scales.length, states[:, n:] * scales.speed
    return Trajectory(t, q, v, tau * scales.effort, joint_names, "minimum time")


def bounds(problem: MinimumTimeProblem, layout: Layout, intervals: int, scales: Scales) -> tuple[Array, Array]:
    """Lower and upper bounds of the scaled unknowns; start and goal are bounds that coincide."""
    limits, N = problem.limits, intervals
    sides = []
    for position, speed, effort, end in (
        (limits.position_lower, -limits.velocity, limits.effort_lower, -1),
        (limits.position_upper, limits.velocity, limits.effort_upper, 1),
    ):
        state, torque = _states(position, speed, scales), effort / scales.effort
        duration = max(problem.duration_bound() / scales.time, 1e-3) if end < 0 else 1e3
        linear, stages = layout.scheme.control == "linear", len(layout.scheme.tableau.inner)
        knot = np.concatenate([state, [duration], torque if linear else []])
        inner = np.full(layout.inner, end * np.inf)
        inner[: layout.stages] = np.tile(state, stages)
        if not linear:
            own = layout.torques // layout.nv
            inner[layout.stages : layout.stages + layout.torques] = np.tile(torque, own)
        side = np.concatenate([np.tile(np.concatenate([knot, inner]), N), knot])
        side[: 2 * layout.nv] = _states(np.asarray(problem.q_start), np.asarray(problem.v_start), scales)
        first = side.size - layout.knot
        side[first : first + 2 * layout.nv] = _states(np.asarray(problem.q_goal), np.asarray(problem.v_goal), scales)
        sides.append(side)
    return sides[0], sides[1]


def worst_violation(
    problem: MinimumTimeProblem, layout: Layout, x: Array, defects: Array, fractions: Array, scales: Scales
) -> Violation:
    """The equation of motion that unknowns violate most; IPOPT keeps bounds, so it is no limit.

    Args:
        problem: what is solved.
        layout: of the unknowns.
        x: the unknowns.
        defects: how far every equation is from its bounds, those of an interval in a row.
        fractions: of the intervals.
        scales: of the unknowns.
    """
    n, defects = layout.nv, np.abs(defects)
    interval, row = np.unravel_index(np.argmax(np.nan_to_num(defects, nan=np.inf)), defects.shape)
    duration = float(x[2 * n]) * scales.time
    time = duration * float(np.sum(fractions[:interval]))
    dynamics = n * layout.scheme.tableau.c.size if layout.scheme.dynamics == "inverse" else 0
    names = problem.robot.joint_names
    value = float(defects[interval, row])
    if row < dynamics:
        return Violation("equation of motion", names[row % n], time, value)
    row = (row - dynamics) % (2 * n)
    return Violation("position defect" if row < n else "velocity defect", names[row % n], time, value)


def mesh(intervals: int, graded: bool) -> Array:
    """Knots as parts of the duration, shape (intervals + 1,): even, or dense at both ends."""
    even = np.linspace(0, 1, intervals + 1)
    return 0.3 * even + 0.35 * (1 - np.cos(np.pi * even)) if graded else even
