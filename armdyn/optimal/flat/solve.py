"""The fastest curve near a guess, by IPOPT."""

from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.flat.basis import DEGREE, Basis
from armdyn.optimal.flat.blocks import Block, program_of
from armdyn.optimal.flat.curve import Curve, Leg
from armdyn.optimal.flat.equations import WINDOW, rate_equations, torque_equations
from armdyn.optimal.problem.status import Status
from armdyn.optimal.program.assembly import Program
from armdyn.optimal.solve.ipopt import Ipopt, IpoptSettings, in_time
from armdyn.optimal.task.task import Task

Array = NDArray[np.float64]
Index = NDArray[np.int_]

POINTS = 2
"""Gauss's points in an interval at which torques are unknowns."""


@dataclass(frozen=True)
class Shape:
    """What a program of curves depends on beside the arm: equal shapes share one.

    Attributes:
        joints: of the arm.
        intervals: of every leg.
        highest: order of the highest derivative with limits, 1 to 3.
    """

    joints: int
    intervals: tuple[int, ...]
    highest: int = 1

    def points(self, leg: int) -> Index:
        """Where a leg's control points stand, shape (size, nv)."""
        before = sum(self._leg(k) for k in range(leg))
        size = self.intervals[leg] + DEGREE
        return before + np.arange(size * self.joints).reshape(size, self.joints)

    def duration(self, leg: int) -> int:
        """Where its duration stands."""
        return int(self.points(leg)[-1, -1]) + 1

    def torques(self, leg: int) -> Index:
        """Where its torques stand, shape (intervals * POINTS, nv)."""
        count = self.intervals[leg] * POINTS
        return self.duration(leg) + 1 + np.arange(count * self.joints).reshape(count, self.joints)

    @property
    def size(self) -> int:
        """Unknowns."""
        return sum(self._leg(k) for k in range(len(self.intervals)))

    def _leg(self, leg: int) -> int:
        intervals = self.intervals[leg]
        return self.joints * (intervals + DEGREE) + 1 + self.joints * intervals * POINTS

    def windows(self, leg: int) -> Index:
        """Unknowns of the torque equations, a column for every point."""
        points, intervals = self.points(leg), np.repeat(np.arange(self.intervals[leg]), POINTS)
        window = points[intervals[:, None] + np.arange(WINDOW)].reshape(intervals.size, -1)
        return np.hstack([window, np.full((intervals.size, 1), self.duration(leg)), self.torques(leg)]).T

    def differences(self, leg: int, order: int) -> Index:
        """Unknowns of a derivative's control points, a column for each of these."""
        points = self.points(leg)
        count = len(points) - order
        window = points[np.arange(count)[:, None] + np.arange(order + 1)].reshape(count, -1)
        return np.hstack([window, np.full((count, 1), self.duration(leg))]).T


def build(dynamics: Dynamics, shape: Shape, asked: bool | None) -> Program:
    """The program of curves."""
    n, blocks = shape.joints, list[Block]()
    for leg in range(len(shape.intervals)):
        blocks.append(Block(torque_equations(dynamics, asked), shape.windows(leg), 3 * WINDOW + 1, True))
        blocks += [
            Block(rate_equations(n, order), shape.differences(leg, order), order + 1 + n)
            for order in range(1, shape.highest + 1)
        ]
    return program_of(blocks, shape.size, n + 11, [shape.duration(leg) for leg in range(len(shape.intervals))])


@dataclass(frozen=True, eq=False)
class Room:
    """What is left of the torque limits at the points, where a curve exceeds them beside these.

    Attributes:
        upper: taken off the upper limits, as parts of half the range, one array for each leg, shape (points, nv).
        lower: likewise of the lower ones.
    """

    upper: tuple[Array, ...]
    lower: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class Solved:
    """What IPOPT made of one guess.

    Attributes:
        curve: the motion, where it ended.
        status: how it ended.
        message: IPOPT's word for it.
        iterations: of IPOPT.
    """

    curve: Curve
    status: Status
    message: str
    iterations: int
    lam: Array


