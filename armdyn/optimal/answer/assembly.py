"""Assembly of a solution: choice among the optima, status and message."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.answer.words import replay_words
from armdyn.optimal.mesh.candidates import SearchResult
from armdyn.optimal.mesh.land import as_replayed, with_adjoint_check
from armdyn.optimal.mesh.multistart import grouped, within
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status, Violation
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import LIMIT_TOLERANCE, Certificate
from armdyn.optimal.verify.optimum import Optimum
from armdyn.optimal.verify.sensitivity import deciding
from armdyn.reprs import joint_unit
from armdyn.trajectory import Trajectory

_NEARLY = 1000 * LIMIT_TOLERANCE
"""Largest excess over a limit, as a part of it, of a motion that is reported as the best so far."""


def assembled(
    task: Task, optima: list[Optimum], found: SearchResult, elapsed: float, bound: float | None = None
) -> Solution:
    """The solution from the best of the optima, with the durations of the others.

    Args:
        task: problem and settings.
        optima: at least one.
        found: search that found them.
        elapsed: wall time [s].
        bound: proven lower bound on the duration [s]; None: unknown. Not used where effort has a weight.
    """
    best, others = _chosen(task, optima, bound)
    decides = best.decides
    if not decides and best.costates:
        decides = deciding(task.problem, best.costates, task.policy.arcs.least_share)
    idle = tuple(name for name in best.certificate.idle if name not in {one.joint for one in decides})
    certificate, duration = replace(best.certificate, idle=idle), best.trajectory.duration
    status = _status(task, best, found)
    remark = "" if certificate.ok else found.remark
    known = [duration, *(optimum.trajectory.duration for optimum in others), *found.slower]
    return Solution(
        success=not (any(_rank(best)) or task.stop.interrupted),
        status=status,
        message="; ".join((_message(task, status, best, found), *best.missed, *([remark] if remark else []))),
        problem=task.problem,
        duration=duration,
        trajectory=replace(
            best.trajectory, name=task.problem.robot.marked(best.trajectory.name), ends=task.problem.ends
        ),
        certificate=certificate,
        arcs=best.arcs,
        phases=best.phases,
        costates=best.costates,
        local_optima=_others(task, duration, known, found.listed),
        intervals=best.intervals,
        iterations=found.iterations + sum(optimum.iterations for optimum in optima),
        solve_time=elapsed,
        worst_violation=_worst(best),
        clearance=best.reports.clearance,
        constraint_reports=best.reports.each,
        via_times=best.via_times,
        moves=_moves(best),
        calm=best.calm,
        search_remark=remark,
        decides=decides,
    )


def failed(task: Task, found: SearchResult, elapsed: float) -> Solution:
    """The solution without a motion. Arguments as for `assembled`."""
    attempt, worst = found.failed[0], found.failed[0].worst_violation
    if task.stop.interrupted:
        status, why = Status.INTERRUPTED, task.stop.word
    elif task.stop.cut_short:
        status, why = Status.TIME_LIMIT, ended_by_time(task.options.time_limit)
    else:
        status, why = attempt.status, attempt.message
    if weak := [one.words for one in task.problem.weak_ends]:  # more likely than the worst equation
        why = "; ".join((*weak, why))
    elif worst:
        why += f"; worst: {worst}"
    why = "; ".join(filter(None, (why, found.remark)))
    return replace(
        without_motion(task.problem, status, why, attempt.trajectory),
        certificate=Certificate(np.inf, np.inf, np.inf, remark=f"no motion was found ({attempt.message})"),
        intervals=task.intervals,
        iterations=found.iterations,
        solve_time=elapsed,
        worst_violation=worst,
    )


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


def ended_in_time(solution: Solution, limit: float) -> Solution:
    """Mark a solution with several goals, some of which the time limit [s] left untried."""
    if solution.status is Status.TIME_LIMIT or not solution.success or solution.certificate.ok:
        return solution
    return replace(solution, status=Status.TIME_LIMIT, message=f"{ended_by_time(limit)}; {solution.message}")


def _chosen(task: Task, optima: list[Optimum], bound: float | None) -> tuple[Optimum, list[Optimum]]:
    """The best of the optima, with its certificate complete, and the others.

    They are completed in turn, best first: one that another integrator does not repeat comes behind the next one, and
    one that is not certified behind a certified one that is as fast.
    """
    left, known = sorted(optima, key=_order), list[Optimum]()
    while left:
        best = min(known, key=_order, default=None)
        doubtful = best is not None and not best.certificate.ok and _alike(task, left[0], best)
        if best is not None and _order(best) <= _order(left[0]) and not doubtful:
            break
        known.append(_completed(task, left.pop(0), bound))
    best = min(known, key=_order)
    best = min((one for one in known if _alike(task, one, best)), key=lambda one: not one.certificate.ok)
    return best, [one for one in (*known, *left) if one is not best]


def with_certificate(solution: Solution, certificate: Certificate) -> Solution:
    """Replace a solution's certificate, and its message accordingly."""
    before, after = (_solved(one, solution.duration) for one in (solution.certificate, certificate))
    return replace(solution, certificate=certificate, message=solution.message.replace(before, after))


