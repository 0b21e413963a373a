"""The optima of a search refined and certified, side by side."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.certificate import GOAL_TOLERANCE, HAMILTONIAN_TOLERANCE, LIMIT_TOLERANCE, certify
from armdyn.optimal.condensed import solve_quickly
from armdyn.optimal.constrained import Checked
from armdyn.optimal.direct import Attempt
from armdyn.optimal.monitor import Stop
from armdyn.optimal.options import MinimumTimeOptions
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.optimal.processes import in_processes
from armdyn.optimal.refine import Refined, prepare_refinement, refine
from armdyn.optimal.rollout import replay_torques
from armdyn.optimal.status import Status, Violation
from armdyn.optimal.transcription import Scheme
from armdyn.optimal.within import within_velocity_limits

_SURE = 5.0
"""Optima of three joints and more that are slower on their mesh than one that is certified by more than so many times
what its mesh was wrong by are only listed: to refine them takes longer than all the rest."""
_SLOWER = 1.02
"""The same where that is more than this part of its duration."""


@dataclass(frozen=True, eq=False)
class Optimum:
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

    def landed(self, options: MinimumTimeOptions) -> bool:
        """Whether its replay ends on the goal."""
        return self.refined.certificate.goal_error <= options.replay_tolerance


@dataclass(frozen=True, eq=False)
class _Reached:
    """How far refinement has come.

    Attributes:
        attempt: on the mesh that was last tried; None: the search's own is still the guess.
        guess: the last attempt that converged.
        mesh: intervals of the last.
        best: of the meshes so far; None: none has converged.
        iterations: of all.
    """

    attempt: Attempt
    guess: Attempt
    mesh: int
    best: Optimum | None
    iterations: int


def refined_optima(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    attempts: Sequence[Attempt],
    stop: Stop,
    tell: Callable[[str], None],
) -> tuple[list[Optimum], list[float]]:
    """The arcs of attempts read on the first mesh; on finer ones for the best, until one lands or is certified.

    Args:
        problem: what is solved.
        dynamics: of its robot.
        scheme: the transcription.
        options: the meshes.
        attempts: on the first mesh or, where they have 0 intervals, of a neighbouring problem; best first.
        stop: asked at every iteration.
        tell: told in words what is being tried.

    Returns:
        Them, in the attempts' order, and the durations of those that were not worth it.
    """
    if options.arcs and problem.robot.nv <= 3:
        prepare_refinement(dynamics, scheme)

    def refined(k: int, begun: _Reached | None, finest: int) -> _Reached:
        step = begun or _first(problem, dynamics, scheme, options, attempts[k], stop)
        while not (_enough(problem, options, step) or stop or 2 * step.mesh > finest):
            if step.best is None and step.mesh > options.intervals:
                break
            step = _finer(problem, dynamics, scheme, options, step, stop)
        return step

    # With an answer in hand a slower optimum is worth one mesh, not all of them.
    few, many = options.intervals, options.max_intervals
    jobs = [partial(refined, k, None, few if k else many) for k in range(len(attempts))]
    optima: list[Optimum] = []
    beaten = np.inf
    tell(f"refining optimum 1 of {len(attempts)}, about {attempts[0].trajectory.duration:.4f} s")
    for step in in_processes(jobs, options.workers if problem.robot.nv > 1 else 1):
        k, landed = len(optima), any(optimum.landed(options) for optimum in optima)
        optima.append(_optimum(problem, options, step if landed else refined(k, step, many), stop))
        if optima[k].refined.certificate.ok:
            duration = attempts[k].trajectory.duration
            beaten = min(beaten, duration + _SURE * abs(duration - optima[k].cost), _SLOWER * optima[k].cost)
        left = attempts[k + 1 :]
        if left and (stop or (problem.robot.nv > 2 and left[0].trajectory.duration > beaten)):
            break
        if left:
            tell(f"refining optimum {k + 2}, about {left[0].trajectory.duration:.4f} s")
    return optima, [attempt.trajectory.duration for attempt in attempts[len(optima) :]]


def _first(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    attempt: Attempt,
    stop: Stop,
) -> _Reached:
    """The first mesh."""
    if attempt.intervals != options.intervals:
        return _finer(problem, dynamics, scheme, options, _Reached(attempt, attempt, 0, None, 0), stop)
    best = _read(problem, dynamics, scheme, options, attempt, stop) if attempt.status is Status.SOLVED else None
    return _Reached(attempt, attempt, options.intervals, best, 0)


def _finer(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    step: _Reached,
    stop: Stop,
) -> _Reached:
    """The next mesh."""
    mesh = 2 * step.mesh or options.intervals
    attempt = solve_quickly(problem, step.guess.trajectory, dynamics, scheme, mesh, options.fine(), stop)
    iterations = step.iterations + attempt.iterations
    if attempt.status is not Status.SOLVED:
        return replace(step, attempt=attempt, mesh=mesh, iterations=iterations)
    best = _read(problem, dynamics, scheme, options, attempt, stop)
    if step.best is not None and _quality(step.best.refined) <= _quality(best.refined):
        best = step.best
    return _Reached(attempt, attempt, mesh, best, iterations)


def _read(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    attempt: Attempt,
    stop: Stop,
) -> Optimum:
    """What a mesh's solution comes to."""
    if options.arcs and scheme.control == "constant":
        refined = refine(problem, dynamics, scheme, attempt.trajectory, attempt.intervals, stop)
    else:
        replay = replay_torques(problem.robot, attempt.trajectory)
        certificate = certify(problem, replay, None, "arcs were not asked for")
        refined = Refined(attempt.trajectory, certificate, None)
    if attempt.worst_violation is not None:  # taken all the same: the motion is one, if not the fastest
        remark = f"the collocation did not converge ({attempt.message}): a faster motion may be near"
        told = "; ".join(filter(None, (remark, refined.certificate.remark)))
        refined = replace(refined, certificate=replace(refined.certificate, remark=told))
    return Optimum(refined, refined.trajectory.duration, attempt.intervals, 0)


