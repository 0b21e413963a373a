"""The speed limit of a frame: against closed forms, and by differences of positions on a finer replay."""

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.constraints import rate_limits
from armdyn.optimal.mesh.direct import solve_on_mesh
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.task import Task
from problems import POSES, cart, held_ur5, paper_arm, solve

START, GOAL = POSES["rr"]


def between(robot, start, goal, *path_constraints, **options):
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, path_constraints=path_constraints)
    return solve(problem, **options)


def fastest(solution, frame):
    """The frame's largest speed [m/s], by differences of its position on a replay with 8000 samples or so."""
    motion = solution.trajectory
    parts = 8000 // motion.t.size
    t = np.unique(np.concatenate([motion.t, *(motion.t[:-1] + k / parts * np.diff(motion.t) for k in range(1, parts))]))
    at = motion(t)
    motion = ad.replay_torques(solution.problem.robot, ad.Trajectory(t, at.q, at.v, at.tau))
    flows = np.diff(t) > 1e-9  # no jump of the torque
    moved = np.diff(places(solution.problem.robot, frame, motion.q), axis=0)
    return float(np.max((np.linalg.norm(moved, axis=1) / np.diff(t))[flows]))


def places(robot, frame, positions):
    """Where the frame is [m], shape (m, 3), by Pinocchio."""
    model, data = robot.model, robot.model.createData()
    number, found = model.getFrameId(frame, pin.FrameType.BODY), []
    for q in positions:
        pin.framesForwardKinematics(model, data, robot.configuration(q))
        found.append(data.oMf[number].translation.copy())
    return np.array(found)


@pytest.mark.parametrize("limit", [0.4, 0.8, 1.2])
def test_a_cart_takes_the_time_of_its_trapezoid(limit):
    solution = between(cart(), [0.0], [2.0], ad.FrameSpeedLimit(limit))
    # 1 N on 1 kg over 2 m. Its corners fall between knots: `settle` stops where a finer mesh changes less than 5e-4.
    assert solution.duration == pytest.approx(2 / limit + limit, rel=1e-3)
    assert solution.duration > (2 / limit + limit) * (1 - 1e-3)  # the limit's own tolerance
    (kept,) = solution.constraint_reports
    assert kept.share == pytest.approx(1, abs=1e-3) and "speed of 'cart'" in kept.name and "m/s" in kept.said


@pytest.mark.slow
def test_two_links_keep_it_everywhere_and_a_lower_one_costs_time():
    durations = []
    for limit in (4.0, 2.0, 1.0):
        solution = between(paper_arm("rr"), START, GOAL, ad.FrameSpeedLimit(limit), starts=1)
        speed = fastest(solution, "tip")
        assert speed <= limit * (1 + 1.1e-3)  # 1e-3, and the error of five points a sample
        assert speed == pytest.approx(solution.constraint_reports[0].share * limit, rel=1e-4)
        assert speed > 0.98 * limit  # it limits this motion
        durations.append(solution.duration)
    assert durations == sorted(durations)
    ends = [ad.Dynamics(paper_arm("rr")).frame_placement(np.array(q), "tip")[1] for q in (START, GOAL)]
    assert durations[-1] > np.linalg.norm(ends[1] - ends[0]) / 1.0  # as the crow flies


@pytest.mark.slow
def test_an_unstable_arm_creeps_where_no_mesh_is_fine_enough():
    """The arm is at full speed within a twentieth of an interval; slowed down as a replay it would miss the goal."""
    solution = between(paper_arm("rr"), [0, 0], [1, -1], ad.FrameSpeedLimit(0.05), starts=1)
    assert solution.success
    t = np.linspace(0, solution.duration, 20_000)  # no replay: open loop the motion is unstable
    moved = np.diff(places(paper_arm("rr"), "tip", solution.trajectory(t).q), axis=0)
    speed = np.max(np.linalg.norm(moved, axis=1)) / t[1]
    assert 0.95 * 0.05 < speed <= 0.05 * (1 + 1e-5)


@pytest.mark.slow
def test_ur5_at_reduced_speed():
    start, goal, robot = [0, -1.2, 1.2], [0.15, -1.25, 1.3], held_ur5()
    once = {"starts": 1, "calm": 0.0, "bound": False, "compile": False}  # less time than to build its machine code
    solution = between(robot, start, goal, ad.FrameSpeedLimit(0.25), **once)
    tip = solution.problem.path_constraints[0].frame
    assert tip == robot.tip
    assert fastest(solution, tip) == pytest.approx(0.25, rel=1e-3)  # the limit's own tolerance
    ends = [ad.Dynamics(robot).frame_placement(np.array(q), tip)[1] for q in (start, goal)]
    assert solution.duration > np.linalg.norm(ends[1] - ends[0]) / 0.25


def test_one_that_is_never_reached_changes_nothing():
    plain = ad.MinimumTimeProblem(paper_arm("rr"), q_start=START, q_goal=GOAL)
    limited = plain.variant(path_constraints=[ad.FrameSpeedLimit(50.0)])
    guess = spline(plain, [])
    durations = [
        solve_on_mesh(Task.of(problem), guess, 40, Task.of(problem).alone()).trajectory.duration
        for problem in (plain, limited)
    ]
    assert durations[0] == pytest.approx(durations[1], rel=1e-6)  # IPOPT's 1e-8, scaled


@pytest.mark.parametrize(
    ("condition", "says"),
    [
        (lambda: ad.FrameSpeedLimit(0.0), r"is 0\.0 m/s; it must be positive and finite"),
        (lambda: ad.FrameSpeedLimit([1.0, 2.0]), "must be a number"),
        (lambda: ad.FrameSpeedLimit(0.25, "tool0"), r"no frame 'tool0' .* the tip is 'tip'"),
        (lambda: ad.FrameSpeedLimit(0.25, "base"), "'base' of rr does not move"),
        (lambda: ad.FrameSpeedLimit, r"path_constraints\[0\] = .* is no path constraint; give values"),
        (lambda: "slowly", r"path_constraints\[0\] = 'slowly' is no path constraint"),
    ],
)
def test_faults_are_named(condition, says):
    with pytest.raises(ProblemError, match=says):
        ad.MinimumTimeProblem(paper_arm("rr"), q_start=START, q_goal=GOAL, path_constraints=[condition()])


def test_a_start_that_is_too_fast_is_named():
    with pytest.raises(ProblemError, match=r"at the start frame 'tip' moves at .* m/s, faster than FrameSpeedLimit"):
        ad.MinimumTimeProblem(
            paper_arm("rr"), q_start=START, q_goal=GOAL, v_start=[1.0, 0.0], path_constraints=[ad.FrameSpeedLimit(0.25)]
        )


@pytest.mark.parametrize("degree", range(5))
def test_polynomials_through_the_points_of_a_sample_are_exact(degree):
    polynomial = np.polynomial.Polynomial(np.eye(5)[degree])
    values, places = polynomial(rate_limits._POINTS), rate_limits._PLACES
    # The inverse of the powers of five points in the unit interval loses three digits.
    np.testing.assert_allclose(rate_limits._VALUES @ values, polynomial(places), atol=1e-13)
    np.testing.assert_allclose(rate_limits._SLOPES @ values, polynomial.deriv()(places), atol=1e-12)
