"""Unknowns and rows of a curve's program: their layout, and the specification that they follow from."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve import DEGREE, WINDOW, Basis, Curve, CurveLeg
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.task import Task

POINTS = 2
"""Number of Gauss points per interval, at which torques are unknowns."""


@dataclass(frozen=True, eq=False)
class TorqueMargin:
    """Margin by which the torque limits are tightened at the Gauss points, because the torque overshoots between them.

    Attributes:
        upper: reduction of the upper limits, as parts of half the range, shape (points, nv).
        lower: increase of the lower limits, likewise.
        rates: reduction of the limits of torque rates, as parts of them, from the point before (or the leg's start) to
            every point, and from the last point to the leg's end, shape (points + 1, nv).
    """

    upper: Array | float = 0.0
    lower: Array | float = 0.0
    rates: Array | float = 0.0


@dataclass(frozen=True, eq=False)
class CurveSpec:
    """Specification of a curve: tightened constraints, torque margins, weights of the costs other than the duration.

    Attributes:
        constraints: tightened path constraints.
        margins: torque margins of every leg; empty: no margins.
        smooth: weight of the mean squared torque against the duration.
        travel: weight of the mean squared velocities, over scales of every joint.
        steps: weight of the squared changes of torques from point to point.
        least: lower bound of the duration [s]; 0: the fastest curve is the solution.
    """

    constraints: TightenedConstraints
    margins: tuple[TorqueMargin, ...] = ()
    smooth: float = 0.0
    travel: float = 0.0
    steps: float = 0.0
    least: float = 0.0

    @classmethod
    def of(cls, task: Task) -> Self:
        """The problem's constraints, and the policy's smoothness unless the problem weighs torques itself."""
        smooth = 0.0 if task.problem.pays_effort else task.policy.curves.smooth
        return cls(TightenedConstraints.of(task), smooth=smooth)

    def margin(self, leg: int) -> TorqueMargin:
        """Torque margins of one leg."""
        return self.margins[leg] if self.margins else TorqueMargin()


@dataclass(frozen=True)
class CurveLayout:
    """Layout of unknowns and equations of a B-spline program.

    Attributes:
        joints: number of joints.
        intervals: number of intervals of every leg.
        orders: orders of the limited derivatives: 1, and perhaps 2 and 3.
        smooth: order of the highest derivative that is continuous between legs.
        rated: whether torque rates are limited.
        lines: number of lines of every joint's torque-speed curve.
        joined: legs that share their first control point, which is free, with the leg before.
    """

    joints: int
    intervals: tuple[int, ...]
    orders: tuple[int, ...] = (1,)
    smooth: int = 1
    rated: bool = False
    lines: int = 0
    joined: tuple[int, ...] = ()

    @property
    def legs(self) -> range:
        return range(len(self.intervals))

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self._before(len(self.intervals))

    def points(self, leg: int) -> Index:
        """Indices of a leg's control points, shape (intervals + DEGREE, joints)."""
        own = self.intervals[leg] + DEGREE - (leg in self.joined)
        points = self._before(leg) + np.arange(own * self.joints).reshape(-1, self.joints)
        return np.vstack([self.points(leg - 1)[-1:], points]) if leg in self.joined else points

    def windows(self, legs: Sequence[tuple[Basis, Array]]) -> Index:
        """Indices of the control points on which poses depend, shape (poses, WINDOW, joints).

        Args:
            legs: basis of each leg, and its poses as parts of its duration.
        """
        return np.concatenate([self.points(k)[basis.window(s)] for k, (basis, s) in enumerate(legs)])

    def duration(self, leg: int) -> int:
        """Index of a leg's duration."""
        return int(self.points(leg)[-1, -1]) + 1

    def torques(self, leg: int) -> Index:
        """Indices of a leg's torques, shape (intervals * POINTS, joints)."""
        size = self.intervals[leg] * POINTS * self.joints
        return self.duration(leg) + 1 + np.arange(size).reshape(-1, self.joints)

    def units(self, way: float, time: float) -> Array:
        """Units of the unknowns, of control points [rad or m] and durations [s], shape (size,); 1 for torques."""
        units = np.ones(self.size)
        for leg in self.legs:
            units[self.points(leg)], units[self.duration(leg)] = way, time
        return units

    def curve(self, guess: Curve, x: Array) -> Curve:
        """The curve of unknowns x, shape (size,), with the bases of a guess."""
        bases = (leg.basis for leg in guess.legs)
        own = zip(self.legs, bases, strict=True)
        return Curve(tuple(CurveLeg(basis, x[self.points(k)], float(x[self.duration(k)])) for k, basis in own))

    def torque_rows(self, leg: int) -> Index:
        """Rows of the torque equations, shape (intervals * POINTS, joints)."""
        return self._rows(leg)[0]

    def rates(self, leg: int, order: int) -> Index:
        """Rows of the equations of a derivative's control points, shape (control points, joints)."""
        return self._rows(leg)[1 + self.orders.index(order)]

    def rates_of_all(self, order: int) -> Index:
        """Rows of the equations of a derivative's control points on all legs, shape (rows,)."""
        return np.concatenate([self.rates(leg, order).ravel() for leg in self.legs])

    def torque_speeds(self, leg: int) -> Index:
        """Rows of the lines of torque-speed curves, shape (intervals * POINTS, lines, joints)."""
        return self._rows(leg)[-1].reshape(-1, self.lines, self.joints)

    def _rows(self, leg: int) -> list[Index]:
        """Rows of each of a leg's kinds of equations, in the program's order, each of shape (places, joints)."""
        places = [
            (POINTS * size, *(size + DEGREE - order for order in self.orders), POINTS * size * self.lines)
            for size in self.intervals
        ]
        ends = sum(sum(each) for each in places[:leg]) + np.cumsum([0, *places[leg]])
        return [np.arange(a, b).reshape(-1, self.joints) for a, b in pairwise(self.joints * ends)]

    def at_points(self, leg: int) -> Index:
        """Indices of the unknowns of the torque equations, a column per point."""
        interval = np.repeat(np.arange(self.intervals[leg]), POINTS)
        return self._columns(leg, interval[:, None] + np.arange(WINDOW), self.torques(leg))

    def in_intervals(self, leg: int) -> Index:
        """Indices of the unknowns of a `CurveInterval`, a column per interval."""
        window = np.arange(self.intervals[leg])[:, None] + np.arange(WINDOW)
        return self._columns(leg, window, self.torques(leg).reshape(self.intervals[leg], -1))

    def differences(self, leg: int, order: int) -> Index:
        """Indices of the unknowns for a derivative's control points, a column per control point."""
        return self._columns(leg, np.arange(self.intervals[leg] + DEGREE - order)[:, None] + np.arange(order + 1))

    def torque_steps(self, leg: int) -> Index:
        """Indices of the unknowns for a leg's torque rates from point to point, a column each."""
        torques = self.torques(leg)
        return np.hstack([torques[:-1], torques[1:], np.full((len(torques) - 1, 1), self.duration(leg))]).T

    def torque_meeting(self, leg: int) -> Index:
        """Indices of the unknowns for the torque rate from the leg before, one column."""
        ends = self.torques(leg - 1)[-1], self.torques(leg)[0]
        return np.concatenate([*ends, [self.duration(leg - 1), self.duration(leg)]])[:, None]

    def _columns(self, leg: int, window: Index, more: Index | None = None) -> Index:
        points, count = self.points(leg), len(window)
        own = [points[window].reshape(count, -1), np.full((count, 1), self.duration(leg))]
        return np.hstack(own if more is None else [*own, more]).T

    def _before(self, leg: int) -> int:
        each = [self.joints * (size * (1 + POINTS) + DEGREE) + 1 for size in self.intervals[:leg]]
        return sum(each) - self.joints * sum(one < leg for one in self.joined)


def curve_layout(problem: MinimumTimeProblem, guess: Curve, constraints: TightenedConstraints) -> CurveLayout:
    """Layout of a problem's program."""
    intervals = tuple(leg.basis.intervals for leg in guess.legs)
    orders = set(constraints.derivative_limits(problem))
    if problem.jerk_limit is not None and not problem.from_rest_to_rest:
        orders.add(2)  # zero accelerations at an end in flight
    rated = constraints.torque_rates(problem) is not None
    smooth, lines = 2 if problem.continuous_torque else 1, len(problem.limits.actuators.lines[0])
    joined = tuple(i + 1 for i in problem.via_regions)
    return CurveLayout(problem.robot.nv, intervals, (1, *sorted(orders)), smooth, rated, lines, joined)


def torque_rates(task: Task, constraints: TightenedConstraints) -> Array | None:
    """Limits of the torque rates [N m/s or N/s], shape (nv,); None: no limits."""
    given = constraints.torque_rates(task.problem)
    kept = 0.0 if task.problem.from_rest_to_rest else 100 * task.policy.curves.velocity_error
    return None if given is None else (1 - kept) * given


def rate_limits(problem: MinimumTimeProblem, constraints: TightenedConstraints) -> dict[int, Array]:
    """Limits of the curve's time derivatives by order, each of shape (nv,); inf: none."""
    none = np.full(problem.robot.nv, np.inf)
    return {1: problem.limits.velocity, 2: none, 3: none} | constraints.derivative_limits(problem)


def finite(limit: Array) -> Array:
    """Limits as scales: infinity becomes 1."""
    return np.where(np.isinf(limit), 1.0, limit)
