"""A solution as plain values, for what is kept of a run."""

import numpy as np

from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.answer.words import assessment, checks
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.proof.certificate import Certificate


def minimum_time_summary(solution: Solution) -> dict[str, object]:
    """A solution as JSON says it: what is not finite, or no motion's duration, is null, units as in `Solution`."""
    worst, certificate, by = solution.worst_violation, solution.certificate, solution.sensitivities()
    return {
        "success": solution.success,
        "status": str(solution.status),
        "message": solution.message,
        "duration": solution.duration if solution.moves else None,
        "assessment": assessment(solution),
        "checks": [{"name": name, "holds": holds, "said": said} for name, holds, said in checks(solution)],
        "usable": solution.usable,
        "certified": solution.certified,
        "extremal": certificate.extremal,
        "idle": list(certificate.idle),
        "lower_bound": solution.lower_bound,
        "gap": solution.gap,
        "gap_proven": solution.gap_proven,
        "decides": [{"limit": one.limit, "joint": one.joint, "part": one.part} for one in solution.decides],
        "what_to_do": list(solution.what_to_do),
        "certificate": _checks(certificate),
        "replay_error": _finite(solution.replay_error),
        "replay_velocity_error": _finite(solution.replay_velocity_error),
        "arcs": [{"duration": arc.duration, "modes": [str(mode) for mode in arc.modes]} for arc in solution.arcs],
        "local_optima": list(solution.local_optima),
        "sensitivities": None
        if by is None
        else {
            "payload_mass": by.payload_mass,
            "effort_upper": by.effort_upper.tolist(),
            "effort_lower": by.effort_lower.tolist(),
            "velocity": by.velocity.tolist(),
        },
        "clearance": None
        if solution.clearance is None
        else {
            "distance": solution.clearance.distance,
            "time": solution.clearance.time,
            "body": solution.clearance.body,
            "other": solution.clearance.other,
            "sure": solution.clearance.sure,
        },
        "conditions": [
            {"name": kept.name, "share": kept.share, "said": kept.said, "reasons": list(kept.reasons)}
            for kept in solution.constraint_reports
        ],
        "reserve": reserve_summary(solution.problem),
        "q_goal": np.asarray(solution.problem.q_goal).tolist(),
        "via_times": list(solution.via_times),
        "goals": [{"q": goal.q.tolist(), "duration": _finite(goal.duration)} for goal in solution.goals],
        "intervals": solution.intervals,
        "iterations": solution.iterations,
        "solve_time": round(solution.solve_time, 3),
        "worst_violation": None if worst is None else str(worst),
    }


def reserve_summary(problem: MinimumTimeProblem) -> dict[str, list[float]] | None:
    """What is kept for feedback, parts of every joint's limits [-]; None if nothing is."""
    kept = problem.reserves
    return {"effort": kept.effort.tolist(), "velocity": kept.velocity.tolist()} if kept.any else None


def _checks(certificate: Certificate) -> dict[str, object]:
    return {
        "ok": certificate.ok,
        "replay": certificate.replay,
        "growth": _finite(certificate.growth),
        "segment_error": _finite(certificate.segment_error),
        "correction": _finite(certificate.correction),
        "correction_share": _finite(certificate.correction_share),
        "goal_error": _finite(certificate.goal_error),
        "goal_velocity_error": _finite(certificate.goal_velocity_error),
        "hamiltonian_spread": _finite(certificate.hamiltonian_spread),
        "switching_violation": _finite(certificate.switching_violation),
        "adjoint_error": _finite(certificate.adjoint_error),
        "transversality": _finite(certificate.transversality),
        "lands": certificate.lands,
        "keeps_limits": certificate.keeps_limits,
        "limit_violation": _finite(certificate.limit_violation),
        "singular": certificate.singular,
        "reasons": list(certificate.reasons),
    }


def _finite(number: float | None) -> float | None:
    return None if number is None or not abs(number) < float("inf") else number
