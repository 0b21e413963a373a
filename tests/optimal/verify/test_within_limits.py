"""Excesses over limits in closed form; torques that track a motion fit its states, keep their limits and land."""

import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import armdyn as ad
from armdyn.optimal.curves.curve import Basis, Curve, graded
from armdyn.optimal.curves.excess import sampled
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.rollout import replay_torques, ticked
from armdyn.optimal.verify.within_limits import excesses, follow, limit_violation, paced, paced_torques, worst_violation
from optimal.curves.bends import problem
from oracles import PinDynamics, assert_close, random_states
from problems import cart, paper_arm, paper_problem


def test_limit_violation_looks_between_samples():
    problem = paper_problem("r", velocity_limit=1.0)
    # Between two samples at 0.9 rad/s the cubic speeds up to 1.5 times the mean slope less a quarter.
    motion = ad.Trajectory([0, 1], [[0.0], [1.2]], [[0.9], [0.9]], [[0.0], [0.0]])
    fastest = 1.5 * 1.2 - 0.5 * 0.9
    assert limit_violation(problem.limits, motion) == pytest.approx(fastest - 1.0, rel=1e-9)


def test_the_worst_limit_is_named_with_joint_and_time():
    problem = paper_problem("rr", velocity_limit=[1.0, 2.0])
    t = [0.0, 1.0, 2.0]
    q, tau = np.zeros((3, 2)), np.array([[0.0, 0.0], [0.0, 4.5], [0.0, 0.0]])
    motion = ad.Trajectory(t, q, np.array([[0.0, 0.0], [1.2, 0.0], [0.0, 0.0]]), tau)
    worst = worst_violation(problem.robot, problem.limits, motion)
    assert (worst.constraint, worst.joint, worst.time) == ("torque limit", "joint2", 1.0)
    assert worst.value == pytest.approx(0.5)  # 1.5 of 3 N m
    assert excesses(problem.limits, motion, dense=1)[1].share == pytest.approx(0.2)
    fast = excesses(problem.limits, motion, dense=1)[1].worst(problem.robot)
    assert str(fast) == "velocity limit of joint 'joint1' at t = 1 s by 0.2 rad/s"


def test_a_motion_within_its_limits_exceeds_none():
    problem = paper_problem("rr")
    still = ad.Trajectory([0, 1], np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2)))
    assert limit_violation(problem.limits, still) == 0.0
    assert worst_violation(problem.robot, problem.limits, still) is None


FACTORS = st.floats(0.5, 2.0)


def at_random(nv, count=4):
    """Positions, velocities and accelerations, each of shape (count, nv)."""
    return (np.array(part) for part in zip(*random_states(nv, count), strict=True))


@pytest.mark.parametrize("arm", ["r", "rr", "rrr"])
@settings(max_examples=20)
@given(factor=FACTORS)
def test_torques_are_those_of_velocities_over_s_and_accelerations_over_s_squared(arm, factor):
    robot = paper_arm(arm)
    pin = PinDynamics(robot)
    q, v, a = at_random(robot.nv)
    zero = np.zeros_like(v)
    tau = np.array([pin.rnea(*row) for row in zip(q, v, a, strict=True)])
    found = paced_torques(robot, ad.trajectory.Sample(q, v, zero), tau, factor)
    assert_close(found, [pin.rnea(*x) for x in zip(q, v / factor, a / factor**2, strict=True)], 1e-10)
    # Hollerbach's law: all of a torque but gravity's goes with 1/s².
    gravity = np.array([pin.gravity(row) for row in q])
    assert_close(found - gravity, (tau - gravity) / factor**2, 1e-10)


def test_at_its_own_pace_friction_is_paid_all_the_same():
    robot = paper_arm("rr").with_friction(0.1, 0.2, 0.05)
    q, v, a = at_random(2)
    pin = PinDynamics(robot)
    bare = np.array([pin.rnea(*row) for row in zip(q, v, a, strict=True)])
    tau = bare + robot.friction.torque(v)
    at = ad.trajectory.Sample(q, v, tau)
    assert_close(paced_torques(robot, at, tau, 1.0), tau, 1e-10)
    slow = [pin.rnea(*x) for x in zip(q, v / 2, a / 4, strict=True)] + robot.friction.torque(v / 2)
    assert_close(paced_torques(robot, at, tau, 2.0), slow, 1e-10)


