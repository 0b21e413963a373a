"""Structures mended until their costates agree."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armdyn.optimal.problem.stop import Budget, Stop
from armdyn.optimal.solve.ipopt import in_time
from armdyn.optimal.switching.carried import with_carried_touches, with_other_press
from armdyn.optimal.switching.contacts import with_contacts
from armdyn.optimal.switching.extremal.descent import Extremal, Resisted, fastest
from armdyn.optimal.switching.extremal.flow import Flow, flow_of
from armdyn.optimal.switching.extremal.limits import BEYOND, excess, with_limits
from armdyn.optimal.switching.extremal.march import Setting
from armdyn.optimal.switching.extremal.model import Linear
from armdyn.optimal.switching.extremal.schedule import Schedule, Structure
from armdyn.optimal.switching.signs import with_signs, without_unwanted, wrong_signs
from armdyn.optimal.switching.singular import idle_fall, with_longer_course, with_singular, with_stays
from armdyn.optimal.task.task import Task

_ROUNDS = 40
"""Of mending: where a contact is left by bounces that grow shorter and shorter, each takes two."""
_LEAST = 5e-5
"""By how much H must fall for another stay, or a longer course: half of what is certified."""
_DRIFT = 1e-5
"""Of H along an arc: a tenth of what is certified; beyond it the steps are too long."""
_ASTRAY = 1e-3
"""The same where no extremal was found: then that may be why."""
_SHORTER = 1e-11
"""Of the duration: what mending a contact gains at least, or it is left."""
_TRIAL = 1 / 3
"""Of the budget that is left: what a schedule may spend while others wait; those that lead on take a tenth."""
_PATIENCE, _BETTER = 3, 0.7
"""Rounds in a row that come no nearer than by so much: more go in circles."""


@dataclass(frozen=True, eq=False)
class Settled:
    """What a schedule has come to.

    Attributes:
        extremal: the best; at the worst a motion that lands within its limits; None: there was none.
        wrong: by how much H would fall at worst on the other limit; infinite: it is no extremal.
        why: what it lacks, for people; "": nothing.
    """

    extremal: Extremal | None
    wrong: float
    why: str

    def or_else(self, linear: Linear | None, why: str) -> Self:
        """This or, where no extremal is known, the fastest motion that lands within its limits.

        Args:
            linear: the motion, if there is one.
            why: it is not.
        """
        if np.isfinite(self.wrong) or linear is None or excess(linear.march) > BEYOND:
            return self if self.extremal else replace(self, why=why)
        if self.extremal is not None and self.extremal.schedule.duration <= linear.march.schedule.duration:
            return self
        return replace(self, extremal=Extremal(linear), why=why)


def has_switching(task: Task) -> bool:
    """Whether arcs can be marched: time alone counts, friction has no sharp turns, and every joint has a motor."""
    problem = task.problem
    plain = problem.effort_weight == 0 and not problem.robot.friction.present and not problem.path_constraint_names
    return plain and not np.any(problem.limits.passive)


def setting_of(task: Task, duration: float) -> Setting:
    """What a task's schedules, of about so long a duration [s], are marched by."""
    return Setting.of(task.problem, _flow(task), task.dynamics.last_body, duration)


def prepare_switching(task: Task) -> None:
    """Build, if it is not there, what schedules are marched by: before a fork, so that every worker has it."""
    if not task.stop:
        _flow(task)


def _flow(task: Task) -> Flow:
    return in_time(task, lambda scheme: flow_of(task.dynamics, scheme.compile))


