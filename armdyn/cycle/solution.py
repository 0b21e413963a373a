"""The fastest cycle found, and how far to trust it."""

from collections import defaultdict
from dataclasses import dataclass

from armdyn.arrays import Array
from armdyn.cycle.cycle import Cycle, Leg
from armdyn.cycle.joining import joined
from armdyn.locks import cached_property
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.problem.status import Status
from armdyn.optimal.proof.certificate import percent
from armdyn.optimal.proof.deciding import Share
from armdyn.reprs import brief, called
from armdyn.trajectory import Trajectory

_MOST_LIMITS = 3
"""Limits that are named as deciding the time."""


@brief
@dataclass(frozen=True, eq=False)
class CycleLeg:
    """A move of a cycle, solved.

    Attributes:
        leg: the step.
        solution: its motion.
        begin: when it begins in the cycle [s].
    """

    leg: Leg
    solution: Solution
    begin: float

    @property
    def duration(self) -> float:
        """[s]."""
        return self.solution.duration


@brief
@dataclass(frozen=True, eq=False)
class CycleSolution:
    """A cycle's motions from stop to stop, and how far to trust them.

    Attributes:
        cycle: what was asked.
        status: a `Status`; what is not solved is so because of the first leg that is not.
        message: the same for people.
        legs: the moves in the order in which they are done; empty where no way through the stops was found.
        lower_bound: no cycle through these steps is faster [s]; None: unknown.
        branches: durations of all moves that were solved on the way, of other branches, too.
        solve_time: wall time [s].
    """

    cycle: Cycle
    status: Status
    message: str
    legs: tuple[CycleLeg, ...] = ()
    lower_bound: float | None = None
    branches: int = 0
    solve_time: float = 0.0

    def __str__(self) -> str:
        """A paragraph: duration, verdict, limits that decide the time, bound."""
        return _paragraph(self)

    def _words(self) -> list[str]:
        """Words of `repr`."""
        found = f"{self.duration:.6g} s" if self.legs else "no motion"
        return [called(self.cycle.robot.name), found, self.verdict]

    @property
    def success(self) -> bool:
        """Whether every move was solved, and none was stopped."""
        return self.status is Status.SOLVED and all(leg.solution.success for leg in self.legs)

    @property
    def usable(self) -> bool:
        """Whether every move lands, keeps all limits, and can be held where it ends."""
        return len(self.legs) == len(self.cycle.moves) and all(leg.solution.usable for leg in self.legs)

    @property
    def duration(self) -> float:
        """Time of the cycle, rests included [s]; nan where there is none."""
        return float(sum(leg.duration for leg in self.legs)) + self.cycle.dwell if self.legs else float("nan")

    @property
    def gap(self) -> float | None:
        """How far the duration is above the proven lower bound, as a part of it; None without either."""
        if self.lower_bound is None or not self.usable:
            return None
        return self.duration / self.lower_bound - 1

    @property
    def verdict(self) -> str:
        """How near to the optimum the cycle is proven to be, in a few words."""
        if not self.usable:
            return "not usable"
        return "no bound" if self.gap is None else f"gap {percent(max(self.gap, 0.0))}"

    @property
    def stops(self) -> tuple[Array, ...]:
        """Joint positions at the stops [rad or m], each of shape (nv,)."""
        if not self.legs:
            return ()
        problems = [leg.solution.problem for leg in self.legs]
        return (*(problem.poses[0] for problem in problems), problems[-1].poses[-1])

    @property
    def shares(self) -> tuple[Share, ...]:
        """Shares of the limits in the duration, most first; those of the rests are not among them."""
        parts: defaultdict[tuple[str, str], float] = defaultdict(float)
        for leg in self.legs:
            for one in leg.solution.decides:
                parts[one.limit, one.joint] += one.part * leg.duration / self.duration
        return tuple(sorted((Share(*of, part) for of, part in parts.items()), key=lambda one: -one.part))

    @property
    def decides(self) -> tuple[tuple[str, float], ...]:
        """Names of the limits that decide the duration, and of the rests, and their shares in it, most first."""
        rests = [("rests", self.cycle.dwell / self.duration)] if self.cycle.dwell and self.legs else []
        return tuple(sorted([*((one.name, one.part) for one in self.shares), *rests], key=lambda one: -one[1]))

    @cached_property
    def trajectory(self) -> Trajectory:
        """The whole cycle as one motion, which knows what the arm carries when.

        Raises:
            TrajectoryError: there is no motion.
        """
        return joined(self.cycle, [(one.leg, one.solution) for one in self.legs])


def _paragraph(solution: CycleSolution) -> str:
    name = solution.cycle.robot.name
    if not solution.legs:
        return f"No motion was found for the cycle of {name}: {solution.message}."
    moves, rests = solution.duration - solution.cycle.dwell, solution.cycle.dwell
    said = [
        f"The fastest cycle found for {name} takes {solution.duration:.6f} s: {len(solution.legs)} moves of "
        f"{moves:.6f} s and rests of {rests:.6g} s."
    ]
    if not solution.usable:
        said.append(f"It is not executable: {solution.message}.")
    elif solution.gap is not None:
        said.append(f"It is proven to be at most {percent(max(solution.gap, 0.0))} slower than the fastest possible.")
    if most := solution.decides[:_MOST_LIMITS]:
        said.append(f"Its time is decided by {', '.join(f'{what} ({percent(part)})' for what, part in most)}.")
    if solution.lower_bound is not None:
        said.append(f"No cycle is faster than {solution.lower_bound:.6f} s.")
    said.append(f"It was solved in {solution.solve_time:.1f} s; {solution.branches} motions were solved on the way.")
    return " ".join(said)
