"""Study task "monte-carlo": a controller on many random arms in every case."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from armdyn.arguments import checked, number, whole
from armdyn.studies.monte_carlo import monte_carlo
from armdyn.studies.plant_study import MonteCarloOptions
from armdyn.studies.plants import MAX_ARMS, Plants
from armdyn.studies.rows import Value
from armdyn.studies.tasks.closed_loop import ClosedLoopTask, options_of, plants_of
from armdyn.studies.tasks.task import INTERRUPTED, CaseResult


@dataclass(frozen=True, kw_only=True)
class MonteCarloTask(ClosedLoopTask):
    """Success rate and settled times of a controller on random arms.

    Attributes:
        plants: ranges that the arms are drawn from, by the names of `Plants`.
        count: number of arms.
        within: time in which an arm must settle [s]; None: `duration`.
    """

    name: ClassVar = "monte-carlo"
    section: ClassVar = "monte-carlo"
    outcomes: ClassVar = ("worst_settled_time_s", "success_rate")
    own: ClassVar = (*ClosedLoopTask.own, "plants", "count", "within")

    plants: Mapping[str, Any] = field(default_factory=dict)
    count: int = checked(whole, 100, least=1, most=MAX_ARMS)
    within: float | None = checked(number, None, unit="s", sign="not negative")

    def __post_init__(self) -> None:
        super().__post_init__()
        options_of(Plants, self.plants, "plants")

    def run(self, own: Mapping[str, Value]) -> CaseResult:
        """Run all arms of a case."""
        motion = self.reference_of(own)
        if isinstance(motion, CaseResult):
            return motion
        options = MonteCarloOptions(count=self.count, duration=self.duration, tolerance=self.tolerance, workers=1)
        robot, controller = self.problems.robot(own), self.controller_of(own)
        found = monte_carlo(robot, motion, controller, plants_of(self.plants, robot), self.loop_of(own), options)
        if found.interrupted:
            return CaseResult(status=INTERRUPTED)
        rate = found.success(np.inf if self.within is None else self.within)
        median, most = found.quantiles((0.5, 1.0))
        facts = {
            "reference_s": motion.duration, "success_rate": rate.rate, "success_rate_low": rate.low,
            "success_rate_high": rate.high, "median_settled_time_s": median, "worst_settled_time_s": most,
            "worst_arm": found.worst.k,
        }  # fmt: skip
        return CaseResult(status="done", good=rate.settled == rate.count, message=f"settled: {rate}", facts=facts)
