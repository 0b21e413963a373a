"""Result of a solve: a motion, its certificate, and the statistics of its search."""

from __future__ import annotations

from dataclasses import dataclass

from armdyn.models.scene.collision import Clearance
from armdyn.optimal.constraints.constraint import ConstraintReport
from armdyn.optimal.curves.goals import GoalResult
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status, Violation
from armdyn.optimal.verify.arc import Arc
from armdyn.optimal.verify.certificate import Certificate
from armdyn.optimal.verify.costates import Costates, Phases, Sensitivities, Share, sensitivities
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Result:
    """Fields of a `Solution`, which documents them, and properties; what its words are made of."""

    success: bool
    status: Status
    message: str
    problem: MinimumTimeProblem
    duration: float
    trajectory: Trajectory
    certificate: Certificate
    arcs: tuple[Arc, ...] = ()
    phases: Phases | None = None
    costates: Costates | None = None
    local_optima: tuple[float, ...] = ()
    intervals: int = 0
    iterations: int = 0
    solve_time: float = 0.0
    worst_violation: Violation | None = None
    clearance: Clearance | None = None
    constraint_reports: tuple[ConstraintReport, ...] = ()
    via_times: tuple[float, ...] = ()
    goals: tuple[GoalResult, ...] = ()
    moves: bool = True
    decides: tuple[Share, ...] = ()
    calm: float = 0.0
    search_remark: str = ""
    followed: tuple[str, ...] = ()

    @property
    def feasible(self) -> bool:
        """Whether the replay reaches the goal within all limits and path constraints. See also `usable`."""
        return self.certificate.usable and not any(kept.reasons for kept in self.constraint_reports)

    @property
    def usable(self) -> bool:
        """Whether the motion is feasible, and the motors can hold the arm at the goal, if it should rest there."""
        return self.feasible and self.problem.holding_deficit is None

    @property
    def certified(self) -> bool:
        """Whether the motion is feasible, and extremal or proven within 0.1 % of the least duration of all motions."""
        return self.feasible and self.certificate.ok

    @property
    def lower_bound(self) -> float | None:
        """Proven lower bound on the duration of all motions [s]; None: unknown."""
        return self.certificate.lower_bound

    @property
    def gap(self) -> float | None:
        """Relative gap (duration - lower_bound) / lower_bound; None without a bound or a feasible motion."""
        return self.certificate.gap if self.feasible else None

    @property
    def gap_proven(self) -> bool:
        """Whether `gap` is between a bound and a feasible motion that ends on the goal."""
        return self.feasible and self.certificate.gap_proven

    @property
    def replay_error(self) -> float:
        """Largest joint position error of the replay at the goal [rad or m]."""
        return self.certificate.goal_error

    @property
    def replay_velocity_error(self) -> float:
        """Largest joint velocity error of the replay at the goal [rad/s or m/s]."""
        return self.certificate.goal_velocity_error

    def sensitivities(self) -> Sensitivities | None:
        """Derivatives of t_f with respect to payload and limits; None without costates."""
        return None if self.costates is None else sensitivities(self.problem, self.costates)
