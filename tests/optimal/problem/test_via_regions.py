"""Regions that a frame passes in flight: checked by Pinocchio's placements, against exact via points and bounds."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.models.scene.reaching import frame_placement, poses_reaching, swing
from problems import POSES, paper_arm, solve

START, GOAL = POSES["rr"]


def pointing_down(x, y, z):
    return pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0, 0), np.array([x, y, z]))


@cache
def ur5(over=(0.45, 0.0, 0.4), tolerance=()):
    """300 mm across with 1 kg, over a point; without a tolerance over the joint positions of its centre."""
    robot = ad.Robot.from_library("ur5", payload=ad.Payload(mass=1.0))
    near, limits = np.array([0, -1.3, 1.8, -2.0, -1.57, 0]), robot.limits
    ends = [ad.GoalPose("tool0", pointing_down(0.45, y, 0.2)) for y in (-0.15, 0.15)]
    start = poses_reaching(robot, ends[0], near, limits)[0]
    goal = poses_reaching(robot, ends[1], start, limits)[0]
    region = ad.GoalPose("tool0", pointing_down(*over), tolerance=tolerance)
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, via=[region])
    return problem if tolerance else problem.variant(via=[problem.poses[1]])


@cache
def through_centre():
    """The motion that passes the centre exactly."""
    return solve(ur5(), calm=0.0, bound=False)


def deviations(robot, region, motion, t):
    """By Pinocchio's own placements, shape (times, 6)."""
    model, data, frame = robot.model, robot.model.createData(), robot.model.getFrameId(region.frame)
    found = []
    for q in motion(t).q:
        pin.framesForwardKinematics(model, data, robot.configuration(q))
        off = region.pose.actInv(data.oMf[frame])
        axis = None if region.axis is None else np.eye(3)[region.axis]
        turn = pin.log3(off.rotation) if axis is None else swing(axis, off.rotation @ axis)
        found.append(np.append(off.translation, turn))
    return np.array(found)


@pytest.mark.slow
def test_a_blend_is_passed_and_faster_than_its_centre():
    exact = through_centre()
    # Of one solve, which takes less time than to build its machine code.
    blend = solve(ur5(tolerance=(0.02, 0.02, 0.02, 0.087, 0.087, 0.087)), compile=False, workers=1)
    region, motion = blend.problem.via[0], blend.trajectory
    (passing,) = blend.via_times
    times = np.append(np.linspace(0, motion.duration, 5000), passing)
    beyond = np.max(np.abs(deviations(blend.problem.robot, region, motion, times)) - region.deviations, axis=1)
    assert beyond[-1] < 1e-6 and np.min(beyond) < 1e-6
    assert abs(times[np.argmin(beyond)] - passing) < 0.05 * motion.duration
    assert blend.duration < exact.duration
    free = blend.problem.variant(via=[])
    assert blend.lower_bound == pytest.approx(ad.lower_bound(free).duration)  # the region proves nothing
    assert blend.problem.duration_bound() == free.duration_bound()
    assert np.array_equal(blend.problem.leg_bounds(), [0, 0])


@pytest.mark.slow
def test_a_small_blend_tends_to_its_centre():
    exact = through_centre()
    small = solve(ur5(tolerance=(1e-4,) * 6), bound=False, compile=False, workers=1)
    # A per cent: curves through regions have coarser ends than those through poses.
    assert small.duration == pytest.approx(exact.duration, rel=1e-2)


@pytest.mark.parametrize("fastest", [None, 1.0])
def test_a_planar_arm_passes_a_position(fastest):
    """A slow one, too, which would save two seconds by missing it."""
    robot = paper_arm("rr")
    region = ad.GoalPose("tip", (0.3, 0.0, -0.1), tolerance=(0.02, 0, 0.02, 0, 0, 0))
    solution = solve(ad.MinimumTimeProblem(robot, q_start=START, q_goal=GOAL, via=[region], velocity_limit=fastest))
    assert solution.usable
    beyond = deviations(robot, region, solution.trajectory, np.array(solution.via_times))[0, [0, 2]]
    assert np.max(np.abs(beyond)) <= 0.02 + 1e-6


@pytest.mark.slow
def test_the_elbow_passes_a_region_on_the_side_of_least_travel():
    """A stretching arm may pass with its elbow up or down; a region around a point takes no longer than the point."""
    inside = np.array([-0.56, -0.84])  # the other elbow, nearer to the goal, takes half as long again
    robot, ends = paper_arm("rr"), {"q_start": [-0.89, -1.33], "q_goal": [-0.82, 0.25], "velocity_limit": 5.0}
    exact = ad.MinimumTimeProblem(robot, via=[inside], **ends)
    at = frame_placement(robot, "tip", inside).translation
    region = exact.variant(via=[ad.GoalPose("tip", at, tolerance=(0.01, 0, 0.01, 0, 0, 0))])
    assert region.poses[1] == pytest.approx(inside, abs=1e-6)
    assert solve(region, bound=False).duration < solve(exact, bound=False).duration


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arm", "start", "goal", "at"),
    [
        ("rr", [-1.1, -0.3], [-1.6, 0.4], [0.27, 0.0, -0.39]),
        ("rrr", [1.5, -0.9, 0.4], [1.1, 0.9, 1.7], [-0.27, 0.0, 0.58]),
    ],
)
def test_velocities_do_not_jump_where_legs_meet(arm, start, goal, at):
    """Curves whose velocities jump there are shorter, and no motion follows them."""
    via = [ad.GoalPose("tip", at, tolerance=(0.02, 0, 0.02, 0, 0, 0))]
    problem = ad.MinimumTimeProblem(paper_arm(arm), q_start=start, q_goal=goal, via=via, velocity_limit=20.0)
    assert solve(problem, bound=False).usable


@pytest.mark.parametrize(
    ("region", "says"),
    [
        (
            ad.GoalPose("tip", (0.0, 0.0, 0.0), tolerance=(2, 0, 2, 0, 0, 0)),
            r"via\[0\] is wider than its leg: the start",
        ),
        (ad.GoalPose("tip", (3.0, 0.0, 0.0)), r"via\[0\]: frame 'tip' of rr cannot reach its goal pose"),
        (ad.GoalPose("hand", (0.3, 0.0, 0.0)), r"via\[0\]: .*hand"),
    ],
)
def test_faults_of_a_region_are_named(region, says):
    with pytest.raises(ProblemError, match=says):
        ad.MinimumTimeProblem(paper_arm("rr"), q_start=START, q_goal=GOAL, via=[region])


def test_a_region_takes_motors_everywhere():
    with pytest.raises(ProblemError, match=r"via\[0\] is a region, which takes a motor at every joint"):
        region = ad.GoalPose("tip", (0.3, 0.0, 0.0))
        ad.MinimumTimeProblem(paper_arm("rr"), q_start=START, q_goal=GOAL, via=[region], passive=["joint2"])


def test_files_keep_regions(tmp_path):
    problem = ur5(tolerance=(0.02, 0.02, 0.02, 0.087, 0.087, 0.087))
    problem = problem.variant(via=[*problem.via, problem.poses[0] + 0.5])
    file = tmp_path / "problem.toml"
    file.write_text(problem.to_toml())
    again = ad.read_problem(file)
    assert again.via[0] == problem.via[0]
    np.testing.assert_allclose(again.poses, problem.poses, atol=1e-12)
