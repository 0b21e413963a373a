"""Print results of one controller on 1,000 random arms, and of tuned gains on a set of them.

Run it as `python scripts/many_arms.py [FOLDER]`; rows and the figure of errors go to the folder, and a run that was
stopped goes on with its rows.
"""

import sys
import time
from pathlib import Path

import armdyn as ad
from armdyn.paper import GAINS, PAYLOAD, example
from armdyn.show.figures.loops import plot_envelope
from armdyn.show.plots import save_figure

FRICTION = {"coulomb": (0.0, 0.06), "damping": (0.0, 0.003)}
"""Of each joint: 2 % of the torque limit, and 0.1 % for each rad/s."""
WITHIN = 0.40
"""That an arm has to settle [s]."""


def model(arm: str) -> ad.Robot:
    """The paper's arm with its payload."""
    return ad.Robot.from_spec(ad.ArmSpec.paper(arm), ad.Payload(mass=PAYLOAD))


def random_arms(folder: Path) -> None:
    """RRR along the fastest motion that leaves a tenth of the torque to feedback."""
    robot, poses = model("rrr"), example("rrr", "minimum_time")
    problem = ad.MinimumTimeProblem(robot, q_start=poses.q_start, q_goal=poses.q_goal, reserve=0.1)
    motion = ad.solve_minimum_time(problem).trajectory
    for word, friction in (("without friction", {}), ("with friction", FRICTION)):
        began, file = time.perf_counter(), folder / f"rows {word}.sqlite"
        found = ad.monte_carlo(robot, motion, plants=ad.Plants(seed=1, **friction), file=file)
        seconds = time.perf_counter() - began
        median, nine, most, worst = found.quantiles()
        print(f"RRR {word}: {found.success(WITHIN)} within {WITHIN:.2f} s; {seconds:.1f} s of computing")
        print(
            f"  settled time {median:.3f} s (median), {nine:.3f} s (90 %), {most:.3f} s (99 %), {worst:.3f} s (worst)"
        )
        print(f"  the worst: arm {found.worst.k}, {found.worst.sample.payload:.3f} times the payload")
        settled = f"{found.success(WITHIN).settled} of {len(found.rows)} settle within {WITHIN:.2f} s"
        figure = plot_envelope(found.envelope(), f"RRR {word}: {settled}")
        save_figure(figure, folder / f"envelope {word}.png")


def tuned_gains() -> None:
    """PID control along a ramp, chosen on six arms, and the paper's gains for comparison."""
    for arm, longest in (("rr", 0.5), ("rrr", 0.6)):
        robot, poses = model(arm), example(arm, "minimum_time")
        plants = ad.Plants(seed=1, **FRICTION)
        began = time.perf_counter()
        found = ad.tune(
            robot,
            ad.Ramps(poses.q_start, poses.q_goal, (0.2, longest)),
            ad.ControllerFamily.pid(robot, poses.q_goal),
            plants.corners(robot),
            plants.arms(robot, 200),
            options=ad.TuneOptions(duration=1.2, overshoot=0.045),
        )
        print(f"{arm.upper()}: {found.message}; {time.perf_counter() - began:.0f} s of computing")
        print(f"  {', '.join(f'{name} {value:.4g}' for name, value in found.values.items())}")
        goal = ad.set_point(robot, poses.q_goal)
        paper = ad.track(robot, goal, ad.Pid(GAINS, feedforward=False), q_start=poses.q_start)
        print(f"  the paper's gains as torques: {paper.message}")


if __name__ == "__main__":
    into = Path(sys.argv[1] if len(sys.argv) > 1 else "results/many_arms")
    into.mkdir(parents=True, exist_ok=True)
    random_arms(into)
    tuned_gains()
