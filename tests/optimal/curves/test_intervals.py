"""An interval of a curve, as path constraints see it, against the curve itself."""

import casadi as ca
import numpy as np
import pytest

from armdyn.dynamics import Dynamics
from armdyn.optimal.curves.layout import POINTS, curve_layout
from armdyn.optimal.curves.nlp_data import assemble_curve
from armdyn.optimal.curves.program import (
    CurveInterval,
    meeting_equations,
    rate_equations,
    torque_equations,
    torque_rate_equations,
)
from optimal.curves.bends import bent, problem, spec, task


def intervals(kind="plain"):
    """The curve, its interval in symbols, and the numbers of y and p for every interval of its first leg."""
    job = task(kind)
    guess, request = bent(job.problem), spec(job.problem)
    shape = curve_layout(job.problem, guess, request.constraints)
    x = assemble_curve(job, guess, request, shape).x
    leg, limits = guess.legs[0], job.problem.limits
    half = limits.actuators.half_range
    gauss = leg.basis.gauss(POINTS)[0].ravel()
    x[shape.points(0)], x[shape.duration(0)] = leg.points, leg.duration
    x[shape.torques(0)] = leg.torques(job.problem.robot, gauss) / half
    return job, leg, half, x[shape.in_intervals(0)]


def parameters(job, leg, half, k):
    """Numbers of one interval, by the powers of its part: fitted to the B-splines, not taken from the program."""
    start, h = leg.basis.breaks[k], np.diff(leg.basis.breaks)[k]
    part = np.linspace(0.05, 0.95, 9)
    values = leg.basis.local(start + h * part)[:, 0]
    powers = np.linalg.lstsq(part[:, None] ** np.arange(5), values, rcond=None)[0]
    return np.concatenate([powers.ravel(), [h], half, np.zeros(2), job.dynamics.last_body, np.ones(2), [1.0]])


def test_stages_are_the_curves():
    job, leg, half, columns = intervals()
    stages = CurveInterval(job.dynamics).stages()
    names = ("q", "v", "a", "tau")
    function = ca.Function("stages", [stages.y, stages.p], [getattr(stages, name) for name in names])
    np.testing.assert_array_equal(stages.c[[0, -1]], [0, 1])
    for k, y in enumerate(columns.T):
        start, h = leg.basis.breaks[k], np.diff(leg.basis.breaks)[k]
        q, v, a, tau = (value.full() for value in function(y, parameters(job, leg, half, k)))
        s = start + h * stages.c
        for got, own in zip((q, v, a), leg.at(s), strict=True):
            # Fitted powers: 1e-14 of numbers near one, by their derivatives up to 1/h² T² of that.
            np.testing.assert_allclose(got.T, own, atol=1e-10)
        torques = leg.torques(job.problem.robot, s)
        np.testing.assert_allclose(tau.T[1:-1], torques[1:-1], atol=1e-11)  # at Gauss's points those of the curve
        line = torques[1] + (s[0] - s[1]) / (s[2] - s[1]) * (torques[2] - torques[1])
        np.testing.assert_allclose(tau.T[0], line, atol=1e-10)


def test_equal_intervals_share_their_objects():
    first, second = (CurveInterval(Dynamics(problem("plain").robot, free_last_body=True)) for _ in range(2))
    assert first.dynamics == second.dynamics
    assert first == second and hash(first) == hash(second)
    assert first != CurveInterval(first.dynamics, False)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_rate_is_a_derivative_of_the_curve_over_its_limit(order):
    rng = np.random.default_rng(order)
    points, factors, over = rng.normal(size=(order + 1, 2)), rng.normal(size=order + 1), rng.uniform(1, 2, 2)
    duration = 0.7
    got = rate_equations(2, order).defects([*points.ravel(), duration], [*factors, *over]).full().ravel()
    np.testing.assert_allclose(got, factors @ points / duration**order * over, rtol=1e-14)  # rounding
    other = [*points.ravel(), duration]
    meeting = meeting_equations(2, order).defects([*other, *other], [*factors, *factors, *over])
    np.testing.assert_allclose(meeting.full(), 0, atol=1e-14)
    meeting = meeting_equations(2, order).defects([*other, *np.zeros(2 * order + 2), 1.0], [*factors, *factors, *over])
    np.testing.assert_allclose(meeting.full().ravel(), got, rtol=1e-14)


def test_torque_rates_are_differences_over_the_time_between():
    before, after, over = np.array([0.1, -0.2]), np.array([0.4, 0.1]), np.array([2.0, 3.0])
    one, two, ends = (torque_rate_equations(2, *how).defects for how in ((1,), (2,), (1, True)))
    rate = (after - before) * over / (0.05 * 0.8)
    np.testing.assert_allclose(one([*before, *after, 0.8], [0.05, *over]).full().ravel(), rate, rtol=1e-14)
    np.testing.assert_allclose(ends([*after, 0.8], [*before, 0.05, *over]).full().ravel(), rate, rtol=1e-14)
    both = two([*before, *after, 0.8, 0.5], [0.05, 0.02, *over]).full().ravel()
    np.testing.assert_allclose(both, (after - before) * over / (0.05 * 0.8 + 0.02 * 0.5), rtol=1e-14)


def test_a_torque_costs_its_square_for_as_long_as_it_lasts():
    job = task("plain")
    functions = torque_equations(job.dynamics, False)
    y = np.concatenate([np.zeros(10), [0.5], [0.3, -0.4]])
    basis, shared = np.zeros(15), [3.0, 3.0, 2.0, 5.0, *job.dynamics.last_body, 0.5, 0.25, 4.0]
    cost = float(functions.cost(y, [*basis, 0.1, 0.02, 7.0, *shared]))
    # tie/2 |τ|² + hurry part T/2 (2 τ₁² + 5 τ₂²)
    assert cost == pytest.approx(0.02 / 2 * 0.25 + 4 * 0.1 * 0.5 / 2 * (2 * 0.09 + 5 * 0.16), rel=1e-14)


def test_a_motion_that_is_to_be_calm_costs_its_squared_velocities():
    job = task("plain")
    y = np.concatenate([np.tile([0.2, -0.1], 5), [0.5], [0.0, 0.0]])
    basis = np.repeat([0.2, 0.3, -0.4], 5)  # derivatives are 1.5 times the points
    shared = [3.0, 3.0, 2.0, 5.0, *job.dynamics.last_body, 0.5, 0.25, 4.0]
    cost = float(torque_equations(job.dynamics, False).cost(y, [*basis, 0.1, 0.0, 7.0, *shared]))
    squares = (0.2 / 0.5) ** 2 + (0.1 / 0.25) ** 2
    assert cost == pytest.approx(squares * 7 * 1.5**2 / 2, rel=1e-14)
