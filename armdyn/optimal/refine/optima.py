"""The optima of a search refined and certified, side by side."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.conditions.demands import Checked
from armdyn.optimal.landing.rollout import replay_torques
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status, Violation
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.proof.certificate import GOAL_TOLERANCE, HAMILTONIAN_TOLERANCE, LIMIT_TOLERANCE, certify
from armdyn.optimal.refine.arcs import Refined, prepare_refinement, refine
from armdyn.optimal.refine.slowing import within_velocity_limits
from armdyn.optimal.solve.condensed import solve_quickly
from armdyn.optimal.solve.direct import Attempt
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.scheme import Scheme
from armdyn.processes import in_processes

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


@dataclass(frozen=True, eq=False)
class _Refinement:
    """What all optima of a problem are refined by."""

    problem: MinimumTimeProblem
    dynamics: Dynamics
    scheme: Scheme
    options: MinimumTimeOptions
    stop: Stop

    def first(self, attempt: Attempt) -> _Reached:
        """The first mesh."""
        if attempt.intervals != self.options.intervals:
            return self.finer(_Reached(attempt, attempt, 0, None, 0))
        best = self.read(attempt) if attempt.status is Status.SOLVED else None
        return _Reached(attempt, attempt, self.options.intervals, best, 0)

    def finer(self, step: _Reached) -> _Reached:
        """The next mesh."""
        mesh, guess = 2 * step.mesh or self.options.intervals, step.guess.trajectory
        own = self.options.fine()
        attempt = solve_quickly(self.problem, guess, self.dynamics, self.scheme, mesh, own, self.stop)
        iterations = step.iterations + attempt.iterations
        if attempt.status is not Status.SOLVED:
            return replace(step, attempt=attempt, mesh=mesh, iterations=iterations)
        best = self.read(attempt)
        if step.best is not None and _quality(step.best.refined) <= _quality(best.refined):
            best = step.best
        return _Reached(attempt, attempt, mesh, best, iterations)

    def up_to(self, finest: int, step: _Reached) -> _Reached:
        """On finer and finer meshes until there is enough."""
        while not (self.enough(step) or self.stop or 2 * step.mesh > finest):
            if step.best is None and step.mesh > self.options.intervals:
                break
            step = self.finer(step)
        return step

    def read(self, attempt: Attempt) -> Optimum:
        """What a mesh's solution comes to."""
        problem, motion = self.problem, attempt.trajectory
        if self.options.arcs and self.scheme.control == "constant":
            refined = refine(problem, self.dynamics, self.scheme, motion, attempt.intervals, self.stop)
        else:
            certificate = certify(problem, replay_torques(problem.robot, motion), None, "arcs were not asked for")
            refined = Refined(motion, certificate, None)
        if attempt.worst_violation is not None:  # taken all the same: the motion is one, if not the fastest
            remark = f"the collocation did not converge ({attempt.message}): a faster motion may be near"
            told = "; ".join(filter(None, (remark, refined.certificate.remark)))
            refined = replace(refined, certificate=replace(refined.certificate, remark=told))
        return Optimum(refined, refined.trajectory.duration, attempt.intervals, 0)

    def enough(self, step: _Reached) -> bool:
        """Whether a finer mesh has nothing to give."""
        if step.best is None:
            return False
        certificate, joints = step.best.refined.certificate, self.problem.robot.nv
        # Finer meshes resolve the arcs of small arms; on larger ones they cost more than they have ever given.
        modest = not self.options.arcs or joints > 3
        # Arcs along which H vanishes are an extremal's: what a sign has against it no finer mesh takes back.
        extremal = certificate.goal_error <= GOAL_TOLERANCE and certificate.hamiltonian_spread <= HAMILTONIAN_TOLERANCE
        return certificate.ok or (modest and step.best.landed(self.options)) or (joints > 2 and extremal)

    def optimum(self, step: _Reached) -> Optimum:
        """The best of the meshes, within its limits; or what there is."""
        problem, best, attempt = self.problem, step.best, step.attempt
        if best is None:
            motion = step.guess.trajectory
            remark = f"did not converge on {step.mesh} intervals ({attempt.message})"
            certificate = certify(problem, replay_torques(problem.robot, motion), None, remark)
            unresolved = Refined(motion, certificate, None)
            return Optimum(unresolved, motion.duration, step.mesh, step.iterations, attempt.worst_violation)
        certificate = best.refined.certificate
        over = certificate.limit_violation > LIMIT_TOLERANCE
        if over and best.refined.phases is None and best.landed(self.options) and not self.stop:
            motion, remark, near = best.refined.trajectory, certificate.remark, self.options.replay_tolerance
            if slower := within_velocity_limits(problem, motion, remark, near, self.stop):
                best = replace(best, refined=Refined(*slower, None), cost=slower[0].duration)
        return replace(best, iterations=step.iterations)


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
        stop: asked every few iterations.
        tell: told in words what is being tried.

    Returns:
        Them, in the attempts' order, and the durations of those that were not worth it.
    """
    if options.arcs and scheme.control == "constant" and problem.robot.nv <= 3:
        prepare_refinement(dynamics, scheme)
    refinement = _Refinement(problem, dynamics, scheme, options, stop)
    # With an answer in hand a slower optimum is worth one mesh, not all of them.
    few, many = options.intervals, options.max_intervals

    def refined(k: int) -> _Reached:
        return refinement.up_to(few if k else many, refinement.first(attempts[k]))

    optima: list[Optimum] = []
    beaten = np.inf
    tell(f"refining optimum 1 of {len(attempts)}, about {attempts[0].trajectory.duration:.4f} s")
    jobs = [partial(refined, k) for k in range(len(attempts))]
    for k, step in enumerate(in_processes(jobs, options.workers if problem.robot.nv > 1 else 1)):
        landed = any(optimum.landed(options) for optimum in optima)
        optima.append(refinement.optimum(step if landed else refinement.up_to(many, step)))
        if optima[k].refined.certificate.ok:
            duration = attempts[k].trajectory.duration
            beaten = min(beaten, duration + _SURE * abs(duration - optima[k].cost), _SLOWER * optima[k].cost)
        left = attempts[k + 1 :]
        if left and (stop or (problem.robot.nv > 2 and left[0].trajectory.duration > beaten)):
            break
        if left:
            tell(f"refining optimum {k + 2}, about {left[0].trajectory.duration:.4f} s")
    return optima, [attempt.trajectory.duration for attempt in attempts[len(optima) :]]


def _quality(refined: Refined) -> tuple[bool, float]:
    certificate = refined.certificate
    return not certificate.ok, max(certificate.goal_error, certificate.limit_violation)
