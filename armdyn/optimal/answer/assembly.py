"""From optima to a solution: choice among them, status and message; of several goals the fastest solution."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from armdyn.arguments import expect
from armdyn.models.scene.reaching import GoalPose, slid
from armdyn.optimal.answer.solution import Solution, with_certificate, without_motion
from armdyn.optimal.answer.words import found_words, replay_words
from armdyn.optimal.bound.lower_bound import least_duration
from armdyn.optimal.curves.goals import GoalResult, screened
from armdyn.optimal.mesh.search import SearchResult, grouped, within
from armdyn.optimal.problem.policy.search import SamePolicy
from armdyn.optimal.problem.status import Status, Stop, stopping
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import GAP_TOLERANCE, LIMIT_TOLERANCE, Certificate
from armdyn.optimal.verify.costates import deciding, end_gradient, transversality
from armdyn.optimal.verify.optimum import Optimum, as_replayed
from armdyn.reprs import joint_unit

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
        decides = deciding(task.problem, best.costates, task.policy.curves.least_share)
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
        local_optima=_others(task.policy.same, duration, known, found.listed),
        intervals=best.intervals,
        iterations=found.iterations + sum(optimum.iterations for optimum in optima),
        solve_time=elapsed,
        worst_violation=best.worst_violation
        or (best.reports.worst if certificate.keeps_limits else certificate.exceeded),
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


def _chosen(task: Task, optima: list[Optimum], bound: float | None) -> tuple[Optimum, list[Optimum]]:
    """The best of the optima, with its certificate complete, and the others.

    Optima are completed in turn, best first. This may lower the rank of an optimum, whose replay by another integrator
    may miss the goal or exceed limits: then the next one is completed, too. So are those as fast as a best one that is
    not certified: a certified one of them is preferred.
    """
    left, completed, same = sorted(optima, key=_order), list[Optimum](), task.policy.same.resolved
    while left:
        best = min(completed, key=_order, default=None)
        doubtful = best is not None and not best.certificate.ok and _alike(left[0], best, same)
        if best is not None and _order(best) <= _order(left[0]) and not doubtful:
            break
        completed.append(_completed(task, left.pop(0), bound))
    best = min(completed, key=_order)
    best = min((one for one in completed if _alike(one, best, same)), key=lambda one: not one.certificate.ok)
    return best, [one for one in (*completed, *left) if one is not best]


def _completed(task: Task, optimum: Optimum, bound: float | None) -> Optimum:
    """An optimum with its certificate complete: replayed again, and with the lower bound."""
    optimum = as_replayed(task, optimum)
    certificate = optimum.certificate.bounded(None if task.problem.pays_effort else bound, optimum.trajectory.duration)
    return replace(optimum, certificate=certificate)


def _rank(optimum: Optimum) -> tuple[bool, bool, bool]:
    """Sort key: motions that land first, then those within limits, then those that satisfy path constraints."""
    return not optimum.certificate.lands, not optimum.certificate.keeps_limits, bool(optimum.missed)


def _order(optimum: Optimum) -> tuple[bool, bool, bool, float]:
    """Sort key: `_rank`, then the cost."""
    return *_rank(optimum), optimum.cost


def _alike(optimum: Optimum, best: Optimum, same: float) -> bool:
    """Whether an optimum is as good as the best one, but for rounding."""
    return _rank(optimum) <= _rank(best) and optimum.cost <= (1 + same) * best.cost


def _moves(optimum: Optimum) -> bool:
    """Whether an optimum may be reported as a motion: it lands, and exceeds no limit visibly."""
    nearly = optimum.certificate.limit_violation <= _NEARLY
    return optimum.certificate.lands and nearly and not optimum.missed


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


def _others(same: SamePolicy, best: float, known: Sequence[float], listed: Iterable[float]) -> tuple[float, ...]:
    """Durations of the other optima [s], distinct and increasing; a coarse one near a more accurate one is dropped."""
    more = [d for d in listed if all(abs(d / own - 1) > 4 * same.coarse for own in known)]
    groups = grouped([best, *sorted((*known, *more))], within(same.resolved))
    return tuple(float(group[0]) for group in groups[1:])


def _message(task: Task, status: Status, optimum: Optimum, found: SearchResult) -> str:
    certificate, duration = optimum.certificate, optimum.trajectory.duration
    if status is Status.INFEASIBLE:
        return f"{found.failed[0].message}; without obstacles the fastest motion found takes {duration:.6g} s"
    if not any(_rank(optimum)) and status is not Status.INTERRUPTED:
        weak = task.problem.holding_deficit
        stays = "" if weak is None else f"; not usable: the arm cannot stay at the goal: {weak.words}"
        ended = "" if status is Status.SOLVED else f"{ended_by_time(task.options.time_limit)}; "
        return ended + found_words(certificate, duration) + stays
    if status is Status.REPLAY_MISSED:
        unit, speed = joint_unit(certificate.slides), joint_unit(certificate.slides, "rad/s", "m/s")
        velocity = f"{certificate.goal_velocity_error:.2g} {speed} from its velocity"
        return f"{replay_words(certificate)}, {velocity} (tolerance {task.problem.landing:g} {unit})"
    said = ended_by_time(task.options.time_limit) if status is Status.TIME_LIMIT else status.replace("_", " ")
    if _moves(optimum):
        said += f"; best so far {duration:.6g} s"
    elif status is not Status.CONDITION_MISSED:
        said += "; no motion so far reaches the goal within the limits"
    worst = certificate.exceeded
    if worst is not None and not certificate.keeps_limits:
        said += f"; {worst.constraint} of joint {worst.joint!r} exceeded by {worst.value:.2g} of it"
        said += f" at t = {worst.time:.4g} s"
    return said


Solve = Callable[[Task, float], Solution]


def fastest_goal(task: Task, solve: Solve) -> Solution:
    """Solve for the most promising goals of a problem; return the best solution, with the goals of all.

    Args:
        task: of a problem with several goals, or a goal pose.
        solve: solves a task with one goal within a time limit [s].
    """
    started, problem, options, numbers = time.perf_counter(), task.problem, task.options, task.policy.goals
    until = started + options.time_limit
    task = replace(task, stop=Stop(until, within=task.stop))
    tasks, tried = screened(task)
    solutions: list[Solution] = []
    for i, branch in enumerate(tasks):
        if solutions and task.stop:
            break
        task.progress(f"goal {i + 1} of the {len(tasks)} best")
        solutions.append(solve(branch, max(until - time.perf_counter(), 1e-3)))
        found = solutions[-1].duration if solutions[-1].success else np.inf
        tried[i] = GoalResult(np.asarray(branch.problem.q_goal), found, refined=True)
    best = min(solutions, key=lambda solution: (not solution.success, not solution.moves, solution.duration))
    if problem.goal_pose is not None and best.status is Status.SOLVED:
        best = slid_end(task, best, solve)
    goal = best.problem.x_goal[: problem.robot.nv]
    if best not in solutions:
        tried.append(GoalResult(goal, best.duration, refined=True))
    bound = _bound_of_all(task, solutions, max(until - time.perf_counter(), numbers.bound * options.time_limit))
    missed = transversality(problem, problem.goal_pose, goal, best.costates)
    certificate = replace(best.certificate.bounded(bound, best.duration), transversality=missed)
    tried.sort(key=lambda goal: goal.duration)
    elapsed = time.perf_counter() - started
    answer = replace(with_certificate(best, certificate), goals=tuple(tried), solve_time=elapsed)
    left = task.stop.cut_short and answer.success and not certificate.ok  # goals that were not tried
    if task.stop.interrupted and answer.status is not Status.INTERRUPTED:
        said = f"{task.stop.word}; {answer.message}"
        return replace(answer, success=False, status=Status.INTERRUPTED, message=said)
    if not left or answer.status is Status.TIME_LIMIT:
        return answer
    said = f"{ended_by_time(options.time_limit)}; {answer.message}"
    return replace(answer, status=Status.TIME_LIMIT, message=said)


def slid_end(task: Task, best: Solution, solve: Solve) -> Solution:
    """The fastest solution met while the goal descends along its pose, with steps of Barzilai and Borwein (1988).

    Args:
        task: of the problem with a goal pose; the descent ends with its time.
        best: a solution at one of the joint positions that reach the pose; returned unchanged without costates, or if
            no neighbour is faster.
        solve: solves a task with one goal within a time limit [s].
    """
    numbers, goal = task.policy.goals, expect(task.problem.goal_pose, GoalPose, "goal_pose")
    robot, step = task.problem.robot, numbers.distinct
    for _ in range(numbers.end_solves):
        q = best.problem.x_goal[: robot.nv]
        missed = transversality(best.problem, goal, q, best.costates)
        falls = missed is not None and GAP_TOLERANCE / 10 < missed < np.inf
        if best.costates is None or not falls or step < numbers.least_step:
            break
        gradient = end_gradient(robot, goal, q, best.costates)
        by = -min(step, numbers.largest_step) / float(np.linalg.norm(gradient)) * gradient
        moved = slid(robot, goal, q, by, best.problem.limits)
        if moved is None or task.stop:
            break
        task.progress("the goal moved along the joint positions that reach its pose")
        near = task.for_problem(best.problem.variant(q_goal=moved)).with_options(guesses=(best.trajectory,), starts=1)
        other = solve(near, task.stop.deadline - time.perf_counter())
        if not other.success or other.costates is None or other.duration >= best.duration:
            step /= 4
            continue
        turned = end_gradient(robot, goal, moved, other.costates)
        away, curvature = moved - q, float((moved - q) @ (turned - gradient))
        step = float(away @ away) / curvature * float(np.linalg.norm(turned)) if curvature > 0 else 2 * step
        best = other
    return best


def _bound_of_all(task: Task, solutions: list[Solution], seconds: float) -> float | None:
    """Lower bound on the duration to any goal of the problem, tried or not [s]; None: no bound is known."""
    if not task.options.bound or any(solution.lower_bound is None for solution in solutions):
        return None
    with stopping(seconds, task.stop) as stop:
        bound = least_duration(task.problem, stop.__bool__, task.policy.bound)
    if stop.cut_short:
        task.stop.cut()
    return bound
