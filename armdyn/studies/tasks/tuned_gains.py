"""Study task "tune": the best gains of a controller in every case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from armdyn.studies.plants import Range
from armdyn.studies.rows import Value
from armdyn.studies.tasks.closed_loop import ClosedLoopTask
from armdyn.studies.tasks.random_plants import PLANT_RANGES, PlantsTask
from armdyn.studies.tasks.task import INTERRUPTED, CaseResult, finite
from armdyn.studies.tuning.families import Ramps, family_named
from armdyn.studies.tuning.tune import TuneOptions, tune

_OPTIONS = ("index", "overshoot", "seed", "members", "generations", "time_limit")


@dataclass(frozen=True, kw_only=True)
class TuneTask(PlantsTask):
    """Gains, and the duration of a ramp, with which the worst arm at the ends of the ranges settles soonest.

    Attributes:
        ramp_range: durations of the ramp [s], of the reference "ramp".
        index: see `TuneOptions`, as all below.
        overshoot: likewise.
        seed: likewise.
        members: likewise.
        generations: likewise.
        time_limit: likewise.
    """

    name: ClassVar = "tune"
    section: ClassVar = "tune"
    outcomes: ClassVar = ("settled_time_s", "overshoot")
    own: ClassVar = (*ClosedLoopTask.own, *PLANT_RANGES, "ramp_range", *_OPTIONS)

    controller: str = "pid"
    reference: str = "ramp"
    ramp_range: Range = (0.1, 1.0)
    index: str = "settled"
    overshoot: float = TuneOptions.overshoot
    seed: int = TuneOptions.seed
    members: int = TuneOptions.members
    generations: int = TuneOptions.generations
    time_limit: float = TuneOptions.time_limit

    def __post_init__(self) -> None:
        super().__post_init__()
        self.options  # noqa: B018  # wrong options are refused now

    @property
    def options(self) -> TuneOptions:
        """Options of the search."""
        given: dict[str, Any] = {name: getattr(self, name) for name in _OPTIONS}
        return TuneOptions(**given, duration=self.duration, tolerance=self.tolerance, workers=1)

    def work(self, settings: Mapping[str, Value], guess: bytes, revisit: bool = False) -> CaseResult:
        """Tune the controller of a case."""
        own = self.problems.settings(settings)
        robot, ends = self.problems.robot(own), self.problems.ends(own)
        motion = Ramps(*ends, self.ramp_range) if self.reference == "ramp" else self.reference_of(own)
        if isinstance(motion, CaseResult):
            return motion
        family, plants = family_named(self.controller, robot, ends[1]), self.plants(robot).corners(robot)
        found = tune(robot, motion, family, plants, loop=self.loop_of(own), options=self.options)
        if found.status == "interrupted":
            return CaseResult(status=INTERRUPTED)
        worst = found.training
        facts = {
            **found.values, "reference_s": found.reference.duration, "settled_time_s": finite(worst.settled_time),
            "overshoot": finite(worst.overshoot), "index": finite(worst.index), "settled": worst.settled,
            "arms": worst.count, "evaluations": found.evaluations,
        }  # fmt: skip
        good = worst.settled == worst.count
        return CaseResult(status="settled" if good else "not_settled", good=good, message=found.message, facts=facts)
