"""Time-energy optima by the direct method, which the indirect one starts from, too.

With a weight on effort the torque is continuous where no limit of a state is met, so that there are few arcs to
find, but there are several local optima, and J = ∫ (1 + w/2 τᵀτ) dt tells them apart, not the duration.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.arcs.grid import Density
from armdyn.optimal.arcs.phases import TABLEAU, Phases, Unresolved
from armdyn.optimal.arcs.posing import PhaseAim
from armdyn.optimal.arcs.solving import solve_phases
from armdyn.optimal.arcs.structure import with_overlooked, without_idle_touches, without_vanished
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.proof.certificate import HAMILTONIAN_TOLERANCE, pontryagin
from armdyn.optimal.search.multistart import search
from armdyn.optimal.solve.attempt import Attempt
from armdyn.optimal.task.options import DirectOptions, MinimumTimeOptions
from armdyn.optimal.task.policy import Policy
from armdyn.optimal.task.scheme import Scheme
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

_COARSE, _FINE, _MOST_ROUGH, _MOST = 25, 30, 120, 240
"""Intervals of the search, of the first solution by a high order, of the last that is rough, and of the finest."""
_STEPS = 12
"""Solves spent on all optima together; one takes from a tenth of a second to twenty on the finest mesh."""
_SETTLED, _ROUGH = 0.1 * HAMILTONIAN_TOLERANCE, 0.05
"""Of H, and of what it could fall by: where a mesh is fine enough to be replayed, and too coarse to tell limits by."""
_SAME = 1e-4
"""Coarse optima whose J and duration both differ by less than this part and ten times it are one."""
_SAME_OPTIMUM = 1e-7
"""Resolved optima whose J differs by less than this part are one."""
_WORTH = 1.5
"""Coarse optima of a J this much larger than the best are let go; not more, as some of the best are artefacts."""


@dataclass(frozen=True, eq=False)
class SmoothOptima:
    """What a search has found.

    Attributes:
        optima: different local optima, the one of least J first, with costates from the multipliers.
        attempts: what they were found among.
    """

    optima: tuple[Phases, ...]
    attempts: tuple[Attempt, ...]


def smooth_optima(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    starts: int,
    seed: int,
    count: int,
    stop: Stop,
    tell: Callable[[str], None] = lambda text: None,
    workers: int | None = 1,
) -> SmoothOptima:
    """Different local optima from many guesses.

    Args:
        problem: with effort_weight > 0.
        dynamics: of its robot, with a free last body.
        scheme: says the form of the dynamics.
        starts: guesses of the search, the first of them straight.
        seed: of the other guesses.
        count: so many optima at most.
        stop: asked every few iterations.
        tell: told in words what is being tried.
        workers: processes of the search; None: one per core.
    """
    linear = replace(scheme, method="lobatto3", control="linear")
    coarse = [DirectOptions(1e-5, 200)]
    attempts = search(problem, dynamics, linear, [_COARSE], starts, seed, coarse, workers, stop, tell)
    found = [resolve(problem, guess, dynamics, scheme, stop) for guess in _distinct(problem, attempts)[:count]]
    optima: list[Phases] = []
    resolved = (phases for phases in found if isinstance(phases, Phases))
    for phases in sorted(resolved, key=lambda phases: cost(problem, phases)):
        if not optima or cost(problem, phases) > (1 + _SAME_OPTIMUM) * cost(problem, optima[-1]):
            optima.append(phases)
    return SmoothOptima(tuple(optima), tuple(attempts))


def resolve(
    problem: MinimumTimeProblem, guess: Trajectory, dynamics: Dynamics, scheme: Scheme, stop: Stop
) -> Phases | Unresolved:
    """The optimum near a guess by Radau IIA of high order, with its multipliers.

    Args:
        problem: with effort_weight > 0.
        guess: the motion to start from.
        dynamics: of its robot, with a free last body.
        scheme: says the form of the dynamics.
        stop: asked every few iterations.
    """
    arc = Arc(guess.duration, (Mode.FREE,) * problem.robot.nv)
    task = Task(problem, dynamics, scheme, MinimumTimeOptions(), Policy.of(problem), stop)
    return solve_phases(task, [arc], guess, _FINE)


def settled(
    problem: MinimumTimeProblem, dynamics: Dynamics, scheme: Scheme, optima: Sequence[Phases], stop: Stop
) -> Iterator[Phases]:
    """Optima whose mesh and structure are good enough to be replayed, that of least J first.

    The one of least J is improved, by one solve, until it is the best of all and there is nothing to improve:
    coarse meshes promise more than there is, and only what promises most is worth a finer one.

    Args:
        problem: with effort_weight > 0.
        dynamics: of its robot, with a free last body.
        scheme: says the form of the dynamics.
        optima: with one arc each.
        stop: asked every few iterations.
    """
    waiting, left = list(optima), []
    task = Task(problem, dynamics, scheme, MinimumTimeOptions(), Policy.of(problem), stop)

    def promise(phases: Phases) -> float:
        return cost(problem, phases)

    def solved(arcs: Sequence[Arc], size: int, near: Phases, density: Density | None) -> Phases | Unresolved:
        size = max(size, 3 * len(arcs))
        return solve_phases(task, arcs, near.torques, size, PhaseAim(density=density))

    for _ in range(_STEPS):
        if not waiting or stop:
            break
        best = min(waiting, key=promise)
        waiting.remove(best)
        stray, size = _stray(problem, best), best.arc_of.size
        if stray <= _SETTLED:
            yield best
            continue
        density = best.density if stray < 1 else None  # an artefact says nothing of where to look
        if HAMILTONIAN_TOLERANCE < stray < _ROUGH and (arcs := _corrected(problem, best)):
            better = solved(arcs, size, best, density)
            if isinstance(better, Phases) and _stray(problem, better) < stray:
                waiting.append(better)
                continue
        if 2 * size > (_MOST if stray < _ROUGH else _MOST_ROUGH):
            left.append(best)
            continue
        better = solved(best.arcs, 2 * size, best, density)
        if isinstance(better, Phases):
            waiting.append(better)
    yield from sorted(left, key=promise)[:2] or sorted(waiting, key=promise)[:1] or optima[:1]


def _stray(problem: MinimumTimeProblem, phases: Phases) -> float:
    """How far H is from 0, or could fall."""
    hamiltonian, _, sign = pontryagin(problem, phases)
    return float(max(np.max(np.abs(hamiltonian)), sign))


def _corrected(problem: MinimumTimeProblem, phases: Phases) -> list[Arc]:
    """The structure that the multipliers ask for; none: this one."""
    return without_vanished(phases) or with_overlooked(problem, phases) or without_idle_touches(phases)


def cost(problem: MinimumTimeProblem, phases: Phases) -> float:
    """J = ∫ (1 + w/2 τᵀτ) dt [s], by the collocation's own quadrature."""
    squares = np.sum(phases.tau**2, axis=2) @ TABLEAU.b
    return float(phases.duration + problem.effort_weight / 2 * np.diff(phases.t) @ squares)


def _distinct(problem: MinimumTimeProblem, attempts: list[Attempt]) -> list[Trajectory]:
    """Motions of converged attempts, no two the same, by J."""
    solved = [a.trajectory for a in attempts if a.status is Status.SOLVED]
    costs = sorted(((trajectory_cost(motion, problem.effort_weight), k) for k, motion in enumerate(solved)))
    kept: list[tuple[float, Trajectory]] = []
    for value, k in costs:
        motion = solved[k]
        if value <= _WORTH * costs[0][0] and not any(
            value <= (1 + _SAME) * other and abs(motion.duration / like.duration - 1) <= 10 * _SAME
            for other, like in kept
        ):
            kept.append((value, motion))
    return [motion for _, motion in kept]


def trajectory_cost(motion: Trajectory, weight: float) -> float:
    """J = ∫ (1 + w/2 τᵀτ) dt [s], exact for torques that are linear between samples.

    Args:
        motion: of which times and torques count.
        weight: w [1/(N m)²].
    """
    a, b = motion.tau[:-1], motion.tau[1:]
    squares = np.sum(a * a + a * b + b * b, axis=1) / 3
    return float(motion.duration + weight / 2 * np.diff(motion.t) @ squares)
