"""Time-energy optima by the direct method, which the indirect one starts from, too.

With a weight on effort the torque is continuous where no limit of a state is met, so that there are few arcs to
find, but there are several local optima, and J = ∫ (1 + w/2 τᵀτ) dt tells them apart, not the duration.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from armdyn.errors import ProblemError
from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.arcs.phases import TABLEAU, Phases, Unresolved
from armdyn.optimal.arcs.posing import PhaseAim
from armdyn.optimal.arcs.solving import solve_phases
from armdyn.optimal.arcs.structure import with_overlooked, without_idle_touches, without_vanished
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.proof.pontryagin import pontryagin
from armdyn.optimal.refine.land import land
from armdyn.optimal.refine.optimum import Optimum
from armdyn.optimal.search.candidates import Found
from armdyn.optimal.search.distinct import grouped, within
from armdyn.optimal.search.multistart import search
from armdyn.optimal.solve.attempt import Attempt
from armdyn.optimal.task.ladder import Ladder
from armdyn.optimal.task.options import DirectOptions
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory


def time_energy(task: Task) -> tuple[list[Optimum], Found]:
    """Optima in the order of their costs, as far as the first that survives its replay, and their search.

    Args:
        task: with a weight on effort.

    Raises:
        ProblemError: the options have guesses.
    """
    if task.options.guesses:
        raise ProblemError("options.guesses: a problem whose effort has a weight makes its own; leave them out")
    starts = task.options.starts or task.policy.smooth.starts
    optima, attempts = smooth_optima(task, starts, task.options.refinements or task.policy.smooth.refined)
    landed: list[Optimum] = []
    for phases in settled(task, optima):
        paid = cost(task.problem, phases)
        task.tell(f"replaying an optimum of J = {paid:.4f} s")
        landed.append(replace(land(task, phases), cost=paid))
        if landed[-1].landed(task.options.replay_tolerance) or task.stop:
            break
    iterations, listed = sum(attempt.iterations for attempt in attempts), tuple(phases.duration for phases in optima)
    return landed, Found((), failed=tuple(attempts), listed=listed, iterations=iterations)


def smooth_optima(task: Task, starts: int, most: int) -> tuple[tuple[Phases, ...], tuple[Attempt, ...]]:
    """Different local optima from many guesses.

    Args:
        task: with a weight on effort.
        starts: guesses of the search, the first of them straight.
        most: so many optima at most.

    Returns:
        Optima, the one of least J first, with costates from the multipliers; and what they were found among, which
        says, if there are none, where those that converged on a coarse mesh have failed.
    """
    numbers, problem = task.policy.smooth, task.problem
    linear = replace(task, scheme=replace(task.scheme, method="lobatto3", control="linear"))
    coarse = [DirectOptions(task.policy.program.coarse_tolerance, numbers.iterations)]
    attempts = search(linear, [numbers.coarse], starts, coarse)
    found = [resolved_near(task, guess) for guess in _distinct(task, attempts)[:most] if not task.stop]
    solved = sorted((each for each in found if isinstance(each, Phases)), key=lambda phases: cost(problem, phases))
    if not solved:
        attempts = [*(_failed(each, numbers.fine) for each in found if isinstance(each, Unresolved)), *attempts]
        if task.stop:
            attempts.insert(0, replace(attempts[0], status=task.stop.status, message=task.stop.word))
    alike = within(task.policy.same.resolved_cost)
    groups = grouped(solved, lambda first, item: alike(cost(problem, first), cost(problem, item)))
    return tuple(group[0] for group in groups), tuple(attempts)


def _failed(phases: Unresolved, intervals: int) -> Attempt:
    """A coarse optimum that did not converge on the fine mesh, as an attempt there."""
    message = f"what converged on a coarse mesh does not on {intervals} intervals ({phases.message})"
    return Attempt(phases.status, message, phases.last.torques, intervals, phases.iterations, None)


def resolved_near(task: Task, guess: Trajectory) -> Phases | Unresolved:
    """The optimum near a guess by Radau IIA of high order, with its multipliers.

    Args:
        task: with a weight on effort.
        guess: the motion to start from.
    """
    modes = tuple(Mode.PASSIVE if idle else Mode.FREE for idle in task.problem.limits.passive)
    arc = Arc(guess.duration, modes)
    return solve_phases(task, [arc], guess, task.policy.smooth.fine)


def settled(task: Task, optima: Sequence[Phases]) -> Iterator[Phases]:
    """Optima whose mesh and structure are good enough to be replayed, that of least J first.

    The one of least J is improved, by one solve, until it is the best of all and there is nothing to improve:
    coarse meshes promise more than there is, and only what promises most is worth a finer one.

    Args:
        task: with a weight on effort.
        optima: with one arc each.
    """
    waiting, left, numbers = list(optima), list[Phases](), task.policy.smooth

    def promise(phases: Phases) -> float:
        return cost(task.problem, phases)

    for _ in range(numbers.steps):
        if not waiting or task.stop:
            break
        best = min(waiting, key=promise)
        waiting.remove(best)
        stray = _stray(task.problem, best)
        if stray <= numbers.settled:
            yield best
            continue
        better = _restructured(task, best, stray)
        size = Ladder(numbers.most if stray < numbers.rough else numbers.most_rough).above(best.arc_of.size)
        if better is None and size is None:
            left.append(best)
            continue
        if better is None and size is not None:
            finer = _solved(task, best.arcs, size, best, stray)
            better = finer if isinstance(finer, Phases) else None
        if better is not None:
            waiting.append(better)
    yield from sorted(left, key=promise)[:2] or sorted(waiting, key=promise)[:1] or optima[:1]


def _restructured(task: Task, phases: Phases, stray: float) -> Phases | None:
    """With the structure that the multipliers ask for; None: there is none, or it is no better."""
    numbers, arcs = task.policy.smooth, task.policy.arcs
    if not numbers.doubted < stray < numbers.rough:
        return None
    wanted = (
        without_vanished(phases, arcs) or with_overlooked(task.problem, phases, arcs) or without_idle_touches(phases)
    )
    if not wanted:
        return None
    better = _solved(task, wanted, phases.arc_of.size, phases, stray)
    return better if isinstance(better, Phases) and _stray(task.problem, better) < stray else None


def _solved(task: Task, arcs: Sequence[Arc], size: int, near: Phases, stray: float) -> Phases | Unresolved:
    """Arcs on a mesh, from a solution that is near; an artefact says nothing of where to look."""
    density = near.density if stray < task.policy.smooth.artefact else None
    return solve_phases(task, arcs, near.torques, max(size, 3 * len(arcs)), PhaseAim(density=density))


def _stray(problem: MinimumTimeProblem, phases: Phases) -> float:
    """How far H is from 0, or could fall."""
    hamiltonian, _, sign = pontryagin(problem, phases)
    return float(max(np.max(np.abs(hamiltonian)), sign))


def cost(problem: MinimumTimeProblem, phases: Phases) -> float:
    """J = ∫ (1 + w/2 τᵀτ) dt [s], by the collocation's own quadrature."""
    squares = np.sum(phases.tau**2, axis=2) @ TABLEAU.b
    return float(phases.duration + problem.effort_weight / 2 * np.diff(phases.t) @ squares)


