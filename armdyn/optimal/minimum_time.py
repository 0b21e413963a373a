"""`solve_minimum_time`: search, refine, certify."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import ProblemError
from armdyn.optimal.certificate import Certificate, certify
from armdyn.optimal.direct import Attempt, DirectOptions, solve_on_mesh
from armdyn.optimal.monitor import Stop, stopping
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.optimal.refine import Refined, refine
from armdyn.optimal.rollout import replay_torques
from armdyn.optimal.search import SAME, distinct, ranked, search
from armdyn.optimal.solution import Solution
from armdyn.optimal.starts import spline
from armdyn.optimal.status import Status
from armdyn.optimal.transcription import Control, DynamicsForm, Scheme
from armdyn.trajectory import Trajectory

_SAME_OPTIMUM = 1e-6
"""Refined durations that differ by less than this part are one optimum."""
_SAME_ON_MESH = 5e-4
"""The same for durations on one mesh, from different guesses."""
_WORTH_REFINING = 1.2
"""Coarse solutions this much slower than the best are not refined, only listed."""


@dataclass(frozen=True, kw_only=True)
class MinimumTimeOptions:
    """How `solve_minimum_time` goes about it.

    Attributes:
        starts: guesses of the global search; None: 1 for one joint, 32 for two, 48 for three, 4 beyond.
        seed: of the guesses after the first; the same seed gives the same answer.
        refinements: so many of the optima found are refined; None: 4 up to three joints, 2 beyond.
        coarse_intervals: of the search's meshes, which its guesses take turns on; the first alone beyond three joints.
        intervals: of the mesh on which the arcs are read.
        max_intervals: of the finest such mesh, tried when the arcs resist or the replay misses the goal.
        arcs: resolve the arcs to exact switching times; without, the answer is the mesh's.
        replay_tolerance: largest goal error of the replay [rad or m] that counts as landed.
        method: collocation tableau; "lobatto3" is Hermite-Simpson.
        control: torque "linear" or "constant" between knots; the arcs are read from constant ones.
        dynamics: "forward", "inverse", or "auto": forward up to three joints, inverse beyond, where
            the derivatives of the articulated-body algorithm cost more than the extra unknowns.
        compile: the program's derivatives as machine code, ten times as fast, built once by the C compiler and
            kept in the user's cache: always, never, or (None) where building takes only seconds or is done.
        max_iterations: of IPOPT, for one guess on one mesh.
        tolerance: of IPOPT, on the scaled problem.
        time_limit: wall time for the whole solve [s].
        workers: processes of the search; None: one per core. They make no difference to the answer.
        verbose: let IPOPT print.
    """

    starts: int | None = None
    seed: int = 0
    refinements: int | None = None
    coarse_intervals: tuple[int, ...] = (15, 25)
    intervals: int = 40
    max_intervals: int = 160
    arcs: bool = True
    replay_tolerance: float = 1e-3
    method: str = "lobatto3"
    control: Control = "constant"
    dynamics: DynamicsForm | Literal["auto"] = "auto"
    compile: bool | None = None
    max_iterations: int = 500
    tolerance: float = 1e-8
    time_limit: float = 300.0
    workers: int | None = None
    verbose: bool = False

    def __post_init__(self) -> None:
        if not self.coarse_intervals or min(self.coarse_intervals) < 1:
            raise ProblemError(f"coarse_intervals is {self.coarse_intervals}; it must be numbers of at least 1")
        for name in ("starts", "refinements", "intervals", "max_intervals", "max_iterations", "workers"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ProblemError(f"{name} is {value}; it must be at least 1")
        for name in ("replay_tolerance", "tolerance", "time_limit"):
            if not getattr(self, name) > 0:
                raise ProblemError(f"{name} is {getattr(self, name)}; it must be positive")
        if self.control not in ("linear", "constant"):
            raise ProblemError(f"control is {self.control!r}; it must be 'linear' or 'constant'")

    def scheme(self, joints: int) -> Scheme:
        """The transcription for an arm of so many joints."""
        form: DynamicsForm = "forward" if joints <= 3 else "inverse"
        return Scheme(self.method, self.control, form if self.dynamics == "auto" else self.dynamics, self.compile)

    def coarse(self) -> DirectOptions:
        """The same for the search: a small barrier keeps more of the guess, and finds more optima."""
        return DirectOptions(1e-5, self.max_iterations, self.verbose, barrier=1e-2)

    def direct(self, tolerance: float | None = None) -> DirectOptions:
        """The part that one call of IPOPT needs."""
        return DirectOptions(tolerance or self.tolerance, self.max_iterations, self.verbose)


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
    started, n = time.perf_counter(), problem.robot.nv
    dynamics, scheme = Dynamics(problem.robot, free_last_body=True), options.scheme(n)
    count = options.starts or {1: 1, 2: 32, 3: 48}.get(n, 4)
    if problem.effort_weight > 0 and options.starts is None:
        count = min(count, 4)  # smooth problems have few optima
    meshes = options.coarse_intervals if n <= 3 else options.coarse_intervals[:1]
    with stopping(options.time_limit) as stop:
        coarse = search(
            problem, dynamics, scheme, meshes, count, options.seed, options.coarse(), options.workers, stop, tell
        )
        tell(f"straight guess on {options.intervals} intervals")
        straight = spline(problem, [])
        plain = solve_on_mesh(problem, straight, dynamics, scheme, options.intervals, options.direct(1e-6), stop)
        iterations = plain.iterations + sum(attempt.iterations for attempt in coarse)
        if n > 3 and plain.status is Status.SOLVED:
            # A finer mesh costs seconds here: only what beats the straight guess on its own mesh is worth one.
            mark = coarse[0].trajectory.duration * (1 - SAME) if coarse[0].status is Status.SOLVED else np.inf
            found = [plain, *(a for a in distinct(ranked(coarse)) if a.trajectory.duration < mark)]
        else:
            found = distinct(ranked([*coarse, plain]))
        coarse = ranked([*coarse, plain])
        if not found:
            coarse, more = _ladder(problem, dynamics, scheme, options, stop, coarse, tell)
            iterations, found = iterations + more, distinct(ranked(coarse))
        limit = options.refinements or (4 if n <= 3 else 2)
        candidates, listed, more = _settled(problem, dynamics, scheme, options, found, limit, stop, tell)
        iterations += more
        results: list[tuple[Refined, Attempt, int]] = []
        for attempt in candidates:
            if results and stop:
                listed.append(attempt.trajectory.duration)
                continue
            tell(f"refining optimum {len(results) + 1}, about {attempt.trajectory.duration:.4f} s")
            # With a certified answer in hand a slower optimum is worth one mesh, not all of them.
            finest = options.intervals if any(r.certificate.ok for r, *_ in results) else options.max_intervals
            results.append(_refined(problem, dynamics, scheme, options, attempt, finest, stop))
            iterations += results[-1][1].iterations
    elapsed = time.perf_counter() - started
    if not results:
        return _failure(problem, coarse[0], iterations, elapsed, options)
    results.sort(key=lambda result: (not _landed(result[0], options), result[0].trajectory.duration))
    best, attempt, mesh = results[0]
    refined = [r.trajectory.duration for r, *_ in results]
    # A coarse duration may be off by a few SAME: near a refined one it is that one.
    others = refined[1:] + [d for d in listed if all(abs(d / known - 1) > 4 * SAME for known in refined)]
    return _solution(problem, best, attempt, mesh, others, iterations, elapsed, options, stop)


def _settled(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    found: Sequence[Attempt],
    limit: int,
    stop: Stop,
    tell: Callable[[str], None],
) -> tuple[list[Attempt], list[float], int]:
    """The best coarse optima, each once, on the mesh that arcs are read from first.

    Returns:
        Them, in the order that this mesh puts them in; durations of the others; iterations spent.
    """
    candidates: list[Attempt] = []
    listed: list[float] = []
    iterations = 0
    for attempt in found:
        worth = attempt.trajectory.duration < _WORTH_REFINING * found[0].trajectory.duration
        if candidates and (len(candidates) == limit or stop or not worth):
            listed.append(attempt.trajectory.duration)
            continue
        finer = attempt
        if attempt.intervals != options.intervals:
            tell(f"optimum of about {attempt.trajectory.duration:.4f} s on {options.intervals} intervals")
            finer = solve_on_mesh(
                problem, attempt.trajectory, dynamics, scheme, options.intervals, options.direct(1e-6), stop
            )
            iterations += finer.iterations
        candidates.append(finer if finer.status is Status.SOLVED else attempt)
        candidates = distinct(candidates, _SAME_ON_MESH)
    return candidates, listed, iterations


def _refined(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    coarse: Attempt,
    finest: int,
    stop: Stop,
) -> tuple[Refined, Attempt, int]:
    """One optimum on finer and finer meshes until it is certified, or else lands at all."""
    mesh, guess, iterations = options.intervals, coarse.trajectory, 0
    best: tuple[Refined, Attempt, int] | None = None
    while True:
        if coarse.intervals == mesh:
            attempt = coarse
        else:
            attempt = solve_on_mesh(problem, guess, dynamics, scheme, mesh, options.direct(1e-6), stop)
            iterations += attempt.iterations
        attempt = attempt.after(iterations)  # those of the coarse attempt are counted with the search
        if attempt.status is Status.SOLVED:
            if options.arcs and (scheme.control == "constant" or problem.effort_weight > 0):
                refined = refine(problem, dynamics, scheme, attempt.trajectory, mesh, stop)
            else:
                replay = replay_torques(problem.robot, attempt.trajectory)
                certificate = certify(problem, replay, None, "arcs were not asked for")
                refined = Refined(attempt.trajectory, certificate, None)
            if best is None or _quality(refined) < _quality(best[0]):
                best = refined, attempt, mesh
            guess = attempt.trajectory
        # Finer meshes resolve the arcs of small arms; on larger ones they cost more than they have ever given.
        modest = not options.arcs or problem.robot.nv > 3
        enough = best is not None and (best[0].certificate.ok or (modest and _landed(best[0], options)))
        if enough or stop or 2 * mesh > finest or (best is None and mesh > options.intervals):
            break
        mesh *= 2
    if best is None:
        replay = replay_torques(problem.robot, coarse.trajectory)
        remark = f"did not converge on {mesh} intervals ({attempt.message})"
        best = Refined(coarse.trajectory, certify(problem, replay, None, remark), None), attempt, mesh
    return best


def _ladder(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    stop: Stop,
    failed: list[Attempt],
    tell: Callable[[str], None],
) -> tuple[list[Attempt], int]:
    """When no guess converged: a finer mesh, the other form of the dynamics, and the other guesses' remains."""
    other: DynamicsForm = "inverse" if scheme.dynamics == "forward" else "forward"
    guesses: list[Trajectory] = [spline(problem, []), failed[0].trajectory]
    attempts, iterations = list(failed), 0
    for form, guess in ((scheme.dynamics, guesses[0]), (other, guesses[0]), (scheme.dynamics, guesses[1])):
        if stop:
            break
        tell(f"no guess converged: trying {form} dynamics on {options.intervals} intervals")
        step = replace(scheme, dynamics=form)
        attempt = solve_on_mesh(problem, guess, dynamics, step, options.intervals, options.direct(), stop)
        attempts.append(attempt)
        iterations += attempt.iterations
        if attempt.status is Status.SOLVED:
            break
    return sorted(attempts, key=lambda a: (a.status is not Status.SOLVED, _rest(a))), iterations