def _completed(task: Task, optimum: Optimum, bound: float | None) -> Optimum:
    """An optimum with its certificate complete: repeated, with the lower bound, and an extremal's adjoint error."""
    optimum = as_replayed(task, optimum)
    certificate = optimum.certificate.bounded(None if task.problem.pays_effort else bound, optimum.trajectory.duration)
    return with_adjoint_check(task, replace(optimum, certificate=certificate))


def _rank(optimum: Optimum) -> tuple[bool, bool, bool]:
    """Sort key: motions that land first, then those within limits, then those that satisfy path constraints."""
    return not optimum.landed, not optimum.within_limits, bool(optimum.missed)


def _order(optimum: Optimum) -> tuple[bool, bool, bool, float]:
    """Sort key: `_rank`, then the cost."""
    return *_rank(optimum), optimum.cost


def _alike(task: Task, optimum: Optimum, best: Optimum) -> bool:
    """Whether an optimum is as good as the best one, but for rounding."""
    return _rank(optimum) <= _rank(best) and optimum.cost <= (1 + task.policy.same.resolved) * best.cost


def _moves(optimum: Optimum) -> bool:
    """Whether an optimum may be reported as a motion: it lands, and exceeds no limit visibly."""
    nearly = optimum.certificate.limit_violation <= _NEARLY
    return optimum.landed and nearly and not optimum.missed


def _status(task: Task, optimum: Optimum, found: SearchResult) -> Status:
    if task.stop.interrupted:
        return Status.INTERRUPTED
    beyond, outside, missed = _rank(optimum)
    kept = not (beyond or outside or missed)
    if task.stop.cut_short and not (kept and optimum.certificate.ok):
        return Status.TIME_LIMIT
    if kept:
        return Status.SOLVED
    if beyond:
        return Status.REPLAY_MISSED
    if outside:
        return Status.LIMIT_EXCEEDED
    blocked = task.problem.has_clearance and any(one.status is Status.INFEASIBLE for one in found.failed[:1])
    return Status.INFEASIBLE if blocked else Status.CONDITION_MISSED


def ended_by_time(limit: float) -> str:
    """Message for a search that its time limit [s] ended."""
    return f"the time limit of {limit:g} s ended the search"


def _worst(optimum: Optimum) -> Violation | None:
    """Worst violation: of a mesh that did not converge, else of the limits, else of the path constraints."""
    if optimum.worst_violation is not None:
        return optimum.worst_violation
    if not optimum.within_limits:
        return optimum.certificate.exceeded
    return optimum.reports.worst


def _others(task: Task, best: float, known: Iterable[float], listed: Iterable[float]) -> tuple[float, ...]:
    """Durations of the other optima [s], distinct and increasing; a coarse one near a more accurate one is dropped."""
    same, known = task.policy.same, list(known)
    more = [d for d in listed if all(abs(d / own - 1) > same.near_known for own in known)]
    groups = grouped([best, *sorted((*known, *more))], within(same.resolved))
    return tuple(float(group[0]) for group in groups[1:])


def _message(task: Task, status: Status, optimum: Optimum, found: SearchResult) -> str:
    certificate, duration = optimum.certificate, optimum.trajectory.duration
    if status is Status.INFEASIBLE:
        return f"{found.failed[0].message}; without obstacles the fastest motion found takes {duration:.6g} s"
    if not any(_rank(optimum)) and status is not Status.INTERRUPTED:
        holding_deficit = task.problem.holding_deficit
        stays = (
            "" if holding_deficit is None else f"; not usable: the arm cannot stay at the goal: {holding_deficit.words}"
        )
        ended = "" if status is Status.SOLVED else f"{ended_by_time(task.options.time_limit)}; "
        return ended + _solved(certificate, duration) + stays
    if status is Status.REPLAY_MISSED:
        unit, speed = (joint_unit(certificate.slides, *units) for units in (("rad", "m"), ("rad/s", "m/s")))
        tolerance = f"(tolerance {task.problem.landing:g} {unit})"
        if certificate.replay == "segments" or not certificate.repeats:
            return f"{replay_words(certificate)} {tolerance}"
        return (
            f"the torques that collocation found end {certificate.goal_error:.2g} {unit} from the goal and "
            f"{certificate.goal_velocity_error:.2g} {speed} from its velocity when replayed {tolerance}; "
            f"open-loop growth {certificate.growth:.2g}"
        )
    said = ended_by_time(task.options.time_limit) if status is Status.TIME_LIMIT else status.replace("_", " ")
    if _moves(optimum):
        said += f"; best so far {duration:.6g} s"
    elif status is not Status.CONDITION_MISSED:
        said += "; no motion so far reaches the goal within the limits"
    worst = certificate.exceeded
    if worst is not None and not optimum.within_limits:
        said += f"; {worst.constraint} of joint {worst.joint!r} exceeded by {worst.value:.2g} of it"
        said += f" at t = {worst.time:.4g} s"
    return said


def _solved(certificate: Certificate, duration: float) -> str:
    return "; ".join((f"{duration:.9g} s", replay_words(certificate), certificate.claims, *certificate.reasons))
