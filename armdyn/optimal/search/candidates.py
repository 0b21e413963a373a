"""The optima that are worth refining: found on coarse meshes, told apart on a finer one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import ProblemError
from armdyn.optimal.landing.rollout import replay_torques
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.search.multistart import SAME, distinct, ranked, search
from armdyn.optimal.search.starts import spline
from armdyn.optimal.solve.condensed import prepare_quickly, solve_quickly
from armdyn.optimal.solve.direct import Attempt, solve_on_mesh
from armdyn.optimal.task.options import DirectOptions, MinimumTimeOptions
from armdyn.optimal.task.policy import Policy
from armdyn.optimal.task.scheme import DynamicsForm, Scheme
from armdyn.optimal.task.task import Task
from armdyn.processes import in_processes
from armdyn.trajectory import Trajectory

_SAME_ON_MESH = 5e-4
"""Durations on one mesh that differ by less than this part, from different guesses, are one optimum."""
_WORTH_REFINING = 1.2
"""Coarse solutions this much slower than the best are not refined, only listed."""
_TRUSTED = 1.05
"""Where the finer mesh makes the best this much slower, coarse ones were too coarse, and are searched on no more."""
_DOUBTED = 1.01
"""Where it makes it this much slower, replays tell whether it is too coarse itself."""
_ASTRAY = 0.2
"""It is where those of all its optima end this far beside the goal, as a part of a joint's way."""

_STARTS = {1: 1, 2: 16, 3: 40}
"""Guesses by joints; beyond three a solve takes seconds, and there are 4."""
_AGAIN = 10
"""The least of them for another search, on finer meshes."""
_ROUND = {1: 1, 2: 12, 3: 16}
"""Guesses by joints where there are obstacles: ways round them, chosen among many; beyond three joints 6."""

_PATIENCE = 250
"""Iterations on a mesh for an arm of more than three joints: those that converge take half of it."""
_KEPT = 1e-6
"""Scaled defects with which a motion beyond three joints is taken, though IPOPT walks on in its flat valley."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """What a search has come to.

    Attributes:
        attempts: the best optima on the first mesh that arcs are read from, best first; if none converged, those
            that did not.
        converged: some did.
        listed: durations of the others on coarse meshes [s].
        iterations: of IPOPT.
        mesh: intervals of the one that arcs are to be read from first.
        slower: durations of those that were told apart on the finer mesh, and were not worth more [s].
    """

    attempts: tuple[Attempt, ...]
    converged: bool
    listed: tuple[float, ...]
    iterations: int
    mesh: int = 0
    slower: tuple[float, ...] = ()


def find_candidates(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    stop: Stop,
    tell: Callable[[str], None],
) -> Candidates:
    """Search from many guesses on coarse meshes, and solve the best on `options.intervals`.

    Args:
        problem: what is to be solved.
        dynamics: of its robot.
        scheme: the transcription.
        options: how many guesses, on which meshes.
        stop: asked every few iterations.
        tell: told in words what is being tried.
    """
    n = problem.robot.nv
    workers = options.workers if n > 1 else 1  # a fork takes as long as the solve
    # With obstacles the straight guess is likely the worst: all begin coarse.
    rounds = bool(problem.obstacles) or problem.self_collision
    count = options.starts or (_ROUND.get(n, 6) if rounds else _STARTS.get(n, 4))
    meshes = options.coarse_intervals if n <= 3 else options.coarse_intervals[:1]

    def on_mesh(guess: Trajectory, own: DirectOptions) -> Callable[[], Attempt]:
        prepare_quickly(problem, dynamics, scheme, options.intervals, own)
        return lambda: solve_quickly(problem, guess, dynamics, scheme, options.intervals, own, stop)

    def searched(meshes: Sequence[int], count: int, beside: Sequence[Callable[[], Attempt]] = ()) -> list[Attempt]:
        own = options.coarse()
        return search(problem, dynamics, scheme, meshes, count, options.seed, own, workers, stop, tell, beside)

    beside = []
    for k, guess in enumerate(options.guesses):
        if guess.q.shape[1] != n:
            raise ProblemError(f"options.guesses[{k}] moves {guess.q.shape[1]} joints, {problem.robot.name} has {n}")
        beside.append(on_mesh(guess, options.fine()))
    if n > 3 and not rounds:  # else there are guesses enough
        beside.append(on_mesh(spline(problem, []), _patient(options.alone(), n)))
    tell(f"search: {count} guesses" + (f", and {len(beside)} on {options.intervals} intervals" if beside else ""))
    attempts = searched(meshes, count, beside)
    found = _different(attempts[: len(beside)], attempts[len(beside) :], n)
    if not found:
        tried = _ladder(problem, dynamics, scheme, options, stop, ranked(attempts), tell)
        iterations, found = sum(a.iterations for a in tried), distinct(ranked(tried))
        if not found:
            return Candidates(tuple(tried), False, (), iterations)
    else:
        iterations = sum(a.iterations for a in attempts)
    limit, mesh = options.refinements or (4 if n <= 3 else 2), options.intervals
    settled, listed, more = _settled(problem, dynamics, scheme, options, found, limit, stop, tell)
    iterations += more
    slower = settled[0].trajectory.duration / found[0].trajectory.duration
    again_at_all = 1 < n <= 3 and not rounds and not stop
    astray = again_at_all and slower > _DOUBTED and all(_astray(problem, attempt) for attempt in settled)
    if astray or (again_at_all and slower > _TRUSTED):
        hopeless = astray and 2 * mesh <= options.max_intervals
        mesh, share = (2 * mesh, 4) if hopeless else (mesh, 2)
        tell(f"optima of {options.coarse_intervals} intervals are {slower:.2f} times as slow on {options.intervals}")
        again = searched((mesh, mesh * 3 // 2), min(count, max(count // share, _AGAIN)))
        iterations += sum(a.iterations for a in again)
        found = distinct(ranked(again if hopeless else [*settled, *again])) or settled
        finer = replace(options, intervals=mesh)
        settled, listed, more = _settled(problem, dynamics, scheme, finer, found, limit, stop, tell)
        iterations += more
    return Candidates(tuple(settled), True, tuple(listed), iterations, mesh)


def _different(alone: Sequence[Attempt], coarse: Sequence[Attempt], joints: int) -> list[Attempt]:
    """What is worth a finer mesh, best first: converged ones on that mesh already, and the search's."""
    known, met = distinct(ranked(alone)), distinct(ranked(coarse))
    if joints <= 3 or not known:  # what is on the finer mesh already may hide none of the others: it costs nothing more
        return ranked([*known, *met])
    # Such a mesh costs seconds here: only what beats the straight guess on its own mesh is worth one.
    straight = coarse[:1] and coarse[0].status is Status.SOLVED
    mark = coarse[0].trajectory.duration * (1 - SAME) if straight else np.inf
    return [*known, *(attempt for attempt in met if attempt.trajectory.duration < mark)]


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
    iterations = 0
    own = _patient(options.fine(), problem.robot.nv)
    prepare_quickly(problem, dynamics, scheme, options.intervals, own)

    def finer(attempt: Attempt) -> Attempt:
        if attempt.intervals == options.intervals:
            return attempt
        guess = attempt.trajectory
        return taken(solve_quickly(problem, guess, dynamics, scheme, options.intervals, own, stop), problem.robot.nv)

    tell(f"the best optima, about {found[0].trajectory.duration:.4f} s, on {options.intervals} intervals")
    jobs = [partial(finer, attempt) for attempt in found]
    for k, (attempt, fine) in enumerate(zip(found, in_processes(jobs, options.workers), strict=True)):
        iterations += fine.iterations if attempt.intervals != options.intervals else 0
        candidates.append(fine if fine.status is Status.SOLVED else attempt)
        candidates = distinct(ranked(candidates), _SAME_ON_MESH) or candidates[:1]
        # Coarse durations may be far too good to be true; those on the mesh are to be beaten.
        worth = _WORTH_REFINING * candidates[0].trajectory.duration
        if len(candidates) == limit or stop or (k + 1 < len(found) and found[k + 1].trajectory.duration >= worth):
            break
    return candidates, [attempt.trajectory.duration for attempt in found[k + 1 :]], iterations