def _enough(problem: MinimumTimeProblem, options: MinimumTimeOptions, step: _Reached) -> bool:
    """Whether a finer mesh has nothing to give."""
    if step.best is None:
        return False
    certificate = step.best.refined.certificate
    # Finer meshes resolve the arcs of small arms; on larger ones they cost more than they have ever given.
    modest = not options.arcs or problem.robot.nv > 3
    # Arcs along which H vanishes are an extremal's: what a sign has against it no finer mesh takes back.
    extremal = certificate.goal_error <= GOAL_TOLERANCE and certificate.hamiltonian_spread <= HAMILTONIAN_TOLERANCE
    return certificate.ok or (modest and step.best.landed(options)) or (problem.robot.nv > 2 and extremal)


def _optimum(problem: MinimumTimeProblem, options: MinimumTimeOptions, step: _Reached, stop: Stop) -> Optimum:
    """The best of the meshes, within its limits; or what there is."""
    best, attempt = step.best, step.attempt
    if best is None:
        replay = replay_torques(problem.robot, step.guess.trajectory)
        remark = f"did not converge on {step.mesh} intervals ({attempt.message})"
        unresolved = Refined(step.guess.trajectory, certify(problem, replay, None, remark), None)
        duration = unresolved.trajectory.duration
        return Optimum(unresolved, duration, step.mesh, step.iterations, attempt.worst_violation)
    certificate = best.refined.certificate
    if best.refined.phases is None and best.landed(options) and not stop:
        over, near = certificate.limit_violation > LIMIT_TOLERANCE, options.replay_tolerance
        motion, remark = best.refined.trajectory, certificate.remark
        if over and (slower := within_velocity_limits(problem, motion, remark, near, stop)):
            best = replace(best, refined=Refined(*slower, None), cost=slower[0].duration)
    return replace(best, iterations=step.iterations)


def _quality(refined: Refined) -> tuple[bool, float]:
    certificate = refined.certificate
    return not certificate.ok, max(certificate.goal_error, certificate.limit_violation)
