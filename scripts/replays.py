"""Independent replays of random answers, by scipy's DOP853 and Radau: claimed against measured errors.

Answers whose certificate says "open loop" are replayed from start to end; of the others 40 random segments, each from
the motion's own sample. Rows are kept in FILE, and a run goes on where the last one ended.

    scripts/replays.py FILE [FIRST LAST]
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from library_motions import poses, table
from scipy.integrate import DOP853, Radau

import armdyn as ad

ARMS = {
    "r": (0, 0.2), "rr": (0, 0.2), "rrr": (0, 0.2), "ur5": (0, 2), "ur10": (0, 2), "panda": (0, 1), "xarm7": (0, 1),
    "kinova": (0, 0.2), "kinova loaded": (0.2, 1.4), "anymal_kinova_arm": (0.2, 1.4),
}  # fmt: skip
"""Least and largest payload [kg]."""
METHODS = [(method, rtol) for method in (DOP853, Radau) for rtol in (1e-10, 1e-12)]


def replayed(robot: ad.Robot, motion: ad.Trajectory, k: int, x: np.ndarray, how: tuple[Any, float]) -> np.ndarray:
    """The end state of segment k from a state x, shapes (2 nv,)."""
    n, model, data, (method, rtol) = robot.nv, robot.model, robot.model.createData(), how
    start, h, tau = motion.t[k], motion.t[k + 1] - motion.t[k], motion.tau[k : k + 2]

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        torque = tau[0] + (t - start) / h * (tau[1] - tau[0]) - robot.friction.torque(x[n:])
        return np.concatenate([x[n:], pin.aba(model, data, robot.configuration(x[:n]), x[n:], torque)])

    solver = method(rate, start, x, motion.t[k + 1], rtol=rtol, atol=1e-2 * rtol, first_step=h)
    while solver.status == "running":
        solver.step()
    return np.asarray(solver.y) if solver.status == "finished" else np.full(2 * n, np.nan)


def row(name: str, index: int) -> list[Any]:
    """Solve a random problem and measure the error: the claimed one, and that of each method."""
    random, plain = np.random.default_rng([24, index]), name.removesuffix(" loaded")
    load = ad.Payload(mass=random.uniform(*ARMS[name]))
    spec = ad.ArmSpec.paper(plain) if plain in ("r", "rr", "rrr") else None
    robot = ad.Robot.from_spec(spec, load) if spec else ad.Robot.from_library(plain, load)
    start, goal = poses(robot, robot.limits.effort_upper, 1000 + index)
    goal = start + random.uniform(0.2, 1.0) * (goal - start)
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)
    found = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(search="quick", calm=0, time_limit=60))
    motion, proof, measured = found.trajectory, found.certificate, []
    x, flowing, open_loop = np.hstack([motion.q, motion.v]), np.flatnonzero(~motion.jumps), proof.replay == "open loop"
    some = flowing if open_loop else random.choice(flowing, min(40, flowing.size), replace=False)
    for how in METHODS if found.usable else ():
        state, ends = x[0], []
        for k in some:
            state = replayed(robot, motion, k, state if open_loop else x[k], how)
            ends.append(state - x[k + 1])
        measured.append(np.max(np.abs(state[: robot.nv] - goal if open_loop else ends)))
    claim = proof.goal_error if open_loop else proof.segment_error
    return [name, index, found.duration, proof.replay, proof.growth, claim, *map(float, measured)]


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("file", type=Path, metavar="FILE")
parser.add_argument("first", type=int, nargs="?", default=0, metavar="FIRST", help="number of the first answer")
parser.add_argument("last", type=int, nargs="?", default=200, metavar="LAST", help="number after that of the last one")
arguments = parser.parse_args()
file, first, last = arguments.file, arguments.first, arguments.last
rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
for index in sorted({*range(first, last)} - {one[1] for one in rows}):
    rows.append(row(list(ARMS)[index % len(ARMS)], index))
    with file.open("a") as lines:
        lines.write(json.dumps(rows[-1]) + "\n")
cells, usable = [], [one for one in rows if len(one) > 6]
for kind in sorted({(one[0], one[3]) for one in usable}):
    numbers = np.array([[*one[2:3], *one[4:6], max(one[6:])] for one in usable if (one[0], one[3]) == kind])
    spans = [f"{low:.2g} to {high:.2g}" for low, high in zip(numbers.min(axis=0), numbers.max(axis=0), strict=True)]
    cells.append([*kind, str(len(numbers)), *spans, f"{np.max(numbers[:, 3] / numbers[:, 2]):.2g}"])
print(table(["arm", "replay", "answers", "t_f [s]", "growth", "claimed", "measured", "worst ratio"], cells))
print(f"{len(rows) - len(usable)} of {len(rows)} answers are not usable.")
