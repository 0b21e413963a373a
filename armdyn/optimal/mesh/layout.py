"""Unknowns and parameters of a program: their indices by name, and their numbers from motions and to them.

The unknowns are in the order of time, and the final time is copied to every knot:

    w = [knot_0 | inner_0 | knot_1 | inner_1 | … | knot_N]
    knot_k  = q, v, T, and the torque if it is linear between knots
    inner_k = q and v in the middle, and the torque unless it is linear

Slices work for numpy arrays and CasADi's SX, MX and DM. All numbers are scaled by the size of the program's guess.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Self

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.locks import cached_property
from armdyn.optimal.mesh.starts import Guesses
from armdyn.optimal.problem.options import Scheme
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.problem.task import Task
from armdyn.trajectory import Trajectory

BODY = 10
"""Number of dynamic parameters of a body: mass, first moments, inertia."""
KEPT = 256
"""Number of cached index arrays, and four times that of programs with IPOPT: a search solves hundreds on few meshes."""


@lru_cache(KEPT)
def _places(first: int, size: int, block: int, blocks: int) -> Index:
    """Indices of a part of every block, shape (blocks, size)."""
    places = block * np.arange(blocks)[:, None] + first + np.arange(size)
    places.setflags(write=False)
    return places


@dataclass(frozen=True)
class KnotFields:
    """Indices of a knot's block.

    Attributes:
        q: positions.
        v: velocities.
        state: positions and velocities.
        time: the final time T.
        torque: torques; empty unless linear between knots.
        size: size of the block.
    """

    q: slice
    v: slice
    state: slice
    time: int
    torque: slice
    size: int


@dataclass(frozen=True)
class Layout:
    """Indices of the program of an arm with `nv` joints."""

    nv: int
    scheme: Scheme

    @property
    def linear(self) -> bool:
        """Whether the torque is linear between knots, and so an unknown at knots."""
        return self.scheme.control == "linear"

    @cached_property
    def knot(self) -> KnotFields:
        """Slices of a knot's unknowns."""
        n = self.nv
        torque = slice(2 * n + 1, 2 * n + 1 + (n if self.linear else 0))
        return KnotFields(slice(0, n), slice(n, 2 * n), slice(0, 2 * n), 2 * n, torque, torque.stop)

    @property
    def rows(self) -> int:
        """Number of equations: defects of (q, v) in the middle and at the end, and the difference of final times."""
        return 4 * self.nv + 1

    @property
    def block(self) -> int:
        """Number of unknowns from one knot to the next."""
        return self.knot.size + 2 * self.nv + (0 if self.linear else self.nv)

    @property
    def width(self) -> int:
        """Number of an interval's unknowns: its two knots' and its own."""
        return self.block + self.knot.size

    def size(self, intervals: int) -> int:
        """Number of unknowns of a program."""
        return self.block * intervals + self.knot.size

    def parts(self, y: Any) -> tuple[Any, Any, Any]:
        """Split an interval's unknowns into its first knot's, its own, and its last knot's."""
        return y[: self.knot.size], y[self.knot.size : self.block], y[self.block : self.width]

    def intervals(self, N: int) -> Index:
        """Indices of each interval's unknowns, a column each, shape (width, N)."""
        return self.block * np.arange(N)[None, :] + np.arange(self.width)[:, None]

    def knots(self, N: int) -> Index:
        """Indices of each knot's unknowns, shape (N + 1, knot)."""
        return _places(0, self.knot.size, self.block, N + 1)

    def inners(self, N: int) -> Index:
        """Indices of each interval's own unknowns: q and v in its middle, and its torque unless linear."""
        return _places(self.knot.size, self.block - self.knot.size, self.block, N)

    def times(self, N: int) -> Index:
        """Indices of the final times, shape (N + 1,)."""
        return self.knots(N)[:, self.knot.time]

    def states(self, N: int) -> Index:
        """Indices of each knot's q and v, shape (N + 1, 2 nv)."""
        return self.knots(N)[:, self.knot.state]

    def middles(self, N: int) -> Index:
        """Indices of q and v in the middle of each interval, shape (N, 2 nv)."""
        return self.inners(N)[:, : 2 * self.nv]

    def torques(self, N: int) -> Index:
        """Indices of the torques, shape (N + 1, nv) at knots if linear, else (N, nv) of intervals."""
        return self.knots(N)[:, self.knot.torque] if self.linear else self.inners(N)[:, 2 * self.nv :]

    def equation(self, row: int) -> tuple[str, int]:
        """Kind and joint of an interval's equation; that of final times counts as a position's."""
        row = row % (2 * self.nv)
        return "position defect" if row < self.nv else "velocity defect", row % self.nv

    def condensed(self, N: int) -> Index:
        """Indices of the unknowns of the condensed program: x_0, u_0, x_1, u_1, …, x_N, and the first final time."""
        return _condensed(self, N)


