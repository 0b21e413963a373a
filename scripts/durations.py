"""Every reference answer with all its digits: to compare the results before and after a change of the code.

Of each problem: the duration T, the cost J, whether it is certified, the number of arcs, the CPU seconds. The clock
ends no solve, and one process solves all. Answers are kept in the file as they come: a run that is ended goes on where
it stopped.

    scripts/durations.py before.json; …; scripts/durations.py after.json
    scripts/durations.py --only friction some.json                  # problems with this word in their names
    scripts/durations.py --compare before.json after.json
"""

import argparse
import json
import math
import time
import warnings
from argparse import Namespace
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path

from search_statistics import problem_of

import armdyn as ad
from armdyn.control.tracking.arrival import Arrival
from armdyn.files import write_whole
from armdyn.optimal.verify.optimum import trajectory_cost
from armdyn.paper import PAYLOADS
from armdyn.paper.continuous_pid import ContinuousLoop, simulate
from armdyn.paper.printed.loop import PAPER_RULE

POSES = {
    "r": ([-math.pi / 2], [math.pi / 20]),
    "rr": ([-math.pi / 2, math.pi / 84], [math.pi / 20, -math.pi / 84]),
    "rrr": ([-math.pi / 2, math.pi / 84, -math.pi / 84], [math.pi / 20, -math.pi / 84, math.pi / 84]),
}
CASES = Path(__file__).parents[1] / "tests" / "cases"
SEED = 5601
"""Of the random pairs; neither tuned on nor reported elsewhere."""
SAME = 1e-9
"""Largest relative difference of two numbers that is not listed."""
Row = dict[str, float | bool | int | None]


@cache
def arm(name: str, mass: float = 0.1006) -> ad.Robot:
    """One of the paper's arms."""
    return ad.Robot.from_spec(ad.ArmSpec.paper(name), ad.Payload(mass=mass))


def example(name: str, robot: ad.Robot | None = None, **more: object) -> ad.MinimumTimeProblem:
    """The paper's motion of an arm."""
    start, goal = POSES[name]
    return ad.MinimumTimeProblem(robot or arm(name), q_start=start, q_goal=goal, **more)


def problems() -> Iterator[tuple[str, ad.MinimumTimeProblem]]:
    """Names and problems."""
    for name in POSES:
        for mass in PAYLOADS:
            yield f"{name} {1000 * mass:g} g minimum time", example(name, arm(name, mass))
            effort = {"effort_weight": 1.0, "effort_limit": 30.0}
            yield f"{name} {1000 * mass:g} g time-energy", example(name, arm(name, mass), **effort)
    yield from published()
    yield from limited()
    yield from passive()
    yield from with_effort()
    for name in ("rr", "rrr"):
        for kind in ("position", "velocity"):
            yield from random_pairs(name, "paper", kind, 4)
        yield from random_pairs(name, "random", "random", 6)


def published() -> Iterator[tuple[str, ad.MinimumTimeProblem]]:
    """Problems of tests/cases."""
    for path in sorted(CASES.glob("*/case.json")):
        case = json.loads(path.read_text())
        robot = ad.Robot.from_urdf(path.with_name("robot.urdf"))
        limits = {"effort_limit": (case["tau_lower"], case["tau_upper"]), "velocity_limit": math.inf}
        limits["position_limit"] = (-math.inf, math.inf)
        yield case["name"], ad.MinimumTimeProblem(robot, q_start=case["q0"], q_goal=case["qf"], **limits)


def limited() -> Iterator[tuple[str, ad.MinimumTimeProblem]]:
    """Problems whose limits of velocity, position and acceleration are met, and with friction."""
    yield "r velocity limit", example("r", velocity_limit=10.0)
    yield "rr velocity limit", example("rr", velocity_limit=8.0)
    yield "rrr velocity limit", example("rrr", velocity_limit=12.0)
    yield "rr no position limit", example("rr", position_limit=(-math.inf, math.inf))
    yield "rrr no position limit", example("rrr", position_limit=(-math.inf, math.inf))
    swing = {"q_start": [-2.5, -1.5], "q_goal": [2.0, 1.0]}
    light = arm("rr", 0.05)
    yield "rr swing, velocity limit", ad.MinimumTimeProblem(light, **swing, velocity_limit=[12.0, 15.0])
    folded = ad.MinimumTimeProblem(light, **swing, position_limit=([-2.6, -1.6], [2.1, 1.1]))
    yield "rr swing, position limit", folded
    yield "rr swing, velocity and position limit", folded.variant(velocity_limit=30.0)
    yield "rr position limit", example("rr", position_limit=([-1.7, -0.5], [0.3, 0.5]))
    yield "rrr position limit", example("rrr", position_limit=(-1.7, 1.7))
    yield "rr acceleration limit", example("rr", acceleration_limit=150.0)
    yield "rr friction", example("rr", arm("rr").with_friction(0.1, 0.2))
    yield "rrr friction", example("rrr", arm("rrr").with_friction(0.02, 0.05))
    yield "rr friction, velocity limit", example("rr", arm("rr").with_friction(0.1, 0.2), velocity_limit=8.0)


