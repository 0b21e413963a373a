"""How often the search finds the best motion, of random problems: docs/search.md.

A problem is a pair of poses, uniform within ±--reach, and a payload, drawn for its number and the seed alone. Poses
that the motors cannot hold at rest are drawn again. The problem is solved as a user would, and by a search of --times
as many guesses that refines all that it finds; their results are compared. "hit" is within 1e-6 of the better of the
two. Times are CPU seconds of all processes. Tune on other seeds than those reported. Results are kept in --out, a line
each, as they come: a run that is ended goes on where it stopped.

    scripts/search_statistics.py --arm rrr --pairs 100 --seed 7 --out rrr.jsonl
    scripts/search_statistics.py --arm rr --links random --limits random --seed 7 --out random.jsonl
    scripts/search_statistics.py --table rr.jsonl rrr.jsonl
"""

import argparse
import json
import multiprocessing
import resource
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.stats import binomtest

import armdyn as ad
from armdyn.optimal.minimum_time import solve_task
from armdyn.optimal.problem.choices import SEARCH_LEVELS
from armdyn.optimal.problem.task import Task

SAME = 1e-6
"""Largest relative difference of two durations that count as the same optimum."""
SPEED = 15.0
"""Velocity limit of --limits velocity, and the middle of those of --limits random [rad/s]: as fast as the paper's arms
move in the mean from pose to pose, so that slower limits shape the motion and faster ones mostly do not."""
FACTOR = 3.0
"""Random links and limits are the paper's, times a factor between 1 / FACTOR and FACTOR, uniform in its logarithm."""


def problem_of(given: argparse.Namespace, k: int) -> ad.MinimumTimeProblem:
    """Problem number k."""
    random = np.random.default_rng([given.seed, k])
    joints, payload = len(given.arm), random.uniform(0, given.payload)
    poses = random.uniform(-given.reach, given.reach, (2, joints))
    spec = ad.ArmSpec.paper(given.arm)
    if given.links != "paper":
        drawn = [other_link(random) if given.links == "other" else random_link(random, link) for link in spec.links]
        spec = ad.ArmSpec(name=given.arm, links=tuple(drawn))
    robot = ad.Robot.from_spec(spec, ad.Payload(mass=payload))
    limits: dict[str, object] = {}
    if given.limits == "none":
        limits["position_limit"] = (-np.inf, np.inf)
    elif given.limits == "velocity":
        limits["velocity_limit"] = SPEED
    elif given.limits == "random":
        limits["effort_limit"] = spec.effort_limit * factors(random, joints)
        limits["velocity_limit"] = SPEED * factors(random, joints)
    most = np.broadcast_to(limits.get("effort_limit", spec.effort_limit), joints)
    for pose in poses:
        while np.any(np.abs(pin.computeGeneralizedGravity(robot.model, robot.model.createData(), pose)) > most):
            pose[:] = random.uniform(-given.reach, given.reach, joints)
    return ad.MinimumTimeProblem(robot, q_start=poses[0], q_goal=poses[1], **limits)


def factors(random: np.random.Generator, size: int) -> np.ndarray:
    """Random factors, shape (size,)."""
    return FACTOR ** random.uniform(-1, 1, size)


def random_link(random: np.random.Generator, link: ad.LinkSpec) -> ad.LinkSpec:
    """A link of another length and mass: its centre of mass and its inertia follow by scale."""
    longer, heavier = factors(random, 2)
    inertia = link.inertia * heavier * longer**2
    return ad.LinkSpec(length=link.length * longer, com=link.com * longer, mass=link.mass * heavier, inertia=inertia)


def other_link(random: np.random.Generator) -> ad.LinkSpec:
    """A link of 0.1 to 0.4 m and 0.05 to 0.4 kg: a rod with its mass somewhere about its middle."""
    length, mass = random.uniform(0.1, 0.4), random.uniform(0.05, 0.4)
    com = random.uniform(0.35, 0.8) * length
    return ad.LinkSpec(length=length, com=com, mass=mass, inertia=mass * length**2 / 12)


def solved(problem: ad.MinimumTimeProblem, options: ad.MinimumTimeOptions, times: float = 1.0) -> dict[str, object]:
    """Solution of a problem by a multiple of the options' guesses, those of curves excepted; its CPU time."""
    started, before = time.perf_counter(), cpu_seconds()
    task = Task.of(problem, options)
    starts = round(times * task.policy.search.starts)
    found = solve_task(replace(task, policy=task.policy.changed("search", starts=starts)))
    return {
        "duration": found.duration if found.usable else None,
        "certified": bool(found.certified),
        "time": cpu_seconds() - before,
        "wall": time.perf_counter() - started,
        "message": found.message,
    }


