"""The result of a solve, converged or not."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from armdyn.models.scene.collision import Clearance
from armdyn.optimal.answer.advice import advice
from armdyn.optimal.answer.words import paragraph, verdict
from armdyn.optimal.arcs.arc import Arc
from armdyn.optimal.arcs.phases import Phases
from armdyn.optimal.path_constraints.constraint import ConstraintReport
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status, Violation
from armdyn.optimal.proof.certificate import Certificate
from armdyn.optimal.proof.sensitivity import Sensitivities, Share, sensitivities
from armdyn.optimal.search.goals import GoalTried
from armdyn.rendering import renderer
from armdyn.reprs import brief, called
from armdyn.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@brief
@dataclass(frozen=True, eq=False)
class Solution:
    """A motion and how far to trust it.

    Attributes:
        success: the solve was not stopped by Ctrl-C, and its motion is `feasible`.
        status: a `Status`.
        message: the same for people.
        problem: the minimum-time problem.
        duration: t_f [s]; of the last iterate if the solve failed: look at `moves` before it is shown to anybody.
        trajectory: the motion; the last iterate if the solve failed.
        certificate: what was checked, each apart.
        arcs: which limit every joint is on, and for how long; empty if that was not resolved.
        phases: the arcs as solved, with costates; None likewise.
        local_optima: durations of the other optima met [s], increasing; those that were not refined to
            the coarse mesh's accuracy.
        intervals: of the last mesh.
        iterations: of the solver, over all meshes and starts.
        solve_time: wall time [s].
        worst_violation: what is worst violated, by the solver's last iterate or by the motion; None if all is kept.
        clearance: where the motion comes nearest to an obstacle or to itself; None if neither was to be kept clear of.
        constraint_reports: how the motion keeps each path constraint; empty without any.
        via_times: when it passes the via points [s].
        goals: all joint positions tried that reach a goal pose, fastest first; empty if there was but one.
        moves: its torques lead to the goal, keep all conditions and, to a thousandth, all limits: where `success` is
            missing it is the best so far; else it is no motion, and `duration` says nothing.
        decides: how much of the time each limit decides, most first; empty if that is not known.
        calm: time that was given for calm joints [s]: without, the motion takes so much less.
        search_remark: a sentence on the search where the motion is not certified: how many different optima a curve's
            guesses met, and how often the best, or that refinement was given up; else empty.
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
    constraint_reports: tuple[ConstraintReport, ...] = ()
    via_times: tuple[float, ...] = ()
    goals: tuple[GoalTried, ...] = ()
    moves: bool = True
    decides: tuple[Share, ...] = ()
    calm: float = 0.0
    search_remark: str = ""

    def __str__(self) -> str:
        """A paragraph: duration, verdict, limits that decide the time, bound."""
        return paragraph(self)

    def _repr_parts(self) -> list[str]:
        """Parts of the `repr`."""
        found = f"{self.duration:.6g} s" if self.moves else "no motion"
        return [called(self.problem.robot.name), found, verdict(self)]

    def _repr_html_(self) -> str:
        """A table and a picture, for notebooks."""
        return renderer().card(self)

    @property
    def feasible(self) -> bool:
        """Whether the replay reaches the goal and keeps all limits and conditions. Says nothing about what follows."""
        return self.certificate.usable and not any(kept.reasons for kept in self.constraint_reports)

    @property
    def usable(self) -> bool:
        """Feasible, and the motors can hold the arm at the goal, where it is to rest there."""
        return self.feasible and self.problem.unheld is None

    @property
    def certified(self) -> bool:
        """Feasible, and extremal or proven to be within a thousandth of the least duration of all motions."""
        return self.feasible and self.certificate.ok

    @property
    def lower_bound(self) -> float | None:
        """Proven lower bound on the duration of all motions [s]; None: unknown."""
        return self.certificate.lower_bound

    @property
    def gap(self) -> float | None:
        """Relative gap (duration - lower_bound) / lower_bound; None without a bound, or if it is not feasible."""
        return self.certificate.gap if self.feasible else None

    @property
    def gap_proven(self) -> bool:
        """Whether `gap` is between a bound and a feasible motion that ends on the goal."""
        return self.feasible and self.certificate.gap_proven

    @property
    def what_to_do(self) -> tuple[str, ...]:
        """Advice, a line for each check that failed; empty if the motion is usable and certified."""
        if self.certified and self.usable:
            return ()
        return tuple(advice(self.problem, self.certificate, self.constraint_reports, self.phases is not None).values())

    @property
    def replay_error(self) -> float:
        """Largest joint position error of the replay at the goal [rad or m]."""
        return self.certificate.goal_error

    @property
    def replay_velocity_error(self) -> float:
        """Largest joint velocity error of the replay at the goal [rad/s or m/s]."""
        return self.certificate.goal_velocity_error

    def plot(self) -> Figure:
        """Position, velocity and torque of every joint over time, with the limits and the switching times.

        Returns:
            A figure of matplotlib's, which pyplot does not know: `figure.savefig("motion.pdf")`.
        """
        return renderer().figure(self)

    def report(self, path: str | os.PathLike[str]) -> Path:
        """Write the report: one HTML file with the arm that moves, its curves, the verdict and what it rests on.

        Args:
            path: of the file, such as "report.html".

        Returns:
            The path written, as given.

        Raises:
            FileError: it cannot be written.
            DiskFullError: there is no room for it.
        """
        return renderer().report(self, path)

    def sensitivities(self) -> Sensitivities | None:
        """Derivatives of t_f by payload and limits; None if the arcs were not resolved."""
        return None if self.phases is None else sensitivities(self.problem, self.phases)
