"""A solution as plain values, for result files."""

from armdyn.files import attributes
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.answer.words import assessment, checks
from armdyn.optimal.problem.problem import MinimumTimeProblem

_CHECKS = (
    "ok", "replay", "growth", "segment_error", "correction", "correction_share", "goal_error",
    "goal_velocity_error", "hamiltonian_spread", "switching_violation", "adjoint_error", "saving",
    "transversality", "lands", "keeps_limits", "limit_violation", "singular", "reasons",
)  # fmt: skip
"""Results of the checks of a certificate."""


def minimum_time_summary(solution: Solution) -> dict[str, object]:
    """A solution as JSON values: null where a number is not finite or no motion was found; units as in `Solution`."""
    worst, certificate, near, by = (
        solution.worst_violation,
        solution.certificate,
        solution.clearance,
        solution.sensitivities(),
    )
    return {
        "success": solution.success,
        "status": str(solution.status),
        "message": solution.message,
        "duration": solution.duration if solution.moves else None,
        "assessment": assessment(solution),
        "checks": [{"name": name, "holds": holds, "said": said} for name, holds, said in checks(solution)],
        **attributes(solution, "usable", "certified"),
        "extremal": certificate.extremal,
        "idle": list(certificate.idle),
        **attributes(solution, "lower_bound", "gap", "gap_proven"),
        "decides": [attributes(one, "limit", "joint", "part") for one in solution.decides],
        **attributes(solution, "calm", "what_to_do"),
        "certificate": attributes(certificate, *_CHECKS),
        **attributes(solution, "replay_error", "replay_velocity_error"),
        "arcs": [{"duration": arc.duration, "modes": [str(mode) for mode in arc.modes]} for arc in solution.arcs],
        "local_optima": list(solution.local_optima),
        "sensitivities": by and attributes(by, "payload_mass", "effort_upper", "effort_lower", "velocity"),
        "clearance": near and attributes(near, "distance", "time", "body", "other", "sure", "points"),
        "conditions": [attributes(kept, "name", "share", "said", "reasons") for kept in solution.constraint_reports],
        "reserve": reserve_summary(solution.problem),
        **attributes(solution.problem, "q_goal"),
        **attributes(solution, "via_times"),
        "goals": [attributes(goal, "q", "duration") for goal in solution.goals],
        **attributes(solution, "intervals", "iterations"),
        "solve_time": round(solution.solve_time, 3),
        "worst_violation": None if worst is None else str(worst),
    }


def reserve_summary(problem: MinimumTimeProblem) -> dict[str, list[float]] | None:
    """Reserves for feedback, as parts of every joint's limits [-]; None: there are none."""
    kept = problem.reserves
    return attributes(kept, "effort", "velocity") if kept.any else None
