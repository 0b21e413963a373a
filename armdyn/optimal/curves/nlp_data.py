"""Data of the B-spline program: guess, parameters, bounds of unknowns and equations."""

from collections.abc import Iterator
from itertools import pairwise
from math import factorial

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.models.values.actuator_limits import ActuatorLimits
from armdyn.optimal.constraints.regions import GoalRegion
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve import WINDOW, Basis, Curve
from armdyn.optimal.curves.layout import POINTS, CurveLayout, CurveSpec, TorqueMargin, finite, rate_limits, torque_rates
from armdyn.optimal.curves.program import CurveInterval, rows_of
from armdyn.optimal.mesh.ipopt import NlpData
from armdyn.optimal.problem.checks import held
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.task import Task

_CAUTIOUS = 0.9
"""Part of the limits to which a guess's torques are clipped, for a start in the interior."""


_Equations = tuple[Array, Array, Array]
"""Parameters, lower and upper bounds of a block of equations."""


def assemble_curve(
    task: Task, guess: Curve, spec: CurveSpec, shape: CurveLayout, units: tuple[float, float] = (1.0, 1.0)
) -> NlpData:
    """Data of the nonlinear program.

    Args:
        task: the problem and its settings.
        guess: initial guess, with the bases of all legs.
        spec: requirements of the curve.
        shape: layout of the program.
        units: units of the control points [rad or m], and of the durations [s], 1 with path constraints.
    """
    problem, blocks, whole = task.problem, list[_Equations](), guess.duration
    way, time = units
    by_order = way / time ** np.arange(4.0)
    limits, n = problem.limits, shape.joints
    half = limits.actuators.half_range
    x, lower, upper = np.empty(shape.size), np.full(shape.size, -np.inf), np.full(shape.size, np.inf)
    for k, leg in enumerate(guess.legs):
        s, weights = leg.basis.gauss(POINTS)
        basis = (by_order[:3, None] * leg.basis.local(s.ravel())).reshape(s.size, -1)
        ties = np.array([spec.smooth, spec.travel * time**2]) * leg.duration / whole / n
        nothing, parts = np.zeros(s.size * n), weights.reshape(-1, 1)
        blocks.append((np.hstack([basis, parts, parts * ties]), nothing, nothing))
        blocks.append((np.full(s.size - 1, spec.steps / n), np.empty(0), np.empty(0)))
        blocks += _rates(task, spec.constraints, leg.basis, shape, k, by_order)
        points, torques, margin = shape.points(k), shape.torques(k), spec.margin(k)
        blocks += _torque_speeds(limits.actuators, basis, margin)
        lower[points], upper[points] = limits.position_lower, limits.position_upper
        least, most = limits.actuators.lower / half, limits.actuators.upper / half
        lower[torques], upper[torques] = least + margin.lower, most - margin.upper
        bound = max(float(problem.leg_bounds()[k]), spec.least * leg.duration / whole)
        lower[shape.duration(k)] = max(bound, 1e-3 * leg.duration)
        x[points], x[shape.duration(k)] = leg.points, leg.duration
        x[torques] = np.clip(leg.torques(problem.robot, s.ravel()) / half, _CAUTIOUS * least, _CAUTIOUS * most)
        _fix_ends(problem, k, points, (lower, upper), free=_ends_free(spec.constraints))
    for values in (x, lower, upper):
        values /= shape.units(way, time)
    speeds = finite(limits.velocity)  # scales of the velocities where legs meet
    if problem.has_regions:
        # Violations in sequential convexification are priced per scale: a scale far above the motion's speeds is free.
        speeds = np.minimum(speeds, max(float(np.max(np.ptp(leg.points, axis=0))) / leg.duration for leg in guess.legs))
    for k in shape.legs[1:]:
        for order in range(1, shape.smooth + 1):
            sides = guess.legs[k - 1].basis.differences(order)[-1], guess.legs[k].basis.differences(order)[0]
            factors = by_order[order] * np.concatenate(sides)
            blocks.append((np.append(factors, 1 / speeds), np.zeros(n), np.zeros(n)))
    blocks += _torque_rates(task, spec, guess)
    blocks += _rows(task, guess, spec.constraints)
    squares = problem.effort_weights() * half**2
    shared = np.concatenate([half, squares, task.dynamics.last_body, travel_scales(task, guess), [time / whole]])
    parameters, g_lower, g_upper = (
        np.concatenate([np.ravel(each) for each in own]) for own in zip(*blocks, strict=True)
    )
    return NlpData(np.clip(x, lower, upper), np.append(shared, parameters), (lower, upper), (g_lower, g_upper))


def travel_scales(task: Task, guess: Curve) -> Array:
    """Scales of dq/ds, s being the part of the time [rad or m], shape (nv,): small for joints that need not move."""
    most = guess.duration * finite(task.problem.limits.velocity)
    ways = np.sum([np.abs(leg.points[-1] - leg.points[0]) for leg in guess.legs], axis=0)
    return np.asarray(most * np.sqrt(ways / most + task.policy.curves.resting_speed))


