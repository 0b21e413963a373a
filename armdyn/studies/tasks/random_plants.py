"""Study task "monte-carlo": a controller on many random arms in every case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from armdyn.models.robots.robot import Robot
from armdyn.studies.monte_carlo import monte_carlo
from armdyn.studies.plant_study import MonteCarloOptions
from armdyn.studies.plants import Plants, Range
from armdyn.studies.rows import Value
from armdyn.studies.tasks.closed_loop import ClosedLoopTask
from armdyn.studies.tasks.task import INTERRUPTED, CaseResult, finite

PLANT_RANGES = ("payload_range", "friction_range", "damping_range", "start_error", "arms_seed")
"""Keys of the ranges that arms are drawn from."""


@dataclass(frozen=True, kw_only=True)
class PlantsTask(ClosedLoopTask):
    """A controller on arms that are drawn from ranges.

    Attributes:
        payload_range: multiples of the model's payload; None: 0.8 to 1.2 where it has one.
        friction_range: Coulomb friction of a joint [N m or N].
        damping_range: viscous friction of a joint [N m s/rad or N s/m].
        start_error: greatest distance of a joint from the start [rad or m].
        arms_seed: of the draws.
    """

    payload_range: Range | None = None
    friction_range: Range = (0.0, 0.0)
    damping_range: Range = (0.0, 0.0)
    start_error: float = 0.0
    arms_seed: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._plants(self.payload_range or (1.0, 1.0))  # wrong ranges are refused now

    def plants(self, robot: Robot) -> Plants:
        """Ranges for a model.

        Raises:
            ProblemError: the model carries no payload that could differ.
        """
        loaded = robot.payload is not None and robot.payload.mass > 0
        return self._plants(self.payload_range or ((0.8, 1.2) if loaded else (1.0, 1.0))).check(robot)

    def _plants(self, payload: Range) -> Plants:
        return Plants(
            payload=payload, coulomb=self.friction_range, damping=self.damping_range, start=self.start_error,
            seed=self.arms_seed,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class MonteCarloTask(PlantsTask):
    """Success rate and settled times of a controller on random arms.

    Attributes:
        count: number of arms.
        within: time in which an arm must settle [s]; None: `duration`.
    """

    name: ClassVar = "monte-carlo"
    section: ClassVar = "monte-carlo"
    outcomes: ClassVar = ("worst_settled_time_s", "success_rate")
    own: ClassVar = (*ClosedLoopTask.own, *PLANT_RANGES, "count", "within")

    count: int = 100
    within: float | None = None

    def work(self, settings: Mapping[str, Value], guess: bytes, revisit: bool = False) -> CaseResult:
        """Run all arms of a case."""
        own = self.problems.settings(settings)
        self.check(list(own))
        motion = self.reference_of(own)
        if isinstance(motion, CaseResult):
            return motion
        options = MonteCarloOptions(count=self.count, duration=self.duration, tolerance=self.tolerance, workers=1)
        robot, controller = self.problems.robot(own), self.controller_of(own)
        found = monte_carlo(robot, motion, controller, self.plants(robot), self.loop_of(own), options)
        if found.interrupted:
            return CaseResult(status=INTERRUPTED)
        rate = found.success(np.inf if self.within is None else self.within)
        median, most = found.quantiles((0.5, 1.0))
        facts = {
            "reference_s": motion.duration, "success_rate": rate.rate, "success_rate_low": rate.low,
            "success_rate_high": rate.high, "median_settled_time_s": finite(median),
            "worst_settled_time_s": finite(most), "worst_arm": found.worst.k,
        }  # fmt: skip
        return CaseResult(status="done", good=rate.settled == rate.count, message=f"settled: {rate}", facts=facts)
