"""The one place that knows what depends on the kind of problem, and the tuned numbers."""

from dataclasses import dataclass
from typing import Self

from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.scheme import Scheme


@dataclass(frozen=True, kw_only=True)
class Policy:
    """How a kind of problem is gone about.

    Attributes:
        joints: their number.
        condensed: few unknowns will do for a search.
        graded: meshes are dense at both ends: larger arms reach their velocity limits, and the ramps to and from
            rest are a thousandth of the motion.
        tie: cost of full torques against the 1 of time on arms of more than three joints, of which some are idle;
            with a tenth of it IPOPT takes two to ten times as long.
        flat: IPOPT's error at which it may stop once the equations of motion hold: some joints are idle, and it
            walks on in a flat valley. None: it goes on.
        flat_with_rows: the same with conditions on the way: where idle joints are is the obstacles' business.
    """

    joints: int
    condensed: bool
    graded: bool
    tie: float
    flat: float | None
    flat_with_rows: float = 1e-4

    @classmethod
    def of(cls, problem: MinimumTimeProblem) -> Self:
        """The policy for a problem."""
        joints = problem.robot.nv
        small = joints <= 3
        return cls(
            joints=joints,
            condensed=small,
            graded=not small,
            tie=0.0 if problem.effort_weight > 0 or small else 1e-2,
            flat=None if small else 1e-5,
        )

    def scheme(self, options: MinimumTimeOptions) -> Scheme:
        """How motion becomes unknowns."""
        return options.scheme(self.joints)
