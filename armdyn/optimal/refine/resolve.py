"""From a mesh's solution to its arcs: the switching structure whose switching functions agree with its modes."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from armdyn.optimal.arcs.arc import Arc
from armdyn.optimal.arcs.detection import detect
from armdyn.optimal.landing.shooting import replay_on_goal
from armdyn.optimal.problem.status import Budget
from armdyn.optimal.proof.certificate import GOAL_TOLERANCE, HAMILTONIAN_TOLERANCE, SWITCHING_TOLERANCE
from armdyn.optimal.proof.pontryagin import pontryagin
from armdyn.optimal.refine.land import as_replayed, land_extremal, with_adjoint_check
from armdyn.optimal.refine.motion_mesh import ResolvedMotions, mesh_optimum
from armdyn.optimal.refine.optimum import Optimum
from armdyn.optimal.refine.slowing import least_slowing
from armdyn.optimal.refine.switch_mesh import at_switches
from armdyn.optimal.search.candidates import at_speed
from armdyn.optimal.solve.direct import Attempt
from armdyn.optimal.switching.costates import phases_of
from armdyn.optimal.switching.extremal.quadratic_model import LinearRollout
from armdyn.optimal.switching.extremal.rollout import ShootingProblem
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.from_arcs import structures_of
from armdyn.optimal.switching.refinement import (
    RefinedExtremal,
    leaves_idle,
    refine_extremal,
    shooting_problem,
)
from armdyn.optimal.task.task import Task

_IDLE = "time leaves a joint idle"


def resolve(task: Task, attempt: Attempt, budget: Budget, resolved: ResolvedMotions) -> Optimum:
    """Best motion near a mesh's solution: a certified one if there is one, else the first by `rank`.

    Args:
        task: the problem and its settings.
        attempt: a collocation solution with constant torques between its knots.
        budget: budget of integrator steps.
        resolved: cache of the problem's resolved motions, extended here.
    """
    known = list[Optimum]()
    for found in _optima(task, attempt, budget, resolved):
        # Checked by another integrator: costates may stray from the adjoint equations although all signs are right,
        # and an unstable motion may leave feedback no torque to repeat it.
        if certified := [one for one in found if one.certificate.ok]:
            chosen = min(certified, key=partial(rank, task))
            best = with_adjoint_check(task, as_replayed(task, chosen))
            if best.certificate.ok:
                return best
            found = [best if one is chosen else one for one in found]
        known += found
    # Uncertified arcs are kept only if their motion is the better one.
    return min(known, key=partial(rank, task))


def _optima(task: Task, attempt: Attempt, budget: Budget, resolved: ResolvedMotions) -> Iterator[list[Optimum]]:
    """Motions near a mesh's solution, in turn: extremals, the resolved mesh's motion, the mesh's own motion.

    Extremals of an unrefined structure are yielded with those of its refined structures: an earlier one may also be
    certified, and faster within the certificate's tolerance.
    """
    if task.stop:
        yield [_of_mesh(task, attempt, f"{task.stop.word} before the arcs were read")]
        return
    fast = at_speed(task, attempt.trajectory)  # structures rarely settle there; the mesh's motion converges sooner
    begun = budget.left
    numbers = task.policy.refinement
    found = _by_switching(task, attempt, budget, numbers.switch_budget_at_speed if fast else numbers.switch_budget)
    extremals = _landed(task, found, attempt, budget)
    if not (found.has_extremal or found.idle or fast):
        found = found.continued(budget)
        extremals += _landed(task, found, attempt, budget)
    yield extremals
    # Else a finer mesh may still show a structure.
    last = budget.left <= numbers.coarse_budget or 2 * attempt.intervals > task.options.max_intervals
    last |= numbers.extremal_is_enough and any(map(is_resolved, extremals))
    if fast:
        resolved.spend(begun - budget.left)
    motion = mesh_optimum(task, found.mesh, found.why, resolved) if fast or last or found.idle else None
    if motion is not None:
        yield [motion]
    elif resolved.spent or resolved.beats(found.mesh):
        budget.spend(budget.left)
    if fast and motion is None and not found.has_extremal and budget.left > 0:
        found = found.continued(budget)
        yield _landed(task, found, attempt, budget)
    if motion is not None and motion.within_limits:
        budget.spend(budget.left)  # no other mesh is better than a resolved motion
        return
    yield [own := _of_mesh(task, found.mesh, found.why)]
    if found.mesh is not attempt and rank(task, own)[0]:  # equal intervals may land although located switches do not
        yield [_of_mesh(task, attempt, found.why)]


def _of_mesh(task: Task, mesh: Attempt, remark: str) -> Optimum:
    """Motion of a mesh's solution, corrected to reach the goal if possible."""
    return Optimum.of(task.problem, replay_on_goal(task, mesh), mesh.intervals, None, remark)


def _landed(task: Task, found: "_Resolved", attempt: Attempt, budget: Budget) -> list[Optimum]:
    """The best extremals, corrected to reach the goal, until one is within its limits."""
    rest = budget if found.has_extremal else Budget(task.stop, 0)  # finer steps turn nothing into an extremal
    landed: list[Optimum] = []
    for extremal in found.extremals[: task.policy.refinement.landed_of]:
        landed.append(land_extremal(task, extremal, attempt.intervals, rest))
        if not rank(task, landed[-1])[0]:
            break
    return landed


def is_resolved(optimum: Optimum) -> bool:
    """Whether a motion ends on the goal with H = 0 all along: finer meshes have the same arcs, whatever their signs."""
    certificate = optimum.certificate
    return certificate.goal_error <= GOAL_TOLERANCE and certificate.hamiltonian_spread <= HAMILTONIAN_TOLERANCE


