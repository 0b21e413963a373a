"""The program of curves: its derivatives against finite differences, its equations against the curve itself."""

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from armdyn.optimal.curves.layout import POINTS, CurveLayout, curve_layout
from armdyn.optimal.curves.nlp_data import assemble_curve
from armdyn.optimal.curves.program import build, rows_of
from optimal.curves.bends import KINDS, bent, problem, spec, task

SMOOTH, TRAVEL, STEPS = 0.01, 0.02, 0.03


def built(kind):
    """A program, and the numbers of a bent curve."""
    job = task(kind)
    guess, request = bent(job.problem), spec(job.problem, smooth=SMOOTH, travel=TRAVEL, steps=STEPS)
    shape = curve_layout(job.problem, guess, request.constraints)
    program = build(job.dynamics, shape, rows_of(job.problem, request.constraints), False)
    return program, shape, guess, job, assemble_curve(job, guess, request, shape)


def values(program):
    """(x, p) -> cost and equations."""
    return ca.Function("values", *([program.functions[name] for name in names] for names in ("xp", "fg")))


def differences(function, x, step):
    """Central differences, two steps of Richardson's: the error is of the fourth order."""
    columns = []
    for i in range(x.size):
        unit = np.zeros(x.size)
        unit[i] = step
        near, far = ((function(x + k * unit) - function(x - k * unit)) / (2 * k * step) for k in (1, 2))
        columns.append((4 * near - far) / 3)
    return np.array(columns).T


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_are_those_of_the_values(kind):
    program, _, _, _, nlp_data = built(kind)
    rng, both = np.random.default_rng(1), values(program)
    x = nlp_data.x + 0.002 * rng.normal(size=nlp_data.x.size)

    def equations(x):
        return both(x, nlp_data.p)[1].full().ravel()

    jacobian = program.jacobian(x, nlp_data.p)[1].full()
    # Rounding 1e-16 over a step of 1e-4, of values of up to a few hundred; the fourth order adds less.
    scale = np.max(np.abs(jacobian))
    assert np.max(np.abs(jacobian - differences(equations, x, 1e-4))) < 1e-8 * scale

    sigma, lam = rng.normal(), rng.normal(size=len(equations(x)))
    f, p = program.functions["f"], program.functions["p"]
    slope = ca.Function("slope", [program.functions["x"], p], [ca.gradient(f, program.functions["x"])])

    def gradient(x):
        return sigma * slope(x, nlp_data.p).full().ravel() + program.jacobian(x, nlp_data.p)[1].full().T @ lam

    upper = program.hessian(x, nlp_data.p, sigma, lam)
    rows, cols = map(np.array, upper.sparsity().get_triplet())
    assert np.all(rows <= cols)
    upper = upper.full()
    whole = upper + np.triu(upper, 1).T
    assert np.max(np.abs(whole - differences(gradient, x, 1e-4))) < 1e-7 * np.max(np.abs(whole))  # as above


@pytest.mark.parametrize("kind", KINDS)
def test_all_equations_but_those_of_the_torques_are_those_of_the_curve(kind):
    program, shape, guess, job, nlp_data = built(kind)
    x, robot, limits = nlp_data.x.copy(), job.problem.robot, job.problem.limits
    half = limits.actuators.half_range
    for k, leg in enumerate(guess.legs):  # not the fixed control points, nor torques clipped, but the curve's
        x[shape.points(k)] = leg.points
        x[shape.torques(k)] = leg.torques(robot, leg.basis.gauss(POINTS)[0].ravel()) / half
    cost, equations = (value.full().ravel() for value in values(program)(x, nlp_data.p))
    lower, upper = nlp_data.g_bounds
    assert equations.shape == lower.shape == upper.shape
    count, place = guess.legs[0].basis.intervals * POINTS * 2, 0
    for leg in guess.legs:
        # Pinocchio and CasADi round differently: torques of some half ranges.
        assert np.max(np.abs(equations[place : place + count])) < 1e-13 * np.max(np.abs(x[shape.torques(0)]))
        np.testing.assert_array_equal(lower[place : place + count], 0)
        place += count
        for order in shape.orders:
            size = leg.basis.size - order
            rates = equations[place : place + 2 * size].reshape(size, 2)
            place += 2 * size
            given = {1: limits.velocity, 2: job.problem.acceleration_limit, 3: job.problem.jerk_limit}[order]
            scale = 1 if given is None else np.where(np.isinf(given), 1, given)
            at_end = leg.basis.curve(leg.points)(1.0, order) / leg.duration**order
            np.testing.assert_allclose(rates[-1] * scale, at_end, rtol=1e-10, atol=1e-10)  # rounding of differences
        place += count * shape.lines
    # Time over the guess's, and the cost of squared torques: by Gauss's points, which here are the definition.
    part = [leg.basis.gauss(POINTS)[1].ravel() @ leg.torques(robot, leg.basis.gauss(POINTS)[0].ravel()) ** 2
            for leg in guess.legs]  # fmt: skip
    tie = sum(SMOOTH / 2 * leg.duration * (own / half**2).sum() / 2 for leg, own in zip(guess.legs, part, strict=True))
    calm = sum(_calm(guess, leg, robot, half, job) for leg in guess.legs)
    weights = job.problem.effort_weights()
    effort = sum(leg.duration * (own * weights).sum() / 2 for leg, own in zip(guess.legs, part, strict=True))
    assert cost[0] == pytest.approx(
        (guess.duration + effort + tie) / guess.duration + calm, rel=1e-12
    )  # rounding of sums