@given(FACTORS)
def test_a_paced_motion_has_the_same_path(factor):
    t = np.array([0.0, 0.3, np.nextafter(0.3, 1), 0.7, 1.0])
    q = np.array([[0.0], [0.2], [0.2], [0.5], [1.0]])
    motion = ad.Trajectory(t, q, np.ones((5, 1)), np.array([[1.0], [1], [-1], [-1], [0]]))
    slow = paced(motion, factor)
    assert slow.duration == pytest.approx(factor, rel=1e-15)
    assert np.array_equal(slow.q, q) and np.array_equal(slow.tau, motion.tau)
    at = np.linspace(0, 1, 23)
    # Positions are a cubic of time over duration, for any duration.
    np.testing.assert_allclose(slow(factor * at).q, motion(at).q, atol=1e-12)
    np.testing.assert_allclose(factor * slow(factor * at).v, motion(at).v, atol=1e-11)


def gentle(nlp_data, duration, intervals=12):
    """A curve that takes its time: about a minimum-jerk profile from pose to pose, with no acceleration at its ends."""
    straight = Curve.straight(nlp_data, Basis(graded(intervals, 1.0)), duration)
    s = straight.legs[0].basis.places[:, None]
    part = s**3 * (10 - 15 * s + 6 * s**2)
    part[:3], part[-3:] = 0, 1
    ends = zip(straight.legs, nlp_data.poses[:-1], nlp_data.poses[1:], strict=True)
    legs = tuple(replace(leg, points=(1 - part) * a + part * b, duration=duration) for leg, a, b in ends)
    return Curve(legs)


@pytest.mark.parametrize(("kind", "jumps"), [("plain", 0), ("friction", 0), ("via", 1), ("torque rate", 0)])
def test_states_and_torques_fit_and_land(kind, jumps):
    nlp_data = problem(kind)
    job, curve = Task.of(nlp_data), gentle(nlp_data, 0.9)
    motion = follow(job, sampled(job, curve))
    assert motion.duration == pytest.approx(curve.duration, rel=1e-15)
    assert np.count_nonzero(motion.jumps) == jumps
    limits = nlp_data.limits
    assert np.all(motion.tau <= limits.effort_upper) and np.all(motion.tau >= limits.effort_lower)
    replay = replay_torques(nlp_data.robot, motion)
    # The very same integration, sample by sample: bit for bit.
    np.testing.assert_array_equal(replay.q, motion.q)
    np.testing.assert_array_equal(replay.v, motion.v)
    # Feedback is a sample late, and fades in the last interval where torques may not jump. That interval is 1/12 of the
    # motion here, 3e-4 where velocities are limited: there they, too, are within 1e-6.
    assert (
        np.max(np.abs(nlp_data.goal_error_of(motion)[:2])) < 1e-6
        and np.max(np.abs(nlp_data.goal_error_of(motion))) < 2e-5
    )
    for k, leg in enumerate(curve.legs):  # and it is near the curve all the way
        start = 0.9 * k
        s = np.linspace(0.01, 0.99, 50)
        np.testing.assert_allclose(motion(start + 0.9 * s).q, leg.at(s)[0], atol=1e-6)


@pytest.mark.parametrize("goal", [(1.0, 0.5), (-1.5, 1.0)], ids=["falls", "swings"])
def test_minutes_of_an_arm_that_falls_or_swings_are_followed(goal):
    """Feedback by the motion's duration alone is slower than the arm falls, or later than half a swing."""
    nlp_data = ad.MinimumTimeProblem(paper_arm("rr"), q_start=[0.0, 0.0], q_goal=goal)
    job = Task.of(nlp_data)
    motion = follow(job, sampled(job, gentle(nlp_data, 150.0)))
    assert motion.t.size < 15_000 and np.max(np.abs(nlp_data.goal_error_of(motion))) < 1e-6


def test_torque_limits_that_saturate_are_not_exceeded():
    nlp_data = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0])
    curve = gentle(nlp_data, 3.0)  # 1.28 N where 1 N is the limit: 10 / √3 d/T² at most
    spec = curve.legs[0].torques(nlp_data.robot, np.linspace(0, 1, 200))
    assert np.max(np.abs(spec)) > 1.2
    motion = follow(Task.of(nlp_data), sampled(Task.of(nlp_data), curve))
    assert np.max(motion.tau) == 1.0 and np.min(motion.tau) == -1.0
    replay = replay_torques(nlp_data.robot, motion)
    # The same steps, but for the order of their sums.
    np.testing.assert_allclose(replay.q, motion.q, atol=1e-10)


