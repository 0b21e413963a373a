"""How often the search finds the best motion, of random problems: docs/search.md.

A problem is a pair of poses within ±2.5 rad and a payload, drawn for its number and the seed alone. It is solved as a
user would, and by a search of --times as many guesses that refines all that it finds; what the two find is compared.
"hit" is within 1e-6 of the better of the two. Tune on other seeds than those reported. Results are kept in --out, a
line each, as they come: a run that is ended goes on where it stopped.

    scripts/search_statistics.py --arm rrr --pairs 100 --seed 2 --out rrr.jsonl
    scripts/search_statistics.py --arm rrr --links other --limits none --payload 1.0 --seed 3 --out other.jsonl
    scripts/search_statistics.py --table rr.jsonl rrr.jsonl
"""

import argparse
import json
import statistics
import sys
import time
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

import armdyn as ad
from armdyn.optimal.task.effort import EFFORTS
from armdyn.optimal.task.policy import Policy

REACH = 2.5
"""Of the poses [rad]."""
SAME = 1e-6
"""Of the better duration: the two found the same."""
SPEED = 15.0
"""Velocity limit of --limits velocity [rad/s]."""


def problem_of(given: argparse.Namespace, k: int) -> ad.MinimumTimeProblem:
    """The problem of a number."""
    random = np.random.default_rng([given.seed, k])
    payload, (start, goal) = random.uniform(0, given.payload), random.uniform(-REACH, REACH, (2, len(given.arm)))
    spec = ad.ArmSpec.paper(given.arm)
    if given.links == "other":
        spec = ad.ArmSpec(name=given.arm, links=tuple(other_link(random) for _ in given.arm))
    robot = ad.Robot.from_spec(spec, ad.Payload(mass=payload))
    limits = {"none": {"position_limit": (-np.inf, np.inf)}, "velocity": {"velocity_limit": SPEED}, "position": {}}
    return ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, **limits[given.limits])


def other_link(random: np.random.Generator) -> ad.LinkSpec:
    """A link of 0.1 to 0.4 m and 0.05 to 0.4 kg: a rod with its mass somewhere about its middle."""
    length, mass = random.uniform(0.1, 0.4), random.uniform(0.05, 0.4)
    com = random.uniform(0.35, 0.8) * length
    return ad.LinkSpec(length=length, com=com, mass=mass, inertia=mass * length**2 / 12)


def solved(problem: ad.MinimumTimeProblem, options: ad.MinimumTimeOptions) -> dict[str, object]:
    """What came of a problem."""
    started = time.perf_counter()
    found = ad.solve_minimum_time(problem, options)
    return {
        "duration": found.duration if found.usable else None,
        "certified": bool(found.certified),
        "time": time.perf_counter() - started,
        "message": found.message,
    }


def measured(given: argparse.Namespace) -> None:
    """Solve what is not in the file yet."""
    kept = lines_of(given.out) if given.out.exists() else []
    done = {line["pair"] for line in kept}
    for k in range(given.first, given.first + given.pairs):
        if k in done:
            continue
        problem = problem_of(given, k)
        options = ad.MinimumTimeOptions(effort=given.effort, time_limit=given.time_limit)
        line: dict[str, object] = {"pair": k, "case": case_of(given), "own": solved(problem, options)}
        if given.times:
            starts = given.times * Policy.of(problem).search.starts
            more = ad.MinimumTimeOptions(effort="thorough", starts=starts, time_limit=20 * given.time_limit)
            line["more"] = solved(problem, more)
        with given.out.open("a") as file:
            file.write(json.dumps(line) + "\n")
        print(f"{line['case']} {k}: {line['own']['message']}", file=sys.stderr, flush=True)


def case_of(given: argparse.Namespace) -> str:
    """What was solved, in words."""
    limits = {"none": "no limits of position", "position": "±π", "velocity": f"±π, {SPEED:g} rad/s"}[given.limits]
    return f"{given.arm.upper()}, {given.links}, {limits}, to {given.payload:g} kg, seed {given.seed}, {given.effort}"


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
    head = ["problems", "certified", "hit", "worst loss", "median [s]", "longest [s]"]
    rows = [head, ["---"] * len(head), *(row(lines_of(path)) for path in paths)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in rows)


def main() -> None:
    """Measure, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--arm", choices=("r", "rr", "rrr"), default="rrr")
    parser.add_argument("--links", choices=("paper", "other"), default="paper", help="the paper's or random ones")
    parser.add_argument("--limits", choices=("position", "none", "velocity"), default="position")
    parser.add_argument("--payload", type=float, default=0.3, metavar="KG", help="the largest")
    parser.add_argument("--effort", choices=EFFORTS, default="normal")
    parser.add_argument("--pairs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first pair")
    parser.add_argument("--seed", type=int, default=1, help="1 is what was tuned on")
    parser.add_argument("--times", type=int, default=20, help="guesses of the search that it is held against; 0: none")
    parser.add_argument("--time-limit", type=float, default=60.0, metavar="S")
    parser.add_argument("--out", type=Path, metavar="FILE")
    parser.add_argument("--table", type=Path, nargs="+", metavar="FILE", help="print what files hold, and end")
    given = parser.parse_args()
    if given.out is None and given.table is None:
        parser.error("give --out FILE, where results are kept, or --table FILE")
    if given.out is not None:
        measured(given)
    print(table(given.table or [given.out]))


if __name__ == "__main__":
    main()
