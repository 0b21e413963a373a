"""Study task "tune": the best gains of a controller in every case."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from armdyn.arguments import checked, one_of
from armdyn.control.laws.registry import CONTROLLERS
from armdyn.studies.plants import Plants, Range
from armdyn.studies.rows import Value
from armdyn.studies.tasks.closed_loop import REFERENCES, ClosedLoopTask, options_of, plants_of
from armdyn.studies.tasks.task import INTERRUPTED, CaseResult
from armdyn.studies.tuning.families import Ramps, family_named
from armdyn.studies.tuning.tune import TuneOptions, tune


@dataclass(frozen=True, kw_only=True)
class TuneTask(ClosedLoopTask):
    """Gains, and the duration of a ramp, with which the worst arm at the ends of the ranges settles soonest.

    Attributes:
        plants: ranges of the arms, by the names of `Plants`.
        ramp_range: durations of the ramp [s], of the reference "ramp".
        options: of the search, by the names of `TuneOptions`.
    """

    name: ClassVar = "tune"
    section: ClassVar = "tune"
    outcomes: ClassVar = ("settled_time_s", "overshoot")
    own: ClassVar = (*ClosedLoopTask.own, "plants", "ramp_range", "options")

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

    def run(self, own: Mapping[str, Value]) -> CaseResult:
        """Tune the controller of a case."""
        robot, ends = self.problems.robot(own), self.problems.ends(own)
        motion = Ramps(*ends, self.ramp_range) if self.reference == "ramp" else self.reference_of(own)
        if isinstance(motion, CaseResult):
            return motion
        form: Any = self.form or "computed_torque"
        family = family_named(self.controller, robot, ends[1], form=form)
        plants = plants_of(self.plants, robot).corners(robot)
        found = tune(robot, motion, family, plants, loop=self.loop_of(own), options=self._search)
        if found.status == "interrupted":
            return CaseResult(status=INTERRUPTED)
        worst = found.training
        facts = {
            **found.values, "reference_s": found.reference.duration, "settled_time_s": worst.settled_time,
            "overshoot": worst.overshoot, "index": worst.index, "settled": worst.settled,
            "arms": worst.count, "evaluations": found.evaluations,
        }  # fmt: skip
        good = worst.settled == worst.count
        return CaseResult(status="settled" if good else "not_settled", good=good, message=found.message, facts=facts)
