"""Advice for an answer that is not usable or not certified: one line per shortcoming.

Names in backticks are arguments of `MinimumTimeProblem` and `MinimumTimeOptions`, and options of the command line.
"""

from collections.abc import Sequence

import numpy as np

from armdyn.optimal.landing.limit_violations import can_be_slowed
from armdyn.optimal.path_constraints.constraint import ConstraintReport
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.proof.certificate import GAP_TOLERANCE, ON_CURVE, Certificate
from armdyn.optimal.task.policy.policy import Policy
from armdyn.reprs import percent

_HOLD = "choose poses that its motors can hold, carry less `payload`, raise `effort_limit`"
_IN_FLIGHT = "pass the goal in flight with `v_goal`"
_MORE_ROOM = "another `seed` plans other paths; a smaller `clearance` leaves more room"
_LITTLE = 0.1
"""Gap above which the bound is weak because torque limits, not velocity limits, decide the duration."""


def advice(
    problem: MinimumTimeProblem,
    certificate: Certificate,
    kept: Sequence[ConstraintReport],
    arcs: bool,
    followed: Sequence[str] = (),
) -> dict[str, str]:
    """Advice for each failed check: "lands", "limits", "conditions", "extremal", "gap".

    A motion that is not usable gets no advice on its optimality. A curve with a gap gets none on Pontryagin's
    conditions, which no option lets a curve satisfy: the gap bounds its distance from the least time.

    Args:
        problem: the minimum-time problem.
        certificate: certificate of the answer.
        kept: constraint reports of the answer.
        arcs: whether the answer's arcs were resolved.
        followed: advice on the search of curves that was followed: "search", "starts".
    """
    if not np.isfinite(certificate.goal_error) and certificate.growth is None:
        if weak := problem.weak_ends:
            ends, flight = " and the ".join(one.pose for one in weak), f", or {_IN_FLIGHT}" * (weak[-1].pose == "goal")
            return {"lands": f"no motion was found, and the arm cannot stay at the {ends}: {_HOLD}{flight}"}
        if problem.has_clearance:
            return {"lands": f"no motion was found: {_MORE_ROOM}"}
        wider = "widen the limits or regions" if problem.has_regions else "widen the limits"
        return {"lands": f"no motion was found: {_raise(problem, wider, 'starts', 'time_limit', 'max_intervals')}"}
    lines = {}
    if not certificate.lands and certificate.replay == "segments":
        lines["lands"] = "open loop it is unstable: keep a `reserve` of the torque limits for feedback"
    elif not certificate.lands:
        links = "light links at strong motors may need their rotors' inertia, `armature`"
        lines["lands"] = f"it does not reach the goal: {_raise(problem, links, 'max_intervals')}"
    if not certificate.keeps_limits:
        lines["limits"] = _for_limits(problem, certificate) + _not_slowed(problem)
    if missed := [each.name for each in kept if each.reasons]:
        tighter = _raise(problem, "tighten the constraint a little", "max_intervals")
        more = _MORE_ROOM if missed == ["clearance"] else tighter
        lines["conditions"] = f"it does not keep {', '.join(missed)}: {more}{_not_slowed(problem)}"
    if lines:
        return lines
    if problem.holding_deficit is not None:
        return {"holds": f"the arm cannot stay at the goal: {_HOLD}, or {_IN_FLIGHT}"}
    if not certificate.extremal and not (certificate.remark == ON_CURVE and not arcs and certificate.gap is not None):
        lines["extremal"] = _for_extremal(problem, certificate, arcs)
    if not certificate.gap_proven or certificate.gap is None or certificate.gap > GAP_TOLERANCE:
        lines["gap"] = _for_gap(problem, certificate, followed)
    return lines


def _raise(problem: MinimumTimeProblem, otherwise: str, *options: str) -> str:
    """Advice to raise those of some options that change the problem's search, or else to do something else."""
    *first, last = [f"`{name}`" for name in options if _changes(problem, name)] or [""]
    named = f"{', '.join(first)} or {last}" if first else last
    return ", or ".join(filter(None, (named and f"raise {named}", otherwise)))


