"""Motions from moving states: against the cold answer, against limits at random times, and where there is no time."""

from dataclasses import replace
from functools import cache
from itertools import count, pairwise
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicHermiteSpline

import armdyn as ad
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.optimal import resolver as live_resolver
from armdyn.optimal.curves import live
from armdyn.optimal.curves.layout import TorqueMargin
from armdyn.optimal.curves.live import LiveProblem, SampledCurve
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.trajectory.interpolation import cubic_accelerations
from problems import CART, paper_arm

READY = np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785])
THERE = np.array([1, 0.2, 0.5, -1.5, 0.3, 2, -0.5])
REST = np.zeros(7)
HEAVY = ad.Payload(mass=2.0)


@cache
def panda():
    return ad.Robot.from_library("panda")


@cache
def first_motion():
    return ad.Resolver(panda()).solve(READY, REST, THERE)


def excess(robot, motion, random, limits=None):
    """Largest excess over a limit at random times by `pin.rnea`, as a part of it; negative: the unused part."""
    limits, data = limits or robot.limits, robot.model.createData()
    t = np.sort(random.uniform(motion.t[0], motion.t[-1], 1000))
    k = np.clip(np.searchsorted(motion.t, t, side="right") - 1, 0, motion.t.size - 2)
    h, at = np.diff(motion.t)[k][:, None], motion(t)
    s, v, rise = (t - motion.t[k])[:, None] / h, motion.v, np.diff(motion.q, axis=0)[k]
    a = ((6 - 12 * s) * rise / h + (6 * s - 4) * v[k] + (6 * s - 2) * v[k + 1]) / h  # of the cubics
    tau = np.array([pin.rnea(robot.model, data, *x) for x in zip(at.q, at.v, a, strict=True)])
    half = (limits.effort_upper - limits.effort_lower) / 2
    torque = np.max(np.maximum(tau - limits.effort_upper, limits.effort_lower - tau) / half)
    position = np.max(np.maximum(at.q - limits.position_upper, limits.position_lower - at.q))
    return max(torque, np.max(np.abs(at.v) / limits.velocity) - 1, position)


def expect_motion(solution, q, v, goal):
    """It begins in the state and rests at the goal."""
    motion = solution.trajectory
    np.testing.assert_allclose(motion.q[[0, -1]], [q, goal], atol=1e-12)
    np.testing.assert_allclose(motion.v[[0, -1]], [v, np.zeros_like(v)], atol=1e-9)


def test_torques_between_samples_are_those_of_the_cubics():
    whole, robot = first_motion().trajectory, panda()
    few = replace(whole, t=whole.t[::24], q=whole.q[::24], v=whole.v[::24], tau=whole.tau[::24])
    nothing = np.zeros((len(few.t), 7))
    tau = inverse_dynamics(robot)(few.q, few.v, nothing)
    sampled = SampledCurve(few.t, few.q, few.v, nothing, tau, TorqueMargin(), 0.0)
    problem = first_motion().problem
    between = LiveProblem.of(problem, Policy.of(problem)).between_samples(sampled)
    cubics, limits, found = CubicHermiteSpline(few.t, few.q, few.v), robot.limits, -np.inf
    for first, last in pairwise(few.t):
        t = np.linspace(np.nextafter(first, last), np.nextafter(last, first), 9)
        tau = inverse_dynamics(robot)(cubics(t), cubics(t, 1), cubics(t, 2))
        half = (limits.effort_upper - limits.effort_lower) / 2
        found = max(found, np.max(np.maximum(tau - limits.effort_upper, limits.effort_lower - tau) / half))
    assert between > 1e-3 and between == pytest.approx(found, rel=1e-6)


def test_from_rest_it_finds_the_motion_of_the_whole_search():
    cold = ad.solve_minimum_time(first_motion().problem, ad.MinimumTimeOptions(calm=0))
    assert first_motion().usable
    assert first_motion().lower_bound is None
    assert first_motion().duration == pytest.approx(cold.duration, rel=3e-3)  # of 24 intervals


@pytest.mark.slow
@pytest.mark.parametrize(("part", "slower"), [(0.0, 2e-3), (0.2, 2e-3), (0.5, 2e-3), (0.8, 5e-2)])
def test_a_moved_goal_is_reached_as_fast_as_by_a_cold_solve_and_within_all_limits(part, slower):
    """Near the goal all torques are at their limits: there the motion may have to keep a margin."""
    random = np.random.default_rng(int(10 * part))
    resolver, at = ad.Resolver(panda()), first_motion().trajectory(part * first_motion().duration)
    resolver.begin_with(first_motion())
    goal = THERE + random.uniform(-0.07, 0.07, 7)
    solution = resolver.solve(at.q, at.v, goal)
    assert solution.usable
    assert solution.status in ("solved", "iteration_limit")
    expect_motion(solution, at.q, at.v, goal)
    assert excess(panda(), solution.trajectory, random) <= 0
    cold = ad.solve_minimum_time(solution.problem, ad.MinimumTimeOptions(calm=0, bound=False))
    assert solution.duration <= (1 + slower) * cold.duration