def _calm(guess, leg, robot, half, job):
    """Price of a leg's mean squared velocities, over scales that ways of the joints have, and of its torque steps."""
    s, weights = (one.ravel() for one in leg.basis.gauss(POINTS))
    limit = job.problem.limits.velocity
    speed = np.where(np.isinf(limit), 1.0, limit)
    ways = sum(np.abs(one.points[-1] - one.points[0]) for one in guess.legs)
    scale = speed * np.sqrt(ways / (guess.duration * speed) + job.policy.curves.resting_speed)
    moving = weights @ np.sum((leg.at(s)[1] / scale) ** 2, axis=1) * leg.duration**2 / guess.duration**2
    steps = np.sum(np.diff(leg.torques(robot, s) / half, axis=0) ** 2)
    return TRAVEL * moving * leg.duration / guess.duration / robot.nv / 2 + STEPS * steps / robot.nv / 2


def test_lines_of_torque_speed_curves_are_the_curves_torques_and_speeds():
    program, shape, guess, job, nlp_data = built("torque speed")
    x, half, (leg,) = nlp_data.x.copy(), job.problem.limits.actuators.half_range, guess.legs
    s = leg.basis.gauss(POINTS)[0].ravel()
    torques = leg.torques(job.problem.robot, s)
    x[shape.points(0)], x[shape.torques(0)] = leg.points, torques / half
    place = shape.torque_speeds(0)
    equations = values(program)(x, nlp_data.p)[1].full().ravel()
    for line, (slope, rest) in enumerate(((0.25, 3.0), (2 / 7, 2.5 + 4 / 7))):  # of joint2 alone
        expected = (torques + [0, slope] * leg.at(s)[1]) / half
        np.testing.assert_allclose(equations[place[:, line]], expected, rtol=1e-10, atol=1e-10)  # as above
        np.testing.assert_allclose(nlp_data.g_bounds[1][place[:, line]], np.tile([np.inf, rest / half[1]], (s.size, 1)))


@pytest.mark.parametrize("kind", ["torque rate", "via and torque rate"])
def test_torque_rates_are_differences_of_the_curves_torques_by_time(kind):
    program, shape, guess, job, nlp_data = built(kind)
    x, problem, half = nlp_data.x.copy(), job.problem, job.problem.limits.effort_upper
    times, torques, starts = [], [], np.append(0.0, guess.passing)
    for k, (leg, start) in enumerate(zip(guess.legs, starts, strict=True)):
        s = leg.basis.gauss(POINTS)[0].ravel()
        times.append(start + leg.duration * s)
        torques.append(leg.torques(problem.robot, s))
        x[shape.torques(k)], x[shape.duration(k)] = torques[-1] / half, leg.duration
    rates = [np.diff(tau, axis=0) / np.diff(t)[:, None] for t, tau in zip(times, torques, strict=True)]
    rates += [
        (after[0] - before[-1])[None] / (t_after[0] - t_before[-1])
        for before, after, t_before, t_after in zip(torques, torques[1:], times, times[1:], strict=False)
    ]
    data = problem.robot.model.createData()
    at_start, at_goal = (
        pin.computeGeneralizedGravity(problem.robot.model, data, np.asarray(q))
        for q in (problem.q_start, problem.q_goal)
    )
    rates += [
        (torques[0][:1] - at_start) / times[0][0],
        (torques[-1][-1:] - at_goal) / (guess.duration - times[-1][-1]),
    ]
    limit = np.asarray(problem.path_constraints[0].limit)
    expected = np.concatenate(rates) / np.where(np.isinf(limit), 1, limit)
    equations = values(program)(x, nlp_data.p)[1].full().ravel()[-expected.size :]
    np.testing.assert_allclose(equations, expected.ravel(), rtol=1e-10, atol=1e-10)  # rounding of differences
    for bound, sign in zip(nlp_data.g_bounds, (-1, 1), strict=True):
        np.testing.assert_array_equal(
            bound[-expected.size :].reshape(-1, 2), [np.where(np.isinf(limit), np.inf, 1) * sign] * len(expected)
        )


def test_unknowns_stand_where_they_are_said_to_once_each():
    shape = CurveLayout(3, (4, 2), (1, 2))
    places = [shape.points(k).ravel() for k in shape.legs] + [shape.torques(k).ravel() for k in shape.legs]
    places = np.concatenate([*places, [shape.duration(k) for k in shape.legs]])
    np.testing.assert_array_equal(np.sort(places), np.arange(shape.size))
    assert shape.at_points(0).shape == (5 * 3 + 1 + 3, 4 * POINTS)
    assert shape.in_intervals(1).shape == (5 * 3 + 1 + 3 * POINTS, 2)
    assert shape.differences(1, 2).shape == (3 * 3 + 1, 2 + 4 - 2)
    assert shape.torque_steps(0).shape == (2 * 3 + 1, 4 * POINTS - 1)
    np.testing.assert_array_equal(shape.torque_meeting(1)[-2:, 0], [shape.duration(0), shape.duration(1)])


def test_equal_questions_get_one_program():
    job = task("via")
    guess, request = bent(job.problem), spec(job.problem)
    first, second = (
        build(job.dynamics, curve_layout(problem("via"), guess, request.constraints), (), False) for _ in range(2)
    )
    assert first is second
