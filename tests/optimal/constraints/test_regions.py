"""Regions of a frame: rows against Pinocchio's own placements, motions against samples, and their bounds."""

from functools import cache
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.models.scene.proof_of_clearance import frame_accelerations
from armdyn.models.scene.reaching import poses_reaching, swing
from armdyn.optimal.constraints.regions import GoalRegion
from problems import POSES, paper_arm, solve

START, GOAL = POSES["rr"]


TOLERANCE = (3.5e-4, 3.5e-4, 0.0, *[np.deg2rad(0.28)] * 3)
"""Norms of 0.5 mm and 0.5°."""
ONCE = {"search": "quick", "workers": 1, "compile": False}
"""Of one solve, which takes less time than to build its machine code."""


def above(y, height=0.0):
    return pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0, 0), np.array([0.45, y, 0.2 + height]))


@cache
def pick_and_place():
    """A UR5 with 1 kg: 25 mm up, 300 mm across, 25 mm down."""
    robot = ad.Robot.from_library("ur5", payload=ad.Payload(mass=1.0))
    near = np.array([0, -1.3, 1.8, -2.0, -1.57, 0])
    start = poses_reaching(robot, ad.GoalPose("tool0", above(-0.15)), near, robot.limits)[0]
    goal = poses_reaching(robot, ad.GoalPose("tool0", above(0.15)), start, robot.limits)[0]
    via = [ad.GoalPose("tool0", above(y, 0.025), tolerance=TOLERANCE) for y in (-0.15, 0.15)]
    ends = ((0, -0.15), (2, 0.15))
    regions = [ad.FrameRegion(ad.GoalPose("tool0", above(y), ("z",), TOLERANCE), leg) for leg, y in ends]
    return ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, via=via, path_constraints=regions)


@cache
def picked_and_placed():
    return solve(pick_and_place(), **ONCE)


@pytest.mark.slow
def test_a_straight_retreat_and_approach_are_straight():
    problem, solution = pick_and_place(), picked_and_placed()
    robot, motion, (first, last) = problem.robot, solution.trajectory, solution.via_times
    model, data, frame = robot.model, robot.model.createData(), robot.model.getFrameId("tool0")
    heights = {}
    times = np.linspace(0, motion.duration, 5000)
    for t, q in zip(times, motion(times).q, strict=True):
        y = -0.15 if t <= first else 0.15
        pin.framesForwardKinematics(model, data, robot.configuration(q))
        off = above(y).actInv(data.oMf[frame])
        heights[t] = data.oMf[frame].translation[2]
        if first < t < last:
            continue
        assert np.hypot(*off.translation[:2]) < 0.5e-3
        assert np.rad2deg(np.linalg.norm(pin.log3(off.rotation))) < 0.5
    up = [heights[t] for t in heights if t <= first]
    assert up[-1] == pytest.approx(0.225, abs=2e-4) and np.all(np.diff(up) > -1e-6)
    for report in solution.constraint_reports[1:]:
        assert report.share <= 1 + 1e-6 and "'tool0' on leg" in report.name
    free = problem.variant(path_constraints=[])
    assert solution.duration > solve(free, **ONCE).duration  # 2 % or so


@pytest.mark.slow
def test_a_part_is_lifted_from_its_table_over_a_wall():
    """The part stands 1 mm over its table at both ends, which is allowed there, and the arm keeps clear on its way."""
    box = ad.Box((0.05, 0.05, 0.05), (0.0, 0.0, 0.03), name="part")
    free, load = pick_and_place(), ad.Payload(mass=1.0, frame="tool0", shapes=[box], name="part")
    table = ad.Box((0.4, 0.8, 0.05), (0.45, 0.0, 0.2 - 0.03 - 0.025 - 0.001 - 0.025), name="table")
    wall = ad.Box((0.1, 0.02, 0.1), (0.5, 0.0, 0.19), name="wall")
    problem = free.variant(
        robot=free.robot.with_payload(load), obstacles=[table, wall], end_contacts=[("part", "table")], clearance=2e-3
    )
    solution = solve(problem, **ONCE)
    assert solution.clearance.sure and solution.clearance.distance > 1e-3 - 2e-4
    assert all(report.share <= 1 + 1e-6 for report in solution.constraint_reports if report.share)
    assert solution.duration < 1.05 * picked_and_placed().duration


def test_files_keep_frame_regions(tmp_path):
    problem, file = pick_and_place(), tmp_path / "problem.toml"
    file.write_text(problem.to_toml())
    assert ad.read_problem(file).path_constraints == problem.path_constraints
    file.write_text(problem.to_toml().replace("leg = 2", "legs = 2"))
    with pytest.raises(ProblemError, match="legs"):
        ad.read_problem(file)


@pytest.mark.slow
def test_a_planar_arm_keeps_to_a_strip():
    strip = ad.FrameRegion(ad.GoalPose("tip", (0.2, 0.0, 0.0), ("z",), (0.29, 0, 0, 0, 0, 0)))
    robot = paper_arm("rr")
    solution = solve(ad.MinimumTimeProblem(robot, q_start=START, q_goal=GOAL, path_constraints=[strip]))
    place = ad.Dynamics(robot).frame_placement
    across = [float(place(solution.trajectory(t).q, "tip")[1][0]) for t in np.linspace(0, solution.duration, 500)]
    assert max(across) < 0.49 + 1e-6
    assert solution.duration > solve(solution.problem.variant(path_constraints=[])).duration * (1 - 5e-3)


