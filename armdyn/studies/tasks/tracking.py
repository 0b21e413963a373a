"""Study tasks of a controller in every case: on one arm, on random arms, its best gains, its best reserve."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from armdyn.arguments import checked, number, one_of, whole
from armdyn.control.laws.registry import CONTROLLERS
from armdyn.control.tracking.track import track
from armdyn.optimal import MinimumTimeOptions, MinimumTimeProblem
from armdyn.studies.monte_carlo import monte_carlo
from armdyn.studies.plant_study import MonteCarloOptions
from armdyn.studies.plants import MAX_ARMS, Plants, Range
from armdyn.studies.reserve import RESERVES, reserve_curve
from armdyn.studies.rows import Value
from armdyn.studies.tasks.closed_loop import REFERENCES, ClosedLoopTask, options_of, plants_of
from armdyn.studies.tasks.task import INTERRUPTED, CaseResult
from armdyn.studies.tuning.families import Ramps, family_named
from armdyn.studies.tuning.tune import TuneOptions, tune
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, kw_only=True)
class TrackTask(ClosedLoopTask):
    """Tracking by one arm; settings "plant_…" change it against the controller's model."""

    name: ClassVar = "track"
    signs: ClassVar = ClosedLoopTask.signs | dict.fromkeys(
        ("plant_payload", "plant_damping", "plant_friction"), "not negative"
    )

    def run(self, settings: Mapping[str, Value], motion: Trajectory) -> CaseResult:
        """Run the loop of a case."""
        run = track(
            self.problems.robot(settings), motion, self.controller_of(settings), self.problems.plant(settings),
            self.loop_of(settings), self.duration, tolerance=self.tolerance,
        )  # fmt: skip
        facts = {
            "reference_s": motion.duration, "settled_time_s": run.settled_time, "failed_time_s": run.failed_time,
            "error_at_end": run.error_at_end, "peak_error": run.peak_error, "saturated": run.saturated,
            "overshoot": float(np.max(run.overshoot)), "limits_exceeded": "; ".join(run.limits_exceeded),
        }  # fmt: skip
        return CaseResult(status=str(run.status), good=run.settled, message=run.message, facts=facts)


@dataclass(frozen=True, kw_only=True)
class MonteCarloTask(ClosedLoopTask):
    """Success rate and settled times of a controller on random arms.

    Attributes:
        plants: ranges that the arms are drawn from, by the names of `Plants`.
        count: number of arms.
        within: time in which an arm must settle [s]; None: `duration`.
    """

    name: ClassVar = "monte-carlo"
    outcomes: ClassVar = ("worst_settled_time_s", "success_rate")
    keys: ClassVar = (*ClosedLoopTask.keys, "plants", "count", "within")

    plants: Mapping[str, Any] = field(default_factory=dict)
    count: int = checked(whole, 100, least=1, most=MAX_ARMS)
    within: float | None = checked(number, None, unit="s", sign="not negative")

    def __post_init__(self) -> None:
        super().__post_init__()
        options_of(Plants, self.plants, "plants")

    def run(self, settings: Mapping[str, Value], motion: Trajectory) -> CaseResult:
        """Run all arms of a case."""
        options = MonteCarloOptions(count=self.count, duration=self.duration, tolerance=self.tolerance, workers=1)
        robot, controller = self.problems.robot(settings), self.controller_of(settings)
        found = monte_carlo(robot, motion, controller, plants_of(self.plants, robot), self.loop_of(settings), options)
        if found.interrupted:
            return CaseResult(status=INTERRUPTED)
        rate = found.success(np.inf if self.within is None else self.within)
        median, most = found.quantiles((0.5, 1.0))
        facts = {
            "reference_s": motion.duration, "success_rate": rate.rate, "success_rate_low": rate.low,
            "success_rate_high": rate.high, "median_settled_time_s": median, "worst_settled_time_s": most,
            "worst_arm": found.worst.k, "beyond_limits": len(found.beyond_limits),
        }  # fmt: skip
        return CaseResult(status="done", good=rate.settled == rate.count, message=f"settled: {rate}", facts=facts)


