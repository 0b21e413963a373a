"""The one place that knows what depends on the kind of problem, and the tuned numbers."""

from dataclasses import dataclass, replace
from typing import Self

from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.scheme import Scheme


@dataclass(frozen=True, kw_only=True)
class Policy:
    """How a kind of problem is gone about."""

    joints: int
    continuous_torque: bool = False

    @classmethod
    def of(cls, problem: MinimumTimeProblem) -> Self:
        """The policy for a problem."""
        return cls(joints=problem.robot.nv, continuous_torque=problem.continuous_torque)

    def scheme(self, options: MinimumTimeOptions) -> Scheme:
        """How motion becomes unknowns; where the torque may not jump, it is linear between knots."""
        scheme = options.scheme(self.joints)
        return replace(scheme, control="linear") if self.continuous_torque else scheme