def test_goals_that_change_in_flight_again_and_again():
    random, resolver = np.random.default_rng(5), ad.Resolver(panda())
    q, v, goal = READY, REST, THERE
    for _ in range(12):
        solution = resolver.solve(q, v, goal)
        assert solution.usable
        expect_motion(solution, q, v, goal)
        assert excess(panda(), solution.trajectory, random) <= 0
        at = solution.trajectory(0.1 * solution.duration)
        q, v, goal = at.q, at.v, goal + random.uniform(-0.02, 0.02, 7)


def test_another_payload_holds_from_the_next_call_on():
    resolver, at = ad.Resolver(panda()), first_motion().trajectory(0.3)
    resolver.begin_with(first_motion())
    resolver.robot = panda().with_payload(HEAVY)
    solution = resolver.solve(at.q, at.v, THERE)
    assert solution.usable
    assert excess(resolver.robot, solution.trajectory, np.random.default_rng(1)) <= 0


@pytest.mark.parametrize(
    "limits",
    [
        {"velocity_limit": 1.0},
        {"effort_limit": [60, 60, 60, 60, 10, 10, 10]},
        {"reserve": 0.2},
        {"acceleration_limit": 8.0},
    ],
    ids=str,
)
def test_limits_may_change_between_calls(limits):
    resolver = ad.Resolver(panda())
    before = first_motion()
    for name, value in limits.items():
        setattr(resolver, name, value)
    after = resolver.solve(READY, REST, THERE)
    assert after.usable
    assert after.duration > before.duration
    assert excess(panda(), after.trajectory, np.random.default_rng(2), after.problem.limits) <= 0
    if "acceleration_limit" in limits:
        motion = after.trajectory
        assert np.max(np.abs(cubic_accelerations(motion.t, motion.q, motion.v))) <= 8.0 * (1 + 1e-6)


def test_without_time_it_follows_the_last_motion():
    resolver, T = ad.Resolver(panda()), first_motion().duration
    resolver.begin_with(first_motion())
    at = first_motion().trajectory(0.4 * T)
    solution = resolver.solve(at.q, at.v, READY, deadline=1e-9)
    assert solution.status == "followed"
    assert not solution.success
    expect_motion(solution, at.q, at.v, THERE)
    assert solution.duration == pytest.approx(0.6 * T, abs=1e-6)
    assert "comes to rest, but not at the goal" in str(solution)


@pytest.mark.parametrize("part", [0.1, 0.5, 0.7])
def test_without_time_and_memory_it_stops_within_all_limits(part):
    at = first_motion().trajectory(part * first_motion().duration)
    solution = ad.Resolver(panda()).solve(at.q, at.v, READY, deadline=1e-9)
    motion = solution.trajectory
    assert solution.status == "stopped"
    assert not solution.usable
    expect_motion(solution, at.q, at.v, motion.q[-1])
    assert excess(panda(), motion, np.random.default_rng(3)) <= 0
    assert solution.duration < 0.5


def test_a_last_motion_of_another_payload_is_not_followed():
    resolver, at = ad.Resolver(panda()), first_motion().trajectory(0.3)
    resolver.begin_with(first_motion())
    resolver.robot = panda().with_payload(HEAVY)
    solution = resolver.solve(at.q, at.v, READY, deadline=1e-9)
    assert solution.status == "stopped"
    assert excess(resolver.robot, solution.trajectory, np.random.default_rng(3)) <= 0


def test_a_last_motion_that_accelerates_more_than_it_now_may_is_not_followed():
    resolver, at = ad.Resolver(panda()), first_motion().trajectory(0.3)
    resolver.begin_with(first_motion())
    resolver.acceleration_limit = 8.0
    solution = resolver.solve(at.q, at.v, READY, deadline=1e-9)
    motion = solution.trajectory
    assert solution.status in ("stopped", "failed")
    if solution.status == "stopped":
        assert np.max(np.abs(cubic_accelerations(motion.t, motion.q, motion.v))) <= 8.0 * (1 + 1e-6)


def test_at_rest_without_time_it_stays():
    solution = ad.Resolver(panda()).solve(READY, REST, THERE, deadline=1e-9)
    assert solution.status == "stopped"
    assert np.all(solution.trajectory.q == READY)
    np.testing.assert_allclose(solution.trajectory.tau[0], panda().holding_torque(READY))


