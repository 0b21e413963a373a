"""Advice for an answer that is not usable or not certified: one line per shortcoming.

Names in backticks are arguments of `MinimumTimeProblem` and `MinimumTimeOptions`, and options of the command line.
"""

from collections.abc import Sequence

import numpy as np

from armdyn.optimal.landing.pace import can_be_slowed
from armdyn.optimal.path_constraints.constraint import ConstraintReport
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.proof.certificate import GAP_TOLERANCE, ON_CURVE, Certificate
from armdyn.reprs import percent

_HOLD = (
    "choose a goal that its motors can hold, carry less `payload`, raise `effort_limit`, or pass the goal in flight "
    "with `v_goal`"
)
_MORE_ROOM = "another `seed` plans other paths; a smaller `clearance` leaves more room"
_LITTLE = 0.1
"""Gap above which the bound is weak because torque limits, not velocity limits, decide the duration."""


def advice(
    problem: MinimumTimeProblem, certificate: Certificate, kept: Sequence[ConstraintReport], arcs: bool
) -> dict[str, str]:
    """Advice for each failed check: "lands", "limits", "conditions", "extremal", "gap".

    A motion that is not usable gets no advice on its optimality. A curve with a gap gets none on Pontryagin's
    conditions, which no option lets a curve satisfy: the gap bounds its distance from the least time.

    Args:
        problem: the minimum-time problem.
        certificate: certificate of the answer.
        kept: constraint reports of the answer.
        arcs: whether the answer's arcs were resolved.
    """
    if not np.isfinite(certificate.goal_error) and certificate.growth is None:
        if problem.crowded:
            return {"lands": f"no motion was found: {_MORE_ROOM}"}
        return {"lands": "no motion was found: raise `starts`, `time_limit` or `max_intervals`, or widen the limits"}
    lines = {}
    if not certificate.lands and certificate.replay == "segments":
        lines["lands"] = "open loop it is unstable: keep a `reserve` of the torque limits for feedback"
    elif not certificate.lands:
        lines["lands"] = (
            "it does not reach the goal: raise `max_intervals`; light links at strong motors may need "
            "their rotors' inertia, `armature`"
        )
    if not certificate.keeps_limits:
        lines["limits"] = _for_limits(certificate) + _not_slowed(problem)
    if missed := [each.name for each in kept if each.reasons]:
        more = _MORE_ROOM if missed == ["clearance"] else "raise `max_intervals`, or tighten the constraint a little"
        lines["conditions"] = f"it does not keep {', '.join(missed)}: {more}{_not_slowed(problem)}"
    if lines:
        return lines
    if problem.holding_deficit is not None:
        return {"holds": f"the arm cannot stay at the goal: {_HOLD}"}
    if not certificate.extremal and not (certificate.remark == ON_CURVE and not arcs and certificate.gap is not None):
        lines["extremal"] = _for_extremal(problem, certificate, arcs)
    if not certificate.gap_proven or certificate.gap is None or certificate.gap > GAP_TOLERANCE:
        lines["gap"] = _for_gap(problem, certificate)
    return lines


def _not_slowed(problem: MinimumTimeProblem) -> str:
    if can_be_slowed(problem):
        return ""
    why = "a joint has no motor" if problem.from_rest_to_rest else "it begins or ends in flight"
    return f"; it cannot be slowed down as a whole, since {why}"


def _for_limits(certificate: Certificate) -> str:
    worst = certificate.exceeded
    if worst is None:
        return "it exceeds a limit: raise `max_intervals`, or give limits a little below the arm's"
    beyond = f"it exceeds the {worst.constraint} of {worst.joint} by {percent(worst.value)} of it"
    return f"{beyond}: raise `max_intervals`, or lower that limit by as much"


def _for_extremal(problem: MinimumTimeProblem, certificate: Certificate, arcs: bool) -> str:
    if not arcs and certificate.remark == ON_CURVE:
        return f"not extremal: {ON_CURVE}; more `starts` may find a faster one"
    if not arcs and problem.path_constraint_names:
        names = ", ".join(problem.path_constraint_names)
        return f"not extremal: Pontryagin's conditions are not checked with {names}; a small gap would say as much"
    if not certificate.on_goal:
        return "not extremal: it ends more than 1e-6 off the goal: raise `max_intervals`, or give `armature`"
    if not arcs:
        return (
            "not extremal: its arcs were not resolved: raise `max_intervals` or `starts`; a small gap would say as much"
        )
    return "not extremal: its arcs do not quite satisfy the optimality conditions: raise `max_intervals` or `starts`"


def _for_gap(problem: MinimumTimeProblem, certificate: Certificate) -> str:
    if problem.pays_effort:
        return "no gap: with `effort_weight` the cost is not time alone; leave it out for the fastest motion"
    if certificate.gap is None and np.all(np.isinf(problem.limits.velocity)):
        return "no gap: without velocity limits no lower bound is known: give `velocity_limit`"
    if certificate.gap is None:
        return "no gap: no lower bound is known; a `velocity_limit` that the motion nearly reaches would give one"
    if not certificate.gap_proven and certificate.on_goal:
        return "the motion is faster than the lower bound: one of the two is wrong: a bug in armdyn"
    if not certificate.gap_proven:
        return "the gap is not proven: the motion ends more than 1e-6 off the goal: raise `max_intervals`"
    if certificate.gap > _LITTLE:
        return "a large gap: the bound is by velocity limits, and weak where torque limits decide"
    if certificate.remark == ON_CURVE:
        return (
            f"look for a faster motion with `search` thorough or more `starts`; much of the gap of "
            f"{percent(certificate.gap)} may be the bound's"
        )
    return f"a gap of {percent(certificate.gap)}: raise `starts` or `max_intervals`; there may be a faster motion"
