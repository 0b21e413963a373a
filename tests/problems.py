"""Motion problems that several tests solve, and their solutions."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

import armdyn as ad
from armdyn.optimal.minimum_time import solve_task
from armdyn.optimal.problem.task import Task

CASES = Path(__file__).parent / "cases"
"""Published problems, a folder each: the robot as a URDF, and `case.json` with poses, limits and known answers."""

POSES = {
    "r": ([-np.pi / 2], [np.pi / 20]),
    "rr": ([-np.pi / 2, np.pi / 84], [np.pi / 20, -np.pi / 84]),
    "rrr": ([-np.pi / 2, np.pi / 84, -np.pi / 84], [np.pi / 20, -np.pi / 84, np.pi / 84]),
}
"""Start and goal of the paper's Examples 1 to 3 [rad]."""

CART = (CASES / "double_integrator_sym" / "robot.urdf").read_text()
"""The double integrator: 1 kg on a level rail, at most 1 N."""


_UNIT = '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
GANTRY = f"""<robot name="gantry"><link name="base"/>
<joint name="x" type="prismatic"><parent link="base"/><child link="bridge"/><axis xyz="1 0 0"/>
<limit lower="-10" upper="10" effort="1" velocity="100"/></joint>
<link name="bridge"><inertial>{_UNIT}</inertial></link>
<joint name="y" type="prismatic"><parent link="bridge"/><child link="head"/><axis xyz="0 1 0"/>
<limit lower="-10" upper="10" effort="1" velocity="100"/></joint>
<link name="head"><inertial>{_UNIT}</inertial></link></robot>"""
"""Two carts, each on its own rail, 2 kg and 1 kg, at most 1 N: none feels the other."""

RR_FILE = """[robot]
name = "rr"
payload = { mass = 0.1006 }

[problem]
q_start = [-1.5, "2deg"]
q_goal = [0.2, "-pi/84"]

[options]
search = "quick"
"""
"""A problem file."""


@cache
def paper_arm(arm, mass=0.1006):
    """An arm of Table 1 with a point mass at its tip."""
    return ad.Robot.from_spec(ad.ArmSpec.paper(arm), payload=ad.Payload(mass=mass))


def paper_problem(arm, mass=0.1006, **limits):
    """Examples 1 to 3."""
    start, goal = POSES[arm]
    return ad.MinimumTimeProblem(paper_arm(arm, mass), q_start=start, q_goal=goal, **limits)


@cache
def held_ur5():
    """A UR5 whose wrist is held still: three joints are a fifth of the work of six."""
    return ad.Robot.from_library("ur5", lock={"wrist_1_joint": -1.0, "wrist_2_joint": -1.5, "wrist_3_joint": 0.0})


@cache
def pick_and_place(arm="rr", start=(-1.0, 0.5), goal=(0.2, -0.1), mass=0.1006, duration=0.6):
    """There with an empty hand, a dwell of 0.1 s in which a part is grasped, and back; of quintics."""
    bare = ad.Robot.from_spec(ad.ArmSpec.paper(arm)) if isinstance(arm, str) else arm
    loaded = bare.with_payload(ad.Payload(mass=mass))
    there, back = ad.ramp(bare, start, goal, duration), ad.ramp(loaded, goal, start, duration)
    dwell = ad.Trajectory.at_rest(
        goal, loaded.holding_torque(goal), 0.1, bare.joint_names, model_hash=loaded.model_hash
    )
    return bare, (
        there.as_piece(name="there", load=ad.load_of(bare))
        + dwell.as_piece(name="part", load=ad.load_of(loaded), event="grasp")
        + back.as_piece(name="back", load=ad.load_of(loaded))
    )


@cache
def published(name):
    """Facts of a published case: `case.json`."""
    return json.loads((CASES / name / "case.json").read_text())


def published_problem(name):
    """A published case, as it is posed."""
    case = published(name)
    robot = ad.Robot.from_urdf(CASES / name / "robot.urdf")
    torques = (case["tau_lower"], case["tau_upper"])
    return ad.MinimumTimeProblem(robot, q_start=case["q0"], q_goal=case["qf"], effort_limit=torques)


@cache
def cart():
    """The double integrator as a robot."""
    return published_problem("double_integrator_sym").robot


def gantry_problem(**limits):
    """2 m on the heavy rail, which decide the time, 4 s without other limits; 0.3 m on the other."""
    return ad.MinimumTimeProblem(ad.Robot.from_urdf_string(GANTRY), q_start=[0, 0], q_goal=[2, 0.3], **limits)


def luus_problem():
    """R. Luus, Iterative Dynamic Programming (2000), section 12.4.2, example 2: two rods and a tip mass, no gravity."""
    return published_problem("luus_two_link")


def miss(problem, motion):
    """Largest error of a motion's end from the goal, in [rad or m] or per second."""
    return np.abs(problem.goal_error_of(motion)).max()


def both_sides(ends):
    """Times of samples at the ends of pieces, shape (2 P,) for P pieces: an end between two is sampled on both sides.

    An ulp before it the torque is still the piece's that ends.
    """
    t = np.repeat(ends, 2)[1:-1]
    t[1:-1:2] = np.nextafter(t[1:-1:2], 0)
    return t


@cache
def solved(arm):
    """Examples 1 to 3 with 100.6 g, solved as users solve them; once for all tests of a process."""
    solution = ad.solve_minimum_time(paper_problem(arm))
    assert solution.success, solution.message
    return solution


def solve(problem, **options):
    """The solution of a problem that has one."""
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(**options))
    assert solution.success, solution.message
    return solution


def random_problem(pair, seed=1, **limits):
    """A pair of scripts/search_statistics.py, of RRR: seed 1 was used for tuning."""
    random = np.random.default_rng([seed, pair])
    payload, (start, goal) = random.uniform(0, 0.3), random.uniform(-2.5, 2.5, (2, 3))
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rrr"), ad.Payload(mass=payload))
    return ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, **limits)


@cache
def random_solution(pair):
    """Its fastest motion, without limits of position."""
    return ad.solve_minimum_time(random_problem(pair, position_limit=(-np.inf, np.inf)))


def mesh_alone(problem, **options):
    """The solution by the resolved mesh, without exact switching times."""
    task = Task.of(problem, ad.MinimumTimeOptions(workers=1, bound=False, **options))
    solution = solve_task(replace(task, policy=task.policy.changed("polish", rounds=0)))
    assert solution.certified and solution.phases is None, solution.message
    return solution