@lru_cache(KEPT)
def _condensed(layout: Layout, N: int) -> Index:
    states = np.sort(np.concatenate([layout.states(N).ravel(), layout.torques(N).ravel()]))
    places = np.append(states, layout.times(N)[0])
    places.setflags(write=False)
    return places


@dataclass(frozen=True)
class Parameters:
    """Parameters of an interval's equations, as numbers or symbols; of a program with the fractions of all intervals.

    Attributes:
        fraction: the interval's length over the duration; of a program shape (N,).
        time: scale of time [s]; of several programs, as also the next two, shape (k,).
        length: scale of positions [rad or m].
        speed: scale of velocities [rad/s or m/s].
        weights: weights of the squared scaled torques, shape (nv,).
        effort: scales of torques [N m or N], shape (nv,).
        last_body: dynamic parameters of the body on the last joint, shape (10,).
    """

    fraction: Any
    time: Any
    length: Any
    speed: Any
    weights: Any
    effort: Any
    last_body: Any

    @staticmethod
    def size(joints: int, intervals: int = 1) -> int:
        """Number of parameters: all but the fraction are common to all intervals."""
        return intervals + 3 + 2 * joints + BODY

    @classmethod
    def of(cls, p: Any, joints: int) -> Self:
        """Split an interval's parameter vector by name."""
        weights, effort = slice(4, 4 + joints), slice(4 + joints, 4 + 2 * joints)
        return cls(p[0], p[1], p[2], p[3], p[weights], p[effort], p[4 + 2 * joints : 4 + 2 * joints + BODY])

    @classmethod
    def sized(cls, task: Task, guesses: Guesses, fractions: Array, tie: float = 0.0) -> Self:
        """Parameters of programs, in units of their guesses.

        Args:
            task: the problem and its settings.
            guesses: the guesses, k of them.
            fractions: interval lengths over the duration, shape (N,).
            tie: cost of all torques at their limits relative to time's 1, in equal parts for all joints: it determines
                joints that time leaves idle.
        """
        limits, time = task.problem.limits, guesses.durations
        length = np.maximum(np.ptp(guesses.q, axis=1).max(axis=1), 0.1)
        effort = np.where(limits.passive, limits.actuators.scale, limits.actuators.strongest)
        weights = task.problem.effort_weight * effort**2 + 2 * tie / effort.size
        return cls(fractions, time, length, length / time, weights, effort, task.dynamics.last_body)

    def each(self) -> list[Self]:
        """The parameters of every program."""
        units = zip(self.time.tolist(), self.length.tolist(), self.speed.tolist(), strict=True)
        return [replace(self, time=time, length=length, speed=speed) for time, length, speed in units]

    def states(self, q: Any, v: Any) -> Array:
        """Scaled states of every program, shape (k, …, 2 nv)."""
        length, speed = (np.reshape(unit, (-1, 1, 1)) for unit in (self.length, self.speed))
        return np.concatenate([q / length, v / speed], axis=-1)

    def packed(self) -> Array:
        """Concatenate the parameters of one program."""
        fractions = np.atleast_1d(self.fraction)
        return np.array([*fractions, self.time, self.length, self.speed, *self.weights, *self.effort, *self.last_body])

    @classmethod
    def by_interval(cls, joints: int, intervals: int) -> Index:
        """Indices of each interval's parameters, a column each, shape (count, intervals)."""
        shared = np.arange(intervals, cls.size(joints, intervals))[:, None].repeat(intervals, axis=1)
        return np.vstack([np.arange(intervals), shared])


