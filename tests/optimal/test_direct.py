import os
import signal
import threading
import time

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal import Status
from armdyn.optimal.problem.stop import Stop, stopping
from armdyn.optimal.refine.slowing import within_velocity_limits
from armdyn.optimal.search.candidates import taken
from armdyn.optimal.search.starts import detours, spline
from armdyn.optimal.solve.direct import solve_on_mesh
from armdyn.optimal.task.options import DirectOptions
from armdyn.optimal.task.task import Task
from problems import cart, paper_problem


@pytest.mark.parametrize("control", ["linear", "constant"])
@pytest.mark.parametrize("form", ["forward", "inverse"])
def test_double_integrator_converges_to_the_closed_form_from_above(tmp_path, control, form):
    # Unit force and mass over 2 m: 2√2 s. Both controls keep the bound, so no mesh can be faster.
    robot = cart(tmp_path)
    problem = ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[2.0])
    excess = []
    for n in (11, 22, 44):  # no multiple puts a knot on the switch of all meshes
        options = ad.MinimumTimeOptions(intervals=n, max_intervals=n, arcs=False, control=control, dynamics=form)
        solution = ad.solve_minimum_time(problem, options)
        assert solution.success, solution.message
        excess.append(solution.duration - 2 * np.sqrt(2))
    assert min(excess) > -1e-7  # IPOPT relaxes bounds by 1e-8 of the scaled problem
    assert excess[-1] < 1e-3


def test_two_links_land_when_replayed():
    solution = ad.solve_minimum_time(paper_problem("rr"))
    assert solution.success, solution.message
    assert solution.status is ad.Status.SOLVED
    # Best known 0.21067170 s: a local solution may be slower, none may be faster.
    assert solution.duration > 0.2106717
    replay = ad.replay_torques(solution.problem.robot, solution.trajectory)
    assert np.max(np.abs(replay.q[-1] - solution.problem.q_goal)) == pytest.approx(solution.replay_error, rel=1e-6)
    assert solution.replay_error < 1e-3
    assert np.max(np.abs(solution.trajectory.tau)) <= 3 * (1 + 1e-7)  # IPOPT's relaxed bounds


def test_velocity_limit_holds_and_costs_time():
    free = ad.solve_minimum_time(paper_problem("rr"))
    problem = paper_problem("rr", velocity_limit=12.0)
    slow = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(refinements=1, max_intervals=80))
    assert slow.success, slow.message
    # What is not certified says by how much it strays; a velocity is held by the collocation, not by the replay.
    assert np.max(np.abs(slow.trajectory.v)) <= 12 * (1 + max(1e-6, slow.certificate.limit_violation))
    assert slow.certificate.limit_violation < 1e-3
    assert slow.duration > max(free.duration, problem.duration_bound())


def test_slowed_down_within_velocity_limits_only_where_it_lands():
    problem = paper_problem("rr", velocity_limit=12.0)
    task = Task.of(problem)
    motion = solve_on_mesh(task, spline(problem, []), 60, task.options.alone()).trajectory
    assert np.max(np.abs(ad.replay_torques(problem.robot, motion).v)) > 12 * (1 + 1e-5)  # there is something to mend
    slowed, certificate = within_velocity_limits(problem, motion, "", 1e-2, Stop())
    assert certificate.limit_violation <= 1e-6 and certificate.goal_error <= 1e-2
    assert 1 < slowed.duration / motion.duration < 1.01
    assert within_velocity_limits(problem, motion, "", 0.1 * certificate.goal_error, Stop()) is None


def test_moving_start_and_goal():
    problem = paper_problem("rr", v_start=[3.0, -2.0], v_goal=[1.0, 1.0])
    solution = ad.solve_minimum_time(problem)
    assert solution.success, solution.message
    np.testing.assert_allclose(solution.trajectory.v[[0, -1]], [[3, -2], [1, 1]], atol=1e-9)
    assert solution.replay_velocity_error < 1e-2


