"""Plan a Panda's motions anew from states along a motion to goals that have moved: time, duration, limits.

    python scripts/resolver.py [GOALS] [SEED] [DEADLINE]

Goals are moved by up to 0.2 rad, or by up to 5 cm at the tip. Without a deadline every motion is compared with
`solve_minimum_time` from the same state (calm=0). Limits are checked by pin.rnea at random times. Times are
processor time and, in brackets, the clock's.
"""

import sys
import time

import numpy as np
import pinocchio as pin

import armdyn as ad

PER_MOTION = 5
SAMPLES = 2000


def excess(robot: ad.Robot, motion: ad.Trajectory, random: np.random.Generator) -> float:
    """Largest excess over a limit at random times, as a part of it; accelerations are those of the cubics between."""
    limits, data = robot.limits, robot.model.createData()
    t = np.sort(random.uniform(motion.t[0], motion.t[-1], SAMPLES))
    k = np.clip(np.searchsorted(motion.t, t, side="right") - 1, 0, motion.t.size - 2)
    h, at = np.diff(motion.t)[k][:, None], motion(t)
    s, v, rise = (t - motion.t[k])[:, None] / h, motion.v, np.diff(motion.q, axis=0)[k]
    a = ((6 - 12 * s) * rise / h + (6 * s - 4) * v[k] + (6 * s - 2) * v[k + 1]) / h
    tau = np.array([pin.rnea(robot.model, data, *x) for x in zip(at.q, at.v, a, strict=True)])
    half = (limits.effort_upper - limits.effort_lower) / 2
    torque = np.max(np.maximum(tau - limits.effort_upper, limits.effort_lower - tau) / half)
    position = np.max(np.maximum(at.q - limits.position_upper, limits.position_lower - at.q))
    return float(max(torque, np.max(np.abs(at.v) / limits.velocity) - 1, position))


def moved(robot: ad.Robot, goal: np.ndarray, random: np.random.Generator, tip: bool) -> np.ndarray:
    """A goal moved by up to 0.2 rad in joint space, or by up to 5 cm at the tip with the same orientation."""
    way = random.normal(size=3 if tip else robot.nv)
    way *= random.uniform(0, 0.05 if tip else 0.2) / np.linalg.norm(way)
    if tip:
        data, last = robot.model.createData(), robot.model.njoints - 1
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pin.computeJointJacobians(robot.model, data, goal)
        jacobian = pin.getJointJacobian(robot.model, data, last, frame)
        way = np.linalg.lstsq(jacobian, np.append(way, np.zeros(3)), rcond=1e-2)[0]
    return np.clip(goal + way, robot.limits.position_lower + 0.01, robot.limits.position_upper - 0.01)


def main(goals: int, seed: int, deadline: float) -> None:
    """Plan, compare and check."""
    random, robot, clock = np.random.default_rng(seed), ad.Robot.from_library("panda"), time.perf_counter
    limits, at_rest, resolver = robot.limits, np.zeros(robot.nv), ad.Resolver(robot)
    middle, half = (
        (limits.position_upper + limits.position_lower) / 2,
        (limits.position_upper - limits.position_lower) / 2,
    )
    seconds, clocks, gaps, beyond, statuses = [], [], [], [], {}
    for k in range(goals):
        if k % PER_MOTION == 0:
            start, goal = middle + 0.8 * half * random.uniform(-1, 1, (2, robot.nv))
            while not (first := resolver.solve(start, at_rest, goal)).usable:
                print(
                    f"motion {k // PER_MOTION}, from rest: {first.status.value}, {first.message}; another one is drawn"
                )
                start, goal = middle + 0.8 * half * random.uniform(-1, 1, (2, robot.nv))
        resolver.begin_with(first)
        state = first.trajectory(random.uniform(0, 0.9) * first.duration)
        new = moved(robot, goal, random, tip=k % 2 == 1)
        began, cpu = clock(), time.process_time()
        solution = resolver.solve(state.q, state.v, new, deadline or None)
        seconds.append(time.process_time() - cpu)
        clocks.append(clock() - began)
        statuses[str(solution.status)] = statuses.get(str(solution.status), 0) + 1
        beyond.append(excess(robot, solution.trajectory, random) if solution.status != "failed" else 0.0)
        if not deadline:
            problem = solution.problem
            cold = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(calm=0, bound=False))
            gaps.append(solution.duration / cold.duration - 1 if solution.usable else np.inf)
    for name, own in (("processor", seconds), ("clock", clocks)):
        middle_, most, worst = (1e3 * np.quantile(own, part) for part in (0.5, 0.99, 1.0))
        print(f"{name} time: median {middle_:.1f} ms, 99 % within {most:.1f} ms, worst {worst:.1f} ms")
    print(f"{goals} goals: {statuses}; largest excess over a limit {max(beyond):.1e} of it")
    if gaps:
        near = np.mean(np.array(gaps) <= 2e-3)
        print(
            f"duration within 0.2 % of the cold one: {near:.1%}; median {np.median(gaps):+.3%}, worst {max(gaps):+.2%}"
        )


if __name__ == "__main__":
    given = sys.argv[1:]
    main(*(kind(own) for kind, own in zip((int, int, float), [*given, *["100", "2", "0"][len(given) :]], strict=True)))
