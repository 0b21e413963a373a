"""Torque-speed curves in the lower bound, against closed forms, quadrature, hand-written phases and solved motions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import armdyn as ad
from armdyn.optimal.bound.cells import Cells, reached
from armdyn.optimal.bound.enclosure import Interval, terms_over
from armdyn.optimal.bound.leg import Forces, bound_legs, rate_by_lines
from armdyn.optimal.bound.proof import proven, relaxed
from armdyn.optimal.problem.policy.bound import BoundPolicy
from optimal.bound.arms import ARMS, drawn, random_problem
from optimal.test_motor_limits import INERTIA, PEAK, turntable
from problems import paper_arm, paper_problem


def driving_cruising_braking(distance, rest, slope, speed, corner=0.0):
    """Duration [s] of J v' = min(PEAK, rest - slope v) up to a speed, at that speed, then of J v' = -PEAK."""
    first, top, rate = corner * INERTIA / PEAK, rest / slope, slope / INERTIA
    driving = np.log((top - corner) / (top - speed)) / rate
    way = corner * first / 2 + top * driving - (speed - corner) / rate
    braking = speed * INERTIA / PEAK
    return first + driving + braking + (distance - way - speed * braking / 2) / speed


@pytest.mark.parametrize(
    ("curve", "speed", "distance", "expected"),
    [
        ([[0, 10], [5, 0]], 2.5, 2.0, driving_cruising_braking(2.0, 10.0, 2.0, 2.5)),
        ([[0, 10], [5, 0]], 4.9, 8.0, driving_cruising_braking(8.0, 10.0, 2.0, 4.9)),
        ([[0, 10], [2, 10], [4, 2]], 3.5, 3.0, driving_cruising_braking(3.0, 18.0, 4.0, 3.5, corner=2.0)),
    ],
)
def test_one_joint_in_closed_form(curve, speed, distance, expected):
    plain, motor = (
        ad.lower_bound(ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[distance], velocity_limit=speed)).duration
        for robot in (turntable(), turntable(torque_speed={"turn": curve}))
    )
    assert plain < motor <= expected
    # Cells of a twentieth of a side, in which w is quadratic.
    assert motor > expected * (1 - 2e-3) and motor > plain + 0.9 * (expected - plain)


def test_a_pendulum_against_quadrature():
    """One joint under gravity drives along its curve to the speed limit, cruises, and brakes with all its torque."""
    limit, curve = 5.0, [[0.0, 3.0], [2.0, 3.0], [6.0, 0.5]]
    robot = paper_arm("r", 0.1006).with_torque_speed({"joint1": curve})
    problem = paper_problem("r").variant(robot=robot, velocity_limit=[limit])
    (start,), (goal,), dynamics = problem.q_start, problem.q_goal, ad.Dynamics(robot)

    def ramp(q, forward):
        def slope(_, x):
            torque = np.interp(x[1], *np.transpose(curve)) if forward else -robot.limits.effort_upper[0]
            return (1 if forward else -1) * np.array([x[1], dynamics.aba(x[:1], x[1:], np.array([torque]))[0]])

        def full(_, x):
            return x[1] - limit

        full.terminal = True
        found = solve_ivp(slope, (0, 10), [q, 0.0], events=full, rtol=1e-11, atol=1e-13)
        return found.t_events[0][0], abs(found.y_events[0][0][0] - q)

    (up, way_up), (down, way_down) = ramp(start, True), ramp(goal, False)
    exact = up + down + (goal - start - way_up - way_down) / limit
    plain, motor = ad.lower_bound(paper_problem("r", velocity_limit=[limit])), ad.lower_bound(problem)
    assert goal - start > way_up + way_down
    assert plain.duration < motor.duration <= exact
    assert motor.duration == pytest.approx(exact, rel=2e-3)  # gravity over boxes of positions


BARE = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), payload=ad.Payload(mass=0.1006))
STEEP = {"joint1": [[0, 3], [1.2, 3], [4, 0.4]], "joint2": [[0, 3], [1.8, 3], [6, 0.2]]}


@pytest.mark.slow
@pytest.mark.parametrize("goal", [(0.5, 1.5), (1.0, 0.5)])
def test_two_joints_are_bounded_higher_and_never_above_a_motion(goal):
    problem = ad.MinimumTimeProblem(BARE, q_start=[0.0, 0.0], q_goal=goal, velocity_limit=[4.0, 6.0])
    slow = problem.variant(robot=BARE.with_torque_speed(STEEP))
    plain, motor = ad.lower_bound(problem), ad.lower_bound(slow)
    solution = ad.solve_minimum_time(slow, ad.MinimumTimeOptions(calm=0, bound=False, workers=1))
    assert solution.usable
    # Boxes of long ramps are wide: found 7 and 13 % below.
    assert plain.duration * 1.015 < motor.duration <= solution.duration < 1.2 * motor.duration


def boxes(problem):
    """Leg, cells and forces of a problem, narrowed once, and multipliers."""
    (leg,) = bound_legs(problem, BoundPolicy())
    known = leg.shortest
    cells = Cells.of(leg, known / 2, 2 * known)
    for _ in range(2):
        cells = cells.narrowed(leg, reached(leg, cells, cells.forces(leg), lambda: False))
    forces = cells.forces(leg)
    return leg, cells, forces, relaxed(leg, cells, forces, cells.ends(leg), known)


def test_any_multipliers_and_shares_of_lines_prove_a_bound():
    robot, limit = turntable(torque_speed={"turn": [[0, 10], [2, 10], [4, 2]]}), 3.5
    problem = ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[3.0], velocity_limit=limit)
    exact = driving_cruising_braking(3.0, 18.0, 4.0, limit, corner=2.0)
    leg, cells, forces, by = boxes(problem)
    ends = cells.ends(leg)
    best, rng = proven(leg, cells, forces, ends, by), np.random.default_rng(3)
    assert 0 < best <= exact and np.any(by.shares > 0.5)
    for _ in range(50):
        momentum = by.momentum * rng.uniform(0.5, 1.5, by.momentum.shape)
        shares = rng.dirichlet([1.0] * (1 + len(by.shares)), by.momentum.shape)[..., 1:]
        other = replace(by, momentum=momentum, shares=np.moveaxis(shares, -1, 0))
        assert proven(leg, cells, forces, ends, other) <= exact


def test_no_torque_of_a_motor_is_beyond_its_lines():
    """Far beyond the speed at which the curves have no torque left, too, where joints brake with their whole torque."""
    robot, rng = BARE.with_torque_speed(STEEP), np.random.default_rng(5)
    actuators, boxes, speed = robot.limits.actuators, 40, np.array([[15.0, 30.0]])
    middle = rng.uniform(-speed, speed, (boxes, 2))
    q, v = Interval.at(rng.uniform(-1, 1, (boxes, 2))), Interval(middle - speed / 3, middle + speed / 3)
    terms = terms_over(ad.Dynamics(robot), q)
    whole = Interval(actuators.lower, actuators.upper).spread((boxes, 2))
    w, way = rng.normal(size=(boxes, 2, 1)), Interval.at(rng.normal(size=(boxes, 2, 1)))
    shares = np.moveaxis(rng.dirichlet([0.3] * (1 + len(actuators.lines[0])), (boxes, 2, 1))[..., 1:], -1, 0)
    found = rate_by_lines(actuators, Forces(terms, v, whole, robot.friction), w, shares, way)
    most = np.full((boxes, 1), -np.inf)
    for _ in range(300):
        speeds = drawn(rng, v)
        tau = np.where(rng.uniform(size=speeds.shape) < 0.5, *actuators.range(q.lower, speeds))
        point = Forces(terms, Interval.at(speeds), Interval.at(tau), robot.friction)
        most = np.maximum(most, point.rate(w, way).lower)
    assert np.all(most <= found.upper)
    assert np.median((found.upper - most) / np.abs(found.upper)) < 1.0  # near the values at points


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "known"), [("ur5", (1.457348, 1.462913, 0.922667)), ("panda", (1.907381, 0.664347, 0.856257))]
)
def test_curves_raise_the_bound_and_never_above_a_motion(name, known):
    """Of the durations known [s], found by `solve_minimum_time`, the last is found again."""
    for k, duration in enumerate(known):
        problem = random_problem(ARMS[name](), k)
        limits = problem.limits
        pairs = zip(problem.robot.joint_names, limits.effort_upper, limits.velocity, strict=True)
        curves = {joint: [[0, most], [0.3 * v, most], [v, 0.2 * most]] for joint, most, v in pairs}
        slow = problem.variant(robot=problem.robot.with_torque_speed(curves))
        plain, found = ad.lower_bound(problem), ad.lower_bound(slow)
        assert plain.duration < found.duration <= duration
    solution = ad.solve_minimum_time(slow, ad.MinimumTimeOptions(calm=0, bound=False))
    assert solution.usable
    assert found.duration <= solution.duration < duration * (1 + 1e-4)
