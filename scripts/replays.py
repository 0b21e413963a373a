"""Independent replays of random answers, by scipy's DOP853 and Radau: what is claimed beside what they measure.

Answers whose certificate says "open loop" are replayed from start to end; of the others random segments, each from the
motion's own sample. Rows are kept, and a run goes on where the last one ended.

    scripts/replays.py --last 200 --rows results/replays.jsonl
"""

import argparse
import json
from pathlib import Path

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


def replayed(robot: ad.Robot, motion: ad.Trajectory, k: int, x: np.ndarray, how: tuple) -> np.ndarray:
    """The end state of segment k from a state x, shapes (2 nv,)."""
    n, model, data = robot.nv, robot.model, robot.model.createData()
    start, h, tau = motion.t[k], motion.t[k + 1] - motion.t[k], motion.tau[k : k + 2]

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        torque = tau[0] + (t - start) / h * (tau[1] - tau[0]) - robot.friction.torque(x[n:])
        return np.concatenate([x[n:], pin.aba(model, data, robot.configuration(x[:n]), x[n:], torque)])

    method, rtol = how
    solver = method(rate, start, x, motion.t[k + 1], rtol=rtol, atol=1e-2 * rtol, first_step=h)
    while solver.status == "running":
        solver.step()
    return solver.y if solver.status == "finished" else np.full(2 * n, np.nan)


def row(name: str, index: int, most: int) -> list:
    """Solve a random problem and measure the answer: what is claimed, and what each method gives."""
    random, load, plain = np.random.default_rng([24, index]), ad.Payload(mass=0.0), name.removesuffix(" loaded")
    load = ad.Payload(mass=random.uniform(*ARMS[name]))
    own = plain in ("r", "rr", "rrr")
    robot = ad.Robot.from_spec(ad.ArmSpec.paper(plain), load) if own else ad.Robot.from_library(plain, load)
    start, goal = poses(robot, robot.limits.effort_upper, 1000 + index)
    goal = start + random.uniform(0.2, 1.0) * (goal - start)
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)
    found = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(effort="quick", time_limit=60))
    motion, proof, measured = found.trajectory, found.certificate, []
    x, segments, open_loop = np.hstack([motion.q, motion.v]), np.flatnonzero(~motion.jumps), proof.replay == "open loop"
    some = segments if open_loop else random.choice(segments, min(most, segments.size), replace=False)
    for how in METHODS if found.usable else ():
        state, ends = x[0], []
        for k in some:
            state = replayed(robot, motion, k, state if open_loop else x[k], how)
            ends.append(state - x[k + 1])
        measured.append(np.max(np.abs(state[: robot.nv] - goal if open_loop else ends)))
    claim = proof.goal_error if open_loop else proof.segment_error
    return [name, index, found.duration, proof.replay, proof.growth, claim, *map(float, measured)]


def main() -> None:
    """Solve, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, default=200)
    parser.add_argument("--segments", type=int, default=40, help="of every unstable motion")
    parser.add_argument("--rows", type=Path, default=Path("replays.jsonl"))
    given = parser.parse_args()
    rows = [json.loads(line) for line in given.rows.read_text().splitlines()] if given.rows.exists() else []
    for index in sorted({*range(given.first, given.last)} - {one[1] for one in rows}):
        rows.append(row(list(ARMS)[index % len(ARMS)], index, given.segments))
        with given.rows.open("a") as file:
            file.write(json.dumps(rows[-1]) + "\n")
    cells = []
    for name, said in sorted({(one[0], one[3]) for one in rows if len(one) > 6}):
        own = [one for one in rows if len(one) > 6 and (one[0], one[3]) == (name, said)]
        growth, claims, worst = (
            np.array([f(one) for one in own]) for f in (lambda r: r[4], lambda r: r[5], lambda r: max(r[6:]))
        )
        spans = [f"{min(x):.0e} to {max(x):.0e}" for x in (growth, claims, worst)]
        cells.append([name, said, str(len(own)), *spans, f"{max(worst / claims):.2g}"])
    print(table(["arm", "replay", "answers", "growth", "claimed", "measured", "measured over claimed, worst"], cells))


if __name__ == "__main__":
    main()
