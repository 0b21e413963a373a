"""Study task "track": a controller has the arm of every case follow a motion."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from armdyn.control.tracking.track import track
from armdyn.studies.rows import Value
from armdyn.studies.tasks.closed_loop import ClosedLoopTask
from armdyn.studies.tasks.task import CaseResult


@dataclass(frozen=True, kw_only=True)
class TrackTask(ClosedLoopTask):
    """Tracking by one arm; settings "plant_…" change it against the controller's model."""

    name: ClassVar = "track"
    section: ClassVar = "track"
    signs: ClassVar = ClosedLoopTask.signs | dict.fromkeys(
        ("plant_payload", "plant_damping", "plant_friction"), "not negative"
    )

    def run(self, own: Mapping[str, Value]) -> CaseResult:
        """Run the loop of a case."""
        controller, motion = self.controller_of(own), self.reference_of(own)
        if isinstance(motion, CaseResult):
            return motion
        run = track(
            self.problems.robot(own), motion, controller, self.problems.plant(own), self.loop_of(own),
            self.duration, tolerance=self.tolerance,
        )  # fmt: skip
        facts = {
            "reference_s": motion.duration, "settled_time_s": run.settled_time, "failed_time_s": run.failed_time,
            "error_at_end": run.error_at_end, "peak_error": run.peak_error, "saturated": run.saturated,
            "overshoot": float(np.max(run.overshoot)),
        }  # fmt: skip
        return CaseResult(status=str(run.status), good=run.settled, message=run.message, facts=facts)
