"""An optimum refined."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from armdyn.optimal.arcs.phases import Phases
from armdyn.optimal.path_constraints.tightened import ConstraintReports
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.proof.certificate import Certificate, certify
from armdyn.optimal.proof.sensitivity import Share
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Optimum:
    """A motion with its replay, certificate and cost.

    Attributes:
        trajectory: replayed torques: states and torques fit each other to the integrator's tolerance.
        certificate: of it.
        cost: what it is judged by [s].
        intervals: of the mesh that it was read from.
        phases: its arcs; None: they could not be resolved, and the certificate says why.
        iterations: of IPOPT.
        worst_violation: of the mesh's solution, if that did not converge.
        reports: the path constraints, if there are any.
        via_times: when it passes the via points [s].
        decides: how much of the time each limit decides, most first, where there are no arcs that say so.
        calm: time that was given for calm joints [s].
    """

    trajectory: Trajectory
    certificate: Certificate
    cost: float
    intervals: int
    phases: Phases | None = None
    iterations: int = 0
    worst_violation: Violation | None = None
    reports: ConstraintReports | None = None
    via_times: tuple[float, ...] = ()
    decides: tuple[Share, ...] = ()
    calm: float = 0.0

    @classmethod
    def of(
        cls,
        problem: MinimumTimeProblem,
        replay: Trajectory,
        intervals: int,
        phases: Phases | None = None,
        remark: str = "",
        **more: Any,
    ) -> Self:
        """A replay with its certificate and its cost J.

        Args:
            problem: that it solves.
            replay: whose states are what its torques lead to.
            intervals: of the mesh that it was read from.
            phases: its arcs; None: they are not known.
            remark: why not.
            more: other attributes.
        """
        motion = replace(replay, name="minimum time")
        certificate = certify(problem, motion, phases, remark)
        return cls(motion, certificate, trajectory_cost(motion, problem.effort_weights()), intervals, phases, **more)

    @property
    def error(self) -> float:
        """The worst error: distance from the goal [rad or m], or excess over a limit as a part of it."""
        return max(self.certificate.goal_error, self.certificate.limit_violation)

    @property
    def within_limits(self) -> bool:
        """Whether its replay keeps all limits of torque, velocity and position."""
        return self.certificate.keeps_limits

    @property
    def missed(self) -> tuple[str, ...]:
        """Violated path constraints, in words."""
        return self.reports.reasons if self.reports else ()

    def landed(self, tolerance: float) -> bool:
        """Whether its replay ends within a tolerance of the goal [rad or m], as of `Certificate.ends_within`."""
        return self.certificate.ends_within(tolerance)

    def usable(self, tolerance: float) -> bool:
        """Whether its replay ends within a tolerance of the goal [rad or m], within all limits and path constraints."""
        return self.landed(tolerance) and self.within_limits and not self.missed


def trajectory_cost(motion: Trajectory, weight: ArrayLike) -> float:
    """J = ∫ (1 + ½ Σ wᵢ τᵢ²) dt [s], exact for linear and held torques.

    Args:
        motion: of which times and torques count.
        weight: w [1/(N m)²], one number or one per joint.
    """
    a, b = motion.tau[:-1], motion.tau_end
    squares = np.sum(np.asarray(weight) * (a * a + a * b + b * b), axis=1) / 3
    return float(motion.duration + np.diff(motion.t) @ squares / 2)
