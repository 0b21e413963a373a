"""Arms in cells: a payload over a wall, a gripper round a box, a box that leaves its table."""

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.models.scene.collision import CollisionModel

DOWN = pin.rpy.rpyToMatrix(np.pi, 0.0, 0.0)


def reaching(robot, near, place):
    """Joint positions at which the tip is at a place [m] and points down."""
    goal = ad.GoalPose(robot.tip, pin.SE3(DOWN, np.array(place)))
    return ad.MinimumTimeProblem(robot, q_start=near, goal_pose=goal).goals[0]


def bins(x, y, name):
    """Floor and four walls."""
    wide, high, thick = 0.3, 0.2, 0.02
    walls = {"left": (-wide / 2, 0), "right": (wide / 2, 0), "front": (0, -wide / 2), "back": (0, wide / 2)}
    sides = [
        ad.Box((thick, wide, high) if dx else (wide, thick, high), (x + dx, y + dy, high / 2), name=f"{name} {side}")
        for side, (dx, dy) in walls.items()
    ]
    return [ad.Box((wide, wide, thick), (x, y, thick / 2), name=f"{name} floor"), *sides]


def least(solution, problem, contacts=()):
    """Least distance at 500 times by coal [m], outside of the solver."""
    model = CollisionModel(problem.robot, problem.obstacles, problem.self_collision, contacts)
    motion = solution.trajectory
    return min(np.min(model.distances(motion(t).q)) for t in np.linspace(0, motion.duration, 500))


@pytest.mark.slow
def test_two_kilograms_of_a_shape_over_a_wall_between_two_bins():
    box = ad.Box((0.08, 0.08, 0.12), (0, 0, 0.06))
    load = ad.Payload(mass=2.0, com=(0, 0, 0.05), inertia=(5e-3, 5e-3, 3e-3), shapes=[box])
    robot = ad.Robot.from_library("panda", payload=load)
    wall = ad.Box((0.4, 0.03, 0.5), (0.5, 0, 0.25), name="wall")
    start, goal = (reaching(robot, [sign * 0.6, 0.3, 0, -2, 0, 2.3, 0.78], (0.5, sign * 0.3, 0.25)) for sign in (1, -1))
    obstacles = [wall, *bins(0.5, 0.3, "A"), *bins(0.5, -0.3, "B")]
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, obstacles=obstacles, self_collision=True)
    solution = ad.solve_minimum_time(problem)
    assert solution.usable and solution.clearance.sure and solution.gap < 0.01
    assert solution.clearance.body == "payload" and solution.clearance.other == "wall"
    assert least(solution, problem) >= problem.clearance


@pytest.mark.slow
def test_a_slow_arm_goes_round_a_post_and_not_through_it():
    """At 0.005 rad/s a price of some seconds for a violated distance is less than what violating it saves."""
    poses = {"q_start": [-0.8, 0.3, 0, -1.9, 0, 2.2, 0.785], "q_goal": [0.8, 0.3, 0, -1.9, 0, 2.2, 0.785]}
    post = ad.Box((0.12, 0.12, 0.6), (0.55, 0, 0.3))
    problem = ad.MinimumTimeProblem(ad.Robot.from_library("panda"), **poses, obstacles=[post], velocity_limit=0.005)
    solution = ad.solve_minimum_time(problem)
    assert solution.usable and solution.clearance.sure and least(solution, problem) >= problem.clearance


@pytest.mark.slow
def test_a_gripper_round_a_box():
    gripper = ad.Tool(
        mass=0.8, com=(0, 0, 0.06), inertia=(2e-3, 2e-3, 1e-3), tip=(0, 0, 0.17), name="gripper",
        shapes=[ad.Box((0.1, 0.06, 0.1), (0, 0, 0.05)), ad.Box((0.14, 0.03, 0.07), (0, 0, 0.135))],
    )  # fmt: skip
    robot = ad.Robot.from_library("xarm7", tool=gripper)
    start, goal = (reaching(robot, [sign * 0.6, -0.3, 0, 0.8, 0, 1.1, 0], (0.4, sign * 0.3, 0.2)) for sign in (1, -1))
    box = ad.Box((0.2, 0.1, 0.35), (0.4, 0, 0.175), name="box")
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, obstacles=[box], self_collision=True)
    solution = ad.solve_minimum_time(problem)
    assert solution.usable and solution.clearance.sure and least(solution, problem) >= problem.clearance


@pytest.mark.slow
def test_a_box_slides_off_its_table_and_not_into_it():
    load = ad.Payload(mass=1.0, com=(0, 0, 0.05), shapes=[ad.Box((0.08, 0.08, 0.12), (0, 0, 0.06))])
    robot = ad.Robot.from_library("panda", payload=load)
    start, goal = (reaching(robot, [sign * 0.6, 0.3, 0, -2, 0, 2.3, 0.78], (0.5, sign * 0.3, 0.12)) for sign in (1, -1))
    table = ad.Box((1.0, 1.2, 0.1), (0.7, 0, -0.05), name="table")
    pair = [("payload", "table")]
    given = {"q_start": start, "q_goal": goal, "obstacles": [table]}
    through = ad.MinimumTimeProblem(robot, **given, allowed_contacts=pair)
    assert least(ad.solve_minimum_time(through), through) < -0.002  # 4.7 mm: not compared, it goes through the table
    problem = ad.MinimumTimeProblem(robot, **given, end_contacts=pair)
    solution = ad.solve_minimum_time(problem)
    assert solution.usable and solution.clearance.sure and least(solution, problem) > -1.5e-4  # 0.1 mm, and GJK's