def _rates(
    task: Task, constraints: TightenedConstraints, basis: Basis, shape: CurveLayout, leg: int, units: Array
) -> Iterator[_Equations]:
    """Limits of derivatives on one leg, by their control points; units of the derivatives by their order."""
    problem = task.problem
    most = 1.0 if problem.from_rest_to_rest else 1 - task.policy.curves.velocity_error
    given = rate_limits(problem, constraints)
    for order in shape.orders:
        factors, scale = units[order] * basis.differences(order), finite(given[order])
        bound = np.tile(np.where(np.isinf(given[order]), np.inf, most), (len(factors), 1))
        lower, upper = -bound, bound.copy()
        for place, outer, v in ((0, leg == 0, problem.v_start), (-1, leg == shape.legs[-1], problem.v_goal)):
            if not (outer and np.any(v)):
                continue  # at rest control points are fixed
            if order == 1:
                lower[place] = upper[place] = np.asarray(v) / scale
            elif order == 2 and problem.jerk_limit is not None:
                lower[place] = upper[place] = 0
        if order == 1 and leg == shape.legs[-1] and _ends_free(constraints):  # at rest at any position
            rest = 1 + _begins_gently(problem, np.asarray(problem.q_goal))
            lower[-rest:] = upper[-rest:] = np.asarray(problem.v_goal) / scale
        yield np.hstack([factors, np.tile(1 / scale, (len(factors), 1))]), lower, upper


def _torque_speeds(actuators: ActuatorLimits, basis: Array, margin: TorqueMargin) -> Iterator[_Equations]:
    """Lines of torque-speed curves at a leg's points.

    Args:
        actuators: actuators with the curves.
        basis: values, first and second derivatives of the points' B-splines, shape (points, 3 WINDOW).
        margin: torque margin at the points.
    """
    slopes, rest = (each / actuators.half_range for each in actuators.lines)
    if not slopes.size:
        return
    first = basis[:, WINDOW : 2 * WINDOW]
    given = np.hstack([first, np.tile(slopes.ravel(), (len(basis), 1))])
    lower, upper = (np.broadcast_to(each, (len(basis), slopes.shape[1])) for each in (margin.lower, margin.upper))
    yield given, lower[:, None] - rest, rest - upper[:, None]


def _torque_rates(task: Task, spec: CurveSpec, guess: Curve) -> Iterator[_Equations]:
    """Limits of torque rates: within legs, where legs meet, and from and to the holding torques."""
    problem = task.problem
    rates = torque_rates(task, spec.constraints)
    if rates is None:
        return
    limits, n = problem.limits, problem.robot.nv
    half = limits.actuators.half_range
    over, whole = half / finite(rates), np.where(np.isinf(rates), np.inf, 1.0)
    places = [leg.basis.gauss(POINTS)[0].ravel() for leg in guess.legs]
    bounds = [whole - np.broadcast_to(spec.margin(k).rates, (s.size + 1, n)) for k, s in enumerate(places)]
    for s, bound in zip(places, bounds, strict=True):
        yield np.hstack([np.diff(s)[:, None], np.tile(over, (s.size - 1, 1))]), -bound[1:-1], bound[1:-1]
    for (before, own), (after, next_own) in pairwise(zip(places, bounds, strict=True)):
        bound = np.minimum(own[-1], next_own[0])
        yield np.concatenate([[1 - before[-1], after[0]], over]), -bound, bound
    starts = problem.q_start, problem.v_start, places[0][0], bounds[0][0]
    ends = problem.q_goal, problem.v_goal, 1 - places[-1][-1], bounds[-1][-1]
    for q, v, part, bound in (starts, ends):
        hold, supplied = held(problem.robot, limits, np.asarray(q), np.asarray(v))
        free = np.where(supplied, bound, np.inf)
        yield np.concatenate([hold / half, [part], over]), -free, free


def _ends_free(constraints: TightenedConstraints) -> bool:
    """Whether the motion may end anywhere in a region."""
    return any(isinstance(each, GoalRegion) for each in constraints.path_constraints)


def _fix_ends(problem: MinimumTimeProblem, leg: int, points: Index, sides: tuple[Array, Array], free: bool) -> None:
    """Fix a leg's ends to their poses, unless these are free, and to rest at the motion's start and goal."""
    ends = ((0, 1, leg == 0, problem.v_start), (-1, -1, leg == len(problem.poses) - 2, problem.v_goal))
    for place, inward, outer, v in ends:
        if (free and outer and place) or (not outer and leg - (place == 0) in problem.via_regions):
            continue
        q = problem.poses[leg if place == 0 else leg + 1]
        at_rest = outer and not np.any(v)
        count = 1 + at_rest + (at_rest and _begins_gently(problem, q))
        for k in range(count):
            for side in sides:
                side[points[place + inward * k]] = q


def _begins_gently(problem: MinimumTimeProblem, q: Array) -> bool:
    """Whether acceleration is zero at rest: jerks are limited, or torques begin at the holding torques."""
    if problem.jerk_limit is not None or not problem.continuous_torque:
        return problem.jerk_limit is not None
    return bool(np.all(held(problem.robot, problem.limits, q, np.zeros_like(q))[1]))


def _rows(task: Task, guess: Curve, constraints: TightenedConstraints) -> Iterator[_Equations]:
    """The path constraints' rows, over the intervals of all legs."""
    problem, place = task.problem, CurveInterval(task.dynamics, task.scheme.compile)
    rows, intervals = rows_of(problem, constraints), [leg.basis.intervals for leg in guess.legs]
    if not rows:
        return
    powers = np.vstack([_powers(leg.basis) for leg in guess.legs])
    for each in rows:
        yield np.append(powers[each.intervals(intervals)], each.numbers), *each.bounds(place, intervals)


def _powers(basis: Basis) -> Array:
    """Coefficients of every interval's B-splines in powers of its part, and its length, shape (intervals, …)."""
    lengths = np.diff(basis.breaks)
    derivatives = basis.local(basis.breaks[:-1], derivatives=4)  # (intervals, order, window)
    orders = np.arange(5)
    scale = lengths[:, None] ** orders / np.array([factorial(order) for order in orders])
    powers = derivatives * scale[:, :, None]
    # By columns, as CasADi stores: for every power the window's coefficients.
    return np.hstack([powers.reshape(basis.intervals, -1), lengths[:, None]])
