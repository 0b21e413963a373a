"""Between the points of the program, too, a settled curve keeps its limits: on grids that it was not settled on."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve import Basis, Curve, graded
from armdyn.optimal.curves.excess import excesses_of, larger_margin
from armdyn.optimal.curves.layout import POINTS, CurveSpec, TorqueMargin
from armdyn.optimal.curves.refinement import refine_curve
from armdyn.optimal.curves.solve import solve_curve
from armdyn.optimal.problem.task import Task
from optimal.curves.bends import bent, task
from problems import cart

BEYOND = 1e-6 + 5e-5
"""Of half a range: tops between 24 looks of an interval are taken from parabolas, which leave their third differences:
a thousandth of those of a torque that swings through a few per cent within an interval."""


def ur5(**options):
    """A random pair of poses over 80 % of the range, clipped to ±π."""
    robot, rng = ad.Robot.from_library("ur5"), np.random.default_rng(1)
    lower, upper = (np.clip(side, -np.pi, np.pi) for side in (robot.limits.position_lower, robot.limits.position_upper))
    middle, half = (lower + upper) / 2, 0.4 * (upper - lower)
    start, goal = (rng.uniform(middle - half, middle + half) for _ in range(2))
    return ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, **options)


def straight(task, intervals=None):
    numbers = task.policy.curves
    return Curve.straight(task.problem, Basis(graded(intervals or numbers.intervals, numbers.shortest)), 1.0)


def shares(problem, curve, looks=43):
    """The largest |torque| over its limit, |speed| over its limit, and |torque rate| [N m/s], between all breaks."""
    limits, tau_share, v_share, rate = problem.limits, 0.0, 0.0, 0.0
    for leg in curve.legs:
        inner = (np.arange(looks) + 0.37) / looks
        s = leg.basis.breaks[:-1, None] + np.diff(leg.basis.breaks)[:, None] * inner
        tau = leg.torques(problem.robot, s.ravel())
        beyond = np.maximum(tau - limits.effort_upper, limits.effort_lower - tau)
        tau_share = max(tau_share, 1 + np.max(beyond / (limits.actuators.width) * 2))
        v_share = max(v_share, np.max(np.abs(leg.at(s.ravel())[1]) / limits.velocity))
        rate = max(rate, np.max(np.abs(np.diff(tau, axis=0)) / (leg.duration * np.diff(s.ravel())[:, None])))
    return tau_share, v_share, rate


def test_a_settled_curve_of_a_real_arm_keeps_its_limits_between_its_points():
    job = Task.of(ur5())
    plain = solve_curve(job, straight(job), CurveSpec(TightenedConstraints.of(job), smooth=job.policy.curves.smooth))
    settled = refine_curve(job, straight(job))
    tau, speed, _ = shares(job.problem, settled.curve)
    assert tau <= 1 + BEYOND
    assert speed <= 1 + 1e-12  # control points are slowed down to the limit itself
    assert shares(job.problem, plain.curve)[0] > 1.005  # there was something to settle
    assert settled.excess <= 0 and settled.solved.converged
    # Cost of limits between the points: 1e-4 at most on twenty pairs.
    assert plain.curve.duration * (1 - 1e-6) <= settled.curve.duration <= plain.curve.duration * (1 + 5e-4)
    assert settled.iterations > plain.result.iterations


@pytest.mark.slow
def test_limits_of_torque_rates_are_kept_between_the_points():
    limit = 1500.0
    job = Task.of(ur5(path_constraints=[ad.TorqueRateLimit(limit)]))
    settled = refine_curve(job, straight(job))
    tau, _, rate = shares(job.problem, settled.curve)
    assert tau <= 1 + BEYOND
    # Means over 1/24 of an interval are within the limit; over shorter parts, near corners of the rate at breaks, they
    # exceed it by its change in 1/48 of an interval. Torques that are handed out are lines over 1/16.
    assert 0.99 * limit < rate <= 1.02 * limit


def cart_task(**options):
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], **options)
    return Task.of(problem, ad.MinimumTimeOptions(compile=False))


def test_where_nothing_is_exceeded_nothing_is_solved_again():
    job = cart_task(acceleration_limit=0.5)  # half the torque is enough
    messages = []
    settled = refine_curve(replace(job, progress=messages.append), straight(job, 20))
    once = solve_curve(job, straight(job, 20), CurveSpec(TightenedConstraints.of(job), smooth=job.policy.curves.smooth))
    assert not messages and settled.iterations == once.result.iterations
    assert settled.curve.duration == pytest.approx(once.curve.duration, rel=1e-6)  # slowed by IPOPT's 1e-7
    assert settled.reports.reasons == ()


def test_room_is_added_only_where_a_torque_exceeds_its_limit():
    job = cart_task()  # the torque jumps in the middle of the eleventh interval
    curve = solve_curve(job, straight(job, 21), CurveSpec(TightenedConstraints.of(job))).curve
    (over,) = excesses_of(job, curve)
    assert over.upper.shape == over.lower.shape == (21 * POINTS, 1)
    # By hand, on many places: each point has its half of an interval.
    (leg,) = curve.legs
    for k in range(21):
        for half in range(2):
            s = leg.basis.breaks[k] + np.diff(leg.basis.breaks)[k] * (half + np.linspace(0, 1, 1201)) / 2
            tau = leg.torques(job.problem.robot, s)
            np.testing.assert_allclose(over.upper[2 * k + half], np.max(tau) - 1, atol=1e-6)  # of parabolas
            np.testing.assert_allclose(over.lower[2 * k + half], -1 - np.min(tau), atol=1e-6)
    assert 0 < np.count_nonzero(over.upper > 0) < 21 and np.max(over.upper) > 1e-3
    messages = []
    settled = refine_curve(replace(job, progress=messages.append), straight(job, 21))
    assert messages and settled.excess <= 0
    # To slow the motion down would cost the root of the excess; tightening where it occurs costs less.
    assert settled.curve.duration < curve.duration * (np.sqrt(1 + np.max(over.upper)) - 1e-3)
    assert shares(job.problem, settled.curve)[0] <= 1 + BEYOND


def test_a_point_without_room_takes_it_from_its_neighbours():
    job, kept = cart_task(), np.full((4, 1), -1.0)
    over = TorqueMargin(kept, np.array([[-1.0], [-1.0], [-1.0], [0.1]]), np.full((5, 1), -1.0))
    once = larger_margin(TorqueMargin(), over, job.policy.curves)
    assert once.lower[3, 0] == pytest.approx(0.15, abs=1e-3)
    assert not np.any(once.lower[:3]) and not np.any(once.upper)
    full = larger_margin(replace(once, lower=np.array([[0.0], [0.0], [0.0], [0.95]])), over, job.policy.curves)
    assert full.lower[3, 0] == 0.95
    np.testing.assert_allclose(np.ravel(full.lower)[:3], [0, 0, 0.15], atol=1e-3)
    np.testing.assert_allclose(np.ravel(full.upper), [0, 0, 0.15, 0], atol=1e-3)


def test_rates_are_counted_to_the_step_in_which_they_are():
    job = task("torque rate")
    curve = bent(job.problem)
    (over,) = excesses_of(job, curve)
    (leg,) = curve.legs
    assert over.rates.shape == (leg.basis.intervals * POINTS + 1, 2)
    marks = np.concatenate([[0.0], leg.basis.gauss(POINTS)[0].ravel(), [1.0]])
    for k in range(len(over.rates)):  # its own and those of its neighbours
        first, last = max(k - 1, 0), min(k + 2, marks.size - 1)
        s = np.linspace(marks[first], marks[last], 4001)
        rates = np.diff(leg.torques(job.problem.robot, s)[:, 0]) / (np.diff(s) * leg.duration)
        # Means over 1/24 of an interval against those over a thousandth, where rates change by their own size.
        assert 1 + over.rates[k, 0] == pytest.approx(np.max(np.abs(rates)) / 40, rel=0.1)
    np.testing.assert_array_equal(over.rates[:, 1], -1)  # that joint has no limit


def test_a_torque_that_no_pace_mends_remains_in_excess():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("r"))
    with pytest.warns(ad.ArmdynWarning, match="to hold the goal"):
        nlp_data = ad.MinimumTimeProblem(robot, q_start=[-1.5], q_goal=[0.15], velocity_limit=4.0, effort_limit=0.2)
    job = Task.of(nlp_data, ad.MinimumTimeOptions(compile=False))
    job = replace(job, policy=job.policy.changed("curves", patience=60))
    settled = refine_curve(job, straight(job, 12))
    assert nlp_data.holding_torque()[0] > 0.2
    assert settled.excess > 0.01
