"""A solution made of the optima that a solve has come to: which is the answer, and what is said of it."""

from collections.abc import Iterable

import numpy as np

from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.problem.status import Status
from armdyn.optimal.proof.certificate import Certificate
from armdyn.optimal.refine.optimum import Optimum
from armdyn.optimal.search.candidates import Found
from armdyn.optimal.search.distinct import grouped, within
from armdyn.optimal.task.task import Task


def assembled(task: Task, optima: list[Optimum], found: Found, elapsed: float) -> Solution:
    """The best of the optima as an answer, beside the durations of all others met.

    Args:
        task: what was solved.
        optima: at least one.
        found: the search that they come from.
        elapsed: wall time [s].
    """
    best, *others = sorted(optima, key=lambda optimum: (_rank(task, optimum), optimum.cost))
    certificate, duration = best.certificate, best.trajectory.duration
    status = _status(task, best)
    missed = best.checked.reasons if best.checked else ()
    if task.stop.late and status is Status.SOLVED and not certificate.ok:
        missed = (*missed, f"the time limit of {task.options.time_limit:g} s ended the search")
    known = [duration, *(optimum.trajectory.duration for optimum in others), *found.slower]
    return Solution(
        success=status is Status.SOLVED,
        status=status,
        message="; ".join((_message(task, status, best), *missed)),
        problem=task.problem,
        duration=duration,
        trajectory=best.trajectory,
        certificate=certificate,
        arcs=best.phases.arcs if best.phases else (),
        phases=best.phases,
        local_optima=_others(task, duration, known, found.listed),
        intervals=best.intervals,
        iterations=found.iterations + sum(optimum.iterations for optimum in optima),
        solve_time=elapsed,
        worst_violation=best.worst_violation,
        clearance=best.checked.clearance if best.checked else None,
        kept=best.checked.kept if best.checked else (),
        via_times=best.via_times,
    )


def failed(task: Task, found: Found, elapsed: float) -> Solution:
    """What there is to say where no motion was found. Arguments as of `assembled`."""
    attempt = found.failed[0]
    return Solution(
        success=False,
        status=attempt.status,
        message=f"{attempt.message}; worst: {attempt.worst_violation}",
        problem=task.problem,
        duration=attempt.trajectory.duration,
        trajectory=attempt.trajectory,
        certificate=Certificate(np.inf, np.inf, np.inf, remark=f"no motion was found ({attempt.message})"),
        intervals=task.options.intervals,
        iterations=found.iterations,
        solve_time=elapsed,
        worst_violation=attempt.worst_violation,
    )


def _rank(task: Task, optimum: Optimum) -> int:
    """Those that keep all conditions and land come first, then those that land."""
    missed = optimum.checked is not None and bool(optimum.checked.reasons)
    return 2 * (not optimum.landed(task.options.replay_tolerance)) + missed


def _status(task: Task, optimum: Optimum) -> Status:
    if task.stop.interrupted:
        return Status.INTERRUPTED
    if not optimum.landed(task.options.replay_tolerance):
        status = Status.REPLAY_MISSED
    else:
        missed = optimum.checked is not None and optimum.checked.reasons
        status = Status.CONDITION_MISSED if missed else Status.SOLVED
    return Status.TIME_LIMIT if task.stop.late and status is not Status.SOLVED else status


def _others(task: Task, best: float, known: Iterable[float], listed: Iterable[float]) -> tuple[float, ...]:
    """Durations of the other optima [s], each once, increasing; a coarse one near a better known one is that one."""
    same, known = task.policy.same, list(known)
    more = [d for d in listed if all(abs(d / own - 1) > same.near_known for own in known)]
    groups = grouped([best, *sorted((*known, *more))], within(same.resolved))
    return tuple(float(group[0]) for group in groups[1:])


def _message(task: Task, status: Status, optimum: Optimum) -> str:
    certificate, duration = optimum.certificate, optimum.trajectory.duration
    if status is Status.REPLAY_MISSED:
        return (
            f"collocation found {duration:.6g} s, but its torques end {certificate.goal_error:.2g} rad from the goal "
            f"when replayed (tolerance {task.options.replay_tolerance:g} rad): raise max_intervals; light links at "
            "strong motors may want the rotors' inertia (armature)"
        )
    if status is not Status.SOLVED:
        return f"{status.replace('_', ' ')}; best so far {duration:.6g} s"
    landed = f"{duration:.9g} s, replayed to within {certificate.goal_error:.1e} rad of the goal"
    return f"{landed}; certified" if certificate.ok else f"{landed}; not certified: {'; '.join(certificate.reasons)}"
