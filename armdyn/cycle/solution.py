"""Solution of a cycle: its moves, status, bound, and the whole as one motion with the payload of each piece."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial, reduce

import numpy as np

from armdyn.arrays import Array
from armdyn.cycle.cycle import Cycle, Leg, RestPlace
from armdyn.cycle.steps import Grasp, Move, Release
from armdyn.errors import TrajectoryError
from armdyn.locks import cached_property
from armdyn.models.robots.loads import load_of
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.answer.words import MOST_LIMITS
from armdyn.optimal.problem.status import Status
from armdyn.optimal.verify.certificate import VELOCITY_TOLERANCE
from armdyn.optimal.verify.costates import Share
from armdyn.reprs import brief, called, gap_words, percent
from armdyn.trajectory import Trajectory

_LAST = 1e-6
"""Rest that carries an event at the end of a cycle [s]: far below any controller's tick."""


def joined(cycle: Cycle, legs: Sequence[tuple[Leg, Solution]]) -> Trajectory:
    """The moves of a cycle and its rests as one motion of several pieces.

    A grasp or release without a rest is the event of the piece that follows; at the end a rest of 1 µs.

    Args:
        cycle: its steps.
        legs: its moves, solved, in order; perhaps the first of them only.

    Raises:
        TrajectoryError: there is no move, or a move does not end where the next one begins.
    """
    if not legs:
        raise TrajectoryError("there is no motion: no move of the cycle is solved")
    pieces, event = list[Trajectory](), ""
    at = legs[0][1].problem.poses[0]
    for stop, (leg, solution) in zip(cycle.stops, legs, strict=False):
        *rests, (event, _) = _dwells(cycle, stop, at)
        pieces += [piece for _, piece in rests if piece is not None]
        move, arm = solution.trajectory, leg.robot
        pieces.append(move.as_piece(name=leg.name, load=load_of(arm), event=event))
        at = move.q[-1] if move.ends is None else move.ends[1, 0]
    if len(legs) == len(cycle.moves):
        pieces += [piece for _, piece in _dwells(cycle, cycle.stops[-1], at, _LAST) if piece is not None]
    landing = max(VELOCITY_TOLERANCE, *(solution.certificate.landing for _, solution in legs))  # of a usable move
    return reduce(partial(Trajectory.join, tolerance=landing), pieces)


def _dwells(cycle: Cycle, stop: RestPlace, q: Array, least: float = 0.0) -> Iterator[tuple[str, Trajectory | None]]:
    """Rests at a stop, each with its event and at least `least` seconds long; last the event without a rest, or ""."""
    event = ""
    for k in stop.rests:
        step, arm = cycle.steps[k - 1], cycle.arms[k]
        if isinstance(step, Move):
            continue
        event = "grasp" if isinstance(step, Grasp) else "release" if isinstance(step, Release) else event or "wait"
        if dwell := max(step.dwell, least):
            torque = np.zeros_like(q) if cycle.conditions.get("kinematic") else arm.holding_torque(q)
            still = Trajectory.at_rest(q, torque, dwell, arm.joint_names, model_hash=arm.model_hash)
            yield event, still.as_piece(name=cycle.name_of(k), load=load_of(arm), event=event)
            event = ""
    yield event if event != "wait" else "", None


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
        """Duration of the move [s]."""
        return self.solution.duration


@brief
@dataclass(frozen=True, eq=False)
class CycleSolution:
    """A cycle's motions from stop to stop, with status and proven bound.

    Attributes:
        cycle: the problem: robot, start and steps.
        status: a `Status`; that of the first leg that is not solved.
        message: the status in words.
        legs: the moves in order of execution; empty where no path through the stops was found.
        lower_bound: no cycle through these steps is faster [s]; None: unknown.
        branches: durations of all moves that were solved, of other branches, too.
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
        name = self.cycle.robot.name
        if not self.legs:
            return f"No motion was found for the cycle of {name}: {self.message}."
        moves, rests = self.duration - self.cycle.dwell, self.cycle.dwell
        parts = [
            f"The fastest cycle found for {name} takes {self.duration:.6f} s: {len(self.legs)} moves of "
            f"{moves:.6f} s and rests of {rests:.6g} s."
        ]
        if not self.usable:
            parts.append(f"It is not executable: {self.message}.")
        elif self.gap is not None:
            parts.append(f"It is {gap_words(self.gap)}.")
        if self.cycle.conditions.get("kinematic"):
            parts.append("Torques are left out.")
        if most := self.decides[:MOST_LIMITS]:
            parts.append(f"Its time is decided by {', '.join(f'{what} ({100 * part:.3g} %)' for what, part in most)}.")
        if self.lower_bound is not None:
            parts.append(f"No cycle is faster than {self.lower_bound:.6f} s.")
        parts.append(f"It was solved in {self.solve_time:.1f} s; {self.branches} motions were solved on the way.")
        return " ".join(parts)

    def _repr_parts(self) -> list[str]:
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
        """The proven gap to the optimum in a few words."""
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
        """Active limits and rests by name, each with its share of the cycle's duration, largest first."""
        rests = [("rests", self.cycle.dwell / self.duration)] if self.cycle.dwell and self.legs else []
        return tuple(sorted([*((one.name, one.part) for one in self.shares), *rests], key=lambda one: -one[1]))

    @cached_property
    def trajectory(self) -> Trajectory:
        """The whole cycle as one motion; each piece has the payload that the arm carries.

        Raises:
            TrajectoryError: there is no motion.
        """
        return joined(self.cycle, [(one.leg, one.solution) for one in self.legs])