def _distinct(task: Task, attempts: Sequence[Attempt]) -> list[Trajectory]:
    """Motions of usable attempts, no two the same, by J."""
    problem, same = task.problem, task.policy.same.coarse_cost
    paid = [(trajectory_cost(a.trajectory, problem.effort_weight), a.trajectory) for a in attempts if a.usable]
    paid.sort(key=lambda one: one[0])
    alike = within(same)
    groups = grouped(
        (one for one in paid if one[0] <= task.policy.smooth.worth * paid[0][0]),
        lambda first, one: (
            alike(first[0], one[0]) and abs(one[1].duration / first[1].duration - 1) <= task.policy.same.coarse_duration
        ),
    )
    return [group[0][1] for group in groups]


def trajectory_cost(motion: Trajectory, weight: ArrayLike) -> float:
    """J = ∫ (1 + ½ Σ wᵢ τᵢ²) dt [s], exact for torques that are linear between samples.

    Args:
        motion: of which times and torques count.
        weight: w [1/(N m)²], one number or one per joint.
    """
    a, b = motion.tau[:-1], motion.tau[1:]
    squares = np.sum(np.asarray(weight) * (a * a + a * b + b * b), axis=1) / 3
    return float(motion.duration + np.diff(motion.t) @ squares / 2)
