"""Forces of a leg against Pinocchio's dynamics at points of the boxes, and its ends against sampled joint positions."""

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.dynamics.symbolic import Dynamics
from armdyn.models.scene.reaching import free_directions, poses_reaching, slid
from armdyn.optimal.bound import leg as leg_module
from armdyn.optimal.bound.enclosure import Interval, terms_over
from armdyn.optimal.bound.frame_sets import GoalSet, Within
from armdyn.optimal.bound.leg import Forces, LegEnd, range_of
from armdyn.optimal.problem.policy.bound import BoundPolicy
from optimal.bound.arms import ARMS, drawn

_STEP = 1e-6
"""Of the difference quotient of M along v [s]; its error is some 1e-9 of the second derivative's size."""


def momentum_rate(robot, q, v, tau):
    """d(M v)/dt by Pinocchio: M a + Ṁ v with M a = τ − nle − τ_f."""
    model, data = robot.model, robot.model.createData()
    bias = pin.nonLinearEffects(model, data, robot.configuration(q), v)

    def inertia(at):
        upper = np.array(pin.crba(model, model.createData(), robot.configuration(at)))
        return np.triu(upper) + np.triu(upper, 1).T

    turning = (inertia(q + _STEP * v) - inertia(q - _STEP * v)) / (2 * _STEP)
    return tau - bias - robot.friction.torque(v) + turning @ v, inertia(q)


def torques_of(robot, v):
    """The whole range of the torques in every box."""
    return Interval(robot.limits.effort_lower, robot.limits.effort_upper).spread(v.lower.shape)


@pytest.mark.parametrize("most_corners", [9, 0])
@pytest.mark.parametrize("arm", ARMS)
def test_the_range_holds_the_rate_at_points(arm, most_corners, monkeypatch):
    monkeypatch.setattr(leg_module, "MOST_CORNERS", most_corners)
    robot, rng = ARMS[arm](), np.random.default_rng(1)
    n = robot.nv
    q_middle, v_middle = rng.uniform(-1, 1, (4, n)), rng.uniform(-1, 1, (4, n))
    q, v = Interval(q_middle - 0.1, q_middle + 0.1), Interval(v_middle - 1, v_middle + 1)
    forces = Forces(terms_over(Dynamics(robot), q), v, torques_of(robot, v), robot.friction)
    w, way, steps = (rng.uniform(-1, 1, (n, 3)) for _ in range(3))
    found = forces.rate(w, Interval.at(way), Interval.at(steps))
    seen = []
    for _ in range(60):
        qs, vs = drawn(rng, q), drawn(rng, v)
        tau = rng.choice([robot.limits.effort_lower, robot.limits.effort_upper])
        for i in range(len(qs)):
            rate, inertia = momentum_rate(robot, qs[i], vs[i], tau)
            value = way.T @ vs[i] + steps.T @ inertia @ vs[i] + w.T @ rate
            room = 1e-6 * (1 + np.abs(value))  # of the difference quotient
            assert np.all(found.lower[i] <= value + room) and np.all(value <= found.upper[i] + room)
            seen.append(value)
    if arm == "cart" and most_corners:  # one joint: the ends themselves are among the points
        assert np.max(seen, axis=0) == pytest.approx(found.upper.max(axis=0), rel=0.2)


