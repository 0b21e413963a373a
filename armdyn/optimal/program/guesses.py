"""Batches of guesses, and the unknowns of their condensed programs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.layout import CondensedLayout
from armdyn.optimal.program.unknowns import Scales, bounds, mesh
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

    def scales(self, problem: MinimumTimeProblem) -> list[Scales]:
        """Scales of each guess's program."""
        ways = np.ptp(self.q, axis=1).max(axis=1)
        effort = Scales.efforts(problem)
        return [Scales.sized(time, way, effort) for time, way in zip(self.durations, ways, strict=True)]


@dataclass(frozen=True, eq=False)
class CondensedStarts:
    """Scaled unknowns of the condensed programs of guesses, on a mesh of equal intervals.

    Attributes:
        x: initial unknowns, shape (k, unknowns).
        lower: lower bounds, likewise.
        upper: upper bounds, likewise.
        scales: scales of each guess.
    """

    x: Array
    lower: Array
    upper: Array
    scales: list[Scales]

    @classmethod
    def of(cls, problem: MinimumTimeProblem, layout: CondensedLayout, guesses: Guesses, intervals: int) -> Self:
        """Make the unknowns of guesses.

        Args:
            problem: the minimum-time problem.
            layout: layout with constant torques in the intervals.
            guesses: the guesses.
            intervals: number of intervals N.
        """
        n, N, scales = problem.robot.nv, intervals, guesses.scales(problem)
        length, speed, time = (np.array([getattr(one, unit) for one in scales]) for unit in ("length", "speed", "time"))
        unit = np.empty((len(scales), 3 * n * N + 2 * n + 1))  # of x_0, u_0, x_1, …, x_N, T
        at = unit[:, : 3 * n * N].reshape(len(scales), N, 3 * n)
        at[..., :n], at[..., n : 2 * n], at[..., 2 * n :] = length[:, None, None], speed[:, None, None], 1.0
        unit[:, -2 * n - 1 : -n - 1], unit[:, -n - 1 : -1], unit[:, -1] = length[:, None], speed[:, None], 1.0

        knots = guesses.durations[:, None] * np.concatenate([[0.0], np.cumsum(np.diff(mesh(N)))])
        q, v, _ = guesses.at(knots)
        tau = guesses.at((knots[:, :-1] + knots[:, 1:]) / 2)[2] / Scales.efforts(problem)
        x = np.ones_like(unit)
        x[:, :-1] = np.concatenate(
            [np.concatenate([q[:, :-1], v[:, :-1], tau], axis=2).reshape(len(scales), -1), q[:, -1], v[:, -1]], axis=1
        )
        x /= unit
        # Bounds in rad, rad/s and the torque's scale.
        sides = bounds(problem, layout.full, N, Scales(1.0, 1.0, 1.0, Scales.efforts(problem)))
        lower, upper = (side[layout.kept(N)] / unit for side in sides)
        lower[:, -1] = np.maximum(problem.duration_bound() / time, 1e-3)
        return cls(np.clip(x, lower, upper), lower, upper, scales)
