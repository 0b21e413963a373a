"""From a mesh's solution to its arcs: the structure whose switching functions agree with its modes."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from armdyn.optimal.arcs.arc import Arc, Mode, merged
from armdyn.optimal.arcs.detection import detect
from armdyn.optimal.arcs.nlp_data import PhaseAim
from armdyn.optimal.arcs.phases import Phases, Unresolved
from armdyn.optimal.arcs.solving import prepare_phases, solve_phases
from armdyn.optimal.arcs.structure import by_sign, with_overlooked, without_idle_touches, without_vanished
from armdyn.optimal.landing.aim import aimed
from armdyn.optimal.problem.stop import Budget
from armdyn.optimal.proof.certificate import GOAL_TOLERANCE, SWITCHING_TOLERANCE, certify
from armdyn.optimal.proof.pontryagin import pontryagin
from armdyn.optimal.refine.land import land, land_extremal
from armdyn.optimal.refine.optimum import Optimum
from armdyn.optimal.refine.slowing import least_slowing
from armdyn.optimal.refine.switch_mesh import at_switches
from armdyn.optimal.solve.attempt import Attempt
from armdyn.optimal.solve.condensed import solve_on_knots
from armdyn.optimal.switching.costates import phases_of
from armdyn.optimal.switching.extremal.descent import Extremal
from armdyn.optimal.switching.extremal.rollout import ShootingProblem
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.from_arcs import structures_of
from armdyn.optimal.switching.refinement import (
    RefinedExtremal,
    has_switching,
    leaves_idle,
    prepare_switching,
    refine_extremal,
    shooting_problem,
)
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

_IDLE = "time leaves a joint idle"
Structure = tuple[tuple[tuple[Mode, ...], tuple[tuple[int, Mode], ...]], ...]


def resolve(task: Task, attempt: Attempt, budget: Budget | None = None) -> Optimum:
    """The arcs of a mesh's solution, or its own motion and why they resist.

    Args:
        task: the problem and its settings.
        attempt: a collocation solution with constant torques between its knots.
        budget: of the integrator's steps that may be spent; None: as many as it takes.
    """
    motion, sharp, known = attempt.trajectory, attempt, list[Optimum]()
    remark = f"{task.stop.word} before the arcs were read"
    if not task.stop:
        own, rolled_out = Budget(task.stop) if budget is None else budget, has_switching(task)
        if rolled_out:
            found = _by_switching(task, attempt, own)
            remark, sharp = found.why, found.mesh
            rest = own if found.settled else Budget(task.stop, 0)  # what is no extremal, finer steps do not make one
            for extremal in found.extremals[: task.policy.refinement.landed_of]:
                known.append(land_extremal(task, extremal, attempt.intervals, rest))
                if not rank(task, known[-1])[0]:
                    break
        # Where no structure leads to a motion a finer mesh does sooner than the collocation of arcs, at less cost.
        other = not rolled_out or remark == _IDLE or _at_speed(task, motion, *(one.trajectory for one in known))
        if other and not (known and known[0].certificate.ok):
            phases, remark = _structure(task, _arcs_of(task, attempt), motion, budget)
            if phases is not None:
                known.append(land(task, phases, remark, attempt.intervals))
                remark = known[-1].certificate.remark
    certified = [one for one in known if one.certificate.ok]
    if certified:
        return certified[0]
    longest = (1 + task.policy.same.resolved) * sharp.trajectory.duration
    if known and not rank(task, known[-1])[0] and known[-1].trajectory.duration <= longest:
        return known[-1]  # usable, and the mesh's own motion is slower
    for mesh in _alike(task, sharp, attempt):
        landed, replay = aimed(task, mesh.trajectory)
        certificate = certify(task.problem, replay, None, remark)
        known.append(Optimum(landed, certificate, landed.duration, attempt.intervals))
        if not rank(task, known[-1])[0]:
            break
    # Arcs that are not certified are worth having only if their motion is the better one.
    return min(known, key=partial(rank, task))


def _alike(task: Task, sharp: Attempt, attempt: Attempt) -> Iterator[Attempt]:
    """Solutions of one optimum: at located switches, the same a little inside the position limits, equal intervals."""
    yield sharp
    if sharp is attempt:
        return
    limits = task.problem.limits
    inside = task.policy.switch_mesh.inside * (limits.position_upper - limits.position_lower)
    lower, upper = limits.position_lower + inside, limits.position_upper - inside
    ends = np.array([task.problem.q_start, task.problem.q_goal])
    if np.all(np.isfinite(inside)) and np.all((ends >= lower) & (ends <= upper)):
        tighter = replace(task, problem=task.problem.variant(position_limit=(lower, upper)))
        found = solve_on_knots(tighter, sharp.trajectory, sharp.mesh, task.sharp())
        if found.usable:
            yield found
    yield attempt


def _at_speed(task: Task, *motions: Trajectory) -> bool:
    """Whether one of some motions reaches a velocity limit, which extremals know nothing of."""
    near = (1 - task.policy.arcs.near_speed) * task.problem.limits.velocity
    return any(bool(np.any(np.abs(motion.v) >= near)) for motion in motions)


def rank(task: Task, optimum: Optimum) -> tuple[bool, float]:
    """Sort key: optima that land within their limits, slowed down a little or not, by duration, others by their error.

    Args:
        task: what is solved.
        optimum: replayed.
    """
    factor = least_slowing(task, optimum)
    good = optimum.certificate.goal_error <= GOAL_TOLERANCE and factor <= task.policy.refinement.slower
    return not good, factor * optimum.trajectory.duration if good else optimum.error


def prepare_resolving(task: Task) -> None:
    """Build the functions that `resolve` most likely needs, unless they are built."""
    if has_switching(task):
        prepare_switching(task)
        return
    for finer in (1, 2):
        prepare_phases(task, finer * task.policy.refinement.intervals)


def _arcs_of(task: Task, attempt: Attempt) -> list[Arc]:
    """The arcs that a mesh's torques and states say."""
    policy, equal = task.policy, attempt.knots is None
    # The torques of a fine mesh need not be on their limits where time hardly tells.
    switch = max(policy.arcs.switch, attempt.intervals // policy.refinement.blur) if equal else policy.arcs.switch
    brief, near = (0.0, policy.arcs) if equal else (policy.arcs.brief, policy.arcs.at_switches)
    return merged(detect(task.problem, attempt.trajectory, attempt.mesh, switch, near, brief))


def _structure(task: Task, arcs: list[Arc], motion: Trajectory, budget: Budget | None) -> tuple[Phases | None, str]:
    """Phases whose switching functions agree with their modes, or the last ones and why they do not.

    Args:
        task: the problem and its settings.
        arcs: to begin with.
        motion: a guess.
        budget: of integrator steps, of which IPOPT's iterations take some, too; None: as many as it takes.
    """
    problem, numbers = task.problem, task.policy.refinement
    guess, seen = motion, set[Structure]()
    last: Phases | None = None
    for _ in range(numbers.rounds):
        if len(arcs) > numbers.most_arcs:
            return last, f"{len(arcs)} arcs: more than {numbers.most_arcs}"
        if budget:  # spent
            return last, budget.word
        size = max(numbers.intervals, 3 * len(arcs))
        phases = solve_phases(task, arcs, guess, size, PhaseAim(density=last.density if last else None))
        if budget is not None:
            budget.spend(phases.iterations * size * numbers.iteration)
        if isinstance(phases, Unresolved):
            return last, f"the durations of {len(arcs)} arcs did not converge ({phases.message})"
        guess, structure = phases.torques, _named(phases.arcs)
        if structure not in seen and (fewer := without_vanished(phases, task.policy.arcs)):
            seen.add(structure)
            arcs = fewer
            continue
        last = phases
        arcs = with_overlooked(problem, phases, task.policy.arcs) or without_idle_touches(phases)
        if arcs and structure not in seen and not task.stop:
            seen.add(structure)
            continue
        _, switching, worst = pontryagin(problem, phases)
        if worst <= SWITCHING_TOLERANCE:
            return phases, ""
        arcs = by_sign(phases, switching)
        if structure == _named(arcs):  # nothing is to be corrected but the mesh
            return phases, ""
        if structure in seen or task.stop:
            break
        seen.add(structure)
    return last, "the switching structure did not settle"


@dataclass(frozen=True, eq=False)
class _Resolved:
    """Where the structures of a mesh's solution have led.

    Attributes:
        extremals: motions within their limits, extremals first, each by duration; none: nothing lands, or time does not
            determine what some joint does.
        why: what the first lacks, for people; "": nothing.
        mesh: the solution refined at its switches, where that was needed; else the one on equal intervals.
        settled: the first is an extremal.
    """

    extremals: tuple[Extremal, ...]
    why: str
    mesh: Attempt
    settled: bool = False


def _by_switching(task: Task, attempt: Attempt, budget: Budget) -> _Resolved:
    """The extremal that a structure leads to when it is corrected, or the nearest motions.

    Structures of equal intervals come first, then those of a mesh refined at its switches; then the first ones again,
    with all that is left, and last the last one of the others goes on where the budget ended it.
    """
    numbers, shooting = task.policy.refinement, shooting_problem(task, attempt.trajectory.duration)
    found: list[tuple[tuple[bool, float], RefinedExtremal]] = []

    def extremal(structure: SwitchingStructure, most: float) -> bool:
        granted = min(budget.left, most)
        own = Budget(task.stop, granted)
        refined = refine_extremal(replace(shooting, budget=own), structure, own)
        budget.spend(granted - own.left)
        found.append((_lack(task, refined), refined))
        return not found[-1][0][0]

    mesh, first = attempt, list(_structures(task, shooting, attempt))
    settled = any(extremal(each, numbers.glance) for each in first if not budget)
    if not settled and not budget:
        mesh = at_switches(task, attempt)
        sharp = list(_structures(task, shooting, mesh)) if mesh is not attempt else []
        settled = any(extremal(each, numbers.sharp) for each in sharp if not budget)
        reached = found[-1][1].reached if sharp else None
        settled = settled or any(extremal(each, budget.left) for each in first if not budget)
        if reached is not None and not settled and not budget:
            settled = extremal(reached, np.inf)
    found.sort(key=lambda each: each[0])
    extremals = tuple(each.extremal for _, each in found if each.extremal is not None)
    if extremals and leaves_idle(extremals[0], SWITCHING_TOLERANCE):
        return _Resolved((), _IDLE, mesh)
    return _Resolved(extremals, found[0][1].why if found else budget.word, mesh, settled)


def _structures(task: Task, shooting: ShootingProblem, mesh: Attempt) -> Iterator[SwitchingStructure]:
    """Structures that a mesh's arcs say."""
    return structures_of(shooting, _arcs_of(task, mesh), mesh.trajectory, mesh.knots is not None)


def _lack(task: Task, refined: RefinedExtremal) -> tuple[bool, float]:
    """Sorts: extremals before other motions, each by duration."""
    if refined.extremal is None:
        return True, np.inf
    wrong = refined.wrong
    if wrong <= SWITCHING_TOLERANCE:  # contacts that could not be mended are not in it
        wrong = pontryagin(task.problem, phases_of(refined.extremal))[2]
    return wrong > SWITCHING_TOLERANCE, refined.extremal.structure.duration


def _named(arcs: tuple[Arc, ...] | list[Arc]) -> Structure:
    return tuple((arc.modes, arc.touches) for arc in arcs)
