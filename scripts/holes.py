"""Holes to be drilled by a UR5 in any order: seven against all orders, then twelve.

Seven holes at given joint positions: every move between every two is solved, and every one of the 5,040 orders gone
through. Twelve holes by eight branches each: the time that it takes.

    python scripts/holes.py [seven twelve]
"""

import argparse
import sys
import time
from itertools import pairwise, permutations

import numpy as np

import armdyn as ad

SEED = 5
Places = list[np.ndarray] | list[ad.GoalPose]
DRILL = 0.1
"""Time at each hole [s]."""


def twelve() -> tuple[ad.Robot, list[float], list[ad.GoalPose]]:
    """UR5, its start and twelve places on a table, with a drill that points down."""
    robot, random, goals = ad.Robot.from_library("ur5"), np.random.default_rng(SEED), []
    for x, y in zip(random.uniform(0.35, 0.6, 12), random.uniform(-0.3, 0.3, 12), strict=True):
        pose = np.array([[0, 1, 0, x], [1, 0, 0, y], [0, 0, -1, 0.1], [0, 0, 0, 1]], dtype=float)
        goals.append(ad.GoalPose(robot.tip, pose))
    return robot, [0.0, -1.57, 1.57, -1.57, -1.57, 0.0], goals


def drilled(robot: ad.Robot, start: list[float], places: Places) -> tuple[ad.CycleSolution, float]:
    """The cycle through all holes, and the time that its solution takes [s]."""
    steps = [step for k, place in enumerate(places, 1) for step in (ad.Move(place, name=f"hole {k}"), ad.Wait(DRILL))]
    began = time.perf_counter()
    cycle = ad.Cycle(robot, start=start, steps=steps, closed=True, order="free")
    found = ad.solve_cycle(cycle, ad.MinimumTimeOptions(time_limit=3600.0))
    return found, time.perf_counter() - began


def by_all_orders(robot: ad.Robot, start: list[float], places: list[np.ndarray]) -> float:
    """The least duration over all orders [s]."""
    stops = [np.array(start), *places]
    lengths = {}
    for i, j in permutations(range(len(stops)), 2):
        found = ad.solve_minimum_time(ad.MinimumTimeProblem(robot, q_start=stops[i], q_goal=stops[j]))
        lengths[i, j] = found.duration if found.usable else np.inf
    orders = permutations(range(1, len(stops)))
    return min(sum(lengths[pair] for pair in pairwise([0, *order, 0])) for order in orders) + len(places) * DRILL


def main() -> None:
    """Print both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", choices=["seven", "twelve"], help="both by default")
    for case in parser.parse_args(sys.argv[1:] or ["seven", "twelve"]).cases:
        robot, start, goals = twelve()
        near = [ad.MinimumTimeProblem(robot, q_start=start, goal_pose=goal).goals[0] for goal in goals[:7]]
        found, seconds = drilled(robot, start, near if case == "seven" else goals)
        order = ", ".join(leg.leg.name for leg in found.legs)
        print(
            f"{case}: {found.duration:.9f} s by {found.branches} solved moves in {seconds:.1f} s: {order}", flush=True
        )
        if case == "seven":
            least = by_all_orders(robot, start, near)
            print(f"all orders: {least:.9f} s, difference {found.duration - least:+.1e} s", flush=True)


if __name__ == "__main__":
    main()
