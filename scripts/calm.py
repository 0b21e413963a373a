"""Prints the time that calm joints cost, and the travel that they save.

On the figure's pair of each arm, and on random pairs of poses, of which two joints end where they begin:

    python scripts/calm.py [--pairs 20] [--seed 5] [--figure calm.png]

Excess travel is how much farther than it has to a joint goes. A joint turns back where its velocity changes its sign at
more than a hundredth of its limit. Variation is the sum of a motion's torque changes over the torque limits.
"""

import argparse
import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import armdyn as ad

Array = NDArray[np.float64]

PAIRS = {
    "ur5": ([0, -1.2, 1.2, 0, 0.5, 0], [1, -0.8, 0.8, 0.4, 0.3, 0]),
    "panda": ([0, -0.785, 0, -2.356, 0, 1.571, 0.785], [1, 0.2, 0, -1.5, 0, 2, -0.5]),
}
"""Start and goal of the figure's motions, some of whose joints end where they begin [rad]."""


def measured(robot: ad.Robot, motion: ad.Trajectory) -> tuple[Array, Array, float]:
    """Excess travel [rad] and how often each joint turns back, shape (nv,) each; variation of the torques."""
    travel = np.sum(np.abs(np.diff(motion.q, axis=0)), axis=0) - np.abs(motion.q[-1] - motion.q[0])
    least = 0.01 * robot.limits.velocity
    signs = (np.sign(v[np.abs(v) > some]) for v, some in zip(motion.v.T, least, strict=True))
    back = np.array([np.count_nonzero(np.diff(one)) for one in signs])
    return travel, back, float(np.sum(np.abs(np.diff(motion.tau, axis=0)) / robot.limits.effort_upper))


def pairs(robot: ad.Robot, count: int, seed: int) -> list[tuple[Array, Array, Array]]:
    """Starts, goals, and the joints that have the same position in both."""
    rng, limits = np.random.default_rng(seed), robot.limits
    lower, upper = np.maximum(limits.position_lower, -np.pi), np.minimum(limits.position_upper, np.pi)
    middle, half = (lower + upper) / 2, 0.4 * (upper - lower)
    out = []
    for _ in range(count):
        start, goal = (rng.uniform(middle - half, middle + half) for _ in range(2))
        resting = rng.permutation(robot.nv)[:2]
        goal[resting] = start[resting]
        out.append((start, goal, resting))
    return out


def table(name: str, robot: ad.Robot, given: Sequence[tuple[Array, Array, Array]]) -> dict[float, list[float]]:
    """Rows of an arm, without and with calm joints; excess travel of resting joints by the share [rad]."""
    shares, count = (0.0, 1e-3), len(given)
    found = {share: ([], [], [], [], []) for share in shares}
    longer, changed = [], 0
    for start, goal, resting in given:
        problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)
        both = []
        for share in shares:
            began = time.process_time()
            solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(calm=share, compile=True))
            travel, back, variation = measured(robot, solution.trajectory)
            each = travel[resting], back, [variation], [solution.usable], [time.process_time() - began]
            for values, more in zip(found[share], each, strict=True):
                values.extend(more)
            both.append(solution)
        longer.append(both[1].duration / both[0].duration - 1)
        changed += both[0].certified != both[1].certified
    for share in shares:
        travel, back, variation, usable, seconds = found[share]
        print(
            f"| {name}, calm={share:g} | {sum(usable)} of {count} | {np.median(travel):.3f}, "
            f"{np.quantile(travel, 0.9):.2f} | {np.median(back):g}, {np.mean(back):.1f} | {np.median(variation):.1f} | "
            f"{np.median(seconds):.2f} |",
            flush=True,
        )
    print(f"{name}: slower by {np.median(longer):.2g} (median), {max(longer):.2g} at most; other verdicts: {changed}")
    return {share: found[share][0] for share in shares}


def figure(path: str) -> None:
    """Velocities of two motions, the fastest above, the calm one below."""
    from matplotlib import pyplot as plt

    _, axes = plt.subplots(2, 2, figsize=(10, 5.8), sharey=True, sharex="col", layout="constrained")
    for column, (name, (start, goal)) in zip(axes.T, PAIRS.items(), strict=True):
        robot = ad.Robot.from_library(name)
        problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)
        for axis, share in zip(column, (0.0, 1e-3), strict=True):
            solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(calm=share))
            motion = solution.trajectory
            travel, back, _ = measured(robot, motion)
            resting = np.equal(start, goal)
            for j, joint in enumerate(robot.joint_names):
                label = joint.replace("_joint", "").replace("panda", "joint ").replace("_", " ")
                axis.plot(
                    1e3 * motion.t, motion.v[:, j] / robot.limits.velocity[j], label=label, lw=2 if resting[j] else 1
                )
            axis.set_title(
                f"{name}, calm={share:g}: {solution.duration:.4f} s, turns back {np.sum(back)} times,\n"
                f"resting joints travel {np.sum(travel[resting]):.2f} rad",
                fontsize=9,
            )
            axis.grid(alpha=0.3)
        column[1].set_xlabel("time [ms]")
        column[1].legend(fontsize=7, ncols=4, loc="upper center", bbox_to_anchor=(0.5, -0.2))
    for axis in axes[:, 0]:
        axis.set_ylabel("velocity over its limit [-]")
    plt.savefig(path, dpi=110)


def main() -> None:
    """Print the table, or draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=20, help="of each arm (20)")
    parser.add_argument("--seed", type=int, default=5, help="of the poses (5)")
    parser.add_argument("--figure", help="draw two motions instead")
    options = parser.parse_args()
    if options.figure:
        figure(options.figure)
        return
    print("| arm | usable | excess travel of resting joints: median, 90 % [rad] | turns back: median, mean | "
          "variation: median | CPU: median [s] |")  # fmt: skip
    print("|---|---|---|---|---|---|")
    travels = dict[float, list[float]]()
    for name, (start, goal) in PAIRS.items():
        robot = ad.Robot.from_library(name)
        table(f"{name}, usual pair", robot, [(np.array(start), np.array(goal), np.flatnonzero(np.equal(start, goal)))])
        for share, more in table(name, robot, pairs(robot, options.pairs, options.seed)).items():
            travels.setdefault(share, []).extend(more)
    for share, travel in travels.items():
        print(f"random pairs of both arms, calm={share:g}: excess travel {np.median(travel):.3f} rad in the median")


if __name__ == "__main__":
    main()