def to_unknowns(guesses: Guesses, layout: Layout, by: Parameters) -> Array:
    """Unknowns of motions, shape (k, unknowns).

    Args:
        guesses: the motions, k of them.
        layout: layout of the unknowns.
        by: parameters of their programs.
    """
    N, durations = by.fraction.size, guesses.durations
    knots = durations[:, None] * np.concatenate([[0], np.cumsum(by.fraction)])
    q, v, tau = guesses.at(np.concatenate([knots, (knots[:, :-1] + knots[:, 1:]) / 2], axis=1))
    states, torques, times = by.states(q, v), tau / by.effort, (durations / by.time)[:, None]
    x = np.empty((durations.size, layout.size(N)))
    x[:, layout.states(N)], x[:, layout.middles(N)] = states[:, : N + 1], states[:, N + 1 :]
    x[:, layout.torques(N)], x[:, layout.times(N)] = (
        torques[:, : N + 1] if layout.linear else torques[:, N + 1 :],
        times,
    )
    return x


def to_trajectory(
    x: Array, layout: Layout, by: Parameters, joint_names: tuple[str, ...], legs: Sequence[int] = ()
) -> Trajectory:
    """Trajectory of the unknowns: samples at the knots and at the stages between.

    Args:
        x: the unknowns.
        layout: layout of the unknowns.
        by: parameters of the program; fractions are of the legs.
        joint_names: names of the joints.
        legs: number of intervals per leg; by default one leg.
    """
    N = by.fraction.size
    states, middles, tau, T = (x[at(N)] for at in (layout.states, layout.middles, layout.torques, layout.times))
    times, first = np.zeros(N + 1), 0
    for length in legs or (N,):
        last = first + length
        duration = max(float(T[first]) * by.time, 1e-9)
        times[first + 1 : last + 1] = times[first] + duration * np.cumsum(by.fraction[first:last])
        first = last
    left, right = (tau[:-1], tau[1:]) if layout.linear else (tau, tau)
    t = np.stack([times[:-1], (times[:-1] + times[1:]) / 2, np.nextafter(times[1:], 0)], axis=1)
    t[-1, 2], kept = times[N], np.ones((N, 3), bool)
    kept[:-1, 2] = not layout.linear  # where torques jump, one ulp before the next knot
    at = np.stack([states[:-1], middles, states[1:]], axis=1)[kept]
    torques = np.stack([left, (left + right) / 2, right], axis=1)[kept] * by.effort
    q, v = at[:, layout.knot.q] * by.length, at[:, layout.knot.v] * by.speed
    return Trajectory(t[kept], q, v, torques, joint_names, "minimum time")


def bounds(problem: MinimumTimeProblem, layout: Layout, by: Parameters) -> tuple[Array, Array]:
    """Lower and upper bounds of the unknowns, each of shape (k, unknowns); start and goal are equal bounds."""
    limits, N, sides = problem.limits, by.fraction.size, []
    states, ends = (
        layout.states(N),
        by.states(*np.array([problem.x_start, problem.x_goal]).reshape(2, 2, -1).swapaxes(0, 1)),
    )
    for position, speed, effort, end in (
        (limits.position_lower, -limits.velocity, limits.actuators.lower, -1),
        (limits.position_upper, limits.velocity, limits.actuators.upper, 1),
    ):
        side, state = np.full((np.size(by.time), layout.size(N)), end * np.inf), by.states(position, speed)
        side[:, states], side[:, layout.middles(N)] = state, state
        least = np.maximum(problem.duration_bound() / np.reshape(by.time, (-1, 1)), 1e-3)
        side[:, layout.times(N)] = least if end < 0 else 1e3
        side[:, layout.torques(N)] = effort / by.effort
        side[:, states[[0, -1]]] = ends
        sides.append(side)
    return sides[0], sides[1]


def mesh(intervals: int) -> Array:
    """Knots as parts of the duration, shape (intervals + 1,)."""
    return np.linspace(0, 1, intervals + 1)


def worst_defect(problem: MinimumTimeProblem, layout: Layout, x: Array, defects: Array, by: Parameters) -> Violation:
    """The most violated equation of motion; bounds are never violated, as IPOPT satisfies them.

    Args:
        problem: the minimum-time problem.
        layout: layout of the unknowns.
        x: the unknowns.
        defects: violation of every equation, interval by interval.
        by: parameters of the program.
    """
    defects = np.abs(defects)
    interval, row = np.unravel_index(np.argmax(np.nan_to_num(defects, nan=np.inf)), defects.shape)
    time = float(x[layout.knot.time]) * by.time * float(np.sum(by.fraction[:interval]))
    constraint, joint = layout.equation(int(row))
    return Violation(constraint, problem.robot.joint_names[joint], time, float(defects[interval, row]))