def test_excess_between_samples_is_found():
    robot = paper_arm("rr")
    region = ad.FrameRegion(ad.GoalPose("tip", (0.3, 0.0, 0.0), ("x",), (0, 0, 0.35, 0, 0, 0)))
    problem = ad.MinimumTimeProblem(robot, q_start=[-0.3, 0.0], q_goal=[0.3, 0.0], path_constraints=[region])
    t, q = np.array([0.0, 1.0]), np.array([[-0.3, 0.0], [0.3, 0.0]])
    for speed, kept in ((0.6, True), (12.0, False)):
        motion = ad.Trajectory(t, q, np.full((2, 2), [speed, 0.0]), np.zeros((2, 2)), robot.joint_names)
        report = region.check(problem, motion, np.empty(0))
        high = max(
            abs(float(ad.Dynamics(robot).frame_placement(motion(s).q, "tip")[1][2])) for s in np.linspace(0, 1, 999)
        )
        assert (high < 0.35) == kept == (not report.reasons)
        assert high / 0.35 - 1e-6 <= report.share < high / 0.35 + 0.02


def test_bounds_on_a_frame_hold_on_cubics():
    robot, rng = ad.Robot.from_library("panda"), np.random.default_rng(0)
    q, v = rng.normal(size=(2, 7)), rng.normal(size=(2, 7))
    motion = ad.Trajectory(np.array([0.0, 1.0]), q, v, np.zeros((2, 7)), robot.joint_names)
    point, (speed, turning) = frame_accelerations(robot, motion, robot.tip)
    data, frame, h = robot.model.createData(), robot.model.getFrameId(robot.tip), 1e-4
    places = []
    for t in np.concatenate([s + h * np.arange(3) for s in np.linspace(0, 1 - 2 * h, 50)]):
        pin.framesForwardKinematics(robot.model, data, robot.configuration(motion(t).q))
        places.append(data.oMf[frame].copy())
    for one, two, three in zip(*(places[k::3] for k in range(3)), strict=True):
        second = (three.translation - 2 * two.translation + one.translation) / h**2
        first = pin.log3(one.rotation.T @ two.rotation) / h, pin.log3(two.rotation.T @ three.rotation) / h
        assert np.linalg.norm(second) < point[0] and np.linalg.norm(first[0]) < speed[0]
        assert np.linalg.norm(first[1] - first[0]) / h < turning[0]


@pytest.mark.parametrize(
    ("region", "says"),
    [
        (ad.FrameRegion(ad.GoalPose("tip", (0.3, 0, 0), ("x",))), "FrameRegion has no tolerance in z"),
        (
            ad.FrameRegion(ad.GoalPose("tip", (0.3, 0, 0), ("x", "z"))),
            "no direction in which 'tip' can move, .* x, z, ry",
        ),
        (ad.FrameRegion(ad.GoalPose("tip", (0.3, 0, 0), ("x",), (0, 0, 0.1, 0, 0, 0)), leg=1), "has leg 1; the motion"),
        (ad.FrameRegion(ad.GoalPose("tip", (0.3, 0, 0), ("x",), (0, 0, 0.1, 0, 0, 0))), "the start is .* m outside of"),
        (ad.FrameRegion(ad.GoalPose("hand", (0.3, 0, 0), ("x", "z"))), "FrameRegion: .*hand"),
    ],
)
def test_faults_of_a_region_are_named(region, says):
    with pytest.raises(ProblemError, match=says):
        ad.MinimumTimeProblem(paper_arm("rr"), q_start=START, q_goal=GOAL, path_constraints=[region])


def test_turns_too_far_for_a_proof_are_refused():
    with pytest.raises(ProblemError, match=r"turn by 1\.13 rad, and it is proven up to 1 rad"):
        ad.FrameRegion(ad.GoalPose("tool0", np.eye(4), ("x", "y", "z", "rz"), (0, 0, 0, 0.8, 0.8, 0)))


UNEVEN = (0.1, 0.2, 0.0, 0.0, 0.3, 0.4)


@pytest.mark.parametrize(
    ("region", "rows"), [({"tolerance": UNEVEN}, 6), ({"free": ("ry",)}, 5), ({"free": ("x", "rx", "ry", "rz")}, 2)]
)
def test_deviations_are_those_of_the_placements(region, rows):
    robot, rng = ad.Robot.from_library("ur5"), np.random.default_rng(0)
    centre = pin.SE3.Random()
    goal = ad.GoalPose("tool0", centre, **region)
    problem = ad.MinimumTimeProblem(robot, q_start=np.zeros(6), q_goal=np.full(6, 0.1))
    (one,) = GoalRegion(goal).rows(problem)
    assert np.shape(one.upper) == (rows,) and np.all(np.isfinite(one.upper)) and one.where == "last"
    scale = 1 / one.numbers[12:]
    np.testing.assert_allclose(one.upper * scale, goal.deviations[np.isfinite(goal.deviations)])
    q = ca.SX.sym("q", 6)
    stages = SimpleNamespace(q=ca.horzcat(0 * q, q), dynamics=ad.Dynamics(robot))
    function = ca.Function("rows", [q], [one.expression(stages, ca.SX(one.numbers), *one.arguments)])
    model, data, frame = robot.model, robot.model.createData(), robot.model.getFrameId("tool0")
    for at in rng.uniform(-2, 2, (20, 6)):
        pin.framesForwardKinematics(model, data, at)
        off = centre.actInv(data.oMf[frame])
        turn = pin.log3(off.rotation) if goal.axis is None else swing(np.eye(3)[1], off.rotation[:, 1])
        expected = np.append(off.translation, turn)[np.isfinite(goal.deviations)]
        np.testing.assert_allclose(function(at).full().ravel() * scale, expected, atol=1e-9)