def passive() -> Iterator[tuple[str, ad.MinimumTimeProblem]]:
    """Joints without a motor, of docs/passive.md."""
    for name, goal, limit in (
        ("cart_pole", [1.0, 0.0], 20.0),
        ("cart_pole", [1.0, 0.0], 3.0),
        ("cart_pole", [0.0, math.pi], 20.0),
        ("cart_pole", [0.0, math.pi], 10.0),
        ("pendubot", [math.pi, 0.0], 6.0),
        ("pendubot", [math.pi, 0.0], 1.5),
    ):
        robot = ad.Robot.from_library(name, effort_limit=limit)
        problem = ad.MinimumTimeProblem(robot, q_start=[0.0, 0.0], q_goal=goal)
        yield f"{name} to {goal[0]:.3g}, {goal[1]:.3g} with {limit:g}", problem
    slow = {"effort_limit": 10.0, "velocity_limit": [0.8, math.inf]}
    robot = ad.Robot.from_library("cart_pole")
    yield "cart_pole, velocity limit", ad.MinimumTimeProblem(robot, q_start=[0.0, 0.0], q_goal=[1.0, 0.0], **slow)


def with_effort() -> Iterator[tuple[str, ad.MinimumTimeProblem]]:
    """Least time and energy where limits are met, with friction, and of a passive joint."""
    for name in ("r", "rr"):
        yield f"{name} time-energy, 3 N m", example(name, effort_weight=1.0)
    yield "rr time-energy, weight 0.1", example("rr", effort_weight=0.1)
    yield "r time-energy, velocity limit", example("r", effort_weight=1.0, velocity_limit=8.0)
    friction = arm("rr").with_friction(0.1, 0.2)
    yield "rr time-energy, friction", example("rr", friction, effort_weight=1.0, effort_limit=30.0)
    robot = ad.Robot.from_library("cart_pole")
    yield "cart_pole time-energy", ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[1, 0], effort_weight=0.05)


def random_pairs(name: str, links: str, limits: str, count: int) -> Iterator[tuple[str, ad.MinimumTimeProblem]]:
    """Random poses and payloads, of scripts/search_statistics.py."""
    given = Namespace(arm=name, links=links, limits=limits, reach=2.5, payload=0.3, seed=SEED)
    for k in range(count):
        yield f"{name} random {k}, {links} links, {limits} limits", problem_of(given, k)


def solved(problem: ad.MinimumTimeProblem) -> Row:
    """The answer to a problem."""
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(workers=1, time_limit=math.inf, bound=False))
    known = {"certified": bool(solution.certified), "arcs": len(solution.arcs)}
    if not solution.moves:
        return known
    cost = trajectory_cost(solution.trajectory, problem.effort_weights())
    return {"T": solution.duration, "J": cost, **known}


def by_pid(name: str, mass: float) -> Row:
    """Arrival and end of the paper's PID loop."""
    start, goal = POSES[name]
    run = simulate(ContinuousLoop(arm(name, mass), goal), start, Arrival(PAPER_RULE))
    return {"arrival": run.arrival_time, "end": float(run.trajectory.q[-1, 0])}


def answers() -> Iterator[tuple[str, Callable[[], Row]]]:
    """Names, and what computes their rows."""
    for name, problem in problems():
        yield name, partial(solved, problem)
    for name in POSES:
        for mass in PAYLOADS:
            yield f"{name} {1000 * mass:g} g PID", partial(by_pid, name, mass)


def keep(path: Path, word: str) -> None:
    """Compute the answers that a file lacks."""
    rows = read(path) if path.exists() else {}
    for name, answer in answers():
        if name in rows or word not in name:
            continue
        began = time.process_time()
        rows[name] = answer()
        rows[name]["cpu"] = round(time.process_time() - began, 2)
        write_whole(path, json.dumps(rows, indent=1).encode())
        print(name, rows[name], flush=True)


def read(path: Path) -> dict[str, Row]:
    """Rows by name."""
    return json.loads(path.read_text())


def differences(before: dict[str, Row], after: dict[str, Row]) -> Iterator[str]:
    """Lines on every relative difference of more than `SAME`, and on other changes."""
    for name in [*before, *(name for name in after if name not in before)]:
        if name not in before or name not in after:
            yield f"{name}: only {'after' if name in after else 'before'}"
            continue
        for key in ("T", "J", "arrival", "end", "certified", "arcs"):
            a, b = before[name].get(key), after[name].get(key)
            if a is None or b is None or key in ("certified", "arcs"):
                off = "" if a == b else ", changed"
            else:
                off = "" if abs(b / a - 1) <= SAME else f", {b / a - 1:+.1e}"
            if off:
                yield f"{name}: {key} {a} -> {b}{off}"


def compare(before: dict[str, Row], after: dict[str, Row]) -> None:
    """Print the differences of two files, the largest of T and J, and the CPU seconds of both."""
    print(*differences(before, after), sep="\n")
    names = [name for name in before if name in after]
    for key in ("T", "J"):
        both = [(before[name][key], after[name][key]) for name in names if key in before[name] and key in after[name]]
        changes = [b / a - 1 for a, b in both] or [0.0]
        print(f"{key}: {len(both)} answers, {min(changes):+.1e} to {max(changes):+.1e}")
    for key, unit in (("certified", ""), ("cpu", " s")):
        sums = (round(sum(rows[name].get(key, 0) for name in names)) for rows in (before, after))
        print(f"{key}: {' -> '.join(map(str, sums))}{unit}")


def main() -> None:
    """Compute answers, or compare two files of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path, nargs="?", help="where the answers are kept")
    parser.add_argument("--only", default="", metavar="WORD", help="problems with this word in their names")
    parser.add_argument("--compare", type=Path, nargs=2, metavar="FILE")
    given = parser.parse_args()
    warnings.simplefilter("ignore", ad.ArmdynWarning)
    if given.compare:
        compare(*map(read, given.compare))
    elif given.file:
        keep(given.file, given.only)
    else:
        parser.error("give a file, where the answers are kept, or --compare BEFORE AFTER")


if __name__ == "__main__":
    main()
