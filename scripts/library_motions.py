"""Minimum time between two random poses, for every arm that goes by a name: a Markdown table.

Poses are drawn from the middle 80 % of the position limits (an endless joint's from ±π), the same for a seed.
Where the URDF has no torque limits, 10 N m serve.

    scripts/library_motions.py > table.md
    scripts/library_motions.py --only panda ur5 --time-limit 60
"""

import argparse
import json
import subprocess
import sys
import tempfile

import numpy as np

from armdyn.models import Robot
from armdyn.models.robots.library import LIBRARY_ARMS

EFFORT = 10.0
COMMAND = (sys.executable, "-c", "from armdyn.cli import main; main()", "mintime")


def poses(robot: Robot, seed: int) -> np.ndarray:
    """Start and goal [rad or m], shape (2, nv)."""
    lower = np.maximum(robot.limits.position_lower, -np.pi)
    upper = np.minimum(robot.limits.position_upper, np.pi)
    return (lower + upper) / 2 + 0.8 * np.random.default_rng(seed).uniform(-0.5, 0.5, (2, robot.nv)) * (upper - lower)


def solve(name: str, seed: int, time_limit: float) -> list[str]:
    """One row: what `armdyn mintime` made of it."""
    robot = Robot.from_library(name)
    start, goal = (",".join(f"{x:.4f}" for x in pose) for pose in poses(robot, seed))
    own = robot.limits.effort_upper
    given = np.isfinite(own) & (own > 0)
    effort = [] if given.all() else ["--effort-limit", ",".join(f"{x:g}" for x in np.where(given, own, EFFORT))]
    with tempfile.TemporaryDirectory() as folder:
        arguments = [name, f"--q-start={start}", f"--q-goal={goal}", *effort, "--time-limit", str(time_limit)]
        done = subprocess.run(  # noqa: S603  armdyn itself
            [*COMMAND, *arguments, "--json", "--out", folder], capture_output=True, text=True, timeout=20 * time_limit
        )
    try:
        answer = json.loads(done.stdout)
    except ValueError:
        return [name, str(robot.nv), "", "", f"no answer: {done.stderr.strip()[-200:]}"]
    if "duration" not in answer:
        return [name, str(robot.nv), "", "", answer["message"]]
    reasons = answer["certificate"]["reasons"] if answer["success"] else [answer["message"]]
    what = "certified" if answer["certified"] else "; ".join(reasons)
    remark = f" ({EFFORT:g} N m where there is no limit)" if effort else ""
    return [name, str(robot.nv), f"{answer['duration']:.5f}", f"{answer['solve_time']:.1f}", f"{what}{remark}"]


def main() -> None:
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=list(LIBRARY_ARMS), metavar="NAME")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--time-limit", type=float, default=60.0, metavar="S")
    given = parser.parse_args()
    print("| arm | joints | t_f [s] | solved in [s] | outcome |\n|---|---|---|---|---|")
    for name in given.only:
        print(f"| {' | '.join(solve(name, given.seed, given.time_limit))} |", flush=True)


if __name__ == "__main__":
    main()
