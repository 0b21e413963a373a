"""Motions as piecewise B-splines on clamped meshes: legs of control points, each with its duration.

De Boor, A Practical Guide to Splines, 1978, chapters IX to XI.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline
from scipy.optimize import brentq

from armdyn.arrays import Array, Index
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.locks import cached_property
from armdyn.models.robots.robot import Robot
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory

DEGREE = 4
"""Degree of positions: accelerations are quadratic between breaks, and torques have no corners."""
WINDOW = DEGREE + 1
"""Number of control points on which an interval of a curve depends."""


def graded(intervals: int, shortest: float, longest: float = 1.0, ends: tuple[bool, bool] = (True, True)) -> Array:
    """Breaks from 0 to 1 whose distances grow geometrically from the ends, shape (intervals + 1,).

    Args:
        intervals: number of intervals.
        shortest: length of the first and the last interval, as a part of the whole.
        longest: largest length of an interval; exceeded if the intervals are too few.
        ends: whether the lengths grow from the start, and from the end.
    """
    if not any(ends):
        return np.linspace(0, 1, intervals + 1)
    count = np.arange(intervals)
    steps = np.minimum(count if ends[0] else intervals, count[::-1] if ends[1] else intervals)

    def lengths(growth: float) -> Array:
        return np.minimum(shortest * np.exp(np.minimum(growth * steps, 700.0)), longest)

    def beyond(growth: float) -> float:
        return float(np.log(np.sum(lengths(growth))))

    can_grow = intervals > 2 and beyond(0.0) < 0 and intervals * longest > 1
    growth = brentq(beyond, 0.0, -np.log(shortest)) if can_grow else 0.0
    breaks = np.cumsum(lengths(growth))
    return np.append(0.0, breaks / breaks[-1])


@dataclass(frozen=True, eq=False)
class Basis:
    """B-splines of degree `DEGREE` on a clamped mesh from 0 to 1: a curve starts and ends at a control point.

    Attributes:
        breaks: breaks of the mesh, shape (intervals + 1,).
    """

    breaks: Array

    @property
    def intervals(self) -> int:
        """Number of intervals."""
        return self.breaks.size - 1

    @property
    def size(self) -> int:
        """Number of control points of a curve."""
        return self.intervals + DEGREE

    @cached_property
    def knots(self) -> Array:
        """Breaks, the ends repeated, shape (size + DEGREE + 1,)."""
        return np.concatenate([np.zeros(DEGREE), self.breaks, np.ones(DEGREE)])

    @cached_property
    def places(self) -> Array:
        """Greville abscissae, shape (size,)."""
        return np.array([self.knots[i + 1 : i + 1 + DEGREE].mean() for i in range(self.size)])

    def factors(self, order: int) -> Array:
        """Factors from differences of a derivative's control points to the control points of the next derivative.

        Args:
            order: order of the resulting derivative, from 1.

        Returns:
            Shape (size - order,).
        """
        degree, knots = DEGREE - order + 1, self.knots[order - 1 : self.knots.size - order + 1]
        first = np.arange(self.size - order) + 1
        return np.asarray(degree / (knots[first + degree] - knots[first]))

    def differences(self, order: int) -> Array:
        """Factors from neighbouring control points to those of a derivative, shape (size - order, order + 1)."""
        matrix = np.eye(self.size)
        for k in range(1, order + 1):
            matrix = self.factors(k)[:, None] * np.diff(matrix, axis=0)
        window = np.arange(len(matrix))[:, None] + np.arange(order + 1)
        return np.take_along_axis(matrix, window, axis=1)

    def gauss(self, points: int) -> tuple[Array, Array]:
        """Gauss points in every interval and their weights, each of shape (intervals, points)."""
        nodes, weights = np.polynomial.legendre.leggauss(points)
        lengths = np.diff(self.breaks)[:, None]
        return self.breaks[:-1, None] + lengths * (nodes + 1) / 2, lengths * weights / 2

    def squared(self, order: int, points: int) -> Array:
        """Integrals over s of products of two B-splines' derivatives, shape (size, size).

        Args:
            order: order of the derivative.
            points: number of Gauss points per interval.
        """
        s, weights = (each.ravel() for each in self.gauss(points))
        values = self.values(s, order)
        return np.asarray(values.T @ (weights[:, None] * values))

    def values(self, s: Array, order: int) -> Array:
        """Derivatives of all B-splines at s, shape (m, size)."""
        return np.asarray(BSpline(self.knots, np.eye(self.size), DEGREE)(s, order))

    def interval_of(self, s: Array) -> Index:
        """Index of the interval that contains each s, of the shape of s."""
        return np.clip(np.searchsorted(self.breaks, s, side="right") - 1, 0, self.intervals - 1)

    def window(self, s: Array) -> Index:
        """Indices of the control points on which a curve depends at s, shape (m, WINDOW)."""
        return self.interval_of(s)[:, None] + np.arange(WINDOW)

    def local(self, s: Array, derivatives: int = 2) -> Array:
        """Values and derivatives of the nonzero B-splines at s.

        Args:
            s: places from 0 to 1, shape (m,).
            derivatives: highest order.

        Returns:
            Shape (m, derivatives + 1, WINDOW), for the control points of `window`.
        """
        window, orders = self.window(s), range(derivatives + 1)
        return np.stack([np.take_along_axis(self.values(s, order), window, axis=1) for order in orders], axis=1)

    def curve(self, points: Array) -> BSpline:
        """B-spline over s with given control points, shape (size, nv)."""
        return BSpline(self.knots, points, DEGREE)


_RAMP = 0.1
"""Part of a straight guess's time for its acceleration, and for its deceleration."""