def cpu_seconds() -> float:
    """Of this process and of its workers that have ended."""
    for worker in multiprocessing.active_children():
        worker.join()
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def measured(given: argparse.Namespace) -> None:
    """Solve the problems that the file lacks."""
    kept = lines_of(given.out) if given.out.exists() else []
    done = {line["pair"] for line in kept}
    for k in range(given.first, given.first + given.pairs):
        if k in done:
            continue
        problem = problem_of(given, k)
        options = ad.MinimumTimeOptions(calm=0, search=given.search, time_limit=given.time_limit)
        line: dict[str, object] = {"pair": k, "case": case_of(given), "own": solved(problem, options)}
        if given.times:
            more = replace(options, search="thorough", time_limit=20 * given.time_limit)
            line["more"] = solved(problem, more, given.times / SEARCH_LEVELS["thorough"])
        with given.out.open("a") as file:
            file.write(json.dumps(line) + "\n")
        print(f"{line['case']} {k}: {line['own']['message']}", file=sys.stderr, flush=True)


def case_of(given: argparse.Namespace) -> str:
    """The solved problems, in words."""
    limits = {
        "none": "no limits of position",
        "position": "±π",
        "velocity": f"±π, {SPEED:g} rad/s",
        "random": "±π, random torque and velocity limits",
    }[given.limits]
    links = {"paper": "paper's links", "other": "other links", "random": "random links"}[given.links]
    poses = f"poses within ±{given.reach:.3g} rad"
    return (
        f"{given.arm.upper()}, {links}, {limits}, {poses}, to {given.payload:g} kg, seed {given.seed}, {given.search}"
    )


def lines_of(path: Path) -> list[dict]:
    """Of a file of results."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def share(count: int, of: int) -> str:
    """A part of many, with the 95 % interval of Wilson."""
    interval = binomtest(count, of).proportion_ci(method="wilson")
    return f"{count} of {of} ({100 * interval.low:.0f} to {100 * interval.high:.0f} %)"


def row(lines: list[dict]) -> list[str]:
    """Of the table."""
    times = [line["own"]["time"] for line in lines]
    certified = share(sum(line["own"]["certified"] for line in lines), len(lines))
    both = [line for line in lines if "more" in line]
    hits, worst = "", ""
    if both:
        losses = [loss(line) for line in both]
        hits = share(sum(lost <= SAME for lost in losses), len(both))
        worst = f"{100 * max(losses):.2g} %"
    return [lines[0]["case"], certified, hits, worst, f"{statistics.median(times):.2f}", f"{max(times):.1f}"]


def loss(line: dict) -> float:
    """By how much the search of a line is slower than the best known."""
    own, more = (line[key]["duration"] or np.inf for key in ("own", "more"))
    return 0.0 if own <= more else own / more - 1


def table(paths: list[Path]) -> str:
    """Of files of results, in Markdown."""
    head = ["problems", "certified", "hit", "worst loss", "median [CPU s]", "longest [CPU s]"]
    rows = [head, ["---"] * len(head), *(row(lines_of(path)) for path in paths)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in rows)


def main() -> None:
    """Measure, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--arm", choices=("r", "rr", "rrr"), default="rrr")
    parser.add_argument("--links", choices=("paper", "other", "random"), default="paper")
    parser.add_argument("--limits", choices=("position", "none", "velocity", "random"), default="position")
    parser.add_argument("--reach", type=float, default=np.pi, metavar="RAD", help="poses are uniform within ± this")
    parser.add_argument("--payload", type=float, default=0.3, metavar="KG", help="the largest")
    parser.add_argument("--search", choices=SEARCH_LEVELS, default="normal")
    parser.add_argument("--pairs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first pair")
    parser.add_argument("--seed", type=int, default=1, help="1 was used for tuning")
    parser.add_argument("--times", type=int, default=20, help="guesses of the search that it is held against; 0: none")
    parser.add_argument("--time-limit", type=float, default=60.0, metavar="S")
    parser.add_argument("--out", type=Path, metavar="FILE")
    parser.add_argument("--table", type=Path, nargs="+", metavar="FILE", help="print the files' rows, and end")
    given = parser.parse_args()
    if given.out is None and given.table is None:
        parser.error("give --out FILE, where results are kept, or --table FILE")
    if given.out is not None:
        measured(given)
    print(table(given.table or [given.out]))


if __name__ == "__main__":
    main()