def _rest(attempt: Attempt) -> float:
    return attempt.worst_violation.value if attempt.worst_violation else 0.0


def _quality(refined: Refined) -> tuple[bool, float]:
    certificate = refined.certificate
    return not certificate.ok, max(certificate.goal_error, certificate.limit_violation)


def _landed(refined: Refined, options: MinimumTimeOptions) -> bool:
    return refined.certificate.goal_error <= options.replay_tolerance


def _solution(
    problem: MinimumTimeProblem,
    best: Refined,
    attempt: Attempt,
    mesh: int,
    others: Sequence[float],
    iterations: int,
    elapsed: float,
    options: MinimumTimeOptions,
    stop: Stop,
) -> Solution:
    duration, certificate = best.trajectory.duration, best.certificate
    status = Status.SOLVED if _landed(best, options) else Status.REPLAY_MISSED
    if stop.interrupted:
        status = Status.INTERRUPTED
    elif stop.late and not certificate.ok:
        status = Status.TIME_LIMIT
    kept: list[float] = []
    for other in sorted(others):
        if other > (kept[-1] if kept else duration) * (1 + _SAME_OPTIMUM):
            kept.append(float(other))
    return Solution(
        success=status is Status.SOLVED,
        status=status,
        message=_message(status, duration, certificate, options),
        problem=problem,
        duration=duration,
        trajectory=best.trajectory,
        certificate=certificate,
        arcs=best.phases.arcs if best.phases else (),
        phases=best.phases,
        local_optima=tuple(kept),
        intervals=mesh,
        iterations=iterations,
        solve_time=elapsed,
        worst_violation=attempt.worst_violation,
    )


def _message(status: Status, duration: float, certificate: Certificate, options: MinimumTimeOptions) -> str:
    if status is Status.REPLAY_MISSED:
        return (
            f"collocation found {duration:.6g} s, but its torques end {certificate.goal_error:.2g} rad from the goal "
            f"when replayed (tolerance {options.replay_tolerance:g} rad): raise max_intervals"
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
