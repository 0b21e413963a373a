"""Goals either way round, and joint positions within via regions."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import quad

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.models.scene.reaching import frame_placement, poses_reaching, swing
from armdyn.optimal.problem.poses import MOST_GOALS, endless, goals_with_turns
from oracles import joint, link, two_links, urdf
from problems import POSES, paper_arm, solve

EFFORT = 1.2
WEIGHT = 9.81 * 0.1
"""Of the link of `oracles.INERTIAL`: m g l [N m]; it turns with 0.02 + 0.1² = 0.03 kg m²."""


def endless_joint(name, ends, axis, velocity=1000.0):
    inside = f'<axis xyz="{axis}"/><limit effort="{EFFORT}" velocity="{velocity}"/>'
    return joint(name, *ends, "continuous", inside)


def pendulum(folder, axis="0 -1 0"):
    path = folder / "pendulum.urdf"
    path.write_text(two_links(joint=endless_joint("shoulder", ("base", "arm"), axis)))
    return ad.Robot.from_urdf(path)


def exact(start, goal):
    """Minimum time [s] of the pendulum without turning back: full torque, then full brake; energy gives both."""
    way, sign = abs(goal - start), np.sign(goal - start)
    rise = WEIGHT * (np.sin(goal) - np.sin(start))
    switch = way / 2 + rise / (2 * EFFORT)

    def energy(x):
        if x < switch:
            return EFFORT * x - WEIGHT * (np.sin(start + sign * x) - np.sin(start))
        return EFFORT * (way - x) + WEIGHT * (np.sin(goal) - np.sin(start + sign * x))

    def dt(phi):  # x = way sin² phi takes away the ends' singularities
        return way * np.sin(2 * phi) / np.sqrt(2 * energy(way * np.sin(phi) ** 2) / 0.03)

    at = np.arcsin(np.sqrt(switch / way))
    return sum(quad(dt, *part, epsabs=1e-13, epsrel=1e-13)[0] for part in ((0, at), (at, np.pi / 2)))


def test_the_faster_way_is_not_the_shorter(tmp_path):
    """Over the top it is 3.04 rad, below it is 3.24 rad, downhill first."""
    robot, goal = pendulum(tmp_path), np.pi - 0.1
    problem = ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[goal], wrap=True)
    solution = ad.solve_minimum_time(problem)
    assert solution.certificate.ok, solution.certificate.reasons
    assert solution.trajectory.q[-1, 0] == pytest.approx(goal - 2 * np.pi, abs=1e-6)
    assert solution.duration == pytest.approx(exact(0.0, goal - 2 * np.pi), rel=1e-8)
    other = next(tried for tried in solution.goals if tried.q[0] > 0)
    assert other.duration == pytest.approx(exact(0.0, goal), rel=1e-8)
    found = ad.solve_minimum_time(ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[goal]))
    assert found.trajectory.q[-1, 0] == pytest.approx(goal, abs=1e-6)
    assert found.duration == pytest.approx(other.duration, rel=1e-8)


@pytest.mark.parametrize(("start", "goal", "short"), [(3.0, -3.0, 2 * np.pi - 6), (0.0, 20.0, 20 - 6 * np.pi)])
def test_without_gravity_it_is_the_shorter(start, goal, short, tmp_path):
    problem = ad.MinimumTimeProblem(pendulum(tmp_path, "0 0 1"), q_start=[start], q_goal=[goal], wrap=True)
    solution = ad.solve_minimum_time(problem)
    assert solution.trajectory.q[-1, 0] == pytest.approx(start + short, abs=1e-6)
    # About the vertical axis every link of the oracle has 0.02 + 0.1² kg m².
    assert solution.duration == pytest.approx(2 * np.sqrt(abs(short) * 0.03 / EFFORT), rel=1e-8)


@pytest.mark.slow
def test_one_endless_joint_of_two(read):
    """A joint with limits goes to its given goal; its neighbour takes the nearer turn."""
    limited = joint("elbow", "a", "b")
    first = endless_joint("shoulder", ("base", "a"), "0 -1 0")
    robot = read(urdf('<link name="base"/>', link("a"), link("b"), first, limited), effort_limit=[5.0, 5.0])
    problem = ad.MinimumTimeProblem(robot, q_start=[-3.0, 0.0], q_goal=[3.0, 0.5], wrap=True)
    assert endless(robot, problem.limits).tolist() == [True, False]
    assert np.allclose(problem.goals, [[3.0 - 2 * np.pi, 0.5], [3.0, 0.5]])
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(starts=4))
    assert solution.success
    assert solution.trajectory.q[-1] == pytest.approx([3.0 - 2 * np.pi, 0.5], abs=1e-6)


def test_ways_of_many_joints_are_few_and_nearest_first():
    robot = ad.Robot.from_library("kinova")
    turning = endless(robot, robot.limits)
    assert turning.sum() == 4 - int(not turning[4])
    start, goal = np.zeros(6), np.full(6, 3.0)
    ways = goals_with_turns(start, [goal, goal + 2 * np.pi * turning], robot.limits, turning)
    assert len(ways) == min(MOST_GOALS, 2 ** (1 + int(turning.sum())))
    bounds = [np.max(np.abs(way) / robot.limits.velocity) for way in ways]
    assert np.all(np.diff(bounds) >= -1e-12)
    assert np.array_equal(ways[0], goal)
    assert all(np.allclose(np.cos(way - goal), 1) for way in ways)
    assert all(np.array_equal(way[~turning], goal[~turning]) for way in ways)


def test_a_whole_turn_is_no_motion(tmp_path):
    with pytest.raises(ProblemError, match="the same state"):
        ad.MinimumTimeProblem(pendulum(tmp_path), q_start=[0.3], q_goal=[0.3 + 2 * np.pi], wrap=True)


def test_prismatic_and_limited_joints_do_not_turn():
    assert not np.any(endless(ad.Robot.from_library("ur5"), ad.Robot.from_library("ur5").limits))


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
