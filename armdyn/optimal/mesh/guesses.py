"""Batches of guesses, and the unknowns of their condensed programs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.optimal.mesh.layout import CondensedLayout
from armdyn.optimal.mesh.unknowns import Scales, bounds, mesh
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory
from armdyn.trajectory.interpolation import cubic


@dataclass(frozen=True, eq=False)
class Guesses:
    """Motions as initial guesses, all with the same number of samples.

    Attributes:
        t: times [s], from 0, shape (k, samples).
        q: joint positions [rad or m], shape (k, samples, nv).
        v: joint velocities [rad/s or m/s], shape (k, samples, nv).
        tau: joint torques [N m or N], shape (k, samples, nv).
    """

    t: Array
    q: Array
    v: Array
    tau: Array

    @property
    def durations(self) -> Array:
        """Duration of each guess [s], shape (k,)."""
        return np.asarray(self.t[:, -1])

    @classmethod
    def sampled(cls, motions: Sequence[Trajectory], samples: int) -> Self:
        """Sample motions at evenly spaced times, the same number for each."""
        t = [np.linspace(0, 1, samples) * motion.duration for motion in motions]
        at = [motion(motion.t[0] + times) for motion, times in zip(motions, t, strict=True)]
        return cls(np.stack(t), *(np.stack(parts) for parts in zip(*at, strict=True)))

    @classmethod
    def joined(cls, several: Sequence["Guesses"]) -> Self:
        """Concatenate guesses that have the same number of samples."""
        parts = zip(*((one.t, one.q, one.v, one.tau) for one in several), strict=True)
        return cls(*(np.concatenate(part) for part in parts))

    def chosen(self, which: Sequence[int]) -> "Guesses":
        """The guesses at given indices."""
        at: Index = np.array(which)
        return Guesses(self.t[at], self.q[at], self.v[at], self.tau[at])

    def motion(self, k: int, joint_names: tuple[str, ...]) -> Trajectory:
        """One guess as a motion."""
        return Trajectory(self.t[k], self.q[k], self.v[k], self.tau[k], joint_names, "start")

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and torques at times of each guess, shape (k, n); each result has shape (k, n, nv).

        Bitwise equal to `Trajectory`: last bits decide between optima that lie close together.
        """
        t, at = self.t, np.minimum(times, self.t[:, -1:])
        found = [np.searchsorted(own, some, side="right") - 1 for own, some in zip(t, at, strict=True)]
        k = np.clip(found, 0, self.q.shape[1] - 2)
        each = np.arange(len(k))[:, None]
        left, h = t[each, k], (t[each, k + 1] - t[each, k])[..., None]
        s = (at - left)[..., None] / h
        (q0, q1), (v0, v1), (tau0, tau1) = ((own[each, k], own[each, k + 1]) for own in (self.q, self.v, self.tau))
        return *cubic(s, h, (q0, q1), (v0, v1)), tau0 + s * (tau1 - tau0)


def condensed_starts(
    problem: MinimumTimeProblem, layout: CondensedLayout, guesses: Guesses, intervals: int
) -> tuple[Array, Array, Array, list[Scales]]:
    """Scaled unknowns of the condensed programs of guesses, on a mesh of equal intervals.

    Args:
        problem: the minimum-time problem.
        layout: layout with constant torques in the intervals.
        guesses: the guesses.
        intervals: number of intervals N.

    Returns:
        Initial unknowns, their lower and upper bounds, each of shape (k, unknowns), and the scales of each guess.
    """
    n, N, effort = problem.robot.nv, intervals, Scales.efforts(problem)
    time, ways = guesses.durations, np.ptp(guesses.q, axis=1).max(axis=1)
    scales = [Scales.sized(*sizes, effort) for sizes in zip(time, ways, strict=True)]
    length, speed = (np.array([getattr(one, unit) for one in scales]) for unit in ("length", "speed"))
    unit = np.empty((len(scales), 3 * n * N + 2 * n + 1))  # of x_0, u_0, x_1, …, x_N, T
    at = unit[:, : 3 * n * N].reshape(len(scales), N, 3 * n)
    at[..., :n], at[..., n : 2 * n], at[..., 2 * n :] = length[:, None, None], speed[:, None, None], 1.0
    unit[:, -2 * n - 1 : -n - 1], unit[:, -n - 1 : -1], unit[:, -1] = length[:, None], speed[:, None], 1.0

    knots = time[:, None] * np.concatenate([[0.0], np.cumsum(np.diff(mesh(N)))])
    q, v, _ = guesses.at(knots)
    tau = guesses.at((knots[:, :-1] + knots[:, 1:]) / 2)[2] / effort
    inner = np.concatenate([q[:, :-1], v[:, :-1], tau], axis=2).reshape(len(scales), -1)
    x = np.concatenate([inner, q[:, -1], v[:, -1], np.ones((len(scales), 1))], axis=1) / unit
    # Bounds in rad, rad/s and the torque's scale.
    sides = bounds(problem, layout.full, N, Scales(1.0, 1.0, 1.0, effort))
    lower, upper = (side[layout.kept(N)] / unit for side in sides)
    lower[:, -1] = np.maximum(problem.duration_bound() / time, 1e-3)
    return np.clip(x, lower, upper), lower, upper, scales