def solve_curve(task: Task, guess: Curve, room: Room | None = None, smooth: float = 1e-3, tol=1e-7, mu=0.1, near=None, **more) -> Solved:
    problem, n = task.problem, task.problem.robot.nv
    limits = problem.limits
    shape = Shape(n, tuple(leg.basis.intervals for leg in guess.legs), 1)
    settings = IpoptSettings(tol, task.options.max_iterations, task.options.verbose, (("mu_init", mu),) + tuple(more.items()))
    solver = in_time(task, lambda scheme: Ipopt.of(settings, build, task.dynamics, shape, scheme.compile))
    half = (limits.effort_upper - limits.effort_lower) / 2
    speed = np.where(np.isinf(limits.velocity), 1.0, limits.velocity)
    x = np.empty(shape.size)
    lbx, ubx = np.full(shape.size, -np.inf), np.full(shape.size, np.inf)
    parameters, lbg, ubg = [], [], []
    whole = guess.duration
    for k, leg in enumerate(guess.legs):
        points, T, torques = shape.points(k), shape.duration(k), shape.torques(k)
        s, weights = leg.basis.gauss(POINTS)
        basis = leg.basis.local(s.ravel())
        share = smooth * leg.duration / whole / n
        parameters += [np.hstack([basis.reshape(s.size, -1), share * weights.reshape(-1, 1)]).ravel()] 
        lbg.append(np.zeros(s.size * n)); ubg.append(np.zeros(s.size * n))
        coefficients = np.eye(leg.basis.size)
        for order in range(1, shape.highest + 1):
            coefficients = leg.basis.factors(order)[:, None] * np.diff(coefficients, axis=0)
            window = np.arange(len(coefficients))[:, None] + np.arange(order + 1)
            scale = speed
            parameters.append(np.hstack([np.take_along_axis(coefficients, window, axis=1), np.tile(1 / scale, (len(coefficients), 1))]).ravel())
            bound = np.where(np.isinf(limits.velocity), np.inf, 1.0)
            lbg.append(np.tile(-bound, len(coefficients))); ubg.append(np.tile(bound, len(coefficients)))
        lbx[points], ubx[points] = limits.position_lower, limits.position_upper
        for place, q in ((0, problem.poses[k]), (1, problem.poses[k]), (-2, problem.poses[k + 1]), (-1, problem.poses[k + 1])):
            lbx[points[place]] = ubx[points[place]] = q
        lbx[T] = problem.leg_bounds()[k] if np.all(np.isfinite(limits.velocity)) else 1e-3 * leg.duration
        up, low = limits.effort_upper / half, limits.effort_lower / half
        lbx[torques], ubx[torques] = low + (room.lower[k] if room else 0), up - (room.upper[k] if room else 0)
        x[points], x[T] = leg.points, leg.duration
        x[torques] = np.clip(guess.torques(problem.robot, k, s.ravel()) / half, 0.9 * low, 0.9 * up)
    p = np.concatenate([*map(np.ravel, parameters), half, task.dynamics.last_body, [1 / whole]])
    x = np.clip(x, lbx, ubx)
    outcome = solver.solve(x, p, (lbx, ubx), (np.concatenate(lbg), np.concatenate(ubg)), task.stop, near)
    found = outcome.x
    legs = tuple(
        replace(leg, points=found[shape.points(k)], duration=float(found[shape.duration(k)]))
        for k, leg in enumerate(guess.legs)
    )
    return Solved(Curve(legs), outcome.status, outcome.message, outcome.iterations, outcome)


def straight(task: Task, basis: Basis) -> Curve:
    problem = task.problem
    legs = []
    ramp = 0.1
    for a, b, least in zip(problem.poses[:-1], problem.poses[1:], problem.leg_bounds(), strict=True):
        s = basis.places
        profile = np.where(s < ramp, s**2 / (2 * ramp), np.where(s > 1 - ramp, 1 - ramp - (1 - s) ** 2 / (2 * ramp), s - ramp / 2)) / (1 - ramp)
        points = a + profile[:, None] * (b - a)
        points[[0, 1]], points[[-2, -1]] = a, b
        legs.append(Leg(basis, points, 1.2 * least))
    return Curve(tuple(legs))