def test_unreachable_goal_is_reported_not_pretended():
    # A torque that cannot even lift the arm's own weight leaves no motion to the goal.
    with pytest.warns(ad.ArmdynWarning, match="hold the goal"):
        problem = paper_problem("r", 1.0, effort_limit=0.05, position_limit=(-1.6, 0.2))
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(starts=2, max_iterations=200))
    assert not solution.success
    assert solution.status in (ad.Status.INFEASIBLE, ad.Status.ITERATION_LIMIT, ad.Status.FAILED)
    assert solution.worst_violation is not None
    assert "joint1" in solution.message


def test_time_limit_returns_what_there_is():
    solution = ad.solve_minimum_time(paper_problem("rrr"), ad.MinimumTimeOptions(time_limit=1e-3))
    assert not solution.success
    assert solution.status is ad.Status.TIME_LIMIT
    assert solution.trajectory.duration > 0


def test_interrupt_returns_what_there_is():
    def press():
        time.sleep(0.4)
        os.kill(os.getpid(), signal.SIGINT)

    problem = paper_problem("rrr", position_limit=(-np.inf, np.inf))
    before = signal.getsignal(signal.SIGINT)
    options = ad.MinimumTimeOptions(starts=400)
    thread = threading.Thread(target=press)
    thread.start()
    solution = ad.solve_minimum_time(problem, options)
    thread.join()
    assert solution.status is ad.Status.INTERRUPTED, solution.message
    assert not solution.success
    assert signal.getsignal(signal.SIGINT) is before


def test_same_seed_same_guesses_and_they_fit_the_problem():
    problem = paper_problem("rr")
    first, second = ([spline(problem, way) for way in detours(problem, seed=1, count=3)] for _ in range(2))
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.q, b.q)
    np.testing.assert_allclose(spline(problem, []).q[[0, -1]], [problem.q_start, problem.q_goal], atol=1e-14)
    assert not np.array_equal(first[1].q, first[2].q)


def test_bad_options():
    with pytest.raises(ProblemError, match="intervals is 0"):
        ad.MinimumTimeOptions(intervals=0)
    with pytest.raises(ProblemError, match="time_limit"):
        ad.MinimumTimeOptions(time_limit=-1.0)


@pytest.mark.parametrize("name", ["panda"])
def test_library_arm_within_torque_and_velocity_limits(name):
    robot = ad.Robot.from_library(name)
    problem = ad.MinimumTimeProblem(
        robot,
        q_start=[0, -0.785, 0, -2.356, 0, 1.571, 0.785],
        q_goal=[1.0, 0.2, 0.5, -1.5, 0.3, 2.0, -0.5],
    )
    # Joint 7 turns 1.285 rad at no more than 2.61 rad/s.
    assert problem.duration_bound() == pytest.approx(1.285 / 2.61, rel=1e-12)
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(starts=1))
    assert solution.success, solution.message
    assert problem.duration_bound() < solution.duration < 0.55
    assert np.all(np.abs(solution.trajectory.v) <= robot.limits.velocity * (1 + 1e-7))


def test_beyond_three_joints_a_feasible_motion_is_taken_and_said_not_to_have_converged():
    robot = ad.Robot.from_library("ur5")
    problem = ad.MinimumTimeProblem(robot, q_start=[0, -1, 1, -1, -1.5, 0], q_goal=[-1.5, -1.8, 1.6, -0.4, 0.3, 1.0])
    with stopping(60) as stop:
        task = Task.of(problem, stop=stop)

        def solve(iterations):
            options = DirectOptions(1e-16, iterations)  # below rounding: it never ends by itself
            return solve_on_mesh(task, spline(problem, []), 20, options)

        near, far = solve(100), solve(3)
    assert near.status is far.status is Status.ITERATION_LIMIT
    assert taken(near, 6).status is Status.SOLVED and taken(near, 6).worst_violation is not None
    assert taken(near, 3).status is Status.ITERATION_LIMIT
    assert taken(far, 6).status is Status.ITERATION_LIMIT
