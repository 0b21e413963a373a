"""Study task "reserve": the torque that a fastest motion should leave to feedback, in every case."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from armdyn.arguments import checked, number
from armdyn.optimal import MinimumTimeOptions
from armdyn.studies.reserve import RESERVES, reserve_curve
from armdyn.studies.rows import Value
from armdyn.studies.tasks.closed_loop import ClosedLoopTask
from armdyn.studies.tasks.task import INTERRUPTED, CaseResult


@dataclass(frozen=True, kw_only=True)
class ReserveTask(ClosedLoopTask):
    """Reserve with which likely arms settle soonest.

    Attributes:
        reserves: that are tried, each at least 0 and below 1.
    """

    name: ClassVar = "reserve"
    section: ClassVar = "reserve"
    outcomes: ClassVar = ("settled_time_s", "duration_s")
    own: ClassVar = ("controller", "form", "duration", "reserves")

    duration: float = checked(number, 2.5, unit="s", sign="positive")
    reserves: Sequence[float] = RESERVES

    @property
    def chosen(self) -> tuple[str, ...]:
        """The reserves."""
        return ("reserve", "velocity_reserve")

    def run(self, own: Mapping[str, Value]) -> CaseResult:
        """Try the reserves of a case."""
        curve = reserve_curve(
            self.problems.problem(own), [self.controller_of(own)], reserves=self.reserves, loop=self.loop_of(own),
            duration=self.duration, options=MinimumTimeOptions(workers=1),
        )  # fmt: skip
        if curve.interrupted:
            return CaseResult(status=INTERRUPTED)
        best = curve.best
        if best is None:
            return CaseResult(status="no_reference", message="no reserve has a usable motion")
        facts = {
            "best_reserve": best.reserve, "duration_s": best.duration, "settled_time_s": best.worst,
            "mean_settled_time_s": best.mean, "settled": best.count, "arms": len(best.settled),
        }  # fmt: skip
        good = best.count == len(best.settled)
        message = f"reserve {best.reserve:g}: the last of {len(best.settled)} arms settles after {best.worst:.4f} s"
        return CaseResult(status="settled" if good else "not_settled", good=good, message=message, facts=facts)