def _astray(problem: MinimumTimeProblem, attempt: Attempt) -> bool:
    """Whether the arm ends somewhere else when the mesh's torques are replayed."""
    motion = attempt.trajectory
    missed = np.abs(problem.beside_goal(replay_torques(problem.robot, motion))[: problem.robot.nv])
    return not np.max(missed) <= _ASTRAY * np.max(np.ptp(motion.q, axis=0))


def _patient(options: DirectOptions, joints: int) -> DirectOptions:
    return replace(options, max_iterations=min(options.max_iterations, _PATIENCE)) if joints > 3 else options


def taken(attempt: Attempt, joints: int) -> Attempt:
    """An attempt that ran out of iterations counts as solved where it moves as the arm would; it keeps its message."""
    left = attempt.worst_violation.value if attempt.worst_violation else np.inf
    feasible = joints > 3 and attempt.status is Status.ITERATION_LIMIT and left <= _KEPT
    return replace(attempt, status=Status.SOLVED) if feasible else attempt


def _ladder(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    stop: Stop,
    failed: list[Attempt],
    tell: Callable[[str], None],
) -> list[Attempt]:
    """When no guess converged: a finer mesh, the other form of the dynamics, and the other guesses' remains."""
    other: DynamicsForm = "inverse" if scheme.dynamics == "forward" else "forward"
    guesses: list[Trajectory] = [spline(problem, []), failed[0].trajectory]
    attempts = list(failed)
    for form, guess in ((scheme.dynamics, guesses[0]), (other, guesses[0]), (scheme.dynamics, guesses[1])):
        if stop:
            break
        tell(f"no guess converged: trying {form} dynamics on {options.intervals} intervals")
        step = replace(scheme, dynamics=form)
        task = Task(problem, dynamics, step, options, Policy.of(problem), stop)
        attempt = solve_on_mesh(task, guess, options.intervals, options.alone())
        attempts.append(attempt)
        if attempt.status is Status.SOLVED:
            break
    return sorted(attempts, key=lambda a: (a.status is not Status.SOLVED, _rest(a)))


def _rest(attempt: Attempt) -> float:
    return attempt.worst_violation.value if attempt.worst_violation else 0.0
