"""The limit of how fast torques change: against closed forms, and by differences of torques."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.mesh.direct import solve_on_mesh
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.task import Task
from problems import POSES, cart, paper_arm, solve

START, GOAL = POSES["rr"]


def rr(*path_constraints):
    return ad.MinimumTimeProblem(paper_arm("rr"), q_start=START, q_goal=GOAL, path_constraints=path_constraints)


@pytest.mark.parametrize(
    ("rate", "duration"),
    [
        # On 1 kg it is a jerk limit. Double S, see Biagiotti and Melchiorri, Trajectory Planning (2008), section 3.4.
        (0.5, 4 * np.cbrt(2 / (2 * 0.5))),
        (4.0, 1 / 4 + np.sqrt(1 / 4**2 + 4 * 2)),  # here the torque reaches its 1 N, too
    ],
)
def test_a_cart_takes_the_time_of_its_double_s(rate, duration):
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], path_constraints=[ad.TorqueRateLimit(rate)])
    solution = solve(problem)
    # Corners fall between knots: `settle` stops where a mesh twice as fine changes less than 5e-4.
    assert solution.duration == pytest.approx(duration, rel=5e-4)
    assert solution.duration > duration * (1 - 1e-4)  # IPOPT's tolerance


@pytest.mark.slow
def test_two_links_keep_it_everywhere_and_a_lower_one_costs_time():
    durations = []
    for limit in (np.array([200.0, 100.0]), np.array([50.0, 25.0]), np.array([5.0, 5.0])):
        solution = solve(rr(ad.TorqueRateLimit(limit)), starts=1)
        motion, model = solution.trajectory, solution.problem.robot.model
        rates = np.abs(np.diff(motion.tau, axis=0)) / np.diff(motion.t)[:, None]
        assert np.max(rates / limit) == pytest.approx(1, abs=1e-4)  # IPOPT's tolerance, on a barrier's inner side
        assert np.max(rates / limit) <= 1 + 1e-6
        for q, tau in ((START, motion.tau[0]), (GOAL, motion.tau[-1])):  # at rest before and after
            hold = pin.computeGeneralizedGravity(model, model.createData(), np.array(q))
            np.testing.assert_allclose(tau, hold, atol=1e-6)
        durations.append(solution.duration)
    assert durations == sorted(durations)


def test_none_at_all_changes_nothing_but_the_control():
    problem, plain = rr(ad.TorqueRateLimit(np.inf)), rr()
    task, guess = Task.of(problem), spline(plain, [])
    assert task.scheme.control == "linear" and Task.of(plain).scheme.control == "constant"
    linear = replace(Task.of(plain), scheme=task.scheme)
    durations = [solve_on_mesh(each, guess, 40, each.alone()).trajectory.duration for each in (task, linear)]
    assert durations[0] == pytest.approx(durations[1], rel=1e-6)  # IPOPT's 1e-8, scaled


def test_a_jump_of_the_torque_is_seen():
    jumping = ad.solve_minimum_time(rr(), ad.MinimumTimeOptions(starts=1)).trajectory
    problem = rr(ad.TorqueRateLimit(1e6))
    kept = problem.path_constraints[0].check(problem, jumping, np.empty(0))
    assert kept.share > 1e6 and "changes" in kept.reasons[0] and "begins with a jump" in kept.reasons[1]
    assert kept.worst.constraint == "torque-rate limit" and kept.worst.value == kept.share - 1


def test_a_motion_that_begins_in_flight_begins_with_any_torque():
    problem = ad.MinimumTimeProblem(
        paper_arm("rr"), q_start=START, q_goal=GOAL, v_start=[2.0, 0.0], path_constraints=[ad.TorqueRateLimit(50.0)]
    )
    solution = solve(problem, starts=4)
    model = problem.robot.model
    hold = pin.computeGeneralizedGravity(model, model.createData(), np.array(START))
    assert np.max(np.abs(solution.trajectory.tau[0] - hold)) > 0.1


@pytest.mark.parametrize(
    ("limit", "says"),
    [
        (0.0, r"of joint 'joint1' is 0\.0 N m/s \(index 0\); it must be positive"),
        ([1.0, np.nan], r"TorqueRateLimit is nan N m/s \(index 1\)"),
        ([1.0, 2.0, 3.0], r"has shape \(3,\); expected one number or 2, one per joint: joint1, joint2"),
    ],
)
def test_faults_are_named(limit, says):
    with pytest.raises(ProblemError, match=says):
        rr(ad.TorqueRateLimit(limit))
