"""The one place that knows what depends on the kind of problem, and the tuned numbers."""

from dataclasses import dataclass
from typing import Self

from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.scheme import Scheme


@dataclass(frozen=True, kw_only=True)
class Policy:
    """How a kind of problem is gone about."""

    joints: int

    @classmethod
    def of(cls, problem: MinimumTimeProblem) -> Self:
        """The policy for a problem."""
        return cls(joints=problem.robot.nv)

    def scheme(self, options: MinimumTimeOptions) -> Scheme:
        """How motion becomes unknowns."""
        return options.scheme(self.joints)
