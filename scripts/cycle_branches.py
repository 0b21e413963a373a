"""Cycles with stops only against all branches, one by one: RR (two branches at each place) and UR5 (eight).

The joint positions are found here by scipy's least squares from random positions, and every move between every two of
them is solved; the cycle is the least sum. `solve_cycle` works out only the moves that may matter, and has to agree to
1e-6 s.

    python scripts/cycle_branches.py [rr ur5]
"""

import argparse
import sys
import time
from itertools import product

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares

import armdyn as ad

OPTIONS = ad.MinimumTimeOptions()
SEED = 77


def branches(robot: ad.Robot, goal: np.ndarray, near: np.ndarray) -> list[np.ndarray]:
    """All joint positions that bring the tip to a pose, shape (4, 4), or a position, shape (3,), within half a turn."""
    model, random, found = robot.model, np.random.default_rng(SEED), list[np.ndarray]()
    data, frame = model.createData(), model.getFrameId(robot.tip)
    low = np.maximum(robot.limits.position_lower, near - np.pi)
    high = np.minimum(robot.limits.position_upper, near + np.pi)

    def error(q: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(model, data, robot.configuration(q))
        here = data.oMf[frame]
        return here.actInv(goal) if goal.ndim == 1 else pin.log6(here.actInv(pin.SE3(goal))).vector

    for _ in range(200):
        solved = least_squares(error, random.uniform(low, high), xtol=1e-15, ftol=1e-15, gtol=1e-15)
        q = near + (solved.x - near + np.pi) % (2 * np.pi) - np.pi
        q += 2 * np.pi * ((q < robot.limits.position_lower).astype(float) - (q > robot.limits.position_upper))
        inside = np.all((q >= robot.limits.position_lower) & (q <= robot.limits.position_upper))
        reached = np.linalg.norm(solved.fun) < 1e-9
        if reached and inside and all(np.max(np.abs(q - other)) > 1e-3 for other in found):
            found.append(q)
    return found


def case(name: str) -> tuple[ad.Robot, np.ndarray, list[np.ndarray], ad.Payload]:
    """Arm, start, two places and a part."""
    if name == "rr":
        robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
        places = [np.array([0.06, 0, 0.05]), np.array([-0.05, 0, 0.06])]
        return robot, np.array([0.1, 0.2]), places, ad.Payload(mass=0.1)
    robot, poses = ad.Robot.from_library("ur5"), []
    turn = pin.rpy.rpyToMatrix(np.array([np.pi, 0.2, 1.1]))
    for place in ((0.4, -0.25, 0.2), (0.35, 0.3, 0.1)):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn, place
        poses.append(pose)
    return robot, np.array([0.3, -1.4, 1.5, -1.6, -1.4, 0.2]), poses, ad.Payload(mass=1.0)


def compare(name: str) -> str:
    """A row of the table."""
    robot, start, places, part = case(name)
    goals = [ad.GoalPose(robot.tip, place) for place in places]
    steps = [ad.Move(goals[0]), ad.Grasp(part), ad.Move(goals[1]), ad.Release()]
    began = time.perf_counter()
    solved = ad.solve_cycle(ad.Cycle(robot, start=start, steps=steps, closed=True), OPTIONS)
    own = time.perf_counter() - began
    here, there = (branches(robot, place, start) for place in places)
    loaded = robot.with_payload(part)

    def least(arm: ad.Robot, a: np.ndarray, b: np.ndarray) -> float:
        found = ad.solve_minimum_time(ad.MinimumTimeProblem(arm, q_start=a, q_goal=b), OPTIONS)
        return found.duration if found.usable else np.inf

    began = time.perf_counter()
    to = [least(robot, start, a) for a in here]
    between = {(i, j): least(loaded, here[i], there[j]) for i, j in product(range(len(here)), range(len(there)))}
    back = [least(robot, b, start) for b in there]
    best = min(to[i] + length + back[j] for (i, j), length in between.items())
    every = time.perf_counter() - began
    count = len(to) + len(between) + len(back)
    return (
        f"| {name} | {len(here)}, {len(there)} | {solved.duration:.9f} | {best:.9f} | {solved.duration - best:+.1e} | "
        f"{solved.branches} of {count} | {own:.1f} | {every:.1f} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("arms", nargs="*", choices=["rr", "ur5"], help="all by default")
    columns = "arm", "branches", "solve_cycle [s]", "least of all [s]", "difference", "moves solved", "its time [s]"
    print(f"| {' | '.join(columns)} | all moves [s] |")
    print("|---|---|---|---|---|---|---|---|")
    for name in parser.parse_args(sys.argv[1:] or ["rr", "ur5"]).arms:
        print(compare(name), flush=True)


if __name__ == "__main__":
    main()
