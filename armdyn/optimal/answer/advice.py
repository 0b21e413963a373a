"""Advice for an answer that is not usable or not certified: one line per shortcoming.

Names in backticks are arguments of `MinimumTimeProblem` and `MinimumTimeOptions`, and options of the command line.
"""

import warnings
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from armdyn.errors import ArmdynWarning
from armdyn.optimal.constraints.constraint import ConstraintReport
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import GAP_TOLERANCE, ON_CURVE, Certificate
from armdyn.optimal.verify.slowing import can_be_slowed
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
Remedy = Callable[..., str]
"""`_remedy` of a problem and the options that were followed."""
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
        followed: options whose advice was followed, or has no effect, see `followed_by`.
    """
    remedy = partial(_remedy, problem, followed)
    if not np.isfinite(certificate.goal_error) and certificate.growth is None:
        if weak := problem.weak_ends:
            ends, flight = " and the ".join(one.pose for one in weak), f", or {_IN_FLIGHT}" * (weak[-1].pose == "goal")
            return {"lands": f"no motion was found, and the arm cannot stay at the {ends}: {_HOLD}{flight}"}
        if problem.has_clearance:
            return {"lands": f"no motion was found{remedy('seed', 'clearance', 'time_limit')}"}
        wider = "widen the limits or regions" if problem.has_regions else "widen the limits"
        ways = remedy("starts", "time_limit", "max_intervals", otherwise=wider)
        return {"lands": f"no motion was found{ways}"}
    lines = {}
    if not certificate.lands and certificate.replay == "segments":
        larger = "larger " * bool(np.any(problem.reserves.effort))
        lines["lands"] = f"open loop it is unstable: keep a {larger}`reserve` of the torque limits for feedback"
    elif not certificate.lands:
        lines["lands"] = f"it does not reach the goal{remedy('max_intervals', 'armature')}"
    if not certificate.keeps_limits:
        lines["limits"] = _for_limits(certificate, remedy) + _not_slowed(problem)
    if missed := [each.name for each in kept if each.reasons]:
        tighter = remedy("max_intervals", otherwise="tighten the constraint a little")
        more = remedy("seed", "clearance") if missed == ["clearance"] else tighter
        lines["conditions"] = f"it does not keep {', '.join(missed)}{more}{_not_slowed(problem)}"
    if lines:
        return lines
    if problem.holding_deficit is not None:
        return {"holds": f"the arm cannot stay at the goal: {_HOLD}, or {_IN_FLIGHT}"}
    if not certificate.extremal and not (certificate.remark == ON_CURVE and not arcs and certificate.gap is not None):
        lines["extremal"] = _for_extremal(problem, certificate, arcs, remedy)
    if not certificate.gap_proven or certificate.gap is None or certificate.gap > GAP_TOLERANCE:
        lines["gap"] = _for_gap(problem, certificate, remedy)
    return lines


def followed_by(task: Task, status: Status) -> tuple[str, ...]:
    """Options of a task that are not advised: raised already, or without effect, as a time limit that was not reached.

    Args:
        task: problem and options as given.
        status: of its solution.
    """
    unreached = () if status is Status.TIME_LIMIT else ("time_limit",)
    return tuple(dict.fromkeys((*_raised(task), *unreached, *_without_effect(task))))


def warn_of_options_without_effect(task: Task) -> None:
    """Warn of options that are set, and have no effect on the task's problem."""
    raised = _raised(task)
    for name, why in _without_effect(task).items():
        if name in raised:
            warnings.warn(f"`{name}` has no effect here: {why}", ArmdynWarning, stacklevel=3)


def _raised(task: Task) -> tuple[str, ...]:
    """Options of a task that are above their defaults."""
    policy, options, usual = task.policy, task.options, MinimumTimeOptions()
    own = (
        policy.curves if policy.strategy.curves_alone else policy.smooth if task.problem.pays_effort else policy.search
    )
    raised = {
        "search": options.search == "thorough",
        "starts": (options.starts or 0) > own.starts,
        "max_intervals": options.max_intervals > usual.max_intervals,
        "calm": options.calm > usual.calm,
        "bound_programs": options.bound_programs is not None,
    }
    return tuple(name for name, chosen in raised.items() if chosen)


