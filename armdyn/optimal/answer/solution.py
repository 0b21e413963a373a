"""What comes out of a solve, converged or not."""

from dataclasses import dataclass

from armdyn.models.scene.collision import Clearance
from armdyn.optimal.arcs.arc import Arc
from armdyn.optimal.arcs.phases import Phases
from armdyn.optimal.conditions.condition import Kept
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status, Violation
from armdyn.optimal.proof.certificate import Certificate
from armdyn.optimal.proof.sensitivity import Sensitivities, sensitivities
from armdyn.optimal.search.goals import GoalTried
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Solution:
    """A motion and how far to trust it.

    Attributes:
        success: converged, and the replay landed on the goal within all limits.
        status: a `Status`.
        message: the same for people.
        problem: what was asked.
        duration: t_f [s]; of the last iterate if the solve failed: look at `moves` before it is shown to anybody.
        trajectory: the motion; the last iterate if the solve failed.
        certificate: what was checked; `certificate.ok` is more than `success`.
        arcs: which limit every joint is on, and for how long; empty if that was not resolved.
        phases: the arcs as solved, with costates; None likewise.
        local_optima: durations of the other optima met [s], increasing; those that were not refined to
            the coarse mesh's accuracy.
        intervals: of the last mesh.
        iterations: of the solver, over all meshes and starts.
        solve_time: wall time [s].
        worst_violation: what is worst violated, by the solver's last iterate or by the motion; None if all is kept.
        clearance: where the motion comes nearest to an obstacle or to itself; None if neither was to be kept clear of.
        kept: how the motion keeps each of the conditions along the way; empty without any.
        via_times: when it passes the via points [s].
        goals: all joint positions tried that reach a goal pose, fastest first; empty if there was but one.
        moves: its torques lead to the goal, keep all conditions and, to a thousandth, all limits: where `success` is
            missing it is the best so far; else it is no motion, and `duration` says nothing.
    """

    success: bool
    status: Status
    message: str
    problem: MinimumTimeProblem
    duration: float
    trajectory: Trajectory
    certificate: Certificate
    arcs: tuple[Arc, ...] = ()
    phases: Phases | None = None
    local_optima: tuple[float, ...] = ()
    intervals: int = 0
    iterations: int = 0
    solve_time: float = 0.0
    worst_violation: Violation | None = None
    clearance: Clearance | None = None
    kept: tuple[Kept, ...] = ()
    via_times: tuple[float, ...] = ()
    goals: tuple[GoalTried, ...] = ()
    moves: bool = True

    @property
    def replay_error(self) -> float:
        """Largest joint position error of the replay at the goal [rad or m]."""
        return self.certificate.goal_error

    @property
    def replay_velocity_error(self) -> float:
        """Largest joint velocity error of the replay at the goal [rad/s or m/s]."""
        return self.certificate.goal_velocity_error

    def sensitivities(self) -> Sensitivities | None:
        """How t_f answers to payload and limits; None if the arcs were not resolved."""
        return None if self.phases is None else sensitivities(self.problem, self.phases)
