"""Program of curves of a task, for sequential convexification: cost and torques by hand, other equations by CasADi."""

import numpy as np
import scipy.sparse as sp

from armdyn.arrays import Array, Index
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.curve_program import CurveCost, CurveProgram, OtherRows, TorquePrices, quadratic_form
from armdyn.optimal.flat.equations import POINTS
from armdyn.optimal.flat.linear_rows import DerivativeRows, TorqueRows, clearance_rows
from armdyn.optimal.flat.nlp_data import CurveSpec, finite, rate_limits, rows_of, travel_scales
from armdyn.optimal.flat.program import CurveLayout, build
from armdyn.optimal.solve.registry import in_time
from armdyn.optimal.solve.solver import NlpData
from armdyn.optimal.task.task import Task


def curve_cost(task: Task, guess: Curve, spec: CurveSpec, shape: CurveLayout) -> CurveCost:
    """The cost of `assemble_curve`'s nonlinear program, in seconds.

    Args:
        task: task with the effort weights.
        guess: curve whose legs' durations weigh the squares.
        spec: weights of the squares.
        shape: layout of the program.
    """
    n, sizes = shape.joints, [POINTS * count for count in shape.intervals]
    parts = np.concatenate([leg.basis.gauss(POINTS)[1].ravel() for leg in guess.legs])
    times = np.array([leg.duration for leg in guess.legs])
    squares = task.problem.effort_weights() * task.problem.limits.actuators.half_range**2
    steps = np.full(parts.size - 1, spec.steps * guess.duration / n)
    steps[np.cumsum(sizes)[:-1] - 1] = 0.0
    moving = sp.csr_matrix((shape.size, shape.size))
    if spec.travel:
        each = zip(spec.travel * times / n, guess.legs, strict=True)
        squared = [price * leg.basis.squared(1, POINTS) for price, leg in each]
        moving = quadratic_form(shape, squared, travel_scales(task, guess))
    torques = TorquePrices(
        duration_of_point=np.repeat([shape.duration(k) for k in shape.legs], sizes),
        tie=parts * np.repeat(spec.smooth * times / n, sizes),
        effort=parts[:, None] * squares,
        steps=steps,
    )
    priced = spec.smooth or spec.steps or task.problem.pays_effort
    return CurveCost(np.array([shape.duration(k) for k in shape.legs]), moving, torques if priced else None)


def other_equations(shape: CurveLayout, count: int) -> Index:
    """Indices of the equations that limit neither torques nor time derivatives, out of `count` equations."""
    own = [shape.torque_rows(leg).ravel() for leg in shape.legs]
    own += [shape.rates_of_all(order) for order in shape.orders]
    return np.setdiff1d(np.arange(count), np.concatenate(own))


def curve_program(task: Task, guess: Curve, spec: CurveSpec, shape: CurveLayout, data: NlpData) -> CurveProgram:
    """Program for sequential convexification.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        spec: requirements of the curve.
        shape: layout of the program.
        data: the nonlinear program's parameters and bounds.
    """
    problem, bases = task.problem, [leg.basis for leg in guess.legs]
    limits, (lower, upper) = rate_limits(problem, spec.constraints), data.x_bounds
    torques = np.concatenate([shape.torques(leg) for leg in shape.legs])
    free = lower < upper
    free[torques] = False

    def bounds(rows: Index) -> tuple[Array, Array]:
        return data.g_bounds[0][rows], data.g_bounds[1][rows]

    others, required = None, spec.constraints.required_distances(problem)
    if (which := other_equations(shape, data.g_bounds[0].size)).size:
        rows = rows_of(problem, spec.constraints)
        program = in_time(task, lambda scheme: build(task.dynamics, shape, rows, scheme.compile))
        others = OtherRows(program, data.p, which, bounds(which))
    points = [(basis, basis.gauss(POINTS)[0].ravel()) for basis in bases]
    return CurveProgram(
        shape=shape,
        torque_rows=TorqueRows(problem.robot, problem.limits.actuators.half_range, points, shape),
        derivative_rows=tuple(
            DerivativeRows.of(bases, shape, k, finite(limits[k]), bounds(shape.rates_of_all(k))) for k in shape.orders
        ),
        cost=curve_cost(task, guess, spec, shape),
        smooth=_smoothing(task, guess, spec, shape),
        bounds=data.x_bounds,
        free=free,
        torques=torques,
        others=others,
        clearance=None if required is None else clearance_rows(required, guess, task.policy.sequential),
    )


def _smoothing(task: Task, guess: Curve, spec: CurveSpec, shape: CurveLayout) -> sp.csr_matrix:
    """Weights of squared accelerations over velocity limits, in the unknowns; zero if torques have a cost."""
    if spec.smooth or spec.travel:
        return sp.csr_matrix((shape.size, shape.size))
    numbers, times = task.policy.sequential, np.array([leg.duration for leg in guess.legs])
    prices = numbers.smooth * np.ones(times.size)
    if shape.joined:  # of accelerations in time: those of short legs are large
        prices = numbers.smooth_short * (np.max(times) / times) ** 3
    squared = [price * leg.basis.squared(2, POINTS) for price, leg in zip(prices, guess.legs, strict=True)]
    return quadratic_form(shape, squared, task.problem.limits.velocity)
