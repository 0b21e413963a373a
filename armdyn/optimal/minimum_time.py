"""`solve_minimum_time`: search, refine, certify."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import ProblemError
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.arcs.layers import without_dry_friction
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop, stopping
from armdyn.optimal.proof.certificate import Certificate
from armdyn.optimal.refine.arcs import land
from armdyn.optimal.refine.constrained import constrained_optima
from armdyn.optimal.refine.optima import Optimum, refined_optima
from armdyn.optimal.refine.smooth import cost, settled, smooth_optima, trajectory_cost
from armdyn.optimal.search.candidates import Candidates, find_candidates
from armdyn.optimal.search.goals import GoalTried, screened
from armdyn.optimal.search.multistart import SAME
from armdyn.optimal.solve.direct import Attempt
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.policy import Policy
from armdyn.optimal.task.scheme import Scheme
from armdyn.optimal.task.task import Task

_SAME_OPTIMUM = 1e-6
"""Refined durations that differ by less than this part are one optimum."""


def solve_minimum_time(
    problem: MinimumTimeProblem,
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> Solution:
    """The fastest motion between two states, and how far to trust it.

    Many guesses are solved on a coarse mesh; the best different optima are solved finer, their arcs
    resolved to exact switching times, their torques replayed through `pin.aba` by an independent
    integrator, their costates checked. The fastest that lands is the answer.

    Args:
        problem: what is to be solved.
        options: defaults suit arms of one to seven joints.
        progress: told in words what is being tried.

    Returns:
        A `Solution`; look at `success` and `certificate`. Ctrl-C returns the best so far, with status
        "interrupted".
    """
    options = options or MinimumTimeOptions()
    tell = progress or (lambda text: None)
    started = time.perf_counter()
    if len(problem.goals) > 1:
        return _fastest_goal(problem, options, tell)
    dynamics, scheme = Dynamics(problem.robot, free_last_body=True), options.scheme(problem.robot.nv)
    with stopping(options.time_limit) as stop:
        solve = _constrained if problem.along_the_way else _time_energy if problem.effort_weight > 0 else _minimum_time
        results, candidates = solve(problem, dynamics, scheme, options, stop, tell)
    elapsed = time.perf_counter() - started
    if not results:
        return _failure(problem, candidates.attempts[0], candidates.iterations, elapsed, options)
    iterations = candidates.iterations + sum(result.iterations for result in results)
    results = sorted(results, key=lambda result: (_rank(result, options), result.cost))
    known = [*(result.refined.trajectory.duration for result in results), *candidates.slower]
    # A coarse duration may be off by a few SAME: near a better known one it is that one.
    others = [d for d in candidates.listed if all(abs(d / own - 1) > 4 * SAME for own in known)]
    return _solution(problem, results[0], known[1:] + others, iterations, elapsed, options, stop)


def _fastest_goal(problem: MinimumTimeProblem, options: MinimumTimeOptions, tell: Callable[[str], None]) -> Solution:
    """The best of the solutions for the most promising goals, and the durations of all."""
    started = time.perf_counter()
    branches, tried = screened(problem, options, tell)
    solutions: list[Solution] = []
    for i, branch in enumerate(branches):
        left = options.time_limit - (time.perf_counter() - started)
        if solutions and (left <= 0 or solutions[-1].status is Status.INTERRUPTED):
            break
        tell(f"goal {i + 1} of the {len(branches)} best")
        solutions.append(solve_minimum_time(branch, replace(options, time_limit=max(left, 1.0)), tell))
        tried[i] = GoalTried(tried[i].q, solutions[-1].duration if solutions[-1].success else np.inf, refined=True)
    best = min(solutions, key=lambda solution: (not solution.success, solution.duration))
    tried.sort(key=lambda goal: goal.duration)
    return replace(best, goals=tuple(tried), solve_time=time.perf_counter() - started)


def _rank(result: Optimum, options: MinimumTimeOptions) -> int:
    """Those that keep all conditions and land come first, then those that land."""
    missed = result.checked is not None and bool(result.checked.reasons)
    return 2 * (not result.landed(options)) + missed


def _constrained(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    stop: Stop,
    tell: Callable[[str], None],
) -> tuple[list[Optimum], Candidates]:
    """Optima of the mesh with conditions along the way."""
    policy = Policy.of(problem)
    found, candidates = constrained_optima(Task(problem, dynamics, policy.scheme(options), options, policy, stop, tell))
    results = [
        Optimum(
            each.refined,
            trajectory_cost(each.refined.trajectory, problem.effort_weight),
            each.attempt.intervals,
            each.iterations,
            None,
            each.checked,
            tuple(each.attempt.passing.tolist()),
        )
        for each in found
    ]
    return results, candidates


def _minimum_time(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    stop: Stop,
    tell: Callable[[str], None],
) -> tuple[list[Optimum], Candidates]:
    """Optima with arcs, refined in the order of their durations."""
    easier = without_dry_friction(problem) if problem.robot.nv > 3 else problem
    if easier is problem:
        candidates = find_candidates(problem, dynamics, scheme, options, stop, tell)
    else:  # five times as fast, and refinement goes on from there
        candidates = find_candidates(easier, Dynamics(easier.robot, free_last_body=True), scheme, options, stop, tell)
        unmeshed = tuple(replace(attempt, intervals=0) for attempt in candidates.attempts)
        candidates = replace(candidates, attempts=unmeshed)
    if not candidates.converged:
        return [], candidates
    options = replace(options, intervals=candidates.mesh)
    results, slower = refined_optima(problem, dynamics, scheme, options, candidates.attempts, stop, tell)
    return results, replace(candidates, slower=tuple(slower))


def _time_energy(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    stop: Stop,
    tell: Callable[[str], None],
) -> tuple[list[Optimum], Candidates]:
    """Smooth optima in the order of their costs, as far as the first that survives its replay."""
    n = problem.robot.nv
    if options.guesses:
        raise ProblemError("options.guesses: a problem whose effort has a weight makes its own; leave them out")
    starts, limit = options.starts or {1: 2, 2: 16, 3: 24}.get(n, 4), options.refinements or (10 if n == 2 else 6)
    found = smooth_optima(problem, dynamics, scheme, starts, options.seed, limit, stop, tell, options.workers)
    results: list[Optimum] = []
    for phases in settled(problem, dynamics, scheme, found.optima, stop):
        tell(f"replaying an optimum of J = {cost(problem, phases):.4f} s")
        refined = land(problem, dynamics, scheme, phases, stop)
        results.append(Optimum(refined, cost(problem, phases), phases.arc_of.size, phases.iterations))
        if refined.certificate.goal_error <= options.replay_tolerance or stop:
            break
    listed = tuple(phases.duration for phases in found.optima)
    return results, Candidates(found.attempts, bool(results), listed, sum(a.iterations for a in found.attempts))


def _solution(
    problem: MinimumTimeProblem,
    result: Optimum,
    others: Sequence[float],
    iterations: int,
    elapsed: float,
    options: MinimumTimeOptions,
    stop: Stop,
) -> Solution:
    best, certificate = result.refined, result.refined.certificate
    duration = best.trajectory.duration
    status = Status.SOLVED if result.landed(options) else Status.REPLAY_MISSED
    missed = result.checked.reasons if result.checked else ()
    if missed and status is Status.SOLVED:
        status = Status.CONDITION_MISSED
    if stop.interrupted:
        status = Status.INTERRUPTED
    elif stop.late and status is not Status.SOLVED:
        status = Status.TIME_LIMIT
    if stop.late and status is Status.SOLVED and not certificate.ok:
        missed = (*missed, f"the time limit of {options.time_limit:g} s ended the search")
    kept: list[float] = []
    for other in sorted(others):
        if other > (kept[-1] if kept else duration) * (1 + _SAME_OPTIMUM):
            kept.append(float(other))
    return Solution(
        success=status is Status.SOLVED,
        status=status,
        message="; ".join((_message(status, duration, certificate, options), *missed)),
        problem=problem,
        duration=duration,
        trajectory=best.trajectory,
        certificate=certificate,
        arcs=best.phases.arcs if best.phases else (),
        phases=best.phases,
        local_optima=tuple(kept),
        intervals=result.intervals,
        iterations=iterations,
        solve_time=elapsed,
        worst_violation=result.worst_violation,
        clearance=result.checked.clearance if result.checked else None,
        kept=result.checked.kept if result.checked else (),
        via_times=result.via_times,
    )


def _message(status: Status, duration: float, certificate: Certificate, options: MinimumTimeOptions) -> str:
    if status is Status.REPLAY_MISSED:
        return (
            f"collocation found {duration:.6g} s, but its torques end {certificate.goal_error:.2g} rad from the goal "
            f"when replayed (tolerance {options.replay_tolerance:g} rad): raise max_intervals; light links at strong "
            "motors may want the rotors' inertia (armature)"
        )
    if status is not Status.SOLVED:
        return f"{status.replace('_', ' ')}; best so far {duration:.6g} s"
    landed = f"{duration:.9g} s, replayed to within {certificate.goal_error:.1e} rad of the goal"
    return f"{landed}; certified" if certificate.ok else f"{landed}; not certified: {'; '.join(certificate.reasons)}"


def _failure(
    problem: MinimumTimeProblem, attempt: Attempt, iterations: int, elapsed: float, options: MinimumTimeOptions
) -> Solution:
    nowhere = Certificate(np.inf, np.inf, np.inf, remark=f"no motion was found ({attempt.message})")
    return Solution(
        success=False,
        status=attempt.status,
        message=f"{attempt.message}; worst: {attempt.worst_violation}",
        problem=problem,
        duration=attempt.trajectory.duration,
        trajectory=attempt.trajectory,
        certificate=nowhere,
        intervals=options.intervals,
        iterations=iterations,
        solve_time=elapsed,
        worst_violation=attempt.worst_violation,
    )
