"""Advice for an answer that is not usable or not certified: one line per shortcoming.

Names in backticks are arguments of `MinimumTimeProblem` and `MinimumTimeOptions`, and options of the command line.
"""

import numpy as np

from armdyn.optimal.answer.result import Result
from armdyn.optimal.problem.status import Status
from armdyn.optimal.verify.certificate import GAP_TOLERANCE, ON_CURVE
from armdyn.optimal.verify.within_limits import can_be_slowed
from armdyn.reprs import percent

_HOLD = "choose poses that its motors can hold, carry less `payload`, raise `effort_limit`"
_OFF_GOAL = "it ends more than 1e-6 off the goal"
_IN_FLIGHT = "pass the goal in flight with `v_goal`"
_WAYS = {
    "search": "`search` thorough",
    "starts": "more `starts`",
    "time_limit": "a longer `time_limit`",
    "max_intervals": "more `max_intervals`",
    "seed": "another `seed`",
    "clearance": "a smaller `clearance`",
    "armature": "the rotors' inertia, `armature`",
}
"""Remedies by the options that they name."""
_LITTLE = 100 * GAP_TOLERANCE
"""Gap above which the bound is weak because torque limits, not velocity limits, decide the duration."""


def what_to_do(result: Result) -> tuple[str, ...]:
    """Advice, one line per failed check; empty for a usable, certified motion, or if Ctrl-C came first."""
    if (result.certified and result.usable) or (result.status is Status.INTERRUPTED and not result.moves):
        return ()
    return tuple(advice(result).values())


def advice(result: Result) -> dict[str, str]:
    """Advice for each failed check: "lands", "limits", "conditions", "holds", "extremal", "gap".

    A motion that is not usable gets no advice on its optimality. A curve with a gap gets none on Pontryagin's
    conditions, which no option lets a curve satisfy: the gap bounds its distance from the least time.
    """
    certificate, problem, lines = result.certificate, result.problem, dict[str, str]()
    if not np.isfinite(certificate.goal_error) and certificate.growth is None:
        return {"lands": _without_motion(result)}
    if not certificate.lands and certificate.replay == "segments":
        larger = "larger " * bool(np.any(problem.reserves.effort))
        lines["lands"] = f"open loop it is unstable: keep a {larger}`reserve` of the torque limits for feedback"
    elif not certificate.lands:
        lines["lands"] = f"it does not reach the goal{_remedy(result, 'max_intervals', 'armature')}"
    if not certificate.keeps_limits:
        lines["limits"] = _for_limits(result) + _not_slowed(result)
    if missed := [each.name for each in result.constraint_reports if each.reasons]:
        tighter = _remedy(result, "max_intervals", otherwise="tighten the constraint a little")
        more = _remedy(result, "seed", "clearance") if missed == ["clearance"] else tighter
        lines["conditions"] = f"it does not keep {', '.join(missed)}{more}{_not_slowed(result)}"
    if lines:
        return lines
    if problem.holding_deficit is not None:
        return {"holds": f"the arm cannot stay at the goal: {_HOLD}, or {_IN_FLIGHT}"}
    proven = result.phases is None and certificate.remark == ON_CURVE and certificate.gap is not None
    if not (certificate.extremal or proven):
        lines["extremal"] = f"not extremal: {_for_extremal(result)}"
    if not certificate.gap_proven or certificate.gap is None or certificate.gap > GAP_TOLERANCE:
        lines["gap"] = _for_gap(result)
    return lines


def _remedy(result: Result, *options: str, otherwise: str = "") -> str:
    """What to try, after a colon: options of some that have an effect and were not followed, or something else."""
    problem = result.problem
    given = {"clearance": problem.clearance == 0, "armature": bool(np.any(problem.robot.model.armature))}
    *first, last = [_WAYS[name] for name in options if name not in result.followed and not given.get(name)] or [""]
    ways = last and f"try {', '.join(first)}{' or ' if first else ''}{last}"
    said = ", or ".join(filter(None, (ways, otherwise)))
    return said and f": {said}"


def _without_motion(result: Result) -> str:
    problem = result.problem
    if weak := problem.weak_ends:
        ends, flight = " and the ".join(one.pose for one in weak), f", or {_IN_FLIGHT}" * (weak[-1].pose == "goal")
        return f"no motion was found, and the arm cannot stay at the {ends}: {_HOLD}{flight}"
    if problem.has_clearance:
        return f"no motion was found{_remedy(result, 'seed', 'clearance', 'time_limit')}"
    wider = "widen the limits or regions" if problem.has_regions else "widen the limits"
    return f"no motion was found{_remedy(result, 'starts', 'time_limit', 'max_intervals', otherwise=wider)}"


def _not_slowed(result: Result) -> str:
    if can_be_slowed(result.problem):
        return ""
    why = "a joint has no motor" if result.problem.from_rest_to_rest else "it begins or ends in flight"
    return f"; it cannot be slowed down as a whole, since {why}"


def _for_limits(result: Result) -> str:
    worst = result.certificate.exceeded
    what = "a limit" if worst is None else f"the {worst.constraint} of {worst.joint} by {percent(worst.value)} of it"
    lower = "give limits a little below the arm’s" if worst is None else "lower that limit by as much"
    return f"it exceeds {what}{_remedy(result, 'max_intervals', otherwise=lower)}"


def _for_extremal(result: Result) -> str:
    certificate, arcs, names = result.certificate, result.phases is not None, result.problem.path_constraint_names
    if not arcs and certificate.remark == ON_CURVE:
        return f"{ON_CURVE}{_remedy(result, 'starts')}"
    if not arcs and names:
        also = "a small gap would say as much"
        return f"Pontryagin's conditions are not checked with {', '.join(names)}; {also}"
    if not certificate.on_goal:
        return f"{_OFF_GOAL}{_remedy(result, 'max_intervals', 'armature')}"
    more = _remedy(result, "max_intervals", "starts") or _remedy(result, "seed")
    if not arcs:
        return f"its arcs were not resolved{more}; a small gap would say as much"
    return f"its arcs do not quite satisfy the optimality conditions{more}"


def _for_gap(result: Result) -> str:
    certificate, problem = result.certificate, result.problem
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
        return f"the gap is not proven: {_OFF_GOAL}{_remedy(result, 'max_intervals', 'armature')}"
    if certificate.gap > _LITTLE:
        free = "the bound ignores obstacles, " if problem.has_clearance else "the bound "
        return f"a large gap: {free}is by velocity limits, and weak where torque limits decide"
    if certificate.remark == ON_CURVE:
        first = f"look for a faster motion{more}; " if (more := _remedy(result, "search", "starts")) else ""
        return f"{first}much of the gap of {percent(certificate.gap)} may be the bound's"
    more = _remedy(result, "starts", "max_intervals")
    return f"a gap of {percent(certificate.gap)}; there may be a faster motion{more}"
