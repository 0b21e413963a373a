"""Input and output of a peer: the same for all, so that the benchmark can time and kill them alike."""

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import armdyn as ad
from armdyn.optimal.mesh.starts import spline
from armdyn.paper import PAYLOAD, example

INTERVALS = 50

_LIBRARY_POSES = {
    "panda": ((0, -0.785, 0, -2.356, 0, 1.571, 0.785), (1.0, 0.2, 0.5, -1.5, 0.3, 2.0, -0.5)),
    "ur5": ((0, -1.571, 1.571, -1.571, -1.571, 0), (1.2, -0.8, 0.9, -1.0, -1.2, 0.5)),
}

CASES = ("r", "rr", "rrr", *_LIBRARY_POSES)

DROPPED_UP_TO = 10.0
"""A first run longer than this [s] is counted instead of being dropped as a warm-up."""


@dataclass(frozen=True)
class Answer:
    """Of one run: the motion, and how the solver says that it ended."""

    trajectory: ad.Trajectory
    status: str


def problem(case: str) -> ad.MinimumTimeProblem:
    """The paper's Examples 1 to 3 with 100.6 g, or an arm of the library."""
    if case in _LIBRARY_POSES:
        start, goal = _LIBRARY_POSES[case]
        return ad.MinimumTimeProblem(ad.Robot.from_library(case), q_start=start, q_goal=goal)
    one = example(case, "minimum_time")
    robot = ad.Robot.from_spec(ad.ArmSpec.paper(one.arm), payload=ad.Payload(mass=PAYLOAD))
    return ad.MinimumTimeProblem(robot, q_start=one.q_start, q_goal=one.q_goal)


def straight_line(motion: ad.MinimumTimeProblem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, positions and velocities of the guess that everybody would make first, at the knots.

    Its duration is that of armdyn's own guess, a plausible one: from 1 s SNOPT does not end on RR.
    """
    duration = spline(motion, []).duration
    s = np.linspace(0, 1, INTERVALS + 1)[:, None]
    start, goal = np.asarray(motion.q_start), np.asarray(motion.q_goal)
    q = start + s * (goal - start)
    return s.ravel() * duration, q, np.tile((goal - start) / duration, (INTERVALS + 1, 1))


def main(build: Callable[[ad.MinimumTimeProblem, str], Callable[[], Answer]], methods: tuple[str, ...]) -> None:
    """Build, run, time; a trajectory file, and one line of JSON on standard output.

    Args:
        build: (problem, method) to a function that solves once, with everything built.
        methods: the names that `build` knows.
    """
    parser = argparse.ArgumentParser()
    parser.add_argument("--case", choices=CASES, required=True)
    parser.add_argument("--method", choices=methods, required=True)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    started = time.perf_counter()
    solve = build(problem(options.case), options.method)
    building = time.perf_counter() - started
    times: list[float] = []
    while len(times) <= options.repeats and not (times and times[0] > DROPPED_UP_TO and len(times) == options.repeats):
        started = time.perf_counter()
        answer = solve()
        times.append(time.perf_counter() - started)
    kept = times[1:] if len(times) > options.repeats else times
    answer.trajectory.save(options.out)
    print(json.dumps({"status": answer.status, "building": building, "first": times[0], "times": kept}))
    sys.stdout.flush()