def settled(setting: Setting, schedule: Schedule, stop: Stop) -> Settled:
    """The extremal that a schedule leads to when what it lacks is put in.

    Args:
        setting: what is marched.
        schedule: to begin with.
        stop: asked before every step.
    """
    best, mended, stale, others = Settled(None, np.inf, "nothing was tried"), False, 0, _Others()
    for _ in range(_ROUNDS):
        while schedule.size + 1 > setting.most_arcs and setting.finer is not None:
            setting = setting.finer
        found, given_up = _tried(setting, schedule, stop, bool(others.left))
        finer, enough = setting.finer, _DRIFT if isinstance(found, Extremal) else _ASTRAY
        if found.linear is not None and found.linear.drift > enough and finer is not None and not stop:
            setting, schedule = finer, found.linear.march.schedule
            continue
        if isinstance(found, Resisted):
            others.add(with_contacts(Extremal(found.linear), settled=False) if found.linear and not given_up else [])
            if not others.left or stop:
                return best.or_else(found.linear, found.why)
            schedule = others.next()
            continue
        limited = with_limits(found.march) or without_unwanted(found)
        contacts = [limited] if limited else others.of_contacts(found)
        wrong = [] if limited else wrong_signs(found, _LEAST)
        carried = with_carried_touches(found, wrong, others.refused)
        if contacts:
            best = best.or_else(found.linear, "limits of position are not settled")
            others.add(contacts, carried.pair if carried else None)
            schedule = carried.schedule if carried else others.next()
            continue
        idle = max([0.0, *(idle_fall(found, k) for k in found.schedule.courses)])
        worst = max([idle, *(one.value for one in wrong[:1])])
        stale = 0 if worst < _BETTER * best.wrong else stale + 1
        if worst < best.wrong:
            best = Settled(found, worst, "the switching structure did not settle" if worst > _LEAST else "")
        if worst <= _LEAST or stale > _PATIENCE:
            return best
        longer = with_stays(found, _LEAST) or with_longer_course(found, _LEAST)
        if longer is not None:  # what a course that is too short leaves wrong beside it goes with it
            schedule = with_signs(found, [one for one in wrong if one.value > idle], longer)
            continue
        if not wrong:
            return best
        schedule, left = with_signs(found, wrong), [one for one in wrong if one.joint not in others.refused]
        pressed = None if "press" in others.refused else with_other_press(found.schedule, wrong)
        if pressed is not None:
            others.add([schedule], "press")
            schedule = pressed
        elif carried is not None:
            others.add([schedule], carried.pair)
            schedule = carried.schedule
        elif mended and left and (smooth := with_singular(found, left)) is not None:
            others.add([schedule], left[0].joint)
            schedule = smooth
        mended = True
    return best


def _tried(setting: Setting, schedule: Schedule, stop: Stop, waiting: bool) -> tuple[Extremal | Resisted, bool]:
    """What a schedule leads to, within a part of the budget where others wait; and whether it was given up."""
    if not waiting or not isinstance(stop, Budget):
        found = fastest(setting, schedule, stop)
        return found, bool(stop)
    granted = stop.left * _TRIAL
    trial = Budget(stop, granted)
    found = fastest(replace(setting, budget=trial), schedule, trial)
    stop.spend(granted - trial.left)
    return found, bool(trial)


class _Others:
    """Schedules to be tried where nothing comes of one.

    Attributes:
        left: the schedules, the next one last, each with what is refused once it is tried.
        refused: joints whose singular arcs, and pairs of joints whose carried contacts, led to nothing.
    """

    def __init__(self) -> None:
        self.left: list[tuple[Schedule, object]] = []
        self.refused = set[object]()
        self._seen, self._instead = dict[Structure, float](), list[Schedule]()

    def add(self, schedules: list[Schedule], reason: object = None) -> None:
        """Schedules, the likeliest first, which is tried next; the reason is what is tried before it."""
        self.left = [each for each in self.left if each[0] not in schedules]
        self.left += [(schedule, None) for schedule in reversed(schedules[1:])]
        self.left += [(schedule, reason) for schedule in schedules[:1]]

    def next(self) -> Schedule:
        """The next one."""
        schedule, reason = self.left.pop()
        self.refused.add(reason)
        return schedule

    def of_contacts(self, found: Extremal) -> list[Schedule]:
        """Schedules with contacts mended; where they came out as they were, those that were the others then."""
        structure, duration = found.schedule.structure, found.schedule.duration
        known = self._seen.get(structure, np.inf)
        self._seen[structure] = min(duration, known)
        if duration > (1 - _SHORTER) * known:
            contacts, self._instead = self._instead, []
            return contacts
        contacts = with_contacts(found)
        self._instead = contacts[1:]
        return contacts


def leaves_idle(extremal: Extremal, tolerance: float) -> bool:
    """Whether time does not determine what some joint does for more than half of the motion.

    Such a joint is better moved gently than from limit to limit.

    Args:
        extremal: whose joints are all on limits.
        tolerance: of what H feels of a torque, against the 1 that time costs.
    """
    march, limits = extremal.march, extremal.march.setting.problem.limits
    ranges = limits.actuators.width
    idle = (np.abs(extremal.switching) * ranges <= tolerance) & (ranges > 0)
    elsewhere = (march.torques.felt > 0) | (march.torques.held > 0) | (march.torques.carried[:, ranges.size :] > 0)
    shares = np.tile(march.h, 2) @ (idle & ~np.tile(elsewhere, (2, 1))) / 2
    return bool(np.any(shares > extremal.schedule.duration / 2))