def _without_effect(task: Task) -> dict[str, str]:
    """Options without effect on a task's problem, and why."""
    problem, methods = task.problem, task.policy.strategy.methods
    useless = {"bound_programs": "it is of cycles"}
    if methods == ("profiles",):
        return useless | dict.fromkeys(("search", "starts", "max_intervals", "calm"), "joints have one profile each")
    if "curves" not in methods:
        return useless | {"calm": "motions of a mesh are as fast as can be"}
    if task.policy.strategy.curves_alone:
        useless["max_intervals"] = "motions are curves, which have no mesh"
        if problem.has_clearance or problem.has_regions or (len(problem.poses) > 2 and problem.jerk_limit is None):
            useless |= dict.fromkeys(("search", "starts"), "paths are planned, and are the guesses")
    return useless


def _remedy(problem: MinimumTimeProblem, followed: Sequence[str], *options: str, otherwise: str = "") -> str:
    """What to try, after a colon: options of some that have an effect and were not followed, or something else."""
    given = {"clearance": problem.clearance == 0, "armature": bool(np.any(problem.robot.model.armature))}
    *first, last = [_WAYS[name] for name in options if name not in followed and not given.get(name)] or [""]
    ways = last and f"try {', '.join(first)}{' or ' if first else ''}{last}"
    said = ", or ".join(filter(None, (ways, otherwise)))
    return said and f": {said}"


def _not_slowed(problem: MinimumTimeProblem) -> str:
    if can_be_slowed(problem):
        return ""
    why = "a joint has no motor" if problem.from_rest_to_rest else "it begins or ends in flight"
    return f"; it cannot be slowed down as a whole, since {why}"


def _for_limits(certificate: Certificate, remedy: Remedy) -> str:
    worst = certificate.exceeded
    if worst is None:
        return f"it exceeds a limit{remedy('max_intervals', otherwise='give limits a little below the arm’s')}"
    beyond = f"it exceeds the {worst.constraint} of {worst.joint} by {percent(worst.value)} of it"
    return f"{beyond}{remedy('max_intervals', otherwise='lower that limit by as much')}"


def _for_extremal(problem: MinimumTimeProblem, certificate: Certificate, arcs: bool, remedy: Remedy) -> str:
    if not arcs and certificate.remark == ON_CURVE:
        return f"not extremal: {ON_CURVE}{remedy('starts')}"
    if not arcs and problem.path_constraint_names:
        names = ", ".join(problem.path_constraint_names)
        return f"not extremal: Pontryagin's conditions are not checked with {names}; a small gap would say as much"
    if not certificate.on_goal:
        return f"not extremal: {_OFF_GOAL}{remedy('max_intervals', 'armature')}"
    more = remedy("max_intervals", "starts") or remedy("seed")
    if not arcs:
        return f"not extremal: its arcs were not resolved{more}; a small gap would say as much"
    return f"not extremal: its arcs do not quite satisfy the optimality conditions{more}"


def _for_gap(problem: MinimumTimeProblem, certificate: Certificate, remedy: Remedy) -> str:
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
        return f"the gap is not proven: {_OFF_GOAL}{remedy('max_intervals', 'armature')}"
    if certificate.gap > _LITTLE:
        free = "the bound ignores obstacles, " if problem.has_clearance else "the bound "
        return f"a large gap: {free}is by velocity limits, and weak where torque limits decide"
    if certificate.remark == ON_CURVE:
        first = f"look for a faster motion{more}; " if (more := remedy("search", "starts")) else ""
        return f"{first}much of the gap of {percent(certificate.gap)} may be the bound's"
    return f"a gap of {percent(certificate.gap)}; there may be a faster motion{remedy('starts', 'max_intervals')}"
