"""Refine a switching structure until it satisfies Pontryagin's conditions."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armdyn.optimal.problem.status import Budget
from armdyn.optimal.switching.contacts import with_contacts
from armdyn.optimal.switching.extremal.descent import fastest
from armdyn.optimal.switching.extremal.flow import Flow, flow_of
from armdyn.optimal.switching.extremal.quadratic_model import LinearRollout
from armdyn.optimal.switching.extremal.rollout import ShootingProblem
from armdyn.optimal.switching.extremal.state_limits import with_limits, within_limits
from armdyn.optimal.switching.extremal.structure import StructureKey, SwitchingStructure
from armdyn.optimal.switching.signs import (
    WrongSign,
    idle_fall,
    with_bang_arcs,
    with_longer_control,
    with_signs,
    with_singular,
    without_wrong_touches,
    wrong_signs,
)
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class RefinedExtremal:
    """Result of refining a structure.

    Attributes:
        extremal: the best extremal, else a motion that lands within its limits; None: neither.
        wrong: largest decrease of H on the other limit; infinite: not an extremal.
        why: violated condition, in words; "": none.
        reached: the structure when the refinement was stopped; None: it finished, or other structures were next.
    """

    extremal: LinearRollout | None
    wrong: float
    why: str
    reached: SwitchingStructure | None = None

    def or_else(self, linear: LinearRollout | None, why: str) -> Self:
        """This result if it has an extremal; else the fastest motion that reaches the goal within its limits.

        Args:
            linear: the motion, if there is one.
            why: reason why that motion is no extremal.
        """
        if np.isfinite(self.wrong) or linear is None or not within_limits(linear.rollout):
            return self if self.extremal else replace(self, why=why)
        if self.extremal is not None and self.extremal.structure.duration <= linear.structure.duration:
            return self
        return replace(self, extremal=linear, why=why)


def shooting_problem(task: Task, motion: Trajectory) -> ShootingProblem:
    """Shooting problem of a task's structures near a motion."""
    return ShootingProblem.of(task, _flow(task), motion)


def prepare_switching(task: Task) -> None:
    """Build the flow before a fork, so that every worker has it."""
    if not task.stop:
        _flow(task)


def _flow(task: Task) -> Flow:
    return task.in_time(lambda scheme: flow_of(task.dynamics, scheme.compile))


def refine_extremal(shooting: ShootingProblem, structure: SwitchingStructure) -> RefinedExtremal:
    """Refine a switching structure until it satisfies Pontryagin's conditions: switches, contacts, singular arcs.

    Args:
        shooting: the shooting problem.
        structure: initial structure.
    """
    best, mended, stale, others = RefinedExtremal(None, np.inf, "nothing was tried"), False, 0, _Others()
    numbers, budget = shooting.policy.switching, shooting.budget
    for _ in range(numbers.rounds):
        while structure.size + 1 > shooting.most_arcs and (more := shooting.finer()) is not None:
            shooting = more
        found, why, given_up = _refined_once(shooting, structure, bool(others.left))
        enough = numbers.drift_unsolved if why else numbers.drift
        drifts = found is not None and found.drift > enough and not budget
        finer = shooting.finer(found.rollout) if found is not None and drifts else None
        if found is not None and finer is not None:
            shooting, structure = finer, found.structure
            continue
        if found is None or why:
            others.add(with_contacts(found, is_extremal=False) if found and not given_up else [])
            if not others.left or budget:
                reached = found.structure if found and not others.left and budget else None
                return replace(best.or_else(found, why), reached=reached)
            structure = others.next()
            continue
        limited = with_limits(found.rollout) or without_wrong_touches(found)
        contacts = [limited] if limited else others.of_contacts(found)
        if contacts:
            best = best.or_else(found, "the position limits did not converge")
            others.add(contacts)
            structure = others.next()
            continue
        wrong = wrong_signs(found, numbers.least)
        idle = max([0.0, *(idle_fall(found, k) for k in found.structure.controls)])
        worst = max([idle, *(one.value for one in wrong[:1])])
        stale = 0 if worst < numbers.better * best.wrong else stale + 1
        if worst < best.wrong:
            best = RefinedExtremal(
                found, worst, "the switching structure did not converge" if worst > numbers.least else ""
            )
        if worst <= numbers.least or stale > numbers.patience:
            return best
        longer = with_bang_arcs(found, numbers.least) or with_longer_control(found, numbers.least)
        if longer is not None:  # wrong signs next to a too short singular control vanish with it
            structure = with_signs(found, [one for one in wrong if one.value > idle], longer)
            continue
        if not wrong:
            return best
        instead = others.singular_of(found, wrong) if mended else None
        structure, mended = with_signs(found, wrong), True
        if instead is not None:
            others.add([structure], instead[1])
            structure = instead[0]
    return best