def rank(task: Task, optimum: Optimum) -> tuple[bool, float]:
    """Sort key: first the optima that reach the goal within their limits, by duration; then the others, by error.

    Args:
        task: the problem and its settings.
        optimum: a replayed optimum.
    """
    factor = least_slowing(task, optimum)
    good = optimum.certificate.goal_error <= GOAL_TOLERANCE and factor <= task.policy.refinement.slower
    return not good, factor * optimum.trajectory.duration if good else optimum.error


def _arcs_of(task: Task, attempt: Attempt) -> list[Arc]:
    """Detect arcs from a mesh's torques and states."""
    policy, equal = task.policy, attempt.knots is None
    # A fine mesh's torques may be off their limits where the duration hardly depends on them.
    switch = max(policy.arcs.switch, attempt.intervals // policy.refinement.blur) if equal else policy.arcs.switch
    brief, near = (0.0, policy.arcs) if equal else (policy.arcs.brief, policy.arcs.at_switches)
    return detect(task.problem, attempt.trajectory, attempt.mesh, switch, near, brief)


@dataclass(frozen=True, eq=False)
class _Resolved:
    """Results of the switching structures tried for a mesh's solution.

    Attributes:
        shooting: shooting problem of the structures.
        attempts: result of each structure, with its sort key, best first.
        first: structures of equal intervals.
        sharp: structures of a mesh refined at its switches.
        mesh: solution on the refined mesh if needed, else on equal intervals.
        reached: state of the last structure when its budget ended; None: it finished.
    """

    shooting: ShootingProblem
    attempts: list[tuple[tuple[bool, float], RefinedExtremal]]
    first: list[SwitchingStructure]
    sharp: list[SwitchingStructure]
    mesh: Attempt
    reached: SwitchingStructure | None = None

    @property
    def has_extremal(self) -> bool:
        """Whether the best result is an extremal without idle joints."""
        return bool(self.attempts) and not self.attempts[0][0][0]

    @property
    def idle(self) -> bool:
        """Whether the best result has an idle joint."""
        best = self.attempts[0][1].extremal if self.attempts else None
        return best is not None and leaves_idle(best, SWITCHING_TOLERANCE)

    @property
    def extremals(self) -> tuple[LinearRollout, ...]:
        """Motions within their limits, extremals first, each by duration; empty: nothing lands, or a joint is idle."""
        found = tuple(one.extremal for _, one in self.attempts if one.extremal is not None)
        return () if found and leaves_idle(found[0], SWITCHING_TOLERANCE) else found

    @property
    def why(self) -> str:
        """Violated condition of the best structure, in words; empty without any."""
        if not self.attempts:
            return "no structure was read"
        return _IDLE if self.idle else self.attempts[0][1].why

    def with_attempt(self, structure: SwitchingStructure, budget: Budget, most: float = np.inf) -> "_Resolved":
        """Add the result of a structure, found within a part of a budget."""
        granted = min(budget.left, most)
        own = Budget(budget, granted)
        refined = refine_extremal(replace(self.shooting, budget=own), structure)
        budget.spend(granted - own.left)
        attempts = [*self.attempts, (_violation(self.shooting, refined), refined)]
        return replace(self, attempts=sorted(attempts, key=lambda one: one[0]), reached=refined.reached)

    def continued(self, budget: Budget) -> "_Resolved":
        """Retry the first structures with the rest of the budget, then continue the last other one."""
        found, reached = self, self.reached if self.sharp else None
        for structure in [*self.first, *([] if reached is None else [reached])]:
            if not (found.has_extremal or budget):
                found = found.with_attempt(structure, budget)
        return found


def _by_switching(task: Task, attempt: Attempt, budget: Budget, sharp_budget: int) -> _Resolved:
    """The extremal of a corrected structure, or the nearest motions.

    Structures of equal intervals come first, then those of a mesh refined at its switches.

    Args:
        task: the problem and its settings.
        attempt: a solution on equal intervals.
        budget: budget of all structures.
        sharp_budget: budget of one structure of a refined mesh; 0: no such structure is tried.
    """
    numbers, shooting = task.policy.refinement, shooting_problem(task, attempt.trajectory)
    found = _Resolved(shooting, [], list(_structures(task, shooting, attempt)), [], attempt)
    for structure in found.first:
        if not (found.has_extremal or budget):
            found = found.with_attempt(structure, budget, numbers.coarse_budget)
    if sharp_budget and not (found.has_extremal or budget):
        mesh = at_switches(task, attempt)
        sharp = [] if mesh is attempt else list(_structures(task, shooting, mesh))
        found = replace(found, sharp=sharp, mesh=mesh)
        for structure in sharp:
            if not (found.has_extremal or budget):
                found = found.with_attempt(structure, budget, sharp_budget)
    return found


def _structures(task: Task, shooting: ShootingProblem, mesh: Attempt) -> Iterator[SwitchingStructure]:
    """Switching structures from a mesh's arcs."""
    return structures_of(shooting, _arcs_of(task, mesh), mesh.trajectory, mesh.knots is not None)


def _violation(shooting: ShootingProblem, refined: RefinedExtremal) -> tuple[bool, float]:
    """Sort key: extremals before other motions, and these before motions with an idle joint; each by duration."""
    if refined.extremal is None:
        return True, np.inf
    if leaves_idle(refined.extremal, SWITCHING_TOLERANCE):
        return True, refined.extremal.structure.duration
    wrong = refined.wrong
    if wrong <= SWITCHING_TOLERANCE:  # contacts that could not be corrected are not included
        wrong = pontryagin(shooting.problem, phases_of(refined.extremal))[2]
    return wrong > SWITCHING_TOLERANCE, refined.extremal.structure.duration