@dataclass(frozen=True, kw_only=True)
class TuneTask(ClosedLoopTask):
    """Gains, and the duration of a ramp, with which the worst arm at the ends of the ranges settles soonest.

    Attributes:
        plants: ranges of the arms, by the names of `Plants`.
        ramp_range: durations of the ramp [s], of the reference "ramp".
        options: of the search, by the names of `TuneOptions`.
    """

    name: ClassVar = "tune"
    outcomes: ClassVar = ("settled_time_s", "overshoot")
    keys: ClassVar = (*ClosedLoopTask.keys, "plants", "ramp_range", "options")

    controller: str = checked(one_of, "pid", known=tuple(CONTROLLERS))
    reference: str = checked(one_of, "ramp", known=REFERENCES)
    plants: Mapping[str, Any] = field(default_factory=dict)
    ramp_range: Range = (0.1, 1.0)
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        options_of(Plants, self.plants, "plants")
        self._search  # noqa: B018  # wrong options are refused now

    @property
    def required(self) -> tuple[str, ...]:
        """No settings."""
        return ()

    @property
    def chosen(self) -> tuple[str, ...]:
        """Gains of the controller, and the ramp's duration."""
        return (*CONTROLLERS[self.controller].settings, "ramp")

    @property
    def _search(self) -> TuneOptions:
        others = {"duration": self.duration, "tolerance": self.tolerance, "workers": 1}
        return options_of(TuneOptions, self.options, "options", **others)

    def reference_of(self, settings: Mapping[str, Value]) -> Any:
        """Ramps, or the fastest motion of a case."""
        if self.reference == "ramp":
            return Ramps(*self.problems.ends(settings), self.ramp_range)
        return super().reference_of(settings)

    def run(self, settings: Mapping[str, Value], motion: Trajectory | Ramps) -> CaseResult:
        """Tune the controller of a case."""
        robot, form = self.problems.robot(settings), self.form or "computed_torque"
        family = family_named(self.controller, robot, self.problems.ends(settings)[1], form=form)  # type: ignore[arg-type]
        plants = plants_of(self.plants, robot).corners(robot)
        found = tune(robot, motion, family, plants, loop=self.loop_of(settings), options=self._search)
        if found.status == "interrupted":
            return CaseResult(status=INTERRUPTED)
        worst = found.training
        facts = {
            **found.values, "reference_s": found.reference.duration, "settled_time_s": worst.settled_time,
            "overshoot": worst.overshoot, "index": worst.index, "settled": worst.settled,
            "arms": worst.count, "beyond_limits": worst.beyond_limits, "evaluations": found.evaluations,
        }  # fmt: skip
        good = worst.settled == worst.count
        return CaseResult(status="settled" if good else "not_settled", good=good, message=found.message, facts=facts)


@dataclass(frozen=True, kw_only=True)
class ReserveTask(ClosedLoopTask):
    """Reserve with which likely arms settle soonest.

    Attributes:
        reserves: that are tried, each at least 0 and below 1.
    """

    name: ClassVar = "reserve"
    outcomes: ClassVar = ("settled_time_s", "duration_s")
    keys: ClassVar = ("controller", "form", "duration", "reserves")

    duration: float = checked(number, 2.5, unit="s", sign="positive")
    reserves: Sequence[float] = RESERVES

    @property
    def chosen(self) -> tuple[str, ...]:
        """The reserves."""
        return ("reserve", "velocity_reserve")

    def reference_of(self, settings: Mapping[str, Value]) -> MinimumTimeProblem:
        """The problem of a case: one motion is solved for each reserve."""
        return self.problems.problem(settings)

    def run(self, settings: Mapping[str, Value], problem: MinimumTimeProblem) -> CaseResult:
        """Try the reserves of a case."""
        curve = reserve_curve(
            problem, [self.controller_of(settings)], reserves=self.reserves, loop=self.loop_of(settings),
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
            "beyond_limits": best.beyond_limits,
        }  # fmt: skip
        good = best.count == len(best.settled)
        message = f"reserve {best.reserve:g}: the last of {len(best.settled)} arms settles after {best.worst:.4f} s"
        return CaseResult(status="settled" if good else "not_settled", good=good, message=message, facts=facts)