def test_where_no_stop_keeps_the_limits_there_is_no_motion():
    robot = ad.Robot.from_urdf_string(CART)
    edge = robot.limits.position_upper - 1e-3  # at 1 m/s, and no force stops it within a millimetre
    solution = ad.Resolver(robot).solve(edge, [1.0], [0.0], deadline=1e-9)
    assert solution.status == "failed"
    assert not (solution.success or solution.usable or solution.moves)


def test_of_a_double_integrator_it_is_bang_bang():
    """From x = 0 at v to rest at d: T = (2 √(a d + v²/2) − v) / a, by hand."""
    robot = ad.Robot.from_urdf_string(CART)
    mass = 1 / ad.Dynamics(robot).aba([0.0], [0.0], [1.0])[0]
    a, v, d = 1 / mass, 0.5, 1.0
    solution = ad.Resolver(robot).solve([0.0], [v], [d])
    assert solution.usable
    assert solution.duration == pytest.approx(
        (2 * np.sqrt(a * d + v**2 / 2) - v) / a, rel=0.01
    )  # a jump takes an interval


def test_motions_at_their_torque_limits_all_the_way_settle():
    """Curve and margins of an RRR converge together: two loops of steps left nine in ten of such motions unsettled."""
    robot, random = paper_arm("rrr"), np.random.default_rng(3)
    settled = 0
    for _ in range(8):
        start, goal = random.uniform(-1.6, 1.6, (2, 3))
        first = ad.Resolver(robot).solve(start, np.zeros(3), goal)
        assert first.usable
        settled += first.status == "solved"
    assert settled >= 6


def test_obstacles_may_come_and_are_kept_clear_of():
    resolver = ad.Resolver(panda(), clearance=0.01)
    resolver.solve(READY, REST, THERE)
    resolver.obstacles = [ad.Sphere((0.45, 0.75, 0.25), 0.12)]
    solution = resolver.solve(READY, REST, THERE)
    assert solution.usable
    assert solution.clearance.distance >= 0.01 - 1e-6


def test_a_goal_pose_is_reached():
    robot, data = panda(), panda().model.createData()
    frame = robot.model.getFrameId("panda_hand")
    pin.framesForwardKinematics(robot.model, data, THERE)
    pose = ad.GoalPose("panda_hand", data.oMf[frame].homogeneous)
    solution = ad.Resolver(robot).solve(READY, REST, pose)
    assert solution.usable
    pin.framesForwardKinematics(robot.model, data, solution.trajectory.q[-1])
    np.testing.assert_allclose(data.oMf[frame].homogeneous, pose.pose.homogeneous, atol=1e-6)


def test_bad_input_is_named():
    resolver = ad.Resolver(panda())
    with pytest.raises(ad.ArmdynError, match="deadline"):
        resolver.solve(READY, REST, THERE, deadline=-1.0)
    with pytest.raises(ad.ArmdynError, match="beyond its limit"):
        resolver.solve(READY, 10 * np.ones(7), THERE)
    with pytest.raises(ad.ArmdynError, match="no motion is needed"):
        resolver.solve(READY, REST, READY)
    with pytest.raises(ad.ArmdynError, match="expected a usable motion"):
        resolver.begin_with(ad.Resolver(panda().with_payload(HEAVY)).solve(READY, REST, THERE))
    with pytest.warns(ad.ArmdynWarning), pytest.raises(ad.ArmdynError, match="has none"):
        ad.Resolver(panda().with_passive(["panda_joint4"])).solve(READY, REST, THERE)


def test_towards_the_same_goal_the_last_motion_goes_on():
    resolver = ad.Resolver(panda())
    whole = resolver.solve(READY, REST, THERE)
    at = whole.trajectory(0.3 * whole.duration)
    rest = resolver.solve(at.q, at.v, THERE)
    assert rest.usable
    assert rest.iterations == 0
    assert rest.duration == pytest.approx(0.7 * whole.duration, abs=1e-6)
    end = whole.trajectory(whole.duration)
    there = resolver.solve(end.q + 1e-13, end.v, THERE)
    assert there.usable
    assert not np.any(there.trajectory.v)


def test_unfinished_work_continues_in_the_next_calls(monkeypatch):
    whole, ticks = first_motion(), count()
    clock = SimpleNamespace(perf_counter=lambda: float(next(ticks)))  # a step takes a second, however busy the machine
    monkeypatch.setattr(live, "time", clock)
    monkeypatch.setattr(live_resolver, "time", clock)
    resolver = ad.Resolver(panda())
    for _ in range(3):
        late = resolver.solve(READY, REST, THERE, deadline=3.0)
        assert (late.status, late.iterations, late.usable) == ("stopped", 0, False)
    own = [resolver.solve(READY, REST, THERE, deadline=4.0) for _ in range(whole.iterations)]
    assert [each.iterations for each in own] == [1] * len(own)
    assert [each.usable for each in own] == [False] * (len(own) - 1) + [True]
    expect_motion(own[-1], READY, REST, THERE)
