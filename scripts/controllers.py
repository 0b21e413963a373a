"""Print checks of random motions that are planned under controllers' presets, with Ruckig's times.

    python scripts/controllers.py [--count 100] [--seed 31] [--robots panda ur10]

Poses are uniform over 80 % of the joint ranges within ±π. "Accepted": by `preset.check`, at the controller's rate.
Ruckig (L. Berscheid, T. Kröger, RSS 2021) knows velocity, acceleration and jerk limits, and no torques; where a preset
has no limit of acceleration or jerk there is no ratio. Seconds are of one solve, bound included, with functions built
once for an arm built before.
"""

import argparse
import time

import numpy as np
from numpy.typing import NDArray

import armdyn as ad

PRESETS = {"panda": "franka-panda", "ur10": "ur10", "ur5": "ur5", "xarm7": "xarm7", "iiwa14": "iiwa14"}


def ruckig_time(problem: ad.MinimumTimeProblem) -> float:
    """Time of Ruckig's motion under the problem's kinematic limits [s]; nan where some are missing."""
    from ruckig import InputParameter, Ruckig, Trajectory

    if problem.acceleration_limit is None or problem.jerk_limit is None:
        return np.nan
    n = problem.robot.nv
    request, found = InputParameter(n), Trajectory(n)
    request.current_position, request.target_position = list(problem.q_start), list(problem.q_goal)
    request.max_velocity = list(problem.limits.velocity)
    request.max_acceleration = list(np.broadcast_to(problem.acceleration_limit, n))
    request.max_jerk = list(np.broadcast_to(problem.jerk_limit, n))
    Ruckig(n).calculate(request, found)
    return float(found.duration)


def measure(name: str, count: int, seed: int) -> str:
    """A row of the table."""
    robot, preset = ad.Robot.from_library(name), ad.ControllerPreset.named(PRESETS[name])
    limits, rng = robot.limits, np.random.default_rng(seed)
    lower, upper = np.maximum(limits.position_lower, -np.pi), np.minimum(limits.position_upper, np.pi)
    middle, half = (lower + upper) / 2, 0.4 * (upper - lower)
    rows = []
    for k in range(count + 1):
        ends = [rng.uniform(middle - half, middle + half) for _ in range(2)]
        problem = ad.MinimumTimeProblem(robot, q_start=ends[0], q_goal=ends[1], preset=preset)
        began, cpu = time.perf_counter(), time.process_time()
        solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(compile=True))
        seconds, cpu = time.perf_counter() - began, time.process_time() - cpu
        if k == 0:
            continue  # builds
        accepted = solution.usable and preset.check(solution.trajectory).ok
        gap = np.nan if solution.gap is None else solution.gap
        rows.append((solution.usable, accepted, seconds, cpu, solution.duration / ruckig_time(problem), gap))
        if not accepted:
            print(f"  {name} {k}: {solution.message}", flush=True)
    usable, accepted, seconds, cpu, ratio, gap = (np.array(column, dtype=float) for column in zip(*rows, strict=True))
    return (
        f"| {name}, {PRESETS[name]} | {usable.sum():.0f} | {accepted.sum():.0f} of {count} | {_pair(seconds, '.2f')} | "
        f"{_pair(cpu, '.2f')} | {_pair(ratio, '.4f')} | {_pair(100 * gap, '.2f')} |"
    )


def _pair(values: NDArray[np.float64], form: str) -> str:
    """Median and largest."""
    if np.all(np.isnan(values)):
        return "-"
    return f"{np.nanmedian(values):{form}}, {np.nanmax(values):{form}}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100, help="motions of each robot (100)")
    parser.add_argument("--seed", type=int, default=31, help="of the poses (31)")
    parser.add_argument("--robots", nargs="+", default=["panda", "ur10"], choices=sorted(PRESETS), help="(panda ur10)")
    options = parser.parse_args()
    print(
        "| robot, preset | usable | accepted | solve: median, longest [s] | CPU, no bound [s] | to Ruckig | gap [%] |"
    )
    print("|---|---|---|---|---|---|---|")
    for name in options.robots:
        print(measure(name, options.count, options.seed), flush=True)


if __name__ == "__main__":
    main()
