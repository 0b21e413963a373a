"""Numbers and picture of docs/run_it_on_a_robot.md: settled times by the reserve for feedback.

Six arms each: payload 20 % less, as it is and 20 % more, without friction and with (2 % of the torque limits, and 0.1 %
for each rad/s); 1 kHz, one tick of delay, encoders of 1e-4 rad, velocities filtered at 80 Hz. A minute and a half.

    python scripts/run_it_on_a_robot.py [docs/run_it_on_a_robot.png]
"""

import sys
import time
from pathlib import Path

import numpy as np

import armdyn as ad
from armdyn.paper import PAYLOAD, example
from armdyn.show.figures.loops import plot_reserves
from armdyn.show.plots import save_figure
from armdyn.studies.reserve import Settling

LIBRARY = {
    "ur5": ([0, -1.57, 1.57, -1.57, -1.57, 0], [1, -0.9, 1, -1, -1.2, 0.5]),
    "panda": ([0, -0.785, 0, -2.356, 0, 1.571, 0.785], [1, 0.2, 0.5, -1.5, 0.3, 2, -0.5]),
}


def problem(name: str) -> ad.MinimumTimeProblem:
    """The paper's arms between the paper's poses, the library's with 1 kg."""
    if name in LIBRARY:
        start, goal = LIBRARY[name]
        return ad.MinimumTimeProblem(
            ad.Robot.from_library(name, payload=ad.Payload(mass=1.0)), q_start=start, q_goal=goal
        )
    poses, spec = example(name, "minimum_time"), ad.ArmSpec.paper(name)
    robot = ad.Robot.from_spec(spec, ad.Payload(mass=PAYLOAD))
    return ad.MinimumTimeProblem(robot, q_start=poses.q_start, q_goal=poses.q_goal)


def joint_pid(robot: ad.Robot, q_goal: np.ndarray, bandwidth: float = 30.0) -> ad.Pid:
    """The controller of a drive: every joint for itself, poles at the bandwidth [rad/s] of the inertia at the goal."""
    inertia = np.diag(ad.Dynamics(robot).crba(q_goal))
    return ad.Pid(ad.PidGains(tuple(bandwidth**2 * inertia), 0.0, tuple(2 * bandwidth * inertia)))


def cell(row: Settling) -> str:
    """Mean and worst, or how many settle."""
    return f"{row.mean:.3f} / {row.worst:.3f}" if np.isfinite(row.worst) else f"{row.count} of {len(row.settled)}"


def main(picture: Path) -> None:
    """Measure, print as Markdown, draw."""
    for name in ("rr", "rrr", "ur5", "panda"):
        request, began = problem(name), time.perf_counter()
        laws = [ad.Lqr(), ad.ComputedTorque(), joint_pid(request.robot, request.q_goal)]
        if name == "rrr":
            laws.append(ad.Lqr(0.05, 0.007, 2.0, 1.0, 1.0))
        curve = ad.reserve_curve(request, laws)
        print(f"\n{name}: {time.perf_counter() - began:.0f} s\n")
        levels = sorted(curve.solutions)
        print("| reserve | " + " | ".join(f"{r:g}" for r in levels) + " |\n|---" + "|---" * len(levels) + "|")
        print("| motion | " + " | ".join(f"{curve.solutions[r].duration:.4f}" for r in levels) + " |")
        for law in laws:
            rows = curve.of(law)
            print(f"| {type(law).__name__} | " + " | ".join(map(cell, rows)) + " |")
            print(f"  fastest joint, of its limit: {max(run.peak_velocity for row in rows for run in row.runs):.3f}")
        if name == "rrr":
            facts = [row.facts() for law in laws[:2] for row in curve.of(law)]
            save_figure(plot_reserves(facts, "RRR with 100.6 g, six arms"), picture)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/run_it_on_a_robot.png"))
