"""Nonlinear program of B-spline motions: layout of its unknowns, and its blocks of equations."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.codegen.deadline import expect_time
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.constraints.rows import IntervalFunctions, StageRows, intervals_of
from armdyn.optimal.curves.curve import DEGREE, WINDOW, Basis, Curve, CurveLeg
from armdyn.optimal.curves.equations import (
    POINTS,
    CurveInterval,
    Shared,
    meeting_equations,
    rate_equations,
    torque_equations,
    torque_rate_equations,
    torque_speed_equations,
    torque_step_cost,
)
from armdyn.optimal.mesh.assembly import Block, Program, program_of


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

    @property
    def all_points(self) -> Index:
        """Indices of the coordinates of all control points, each once."""
        return np.unique(np.concatenate([self.points(leg).ravel() for leg in self.legs]))

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
        units[self.all_points], units[[self.duration(k) for k in self.legs]] = way, time
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

    def torque_ends(self) -> tuple[Index, Index]:
        """Indices of the unknowns for the torque rates at start and goal, one column each."""
        last = self.legs[-1]
        ends = (self.torques(0)[0], self.duration(0)), (self.torques(last)[-1], self.duration(last))
        first, final = (np.append(torques, duration)[:, None] for torques, duration in ends)
        return first, final

    def _columns(self, leg: int, window: Index, more: Index | None = None) -> Index:
        points, count = self.points(leg), len(window)
        own = [points[window].reshape(count, -1), np.full((count, 1), self.duration(leg))]
        return np.hstack(own if more is None else [*own, more]).T

    def _before(self, leg: int) -> int:
        each = [self.joints * (size * (1 + POINTS) + DEGREE) + 1 for size in self.intervals[:leg]]
        return sum(each) - self.joints * sum(one < leg for one in self.joined)


_BUILT = 2.5e-5
"""Approximate time in which the equations of a curve are built, over the cube of the number of joints [s]."""


@built_once(maxsize=32)
def build(dynamics: Dynamics, shape: CurveLayout, rows: tuple[StageRows, ...], compile_mode: bool | None) -> Program:
    """The program of curves: torques and rates leg by leg, continuity between legs, then path constraints.

    Args:
        dynamics: dynamics with a symbolic last body.
        shape: layout of the curves.
        rows: rows of path constraints, over the intervals of all legs.
        compile_mode: mode for `compiled`.

    Raises:
        NoTimeError: it would take longer than `deadline.until` allows.
    """
    expect_time(_BUILT * shape.joints**3, f"building the equations of {shape.joints} joints")
    n, blocks, shared = shape.joints, list[Block](), Shared.size(shape.joints)
    first = shared

    def add(one: IntervalFunctions, index: Index, whole: bool = False, rows: StageRows | None = None) -> None:
        """Add equations at places, a column of unknowns each. Parameters: each place's, perhaps `Shared`, the rows'."""
        nonlocal first
        places, common = index.shape[1], 0 if rows is None else rows.numbers
        own = one.defects.numel_in(1) - shared * whole - common
        each = first + np.arange(own * places).reshape(places, own).T
        first += own * places + common
        same = np.concatenate([np.arange(shared * whole), np.arange(first - common, first)])
        parameters = np.vstack([each, same[:, None].repeat(places, axis=1)])
        blocks.append(Block(one, index, parameters, rows is not None and rows.where == "sum"))

    for leg in shape.legs:
        add(torque_equations(dynamics, compile_mode), shape.at_points(leg), whole=True)
        add(torque_step_cost(n), shape.torque_steps(leg)[: 2 * n])
        for order in shape.orders:
            add(rate_equations(n, order), shape.differences(leg, order))
        if shape.lines:
            add(torque_speed_equations(n, shape.lines), shape.at_points(leg))
    for leg in shape.legs[1:]:
        for order in range(1, shape.smooth + 1):
            before, after = shape.differences(leg - 1, order)[:, -1:], shape.differences(leg, order)[:, :1]
            add(meeting_equations(n, order), np.vstack([before, after]))
    if shape.rated:  # within each leg, between legs, and at both ends
        for leg in shape.legs:
            add(torque_rate_equations(n, 1), shape.torque_steps(leg))
        for leg in shape.legs[1:]:
            add(torque_rate_equations(n, 2), shape.torque_meeting(leg))
        for end in shape.torque_ends():
            add(torque_rate_equations(n, 1, given=True), end)
    everywhere = np.hstack([shape.in_intervals(leg) for leg in shape.legs])
    for each in rows:
        index = everywhere[:, intervals_of(each, shape.intervals)]
        add(each.functions(CurveInterval(dynamics, compile_mode)), index, True, each)
    return program_of(blocks, shape.size, [shape.duration(leg) for leg in shape.legs], shared - 1)
