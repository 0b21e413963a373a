"""A solution as plain values, for result files."""

from typing import Any

import numpy as np

from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.answer.words import assessment, checks
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.proof.certificate import Certificate


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
        **_plain(solution, "usable", "certified"),
        "extremal": certificate.extremal,
        "idle": list(certificate.idle),
        **_plain(solution, "lower_bound", "gap", "gap_proven"),
        "decides": [_plain(one, "limit", "joint", "part") for one in solution.decides],
        **_plain(solution, "calm", "what_to_do"),
        "certificate": _checks(certificate),
        **_plain(solution, "replay_error", "replay_velocity_error"),
        "arcs": [{"duration": arc.duration, "modes": [str(mode) for mode in arc.modes]} for arc in solution.arcs],
        "local_optima": list(solution.local_optima),
        "sensitivities": by and _plain(by, "payload_mass", "effort_upper", "effort_lower", "velocity"),
        "clearance": near and _plain(near, "distance", "time", "body", "other", "sure", "points"),
        "conditions": [_plain(kept, "name", "share", "said", "reasons") for kept in solution.constraint_reports],
        "reserve": reserve_summary(solution.problem),
        "q_goal": np.asarray(solution.problem.q_goal).tolist(),
        "via_times": list(solution.via_times),
        "goals": [_plain(goal, "q", "duration") for goal in solution.goals],
        **_plain(solution, "intervals", "iterations"),
        "solve_time": round(solution.solve_time, 3),
        "worst_violation": None if worst is None else str(worst),
    }


def reserve_summary(problem: MinimumTimeProblem) -> dict[str, list[float]] | None:
    """Reserves for feedback, as parts of every joint's limits [-]; None: there are none."""
    kept = problem.reserves
    return {"effort": kept.effort.tolist(), "velocity": kept.velocity.tolist()} if kept.any else None


def _checks(certificate: Certificate) -> dict[str, object]:
    """Results of the checks, by name."""
    return _plain(
        certificate, "ok", "replay", "growth", "segment_error", "correction", "correction_share", "goal_error",
        "goal_velocity_error", "hamiltonian_spread", "switching_violation", "adjoint_error", "saving", "transversality",
        "lands", "keeps_limits", "limit_violation", "singular", "reasons",
    )  # fmt: skip


def _plain(value: object, *names: str) -> dict[str, object]:
    """Some attributes of a value, by their names, as JSON knows them."""
    return {name: _json(getattr(value, name)) for name in names}


def _json(value: Any) -> object:
    """A value as JSON knows it; null for a number that is not finite."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple):
        return list(value)
    return None if isinstance(value, float) and not np.isfinite(value) else value
