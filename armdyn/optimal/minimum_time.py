"""`solve_minimum_time`: search, refine, certify."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import ProblemError
from armdyn.optimal.candidates import Candidates, find_candidates
from armdyn.optimal.certificate import GOAL_TOLERANCE, HAMILTONIAN_TOLERANCE, LIMIT_TOLERANCE, Certificate, certify
from armdyn.optimal.constrained import Checked, constrained_optima
from armdyn.optimal.direct import Attempt, solve_on_mesh
from armdyn.optimal.goals import GoalTried, screened
from armdyn.optimal.layers import without_dry_friction
from armdyn.optimal.monitor import Stop, stopping
from armdyn.optimal.options import MinimumTimeOptions
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.optimal.refine import Refined, land, refine
from armdyn.optimal.rollout import replay_torques
from armdyn.optimal.search import SAME
from armdyn.optimal.smooth import cost, settled, smooth_optima, trajectory_cost
from armdyn.optimal.solution import Solution
from armdyn.optimal.status import Status, Violation
from armdyn.optimal.transcription import Scheme
from armdyn.optimal.within import within_velocity_limits

_SAME_OPTIMUM = 1e-6
"""Refined durations that differ by less than this part are one optimum."""
_BEATEN = 1.02
"""Optima of three joints and more that are this much slower on their mesh than one that is certified are only listed:
to refine them takes longer than all the rest, and meshes are wrong by less."""


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
        solve = _constrained if problem.conditions else _time_energy if problem.effort_weight > 0 else _minimum_time
        results, candidates = solve(problem, dynamics, scheme, options, stop, tell)
    elapsed = time.perf_counter() - started
    if not results:
        return _failure(problem, candidates.attempts[0], candidates.iterations, elapsed, options)
    iterations = candidates.iterations + sum(result.iterations for result in results)
    results = sorted(results, key=lambda result: (_rank(result, options), result.cost))
    refined = [result.refined.trajectory.duration for result in results]
    # A coarse duration may be off by a few SAME: near a refined one it is that one.
    others = [d for d in candidates.listed if all(abs(d / known - 1) > 4 * SAME for known in refined)]
    return _solution(problem, results[0], refined[1:] + others, iterations, elapsed, options, stop)


@dataclass(frozen=True, eq=False)
class _Result:
    """An optimum refined.

    Attributes:
        refined: its motion and certificate.
        cost: what it is judged by [s].
        intervals: of the mesh it was read from.
        iterations: of IPOPT.
        worst_violation: of the mesh's solution, if that did not converge.
        checked: the conditions along the way, if there are any.
        via_times: when it passes the via points [s].
    """

    refined: Refined
    cost: float
    intervals: int
    iterations: int
    worst_violation: Violation | None = None
    checked: Checked | None = None
    via_times: tuple[float, ...] = ()


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


def _rank(result: _Result, options: MinimumTimeOptions) -> int:
    """Those that keep all conditions and land come first, then those that land."""
    missed = result.checked is not None and bool(result.checked.reasons)
    return 2 * (not _landed(result.refined, options)) + missed


def _constrained(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    stop: Stop,
    tell: Callable[[str], None],
) -> tuple[list[_Result], Candidates]:
    """Optima of the mesh with conditions along the way."""
    found, candidates = constrained_optima(problem, dynamics, scheme, options, stop, tell)
    results = [
        _Result(
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
) -> tuple[list[_Result], Candidates]:
    """Optima with arcs, refined in the order of their durations."""
    easier = without_dry_friction(problem) if problem.robot.nv > 3 else problem
    if easier is problem:
        candidates = find_candidates(problem, dynamics, scheme, options, stop, tell)
    else:  # five times as fast, and refinement goes on from there
        candidates = find_candidates(easier, Dynamics(easier.robot, free_last_body=True), scheme, options, stop, tell)
        unmeshed = tuple(replace(attempt, intervals=0) for attempt in candidates.attempts)
        candidates = replace(candidates, attempts=unmeshed)
    results: list[_Result] = []
    listed = list(candidates.listed)
    for attempt in candidates.attempts if candidates.converged else ():
        certified = min((r.cost for r in results if r.refined.certificate.ok), default=np.inf)
        if (results and stop) or (problem.robot.nv > 2 and attempt.trajectory.duration > _BEATEN * certified):
            listed.append(attempt.trajectory.duration)
            continue
        tell(f"refining optimum {len(results) + 1}, about {attempt.trajectory.duration:.4f} s")
        # With an answer in hand a slower optimum is worth one mesh, not all of them.
        finest = options.intervals if any(_landed(r.refined, options) for r in results) else options.max_intervals
        results.append(_refined(problem, dynamics, scheme, options, attempt, finest, stop))
    return results, replace(candidates, listed=tuple(listed))


def _time_energy(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    stop: Stop,
    tell: Callable[[str], None],
) -> tuple[list[_Result], Candidates]:
    """Smooth optima in the order of their costs, as far as the first that survives its replay."""
    n = problem.robot.nv
    if options.guesses:
        raise ProblemError("options.guesses: a problem whose effort has a weight makes its own; leave them out")
    starts, limit = options.starts or {1: 2, 2: 16, 3: 24}.get(n, 4), options.refinements or (10 if n == 2 else 6)
    found = smooth_optima(problem, dynamics, scheme, starts, options.seed, limit, stop, tell, options.workers)
    results: list[_Result] = []
    for phases in settled(problem, dynamics, scheme, found.optima, stop):
        tell(f"replaying an optimum of J = {cost(problem, phases):.4f} s")
        refined = land(problem, dynamics, scheme, phases, stop)
        results.append(_Result(refined, cost(problem, phases), phases.arc_of.size, phases.iterations))
        if _landed(refined, options) or stop:
            break
    listed = tuple(phases.duration for phases in found.optima)
    return results, Candidates(found.attempts, bool(results), listed, sum(a.iterations for a in found.attempts))


def _refined(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    coarse: Attempt,
    finest: int,
    stop: Stop,
) -> _Result:
    """One optimum on finer and finer meshes until it is certified, or else lands at all."""
    mesh, guess, iterations = options.intervals, coarse.trajectory, 0
    best: _Result | None = None
    while True:
        if coarse.intervals == mesh:
            attempt = coarse
        else:
            attempt = solve_on_mesh(problem, guess, dynamics, scheme, mesh, options.fine(), stop)
            iterations += attempt.iterations
        if attempt.status is Status.SOLVED:
            if options.arcs and scheme.control == "constant":
                refined = refine(problem, dynamics, scheme, attempt.trajectory, mesh, stop)
            else:
                replay = replay_torques(problem.robot, attempt.trajectory)
                certificate = certify(problem, replay, None, "arcs were not asked for")
                refined = Refined(attempt.trajectory, certificate, None)
            if attempt.worst_violation is not None:  # taken all the same: the motion is one, if not the fastest
                remark = f"the collocation did not converge ({attempt.message}): a faster motion may be near"
                told = "; ".join(filter(None, (remark, refined.certificate.remark)))
                refined = replace(refined, certificate=replace(refined.certificate, remark=told))
            if best is None or _quality(refined) < _quality(best.refined):
                best = _Result(refined, refined.trajectory.duration, mesh, iterations)
            guess = attempt.trajectory
        # Finer meshes resolve the arcs of small arms; on larger ones they cost more than they have ever given.
        modest = not options.arcs or problem.robot.nv > 3
        enough = best is not None and (best.refined.certificate.ok or (modest and _landed(best.refined, options)))
        # Arcs along which H vanishes are an extremal's: what a sign has against it no finer mesh takes back.
        enough = enough or (best is not None and problem.robot.nv > 2 and _extremal(best.refined))
        if enough or stop or 2 * mesh > finest or (best is None and mesh > options.intervals):
            break
        mesh *= 2
    if best is None:
        replay = replay_torques(problem.robot, coarse.trajectory)
        remark = f"did not converge on {mesh} intervals ({attempt.message})"
        unresolved = Refined(coarse.trajectory, certify(problem, replay, None, remark), None)
        best = _Result(unresolved, coarse.trajectory.duration, mesh, iterations, attempt.worst_violation)
    elif best.refined.phases is None and _landed(best.refined, options) and not stop:
        certificate = best.refined.certificate
        over = certificate.limit_violation > LIMIT_TOLERANCE
        if over and (slower := within_velocity_limits(problem, best.refined.trajectory, certificate.remark, stop)):
            best = replace(best, refined=Refined(*slower, None), cost=slower[0].duration)
    return replace(best, iterations=iterations)


def _quality(refined: Refined) -> tuple[bool, float]:
    certificate = refined.certificate
    return not certificate.ok, max(certificate.goal_error, certificate.limit_violation)


def _extremal(refined: Refined) -> bool:
    certificate = refined.certificate
    return certificate.goal_error <= GOAL_TOLERANCE and certificate.hamiltonian_spread <= HAMILTONIAN_TOLERANCE


def _landed(refined: Refined, options: MinimumTimeOptions) -> bool:
    return refined.certificate.goal_error <= options.replay_tolerance


def _solution(
    problem: MinimumTimeProblem,
    result: _Result,
    others: Sequence[float],
    iterations: int,
    elapsed: float,
    options: MinimumTimeOptions,
    stop: Stop,
) -> Solution:
    best, certificate = result.refined, result.refined.certificate
    duration = best.trajectory.duration
    status = Status.SOLVED if _landed(best, options) else Status.REPLAY_MISSED
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