@dataclass(frozen=True, eq=False)
class CurveLeg:
    """Curve from one given pose to the next.

    Attributes:
        basis: B-splines of the leg.
        points: control points [rad or m], shape (basis.size, nv).
        duration: duration [s].
    """

    basis: Basis
    points: Array
    duration: float

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations at s, parts of the duration, each of shape (m, nv)."""
        curve, T = self._curve, self.duration
        return curve(s), curve(s, 1) / T, curve(s, 2) / T**2

    @property
    def fastest(self) -> Array:
        """Upper bounds of the joints' speeds, from their control points [rad/s or m/s], shape (nv,)."""
        controls = self.basis.factors(1)[:, None] * np.diff(self.points, axis=0)
        return np.asarray(np.max(np.abs(controls), axis=0) / self.duration)

    def torques(self, robot: Robot, s: Array) -> Array:
        """Torques at s, parts of the duration, by `rnea` and friction [N m or N], shape (m, nv)."""
        return inverse_dynamics(robot)(*self.at(s))

    @cached_property
    def _curve(self):  # type: ignore[no-untyped-def]  # scipy's BSpline
        return self.basis.curve(self.points)


@dataclass(frozen=True, eq=False)
class Curve:
    """Motion from start to goal along legs of B-splines.

    Attributes:
        legs: from pose to pose, at least one.
    """

    legs: tuple[CurveLeg, ...]

    @classmethod
    def straight(cls, problem: MinimumTimeProblem, basis: Basis, durations: ArrayLike) -> Self:
        """Make a curve from pose to pose on straight lines: accelerate, cruise, decelerate.

        Args:
            problem: problem with the poses.
            basis: basis of every leg.
            durations: durations of the legs [s], shape (legs,), or one for all.
        """
        paths = [np.array(pair) for pair in pairwise(problem.poses)]
        return cls.along(paths, [basis] * len(paths), durations, np.ones(problem.robot.nv))

    @classmethod
    def along(
        cls, paths: Sequence[Array], bases: Sequence[Basis], durations: ArrayLike, speed: Array, flying: bool = False
    ) -> Self:
        """Make a curve along paths of straight segments: accelerate, cruise, decelerate.

        Args:
            paths: path of every leg: joint positions [rad or m], shape (n, nv).
            bases: basis of every leg.
            durations: durations of the legs [s], shape (legs,), or one for all.
            speed: scales of the joints against each other [rad/s or m/s], shape (nv,).
            flying: whether the curve passes the poses between the legs at speed.
        """
        legs, last = [], len(paths) - 1
        every = zip(paths, bases, np.broadcast_to(durations, len(paths)), strict=True)
        for k, (path, basis, duration) in enumerate(every):
            part = _ramped(basis.places, k == 0 or not flying, k == last or not flying)
            marks = np.append(0.0, np.cumsum(np.max(np.abs(np.diff(path, axis=0)) / speed, axis=1)))
            points = np.column_stack([np.interp(part * marks[-1], marks, column) for column in path.T])
            legs.append(CurveLeg(basis, points, float(duration)))
        return cls(tuple(legs))

    def on(self, bases: Sequence[Basis]) -> Self:
        """Approximate the curve on other bases of its legs."""
        pairs = zip(bases, self.legs, strict=True)
        return replace(self, legs=tuple(CurveLeg(own, leg.at(own.places)[0], leg.duration) for own, leg in pairs))

    @classmethod
    def from_motion(cls, motion: Trajectory, basis: Basis) -> Self:
        """Make a curve of one leg with control points sampled from a motion."""
        at = motion(motion.t[0] + motion.duration * basis.places)
        return cls((CurveLeg(basis, at.q, motion.duration),))

    @property
    def duration(self) -> float:
        """Total duration [s]."""
        return float(sum(leg.duration for leg in self.legs))

    @property
    def passing(self) -> Array:
        """Times of the via points [s], shape (legs - 1,)."""
        return np.cumsum([leg.duration for leg in self.legs])[:-1]

    def velocity_jumps(self, speed: Array) -> Array:
        """Jumps of the velocities where legs meet, over the velocity limits or, without one, over the leg's fastest.

        Args:
            speed: velocity limits [rad/s or m/s], shape (nv,), or infinite.

        Returns:
            Jumps [-], shape (legs - 1, nv); zero between the legs of a motion.
        """
        ends = [leg.at(np.array([0.0, 1.0]))[1] for leg in self.legs]
        jumps = np.array([after[0] - before[1] for before, after in pairwise(ends)]).reshape(-1, speed.size)
        fastest = np.max([leg.fastest for leg in self.legs], axis=0) + np.finfo(float).tiny
        return np.asarray(np.abs(jumps) / np.where(np.isfinite(speed), speed, fastest))

    def slower(self, factor: float) -> Self:
        """The curve, slowed down by a factor on its duration."""
        return replace(self, legs=tuple(replace(leg, duration=factor * leg.duration) for leg in self.legs))

    def trajectory(self, robot: Robot, samples: Sequence[ArrayLike] | None = None, jumps: bool = True) -> Trajectory:
        """Samples of the motion with their torques.

        Args:
            robot: the robot.
            samples: samples per interval of each leg, without its end, shape (intervals,), or one number for all; None:
                1.
            jumps: whether the torque may jump where legs meet: then both legs have a sample there.
        """
        parts, start = [], 0.0
        for k, (leg, each) in enumerate(zip(self.legs, samples or [1] * len(self.legs), strict=True)):
            lengths = np.diff(leg.basis.breaks)
            counts = np.broadcast_to(each, lengths.shape)
            fractions = np.concatenate([np.arange(count) / count for count in counts])
            s = np.append(np.repeat(leg.basis.breaks[:-1], counts) + np.repeat(lengths, counts) * fractions, 1.0)
            q, v, a = leg.at(s)
            t = start + leg.duration * s
            start = float(t[-1])
            own: tuple[Array, ...] = t, q, v, inverse_dynamics(robot)(q, v, a)
            if k < len(self.legs) - 1 and jumps:
                t[-1] = np.nextafter(start, 0)
            elif k < len(self.legs) - 1:
                own = tuple(each[:-1] for each in own)
            parts.append(own)
        t, q, v, tau = (np.concatenate(part) for part in zip(*parts, strict=True))
        return Trajectory(t, q, v, tau, robot.joint_names, "minimum time", robot.model_hash)


def _ramped(places: Array, from_rest: bool, to_rest: bool) -> Array:
    """Time scaling: fractions of a path at fractions of the time, with ramps of the speed at ends that are at rest."""
    if not (from_rest and to_rest):
        return places**2 if from_rest else 1 - (1 - places) ** 2 if to_rest else places
    s = np.minimum(places, 1 - places)
    half = np.where(s < _RAMP, s**2 / (2 * _RAMP), s - _RAMP / 2) / (1 - _RAMP)
    return np.where(places < 0.5, half, 1 - half)
