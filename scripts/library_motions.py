"""Minimum times between random poses, of every arm that goes by a name: docs/arms.md.

Poses are drawn from the middle 80 % of the position limits (an endless joint's from ±π), the same for a seed, and
drawn again where the arm cannot be held still. Where the URDF has no torque limits, 10 N m serve. Curves' margins of
torques were tuned on some of these poses: UR3 1, UR10 1, xArm7 0, TIAGo's arms, Baxter 0, Panda 0 to 2, UR5 0 and 1.

    scripts/library_motions.py --out docs/arms.md
    scripts/library_motions.py --only panda ur5
"""

import argparse
import statistics
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

import armdyn as ad
from armdyn.errors import ArmdynError, ArmdynWarning
from armdyn.models.robots.library import LIBRARY_ARMS
from armdyn.optimal.curves.program import torque_equations

EFFORT = 10.0
"""Where a URDF has no torque limit [N m or N]."""


@dataclass(frozen=True)
class Row:
    """Outcome of one pair of poses."""

    arm: str
    joints: int
    pair: int
    solution: ad.Solution | None = None
    failure: str = ""

    def cells(self) -> list[str]:
        """For the table."""
        if self.solution is None:
            return [self.arm, str(self.joints), str(self.pair), *([""] * 6), self.failure]
        found, certificate = self.solution, self.solution.certificate
        bound, gap = ("", "") if found.gap is None else (f"{found.lower_bound:.6f}", f"{100 * found.gap:.3f} %")
        verdict = "certified" if found.certified else "usable" if found.usable else found.message
        return [
            self.arm, str(self.joints), str(self.pair), f"{found.duration:.6f}", bound, gap,
            f"{certificate.goal_error:.0e}", f"{certificate.limit_violation:.0e}", f"{found.solve_time:.1f}", verdict,
        ]  # fmt: skip


def poses(robot: ad.Robot, limit: np.ndarray, seed: int) -> np.ndarray:
    """Start and goal at which the arm can be held still [rad or m], shape (2, nv)."""
    lower, upper = (np.clip(x, -np.pi, np.pi) for x in (robot.limits.position_lower, robot.limits.position_upper))
    random, found = np.random.default_rng(seed), []
    for _ in range(1000):
        q = (lower + upper) / 2 + 0.8 * random.uniform(-0.5, 0.5, robot.nv) * (upper - lower)
        hold = pin.computeGeneralizedGravity(robot.model, robot.model.createData(), robot.configuration(q))
        if np.all(np.abs(hold) < limit):
            found.append(q)
        if len(found) == 2:
            return np.array(found)
    raise ad.ProblemError(f"{robot.name} can be held still in none of 1000 random poses")


def library(name: str, pairs: int, time_limit: float) -> Iterator[Row]:
    """The rows of one arm."""
    robot = ad.Robot.from_library(name)
    own = robot.limits.effort_upper
    limit = np.where(np.isfinite(own) & (own > 0), own, EFFORT)
    torque_equations(ad.Dynamics(robot, free_last_body=True), True)  # the machine code is built before, not measured
    for seed in range(pairs):
        try:
            start, goal = poses(robot, limit, seed)
            problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, effort_limit=limit)
            found = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(calm=0, time_limit=time_limit))
            yield Row(name, robot.nv, seed, found)
        except ArmdynError as error:
            yield Row(name, robot.nv, seed, failure=f"{type(error).__name__}: {error}")


def summary(rows: list[Row]) -> str:
    """One sentence for the library's arms."""
    found = [row.solution for row in rows if row.solution is not None]
    usable, certified = (sum(getattr(one, what) for one in found) for what in ("usable", "certified"))
    gaps = [100 * one.gap for one in found if one.gap is not None and one.usable]
    times = [one.solve_time for one in found]
    claims = "locally optimal, or proven within 0.1 %"
    said = f"Of {len(rows)} motions {usable} are usable and {certified} certified ({claims})"
    if gaps:
        middle, most = statistics.median(gaps), max(gaps)
        said += f"; {len(gaps)} have a proven gap, {middle:.3f} % in the median, {most:.2f} % at most"
    return f"{said}. An answer took {statistics.median(times):.1f} s in the median, {max(times):.1f} s at most."


def table(head: list[str], rows: list[list[str]]) -> str:
    """In Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    """Solve, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=list(LIBRARY_ARMS), metavar="NAME")
    parser.add_argument("--pairs", type=int, default=3, help="of poses of every arm")
    parser.add_argument("--time-limit", type=float, default=60.0, metavar="S")
    parser.add_argument("--out", type=Path, metavar="FILE")
    given = parser.parse_args()
    warnings.simplefilter("ignore", ArmdynWarning)
    rows = []
    for name in given.only:
        for row in library(name, given.pairs, given.time_limit):
            rows.append(row)
            print(" ".join(row.cells()), file=sys.stderr, flush=True)
    head = ["arm", "joints", "pair", "t_f [s]", "bound [s]", "gap", "goal [rad]", "limits", "time [s]", "verdict"]
    said = (__doc__ or "").split("\n\n")[1]
    text = [
        "# Arms by name\n",
        f"Written by `scripts/library_motions.py`: the fastest motions, with `calm=0`.\n\n{said}\n",
    ]
    text += [f"{summary(rows)}\n", table(head, [row.cells() for row in rows]), ""]
    page = "\n".join(text)
    if given.out:
        given.out.write_text(page)
    else:
        print(page)


if __name__ == "__main__":
    main()
