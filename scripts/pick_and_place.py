"""The pick-and-place cycle 25/300/25 mm with 1 kg: armdyn's against straight lines with stops, by toppra and by Ruckig.

Up 25 mm, across 300 mm, down 25 mm with the part, and back the same way without it; no rests. Armdyn once passes both
corners within 20 mm and 5 degrees (blends), once holds the first and last 25 mm straight within 0.5 mm and 0.5 degrees.
The peers stop at the corners: toppra times the straight lines of the tool within the same limits of torque and
velocity, Ruckig moves the joints from corner to corner with the same velocity limits and the largest constant
accelerations whose torques are within their limits.

    python scripts/pick_and_place.py [ur5 panda kinova]
"""

import argparse
import sys
import time
from itertools import pairwise

import numpy as np
import ruckig
import toppra
import toppra.algorithm
import toppra.constraint

import armdyn as ad
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.models.scene.reaching import slid

UP, ACROSS, MASS = 0.025, 0.3, 1.0
PLACES = {"ur5": (0.45, 0.0, 0.2), "panda": (0.5, 0.0, 0.3), "kinova": (0.5, 0.0, 0.3)}
"""The middle of both places [m]."""
WITHIN = (*[0.02 / 3**0.5] * 3, *[np.radians(5) / 3**0.5] * 3)
"""Deviations of a blend: together 20 mm and 5 degrees at most [m, rad]."""
TICKS = 400
"""Points of a line that toppra is given."""


def arm(name: str) -> ad.Robot:
    """An arm of the library, without the parts at its hand."""
    return ad.Robot.from_library(name)


def pose(x: float, y: float, z: float) -> np.ndarray:
    """Of a tool that points down, shape (4, 4)."""
    found = np.diag([1.0, -1.0, -1.0, 1.0])
    found[:3, 3] = x, y, z
    return found


def the_cycle(robot: ad.Robot, middle: tuple[float, float, float], straight: bool) -> ad.Cycle:
    """There with the part and back without; past the corners in blends, or from and to them straight."""
    x, y, z = middle
    here, there = (ad.GoalPose(robot.tip, pose(x, y + side * ACROSS / 2, z)) for side in (-1, 1))
    first, last = (ad.GoalPose(robot.tip, pose(x, y + side * ACROSS / 2, z + UP), (), WITHIN) for side in (-1, 1))
    line = ad.Straight(UP) if straight else None
    move, back = ((), ()) if straight else ((first, last), (last, first))
    return ad.Cycle(
        robot,
        start=here,
        steps=[
            ad.Grasp(ad.Payload(mass=MASS, name="part")),
            ad.Move(there, via=move, retreat=line, approach=line, name="there"),
            ad.Release(),
            ad.Move(here, via=back, retreat=line, approach=line, name="back"),
        ],
        closed=True,
    )


def corners(robot: ad.Robot, q: np.ndarray, places: list[np.ndarray]) -> list[np.ndarray]:
    """Joint positions along straight lines through poses of the tip, from those at the first: a path for each line."""
    paths = []
    for first, last in pairwise(places):
        path = [q]
        for part in np.linspace(0, 1, TICKS)[1:]:
            goal = ad.GoalPose(robot.tip, first + part * (last - first))
            found = slid(robot, goal, path[-1], np.zeros(robot.nv), robot.limits)
            if found is None:
                raise ValueError("the line leaves the arm's reach")
            path.append(found)
        paths.append(np.array(path))
        q = path[-1]
    return paths


def by_toppra(robot: ad.Robot, path: np.ndarray) -> float:
    """Time of a path from rest to rest within limits of torque and velocity [s]."""
    spline = toppra.SplineInterpolator(np.linspace(0, 1, len(path)), path)
    limits, torque = robot.limits, inverse_dynamics(robot)
    torques = toppra.constraint.JointTorqueConstraint(
        lambda q, v, a: torque(q, v, a),
        np.column_stack([limits.effort_lower, limits.effort_upper]),
        np.zeros(robot.nv),
    )
    most = np.minimum(limits.velocity, 100.0)
    speeds = toppra.constraint.JointVelocityConstraint(np.column_stack([-most, most]))
    found = toppra.algorithm.TOPPRA([torques, speeds], spline, gridpoints=np.linspace(0, 1, 401))
    motion = found.compute_trajectory()
    if motion is None:
        raise ValueError("toppra finds no way")
    return float(motion.duration)


