"""Time-energy optima by the direct method, which also starts the indirect one.

With a weight on effort the torque is continuous off the state limits, so that there are few arcs. There are several
local optima, compared by J = ∫ (1 + w/2 τᵀτ) dt, not by duration.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from armdyn.optimal.mesh.candidates import SearchResult
from armdyn.optimal.mesh.detection import with_overlooked, without_idle_touches, without_vanished
from armdyn.optimal.mesh.direct import Attempt
from armdyn.optimal.mesh.land import land, with_adjoint_check
from armdyn.optimal.mesh.multistart import SearchSettings, grouped, search, within
from armdyn.optimal.mesh.phases import Unresolved, solve_phases
from armdyn.optimal.mesh.unknowns import doubled
from armdyn.optimal.problem.options import SolverSettings
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import Arc, Mode
from armdyn.optimal.verify.certificate import OPTIMALITY_TOLERANCE
from armdyn.optimal.verify.optimum import Optimum, trajectory_cost
from armdyn.optimal.verify.phases import TABLEAU, Phases
from armdyn.optimal.verify.pontryagin import pontryagin
from armdyn.trajectory import Trajectory

_LAST = 1e3
"""Multiple of its J that a lead promises if it is to be taken up after all others."""


def time_energy(task: Task) -> tuple[list[Optimum], SearchResult]:
    """Optima by cost, replayed until one reaches the goal, and the search's statistics.

    Args:
        task: task with a weight on effort. The guesses of its options come before the search's.
    """
    numbers, options, weight = task.policy.smooth, task.options, task.problem.effort_weight
    given = [_Candidate(0.0, guess) for guess in options.guesses]
    attempts = _searched(task, task.policy.search.guesses(options, numbers.starts))
    coarse = _distinct(task, attempts)[: task.policy.search.refinements(options, numbers.refined)]
    found = [_Candidate(numbers.optimism * trajectory_cost(motion, weight), motion) for motion in coarse]
    queue = _BestFirst(task, [*given, *found])
    landed: list[Optimum] = []
    for phases in queue.optima():
        paid = cost(task.problem, phases)
        task.progress(f"replaying an optimum of J = {paid:.4f} s")
        landed.append(replace(_replayed(task, phases), cost=paid))
        if landed[-1].landed or task.stop:
            break
    failed = attempts if landed else _none_of(task, attempts, queue.failed)
    iterations = sum(attempt.iterations for attempt in attempts)
    return landed, SearchResult((), failed=tuple(failed), listed=queue.durations, iterations=iterations)


def _replayed(task: Task, phases: Phases) -> Optimum:
    """Replay an optimum, and check its costates by the adjoint equations along the replay.

    The replay's torques are linear between samples. In strongly unstable motions this interpolation error matters:
    finer intervals and more samples reduce it.
    """
    optimum = with_adjoint_check(task, land(task, phases))
    if (optimum.certificate.adjoint_error or 0.0) > OPTIMALITY_TOLERANCE and not task.stop:
        finely = replace(task, policy=task.policy.changed("arcs", samples=task.policy.smooth.samples))
        finer = _solved(finely, phases.arcs, 2 * phases.arc_of.size, phases, 0.0)
        if isinstance(finer, Phases):
            again = with_adjoint_check(finely, land(finely, finer))
            return min(again, optimum, key=lambda one: not one.certificate.ok)
    return optimum


def smooth_optima(task: Task, starts: int, most: int) -> tuple[tuple[Phases, ...], tuple[Attempt, ...]]:
    """Distinct local optima from many guesses.

    Args:
        task: task with a weight on effort.
        starts: number of guesses of the search, the first of them straight.
        most: largest number of optima.

    Returns:
        Optima by J, with costates from the multipliers; and the attempts, which tell, without optima, where those that
        converged on a coarse mesh failed.
    """
    problem, attempts = task.problem, _searched(task, starts)
    found = [resolved_near(task, guess) for guess in _distinct(task, attempts)[:most] if not task.stop]
    solved = sorted((each for each in found if isinstance(each, Phases)), key=lambda phases: cost(problem, phases))
    if not solved:
        failure = [_failed(task, each) for each in found if isinstance(each, Unresolved)]
        attempts = _none_of(task, attempts, failure)
    alike = within(task.policy.same.resolved_cost)
    groups = grouped(solved, lambda first, item: alike(cost(problem, first), cost(problem, item)))
    return tuple(group[0] for group in groups), tuple(attempts)


def _searched(task: Task, starts: int) -> list[Attempt]:
    """Attempts of the search on a coarse mesh."""
    numbers = task.policy.smooth
    linear = replace(task, scheme=replace(task.scheme, control="linear"))
    coarse = [SolverSettings(task.policy.program.coarse_tolerance, numbers.iterations)]
    return search(linear, starts, SearchSettings([numbers.coarse], coarse))


def _none_of(task: Task, attempts: Sequence[Attempt], failure: Sequence[Attempt]) -> list[Attempt]:
    """Reports of attempts without an optimum, the most informative first."""
    reported = [*failure, *attempts]
    if task.stop:
        reported.insert(0, replace(reported[0], status=task.stop.status, message=task.stop.word))
    return reported


def _failed(task: Task, phases: Unresolved) -> Attempt:
    """A coarse optimum that did not converge on the fine mesh, as an attempt there."""
    intervals = task.policy.smooth.fine
    message = f"the coarse optimum did not converge on {intervals} intervals ({phases.message})"
    return Attempt(phases.status, message, phases.last.torques, intervals, phases.iterations, None)


def _no_optimum(phases: Phases, error: float) -> Attempt:
    """Report of an attempt that converged, but to no optimum on any mesh."""
    size = phases.arc_of.size
    message = f"the solution on {size} intervals is no optimum: the Hamiltonian strays from 0 by {error:.2g}"
    return Attempt(Status.FAILED, message, phases.torques, size, phases.iterations, None)


def resolved_near(task: Task, guess: Trajectory) -> Phases | Unresolved:
    """The optimum near a guess by Radau IIA of high order, with its multipliers.

    Args:
        task: task with a weight on effort.
        guess: the initial guess.
    """
    modes = tuple(Mode.PASSIVE if idle else Mode.FREE for idle in task.problem.limits.passive)
    arc = Arc(guess.duration, modes)
    return solve_phases(task, [arc], guess, task.policy.smooth.fine)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """An attempt that may lead to an optimum.

    Attributes:
        promise: lower estimate of its J [s]; 0: unknown.
        motion: solution on a coarse mesh, of a similar problem, or of high order.
    """

    promise: float
    motion: Trajectory | Phases


class _BestFirst:
    """Best-first refinement of candidates by estimated cost J, until no estimate is below the best refined J.

    Coarse meshes underestimate J, and only the best promise is worth a finer mesh.

    Attributes:
        failed: leads that failed.
    """

    def __init__(self, task: Task, candidates: Sequence[_Candidate]):
        self.failed: list[Attempt] = []
        self._task, self._waiting = task, list(candidates)
        self._left, self._resolved = list[Phases](), list[Phases]()

    @property
    def durations(self) -> tuple[float, ...]:
        """Durations of all optima met, resolved or not, except guesses from other problems [s]."""
        coarse = (
            candidate.motion
            for candidate in self._waiting
            if candidate.promise and isinstance(candidate.motion, Trajectory)
        )
        return (*(phases.duration for phases in self._resolved), *(motion.duration for motion in coarse))

    def optima(self) -> Iterator[Phases]:
        """Optima whose mesh and structure are good enough for a replay, by J.

        Without any, the two best of those whose meshes cannot be improved, or the best so far.
        """
        numbers = self._task.policy.smooth
        for _ in range(numbers.steps + len(self._waiting)):
            if not self._waiting or self._task.stop:
                break
            candidate = min(self._waiting, key=lambda candidate: candidate.promise)
            self._waiting = [other for other in self._waiting if other is not candidate]
            best = candidate.motion
            if isinstance(best, Trajectory):
                self._resolve(best, candidate.promise)
            elif (error := _hamiltonian_error(self._task.problem, best)) <= numbers.settled:
                yield best
            else:
                self._improve(best, error)
        waiting = [candidate.motion for candidate in self._waiting if isinstance(candidate.motion, Phases)]
        yield from self._sorted(self._left)[:2] or self._sorted(waiting)[:1]

    def _sorted(self, optima: Sequence[Phases]) -> list[Phases]:
        return sorted(optima, key=lambda phases: cost(self._task.problem, phases))

    def _resolve(self, motion: Trajectory, promise: float) -> None:
        """Solve a lead on the mesh of high order, unless it is near a known optimum."""
        found, problem, numbers = resolved_near(self._task, motion), self._task.problem, self._task.policy.smooth
        if isinstance(found, Unresolved):
            self.failed.append(_failed(self._task, found))
            return
        known, own = [cost(problem, phases) for phases in self._resolved], cost(problem, found)
        if all(abs(own / other - 1) > self._task.policy.same.resolved_cost for other in known):
            self._resolved.append(found)
            worse = own > numbers.likely_artefact * promise / numbers.optimism
            likely_artefact = promise > 0 and (worse or _hamiltonian_error(problem, found) >= numbers.unlikely)
            self._waiting.append(_Candidate(own * (_LAST if likely_artefact else 1.0), found))

    def _improve(self, best: Phases, error: float) -> None:
        """Try another structure, or a finer mesh; if neither converges, it fails or stays unresolved."""
        numbers, rough = self._task.policy.smooth, error >= self._task.policy.smooth.rough
        better: Phases | Unresolved | None = None if rough else _restructured(self._task, best, error)
        if better is None and (size := doubled(best.arc_of.size, numbers.most_rough if rough else numbers.most)):
            better = _solved(self._task, best.arcs, size, best, error)
        if isinstance(better, Phases):
            self._waiting.append(_Candidate(cost(self._task.problem, better), better))
        elif rough:
            self.failed.append(_no_optimum(best, error))
        else:
            self._left.append(best)


def _restructured(task: Task, phases: Phases, error: float) -> Phases | None:
    """Solve the structure that the multipliers imply; None: no such structure, or not better."""
    arcs = task.policy.arcs
    required = (
        without_vanished(phases, arcs) or with_overlooked(task.problem, phases, arcs) or without_idle_touches(phases)
    )
    if not required:
        return None
    better = _solved(task, required, phases.arc_of.size, phases, error)
    return better if isinstance(better, Phases) and _hamiltonian_error(task.problem, better) < error else None


def _solved(task: Task, arcs: Sequence[Arc], size: int, near: Phases, error: float) -> Phases | Unresolved:
    """Solve arcs on a mesh from a near solution; an artefact's density is not used."""
    numbers = task.policy.smooth
    density = near.density if error < numbers.artefact else None
    size = max(size, 3 * len(arcs))
    return solve_phases(task, arcs, near.torques, size, warm=error < numbers.warm, density=density)


