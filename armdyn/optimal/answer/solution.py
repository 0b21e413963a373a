"""Solution of a minimum-time problem, and its summary for `--json`."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from armdyn.files import attributes
from armdyn.optimal.answer.advice import what_to_do
from armdyn.optimal.answer.result import Result
from armdyn.optimal.answer.words import assessment, checks, found_words, paragraph, verdict
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.verify.certificate import Certificate
from armdyn.rendering import renderer
from armdyn.reprs import brief, called
from armdyn.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@brief
@dataclass(frozen=True, eq=False)
class Solution(Result):
    """A motion, its certificate, and the statistics of its search.

    Attributes:
        success: whether the motion is `feasible` and the solve was not stopped by Ctrl-C.
        status: a `Status`.
        message: the status in words.
        problem: the minimum-time problem.
        duration: t_f [s]; of the last iterate if the solve failed: check `moves` before you show it.
        trajectory: the motion; the last iterate if the solve failed.
        certificate: results of the checks.
        arcs: active limit of every joint and duration of each arc, exact with `phases`, else to the resolution of the
            mesh; empty if the motion was not resolved.
        phases: the solved arcs with costates; None: the mesh's motion is the answer, or a curve.
        costates: costates of the motion, of arcs or of a mesh, see `sensitivities`; None: unknown.
        local_optima: durations of the other optima met [s], increasing; unrefined ones to the coarse mesh's accuracy.
        intervals: number of intervals of the last mesh.
        iterations: iterations of the solver, over all meshes and starts.
        solve_time: wall time [s].
        worst_violation: worst violation by the solver's last iterate or by the motion; None if there is none.
        clearance: least distance of the motion to an obstacle or to itself; None if no clearance was required.
        constraint_reports: report of each path constraint; empty without any.
        via_times: times of the via points [s].
        goals: joint positions tried that reach a goal pose, fastest first; empty if there was only one.
        moves: whether the torques reach the goal, satisfy all path constraints and, to a thousandth, all limits.
            Without `success` such a motion is the best so far; if False there is no motion, and `duration` is
            meaningless.
        decides: share of the time that each limit decides, largest first; empty if unknown.
        calm: time spent on calm joints [s]: the fastest motion takes less by this.
        search_remark: remark on the search if the motion is not certified: number of different optima from a curve's
            guesses and how often the best was met, or that refinement was abandoned; else empty.
        followed: options of the search that are not advised: raised already, or, of the time limit, without effect.
    """

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
    def what_to_do(self) -> tuple[str, ...]:
        """Advice, one line per failed check; empty for a usable, certified motion, or if Ctrl-C came first."""
        return what_to_do(self)

    def plot(self) -> Figure:
        """Position, velocity and torque of every joint over time, with the limits and the switching times.

        Returns:
            A matplotlib figure outside pyplot: `figure.savefig("motion.pdf")`.
        """
        return renderer().figure(self)

    def report(self, path: str | os.PathLike[str]) -> Path:
        """Write the report: one HTML file with the animated arm, its curves, the verdict and its reasons.

        Args:
            path: path of the file, such as "report.html".

        Returns:
            The path written, as given.

        Raises:
            FileError: the file cannot be written.
            DiskFullError: the disk is full.
        """
        return renderer().report(self, path)


def without_motion(problem: MinimumTimeProblem, status: Status, why: str, last: Trajectory | None = None) -> Solution:
    """A solution without a motion, with the reason.

    Args:
        problem: the problem.
        status: status of the solve.
        why: the reason, for the message.
        last: last iterate; None: the trajectory rests at the start.
    """
    if last is None:
        q, names = np.asarray(problem.q_start), problem.robot.joint_names
        last = Trajectory.at_rest(q, np.zeros_like(q), 1.0, names, name="no motion")
    said = f"no motion was found: {why}"
    nothing = Certificate(np.inf, np.inf, np.inf, remark=f"no motion was found ({why})")
    return Solution(False, status, said, problem, last.duration, last, nothing, moves=False)


def kinematic(problem: MinimumTimeProblem, solution: Solution) -> Solution:
    """The solution of a kinematic problem from that of its `without_torques`: the motion has no torques."""
    motion = solution.trajectory
    motion = replace(motion, tau=np.zeros_like(motion.tau), model_hash=problem.robot.model_hash)
    posed = solution.problem.variant(robot=problem.robot, kinematic=True, effort_limit=None)
    own = with_certificate(solution, replace(solution.certificate, replay="accelerations"))
    return replace(own, problem=posed, trajectory=motion)


def with_certificate(solution: Solution, certificate: Certificate) -> Solution:
    """Replace a solution's certificate, and its message accordingly."""
    before, after = (found_words(one, solution.duration) for one in (solution.certificate, certificate))
    return replace(solution, certificate=certificate, message=solution.message.replace(before, after))


_CHECKS = (
    "ok", "replay", "growth", "segment_error", "correction", "correction_share", "goal_error",
    "goal_velocity_error", "hamiltonian_spread", "switching_violation", "adjoint_error", "saving",
    "transversality", "lands", "keeps_limits", "limit_violation", "reasons",
)  # fmt: skip
"""Results of the checks of a certificate."""


def minimum_time_summary(solution: Solution) -> dict[str, object]:
    """A solution as JSON values: null where a number is not finite or no motion was found; units as in `Solution`."""
    worst, near = solution.worst_violation, solution.clearance
    certificate, by = solution.certificate, solution.sensitivities()
    singular = not solution.problem.pays_effort and any(arc.singular for arc in solution.arcs)
    return {
        **attributes(solution, "success", "status", "message"),
        "duration": solution.duration if solution.moves else None,
        "assessment": assessment(solution),
        "checks": [{"name": name, "holds": holds, "said": said} for name, holds, said in checks(solution)],
        **attributes(solution, "usable", "certified", "lower_bound", "gap", "gap_proven", "calm", "what_to_do"),
        **attributes(certificate, "extremal", "idle"),
        "decides": [attributes(one, "limit", "joint", "part", "saved", "ties") for one in solution.decides],
        "certificate": {**attributes(certificate, *_CHECKS), "singular": singular},
        **attributes(solution, "replay_error", "replay_velocity_error", "local_optima", "via_times"),
        "arcs": [{"duration": arc.duration, "modes": [str(mode) for mode in arc.modes]} for arc in solution.arcs],
        "sensitivities": by and attributes(by, "payload_mass", "effort_upper", "effort_lower", "velocity"),
        "clearance": near and attributes(near, "distance", "time", "body", "other", "sure", "points"),
        "conditions": [attributes(kept, "name", "share", "said", "reasons") for kept in solution.constraint_reports],
        "reserve": reserve_summary(solution.problem),
        **attributes(solution.problem, "q_goal", "kinematic", "pays_effort"),
        "goals": [attributes(goal, "q", "duration") for goal in solution.goals],
        **attributes(solution, "intervals", "iterations"),
        "solve_time": round(solution.solve_time, 3),
        "worst_violation": None if worst is None else str(worst),
    }


def reserve_summary(problem: MinimumTimeProblem) -> dict[str, list[float]] | None:
    """Reserves for feedback, as parts of every joint's limits [-]; None: there are none."""
    kept = problem.reserves
    return attributes(kept, "effort", "velocity") if kept.any else None