def test_a_motion_in_flight_begins_in_flight():
    nlp_data = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], v_start=[0.3])
    motion = follow(Task.of(nlp_data), sampled(Task.of(nlp_data), gentle(nlp_data, 6.0)))
    np.testing.assert_array_equal(motion.v[0], [0.3])
    # The curve begins at rest: feedback, 160 times as fast as the motion, brings the cart onto it.
    assert np.max(np.abs(nlp_data.goal_error_of(motion))) < 1e-6


def test_torques_that_may_not_jump_end_with_the_holding_torque():
    nlp_data = problem("torque rate")
    motion = follow(Task.of(nlp_data), sampled(Task.of(nlp_data), gentle(nlp_data, 0.9)))
    np.testing.assert_allclose(motion.tau[-1], nlp_data.holding_torque(), atol=1e-9)  # the curve's end, to rounding


def test_lines_have_the_impulses_of_the_torque():
    """Open loop, without feedback: lines through the torque miss by h², those that are laid by h⁴."""
    nlp_data = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0])
    curve = gentle(nlp_data, 4.0)
    job = Task.of(nlp_data)
    misses = []
    for samples in (4, 8):
        few = replace(
            job, policy=job.policy.changed("curves", samples=samples, velocity_error=1e9, steps=1, bandwidth=0.0)
        )
        misses.append(np.max(np.abs(nlp_data.goal_error_of(follow(few, sampled(few, curve))))))
        plain = curve.trajectory(nlp_data.robot, [samples])
        naive = np.max(np.abs(nlp_data.goal_error_of(replay_torques(nlp_data.robot, plain))))
        assert misses[-1] < naive / 5 or naive < 1e-9
    assert misses[1] < misses[0] / 6 or misses[0] < 1e-9  # the ends' lines are of the third order


def test_a_motion_that_is_lost_ends_early(monkeypatch):
    nlp_data = problem("plain")
    wanted = sampled(Task.of(nlp_data), gentle(nlp_data, 0.9))

    def lost(motion):
        tau = motion.tau.copy()
        tau[6] = np.nan
        return tau

    monkeypatch.setattr("armdyn.optimal.verify.within_limits._lines", lost)
    assert follow(Task.of(nlp_data), wanted).t.size == 6
    monkeypatch.setattr("armdyn.optimal.verify.within_limits.RTOL", 1e-300)  # no step is that good
    motion = follow(Task.of(nlp_data), wanted)
    assert motion.t.size == 2
    np.testing.assert_array_equal(motion.q[1], motion.q[0])


def test_samples_are_as_dense_as_gravity_requires():
    """At constant velocities heavy links let the torques of light wrists bend: lines between samples miss those."""
    robot = ad.Robot.from_library("kinova")
    q_start, q_goal = [-2.1, 2.9, 3.4, -1.9, 1.1, 0.5], [0.3, 4.1, 1.9, 2.4, 3.3, -1.7]
    nlp_data = ad.MinimumTimeProblem(robot, q_start=q_start, q_goal=q_goal)
    job = Task.of(nlp_data)
    curve = gentle(nlp_data, 4.0, intervals=56)
    motion = follow(job, sampled(job, curve))
    between = ticked(robot, motion, np.min(np.diff(motion.t)) / 4)
    missed = between.v - curve.legs[0].at(between.t / curve.duration)[1]
    assert np.max(np.abs(missed) / nlp_data.limits.velocity) < job.policy.curves.velocity_error


@pytest.mark.slow
def test_minutes_of_motion_are_not_replayed_for_minutes():
    """A Panda at a five thousandth of its speed: 2315 s, whose replay takes minutes."""
    robot = ad.Robot.from_library("panda")
    problem = ad.MinimumTimeProblem(
        robot, q_start="ready", q_goal=[1.0, 0.3, 0.4, -1.2, 0.5, 2.0, 0.0], velocity_limit=0.0005
    )
    begun, progress = time.perf_counter(), []
    options = ad.MinimumTimeOptions(time_limit=2.0, bound=False)
    solution = ad.solve_minimum_time(problem, options, progress=progress.append)
    assert solution.status is ad.Status.TIME_LIMIT and not solution.usable
    assert progress[-1].startswith("replaying a motion of 231")
    assert time.perf_counter() - begun < 12.0