def _refined_once(
    shooting: ShootingProblem, structure: SwitchingStructure, waiting: bool
) -> tuple[LinearRollout | None, str, bool]:
    """Motion and reason of `fastest`, within a part of the budget while others wait; whether it was abandoned."""
    budget, granted = shooting.budget, shooting.budget.left * shooting.policy.switching.trial
    if not waiting or granted == np.inf:
        return *fastest(shooting, structure), bool(budget)
    trial = Budget(budget, granted)
    found, why = fastest(replace(shooting, budget=trial), structure)
    budget.spend(granted - trial.left)
    return found, why, bool(trial)


class _Others:
    """Stack of alternative switching structures, tried when the current one fails.

    Attributes:
        left: the structures, the next one last, each with the reason that is refused once it is tried.
        refused: joints whose singular arcs failed.
    """

    def __init__(self) -> None:
        self.left: list[tuple[SwitchingStructure, object]] = []
        self.refused = set[object]()
        self._seen = dict[StructureKey, float]()

    def add(self, structures: list[SwitchingStructure], reason: object = None) -> None:
        """Add structures to try next, likeliest first, with the reason to try them."""
        self.left = [each for each in self.left if each[0] not in structures]
        self.left += [(structure, None) for structure in reversed(structures[1:])]
        self.left += [(structure, reason) for structure in structures[:1]]

    def next(self) -> SwitchingStructure:
        """Remove and return the next structure."""
        structure, reason = self.left.pop()
        self.refused.add(reason)
        return structure

    def of_contacts(self, found: LinearRollout) -> list[SwitchingStructure]:
        """Structures with corrected contacts; empty if the structure is known and no faster than before."""
        key, duration = found.structure.key, found.structure.duration
        known = self._seen.get(key, np.inf)
        self._seen[key] = min(duration, known)
        left = duration > (1 - found.shooting.policy.switching.shorter) * known
        return [] if left else with_contacts(found)

    def singular_of(self, found: LinearRollout, wrong: list[WrongSign]) -> tuple[SwitchingStructure, object] | None:
        """A structure with a singular arc in place of wrong signs, and its joint; None: no such structure is left.

        Args:
            found: the extremal.
            wrong: its stretches on the wrong limit, worst first.
        """
        left = [one for one in wrong if one.joint not in self.refused]
        smooth = with_singular(found, left) if left else None
        return None if smooth is None else (smooth, left[0].joint)


def leaves_idle(extremal: LinearRollout, tolerance: float) -> bool:
    """Whether minimum time leaves some joint's motion undetermined for more than half of the duration.

    Such a joint should rather move smoothly than bang-bang.

    Args:
        extremal: extremal with all joints on limits.
        tolerance: tolerance of the torques' effect on H, relative to time's 1.
    """
    rollout, limits = extremal.rollout, extremal.shooting.problem.limits
    ranges = limits.actuators.width
    idle = (np.abs(extremal.switching) * ranges <= tolerance) & (ranges > 0)
    elsewhere = (rollout.torques.free_mask > 0) | (rollout.torques.held > 0)
    shares = np.tile(rollout.h, 2) @ (idle & ~np.tile(elsewhere, (2, 1))) / 2
    return bool(np.any(shares > extremal.structure.duration / 2))
