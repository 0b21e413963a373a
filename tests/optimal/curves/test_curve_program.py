"""Rows and costs of sequential convexification against the nonlinear program by CasADi, whose torques are unknowns."""

import casadi as ca
import numpy as np
import pytest
import scipy.sparse as sp

import armdyn as ad
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve import Basis, Curve, graded
from armdyn.optimal.curves.curve_program import curve_cost, curve_program
from armdyn.optimal.curves.layout import CurveSpec, curve_layout
from armdyn.optimal.curves.nlp_data import assemble_curve
from armdyn.optimal.curves.program import build, rows_of
from armdyn.optimal.curves.solve import solve_curve
from armdyn.optimal.problem.task import Task
from oracles import robot_named

WEIGHTS = {"smooth": 1e-2, "travel": 0.3, "steps": 0.2}


def task_of(via=(), **options):
    robot = robot_named("ur5").with_payload(ad.Payload(mass=1.5, com=(0.0, 0.05, 0.1))).with_friction(2.0, 1.0, 0.3)
    problem = ad.MinimumTimeProblem(
        robot, q_start=np.zeros(6), q_goal=[1.0, -0.4, 0.7, 0.3, -0.9, 0.2], via=via, **options
    )
    return Task.of(problem, ad.MinimumTimeOptions(compile=False))


def bent(task, intervals=9):
    """A curve away from the straight line."""
    guess = Curve.straight(task.problem, Basis(graded(intervals, 0.03)), 1.1)
    random = np.random.default_rng(4)
    for leg in guess.legs:
        leg.points[2:-2] += random.normal(scale=0.2, size=leg.points[2:-2].shape)
    return guess


def program_of(task, guess, spec):
    """The nonlinear program's data, and the program of steps."""
    shape = curve_layout(task.problem, guess, spec.constraints)
    data = assemble_curve(task, guess, spec, shape)
    return data, curve_program(task, guess, spec, shape, data)


@pytest.mark.parametrize(
    "options", [{}, {"via": [[0.4, 0.1, 0.2, 0.0, -0.3, 0.1]]}, {"effort_weight": 0.02, "effort_limit": 100.0}]
)
def test_rows_and_costs_are_those_of_the_nonlinear_program(options):
    task = task_of(**options)
    guess = bent(task)
    spec = CurveSpec(TightenedConstraints.of(task), **WEIGHTS)
    shape = curve_layout(task.problem, guess, spec.constraints)
    program = build(task.dynamics, shape, rows_of(task.problem, spec.constraints), False)
    data, own = program_of(task, guess, spec)
    at = own.at(data.x)
    x, sides, at = at.x, at.sides, at.torques

    g, matrix = program.jacobian(x, data.p)
    whole = sp.csc_matrix((matrix.nonzeros(), matrix.row(), matrix.colind()), shape=matrix.shape).toarray()
    torque_rows = np.concatenate([shape.torque_rows(leg).ravel() for leg in shape.legs])
    np.testing.assert_allclose(np.array(g).ravel()[torque_rows], 0, atol=1e-11)
    by_points = whole[torque_rows]
    by_points[:, own.torques.ravel()] = 0
    np.testing.assert_allclose(at.jacobian.toarray(), by_points, rtol=1e-9, atol=1e-9 * np.max(np.abs(by_points)))

    velocities, rates = sides[0], shape.rates_of_all(1)
    np.testing.assert_allclose(velocities.values, np.array(g).ravel()[rates], atol=1e-12)
    np.testing.assert_allclose(velocities.jacobian.toarray(), whole[rates], rtol=1e-12, atol=1e-12)

    cost, f = curve_cost(task, guess, spec, shape), program.functions["f"]
    value = float(ca.Function("f", [program.functions["x"], program.functions["p"]], [f])(x, data.p))
    np.testing.assert_allclose(cost.value(x, at.tau), value * guess.duration, rtol=1e-12)
    slope = np.array(program.gradient(x, data.p)).ravel() * guess.duration
    expected = slope + at.jacobian.T @ slope[own.torques.ravel()]
    expected[own.torques] = 0
    found = cost.gradient(x, at)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.max(np.abs(expected)))


def test_accelerations_by_hand_are_those_of_the_nonlinear_program():
    task = task_of(via=[[0.4, 0.1, 0.2, 0.0, -0.3, 0.1]], acceleration_limit=4.0)
    guess = bent(task)
    data, own = program_of(task, guess, CurveSpec(TightenedConstraints.of(task)))
    at = own.at(data.x)
    program = build(task.dynamics, own.shape, (), False)
    g, matrix = program.jacobian(at.x, data.p)
    whole = sp.csc_matrix((matrix.nonzeros(), matrix.row(), matrix.colind()), shape=matrix.shape).toarray()
    found, which = at.sides[1], own.shape.rates_of_all(2)
    np.testing.assert_allclose(found.values, np.array(g).ravel()[which], atol=1e-12)
    np.testing.assert_allclose(found.jacobian.toarray(), whole[which], atol=1e-11)
    expected = [np.full(own.shape.rates(leg, 2).size, own.shape.duration(leg)) for leg in own.shape.legs]
    np.testing.assert_array_equal(found.duration, np.concatenate(expected))


def test_sides_of_a_power_of_the_duration_are_exact_or_safe():
    task = task_of(acceleration_limit=4.0)
    data, own = program_of(task, bent(task), CurveSpec(TightenedConstraints.of(task)))
    at = own.at(data.x)
    duration, random = int(own.cost.durations[0]), np.random.default_rng(2)
    step = np.where(own.place >= 0, random.normal(scale=1e-2, size=at.x.size), 0.0)
    for longer in (-0.1, 0.2):
        step[duration] = longer
        after = own.at(at.x + step)
        for sides, then in zip(at.sides, after.sides, strict=True):
            jacobians, top, which = sides.below(at.x)
            kept = np.concatenate([jacobian @ step for jacobian in jacobians]) <= top
            true = np.concatenate([then.values <= then.bounds[1], then.values >= then.bounds[0]])
            assert np.all(true[kept])
            np.testing.assert_array_equal(which, np.tile(np.arange(sides.values.size), 2))
            assert np.mean(kept == true) > 0.95


def test_free_curves_need_no_compiler_and_few_steps():
    task = task_of()
    guess = Curve.straight(task.problem, Basis(graded(40, 1e-3)), 1.0)
    spec = CurveSpec.of(task)
    found = solve_curve(task, guess, spec)
    assert found.converged and found.sequential and found.result.iterations <= 11
    again = solve_curve(task, found.curve, spec, found)
    assert again.converged and again.sequential
    # The first one ends where a change of 1e-6 is left.
    np.testing.assert_allclose(again.curve.duration, found.curve.duration, rtol=2e-6)