def _changes(problem: MinimumTimeProblem, option: str) -> bool:
    """Whether an option changes the problem's search: curves have no meshes, and no guesses where paths are planned."""
    if option not in ("starts", "max_intervals") or not Policy.of(problem).strategy.curves_alone:
        return True
    planned = problem.has_clearance or problem.has_regions or (len(problem.poses) > 2 and problem.jerk_limit is None)
    return option == "starts" and not planned


def _not_slowed(problem: MinimumTimeProblem) -> str:
    if can_be_slowed(problem):
        return ""
    why = "a joint has no motor" if problem.from_rest_to_rest else "it begins or ends in flight"
    return f"; it cannot be slowed down as a whole, since {why}"


def _for_limits(problem: MinimumTimeProblem, certificate: Certificate) -> str:
    worst = certificate.exceeded
    if worst is None:
        lower = "give limits a little below the arm's"
        return f"it exceeds a limit: {_raise(problem, lower, 'max_intervals')}"
    beyond = f"it exceeds the {worst.constraint} of {worst.joint} by {percent(worst.value)} of it"
    return f"{beyond}: {_raise(problem, 'lower that limit by as much', 'max_intervals')}"


def _for_extremal(problem: MinimumTimeProblem, certificate: Certificate, arcs: bool) -> str:
    if not arcs and certificate.remark == ON_CURVE:
        more = "; more `starts` may find a faster one" if _changes(problem, "starts") else ""
        return f"not extremal: {ON_CURVE}{more}"
    if not arcs and problem.path_constraint_names:
        names = ", ".join(problem.path_constraint_names)
        return f"not extremal: Pontryagin's conditions are not checked with {names}; a small gap would say as much"
    if not certificate.on_goal:
        return f"not extremal: {_off_goal(problem)}"
    if not arcs:
        return (
            "not extremal: its arcs were not resolved: raise `max_intervals` or `starts`; a small gap would say as much"
        )
    return "not extremal: its arcs do not quite satisfy the optimality conditions: raise `max_intervals` or `starts`"


def _off_goal(problem: MinimumTimeProblem) -> str:
    return f"it ends more than 1e-6 off the goal: {_raise(problem, 'give `armature`', 'max_intervals')}"


def _for_gap(problem: MinimumTimeProblem, certificate: Certificate, followed: Sequence[str]) -> str:
    if problem.pays_effort:
        return "no gap: with `effort_weight` the cost is not time alone; leave it out for the fastest motion"
    if certificate.gap is None and np.all(np.isinf(problem.limits.velocity)):
        return "no gap: without velocity limits no lower bound is known: give `velocity_limit`"
    if certificate.gap is None:
        where = "weak where velocity limits do not shape the motion"
        return f"no gap: no lower bound was computed: ad.lower_bound(problem) gives one, {where}"
    if not certificate.gap_proven and certificate.on_goal:
        return "the motion is faster than the lower bound: one of the two is wrong: a bug in armdyn"
    if not certificate.gap_proven:
        return f"the gap is not proven: {_off_goal(problem)}"
    if certificate.gap > _LITTLE:
        free = "the bound ignores obstacles, " if problem.has_clearance else "the bound "
        return f"a large gap: {free}is by velocity limits, and weak where torque limits decide"
    if certificate.remark == ON_CURVE:
        ways = {"search": "`search` thorough", "starts": "more `starts`"}
        left = " or ".join(words for name, words in ways.items() if name not in followed)
        more = f"look for a faster motion with {left}; " if left and _changes(problem, "starts") else ""
        return f"{more}much of the gap of {percent(certificate.gap)} may be the bound's"
    more = _raise(problem, "", "starts", "max_intervals")
    return f"a gap of {percent(certificate.gap)}" + (f": {more}; there may be a faster motion" if more else "")
