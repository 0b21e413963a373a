"""Print how long a minimum-time motion takes, from the search to the certificate: the README's timings.

    python scripts/timings.py [RUNS]      # by default seven of each arm; machine code is built before

Wall time of `solve_minimum_time`, median and range, on this machine.
"""

import os
import statistics
import sys
import time

import numpy as np

import armdyn as ad
from armdyn.paper import PAYLOAD, example


def problems() -> dict[str, ad.MinimumTimeProblem]:
    """The paper's two and three links, a Panda, and a UR5."""
    found = {}
    for name in ("rr", "rrr"):
        poses = example(name, "minimum_time")
        robot = ad.Robot.from_spec(ad.ArmSpec.paper(name), ad.Payload(mass=PAYLOAD))
        found[name] = ad.MinimumTimeProblem(robot, q_start=poses.q_start, q_goal=poses.q_goal)
    ready, there = [0, -0.785, 0, -2.356, 0, 1.571, 0.785], [1, 0.2, 0.5, -1.5, 0.3, 2, -0.5]
    found["panda"] = ad.MinimumTimeProblem(ad.Robot.from_library("panda"), q_start=ready, q_goal=there)
    there = np.deg2rad([90, -45, 60, -90, 0, 0])
    found["ur5"] = ad.MinimumTimeProblem(ad.Robot.from_library("ur5"), q_start="home", q_goal=there)
    return found


if __name__ == "__main__":
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 7
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    for name, problem in problems().items():
        ad.solve_minimum_time(problem)  # builds missing functions
        seconds = []
        for _ in range(runs):
            began = time.perf_counter()
            solution = ad.solve_minimum_time(problem)
            seconds.append(time.perf_counter() - began)
        gap = "" if solution.gap is None else f", gap {solution.gap:.4%}"
        print(
            f"{name}: {statistics.median(seconds):.2f} s ({min(seconds):.2f} to {max(seconds):.2f}): "
            f"{solution.duration:.6f} s, certified: {solution.certified}{gap}"
        )