def _hamiltonian_error(problem: MinimumTimeProblem, phases: Phases) -> float:
    """Largest deviation of the Hamiltonian from 0, or its possible decrease."""
    hamiltonian, _, sign = pontryagin(problem, phases)
    return float(max(np.max(np.abs(hamiltonian)), sign))


def cost(problem: MinimumTimeProblem, phases: Phases) -> float:
    """J = ∫ (1 + w/2 τᵀτ) dt [s], by the collocation's own quadrature."""
    squares = np.sum(phases.tau**2, axis=2) @ TABLEAU.b
    return float(phases.duration + problem.effort_weight / 2 * np.diff(phases.t) @ squares)


def _distinct(task: Task, attempts: Sequence[Attempt]) -> list[Trajectory]:
    """Motions of usable attempts, distinct, by J."""
    problem, same = task.problem, task.policy.same.coarse_cost
    paid = [(trajectory_cost(a.trajectory, problem.effort_weight), a.trajectory) for a in attempts if a.usable]
    paid.sort(key=lambda one: one[0])
    alike = within(same)
    groups = grouped(
        (one for one in paid if one[0] <= task.policy.smooth.dropped * paid[0][0]),
        lambda first, one: (
            alike(first[0], one[0]) and abs(one[1].duration / first[1].duration - 1) <= task.policy.same.coarse_duration
        ),
    )
    return [group[0][1] for group in groups]
