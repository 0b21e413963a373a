"""How late the default controller settles on random motions that its weights were not chosen on.

Poses within ±π, payloads to 0.3 kg; the motion leaves a tenth of the torque; the arms are `likely_plants`.
Weights were chosen on seed 1; seed 2 is for reporting only.

    python scripts/held_out_tracking.py [rr|rrr] [PAIRS] [SEED]
"""

import sys

import numpy as np

import armdyn as ad


def main(name: str = "rrr", pairs: str = "50", seed: str = "2") -> None:
    """Measure and print."""
    late, arms, without = [], [], 0
    for k in range(int(pairs)):
        random = np.random.default_rng([int(seed), k])
        payload, (start, goal) = random.uniform(0, 0.3), random.uniform(-np.pi, np.pi, (2, len(name)))
        robot = ad.Robot.from_spec(ad.ArmSpec.paper(name), ad.Payload(mass=payload))
        problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, position_limit=(-np.pi, np.pi), reserve=0.1)
        solution = ad.solve_minimum_time(problem)
        if not solution.usable:
            without += 1
            continue
        runs = [ad.track(robot, solution.trajectory, plant=plant, duration=2.5) for plant in ad.likely_plants(robot)]
        arms += [run.settled for run in runs]
        worst = max(np.inf if run.settled_time is None else run.settled_time for run in runs)
        late.append(1e3 * (worst - solution.duration))
    middle, most, last = np.quantile(late, [0.5, 0.9, 1.0], method="higher")
    print(f"{name.upper()}, seed {seed}: {len(late)} motions, {without} not usable")
    print(f"{sum(arms)} of {len(arms)} arms settle; the worst of a motion's, after its end:")
    print(f"{middle:.0f} ms (median), {most:.0f} ms (90 %), {last:.0f} ms (worst)")


if __name__ == "__main__":
    main(*sys.argv[1:])