def by_ruckig(robot: ad.Robot, start: np.ndarray, goal: np.ndarray) -> float:
    """Time from rest to rest with the largest accelerations, as torque over inertia, that are kept [s]."""
    n, torque, limits = robot.nv, inverse_dynamics(robot), robot.limits
    inertia = np.array([torque(start, np.zeros(n), row) - torque(start, np.zeros(n), np.zeros(n)) for row in np.eye(n)])
    able = limits.effort_upper / np.diag(inertia)
    otg, low, high = ruckig.Ruckig(n), 1e-3, 2.0

    def motion(part: float) -> ruckig.Trajectory:
        given, found = ruckig.InputParameter(n), ruckig.Trajectory(n)
        given.current_position, given.target_position = start.tolist(), goal.tolist()
        given.max_velocity = np.minimum(limits.velocity, 100.0).tolist()
        given.max_acceleration = (part * able).tolist()
        given.max_jerk = [float("inf")] * n
        otg.calculate(given, found)
        return found

    def kept(found: ruckig.Trajectory) -> bool:
        times = np.linspace(0, found.duration, 400)
        torques = np.array([torque(*map(np.array, found.at_time(t))) for t in times])
        return bool(np.all((torques >= limits.effort_lower) & (torques <= limits.effort_upper)))

    for _ in range(30):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if kept(motion(middle)) else (low, middle)
    return float(motion(low).duration)


def peers(robot: ad.Robot, middle: tuple[float, float, float]) -> tuple[float, float]:
    """Times of the cycle by toppra and by Ruckig, each on the branch at which it is fastest [s]."""
    x, y, z = middle
    places = [pose(x, y + side * ACROSS / 2, height) for side, height in ((-1, z), (-1, z + UP), (1, z + UP), (1, z))]
    loaded, found = robot.with_payload(ad.Payload(mass=MASS)), list[tuple[float, float]]()
    start = np.clip(np.full(robot.nv, 0.1), robot.limits.position_lower, robot.limits.position_upper)
    for q in ad.MinimumTimeProblem(robot, q_start=start, goal_pose=ad.GoalPose(robot.tip, places[0])).goals:
        try:
            paths = corners(loaded, q, places)
            back = corners(robot, paths[-1][-1], places[::-1])
            lines = sum(by_toppra(loaded, path) for path in paths) + sum(by_toppra(robot, path) for path in back)
        except ValueError:
            continue
        joints = sum(by_ruckig(loaded, path[0], path[-1]) for path in paths)
        found.append((lines, joints + sum(by_ruckig(robot, path[0], path[-1]) for path in back)))
    return min(lines for lines, _ in found), min(joints for _, joints in found)


def compare(name: str) -> str:
    """A row of the table."""
    robot, middle = arm(name), PLACES[name]
    lines, joints = peers(robot, middle)
    row = [name, f"{lines:.4f}", f"{joints:.4f}"]
    for straight in (False, True):
        began = time.perf_counter()
        solved = ad.solve_cycle(the_cycle(robot, middle, straight))
        seconds = time.perf_counter() - began
        if not solved.usable:
            row.append(solved.message)
            continue
        gap = "-" if solved.gap is None else f"{100 * solved.gap:.2f}"
        less = 100 * (1 - solved.duration / min(lines, joints))
        row += [f"{solved.duration:.4f}", f"{less:.0f}", gap, f"{seconds:.1f}"]
    return f"| {' | '.join(row)} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arms", nargs="*", choices=list(PLACES), help="all by default")
    toppra.setup_logging("ERROR")
    columns = [f"{way} [{unit}]" for way in ("blends", "straight") for unit in ("s", "% less", "gap %", "solve s")]
    print(f"| {' | '.join(['arm', 'toppra [s]', 'Ruckig [s]', *columns])} |")
    print("|---" * (3 + len(columns)) + "|")
    for name in parser.parse_args(sys.argv[1:] or list(PLACES)).arms:
        print(compare(name), flush=True)


if __name__ == "__main__":
    main()