@pytest.mark.parametrize("concave", [0.0, 0.5, 30.0])
@pytest.mark.parametrize("bent", [0.0, 1.0])
def test_the_range_is_that_of_chords_less_squares(concave, bent):
    """Of f(v) = bᵀv + Σ |v_i + v_j| less squares: never below its values at points; reached, if f is linear."""
    rng = np.random.default_rng(3)
    lower = np.array([[-1.0, -2.0], [0.5, -0.1], [0.3, 0.3]])
    v = Interval(lower, lower + np.array([[2.0, 2.5], [1.0, 0.3], [0.0, 0.0]]))
    linear = rng.uniform(-1, 1, 2)
    squares = np.broadcast_to(np.array([-concave, 0.0, -concave])[:, None], (3, 3, 1))  # v_1², v_2 v_1, v_2²
    turning = np.broadcast_to(np.array([[bent, bent], [0.0, 0.0]])[..., None], (3, 2, 2, 1))
    given = (np.broadcast_to(linear[:, None], (3, 2, 1)), squares, turning, np.zeros((3, 2, 1)))
    found = range_of(v, *map(Interval.at, given))
    points = lower[:, None] + rng.uniform(0, 1, (3, 4000, 2)) * (v.upper - lower)[:, None]
    corners = np.stack(np.broadcast_arrays(*np.ix_((0, 1), (0, 1))), axis=-1).reshape(4, 2)
    points = np.concatenate([points, lower[:, None] + corners * (v.upper - lower)[:, None]], axis=1)
    convex = points @ linear + bent * np.abs(points.sum(axis=2))
    seen = np.max(convex - concave * np.sum(points**2, axis=2), axis=1)
    assert np.all(found.upper[:, 0] >= seen - 1e-12)  # of rounding
    assert np.all(found.lower[:, 0] <= np.min(convex - concave * np.sum(points**2, axis=2), axis=1) + 1e-12)
    if not bent:
        assert found.upper[:, 0] == pytest.approx(seen, abs=0.02 * (1 + concave))  # how far the nearest point may be
    without = range_of(v, *map(Interval.at, given[:2]), None, Interval.at(given[3]))
    assert bent or (np.all(without.lower >= found.lower) and np.all(without.upper <= found.upper))


def test_forms_of_other_shapes_are_refused():
    v, one = Interval.at(np.zeros((2, 2))), Interval.at(np.zeros((2, 2, 1)))
    with pytest.raises(ValueError, match="do not match"):
        range_of(v, one, one, None, one)


def test_velocities_that_only_hurt_count_at_their_best():
    """Centrifugal force of joint 1 pulls joint 2 of an RR arm outward: at rest of joint 1 it pulls least."""
    robot = ARMS["rr"]()
    q = Interval.at(np.array([[0.3, 1.0]]))
    limit = np.array([[5.0, 0.0]])
    forces = Forces(
        terms_over(Dynamics(robot), q),
        Interval(-limit, limit),
        torques_of(robot, Interval(-limit, limit)),
        robot.friction,
    )
    found = forces.rate(np.array([[0.0], [1.0]]), Interval.at(np.array([[0.02], [0.0]])))
    fast = np.linspace(-5, 5, 2001)
    seen = []
    for v in fast:
        rate, _ = momentum_rate(robot, q.lower[0], np.array([v, 0.0]), robot.limits.effort_upper)
        seen.append(0.02 * v + rate[1])
    assert found.upper[0, 0] == pytest.approx(max(seen), rel=1e-6)  # of the difference quotient
    assert max(seen[0], seen[-1]) < max(seen) - 1e-3


@pytest.mark.slow
def test_the_least_of_a_redundant_end_is_below_all_its_positions_and_near_the_least_of_them():
    """Ends of a Panda, one of whose self-motions is 0.1 rad long: second-order terms are some milliradians."""
    robot = ad.Robot.from_library("panda")
    goal = ad.GoalPose(robot.tip, np.array([[1, 0, 0, 0.5], [0, -1, 0, 0.15], [0, 0, -1, 0.3], [0, 0, 0, 1.0]]))
    limits = robot.limits
    middle = (limits.position_lower + limits.position_upper) / 2
    near = poses_reaching(robot, goal, middle, limits)[0]
    along = free_directions(robot, goal, near)[:, 0]
    found = [slid(robot, goal, near, step * along, limits) for step in np.linspace(-0.05, 0.05, 41)]
    positions = np.array([q for q in found if q is not None])
    assert len(positions) > 30
    box = Interval(positions.min(axis=0) - 1e-4, positions.max(axis=0) + 1e-4)
    within = Within((), limits.velocity, Interval(limits.position_lower, limits.position_upper), 10.0)
    goals = GoalSet(Dynamics(robot), goal, within, BoundPolicy())
    end, rng = LegEnd(box, np.zeros(7), goals.closure_over(box)), np.random.default_rng(7)
    for weights in rng.uniform(-1, 1, (30, 7)):
        across = weights - (weights @ along) * along
        for row in (weights, across):
            assert end.least(row) <= np.min(positions @ row)
        least = np.sum(across * box.centre) - np.abs(across) @ box.radius  # of the box alone
        assert np.min(positions @ across) - end.least(across) < 0.02
        assert end.least(across) >= least - 1e-12
