"""Structures mended until their costates agree."""

from dataclasses import dataclass, replace

import numpy as np

from armdyn.optimal.arcs.arc import Arc
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.switching.descent import Extremal, Resisted, fastest
from armdyn.optimal.switching.flow import flow_of
from armdyn.optimal.switching.march import Setting
from armdyn.optimal.switching.schedule import Schedule
from armdyn.optimal.switching.signs import with_limits, with_signs, without_unwanted, wrong_signs
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

_ROUNDS = 12
"""Of mending."""
_LEAST = 2e-5
"""By how much H must fall for another stay: a fifth of what is certified."""


@dataclass(frozen=True, eq=False)
class Settled:
    """What a schedule has come to.

    Attributes:
        extremal: the last; None: there was none.
        wrong: by how much H would fall at worst on the other limit.
        why: what it lacks, for people; "": nothing.
    """

    extremal: Extremal | None
    wrong: float
    why: str

    @property
    def arcs(self) -> list[Arc]:
        """Its structure."""
        return self.extremal.schedule.arcs() if self.extremal else []


def has_switching(task: Task) -> bool:
    """Whether a problem's arcs can be marched: time alone counts, and friction has no sharp turns."""
    problem = task.problem
    return problem.effort_weight == 0 and not problem.robot.friction.present and not problem.along_the_way


def setting_of(task: Task) -> Setting:
    """What a task's schedules are marched by."""
    return Setting(task.problem, flow_of(task.dynamics, task.scheme.compile), task.dynamics.last_body)


def settled(setting: Setting, schedule: Schedule, stop: Stop) -> Settled:
    """The extremal that a schedule leads to when what it lacks is put in.

    Args:
        setting: what is marched.
        schedule: to begin with.
        stop: asked before every step.
    """
    best = Settled(None, np.inf, "nothing was tried")
    for _ in range(_ROUNDS):
        found = fastest(setting, schedule, stop)
        if isinstance(found, Resisted):
            return replace(best, why=found.why)
        if mended := with_limits(found) or without_unwanted(found):
            schedule = mended
            best = replace(best, why="limits of position are not settled")
            continue
        wrong = wrong_signs(found, _LEAST)
        best = Settled(found, wrong[0].value if wrong else 0.0, "the switching structure did not settle" if wrong else "")
        if not wrong:
            return best
        schedule = with_signs(found, wrong)
    return best


def motion_of(extremal: Extremal) -> Trajectory:
    """An extremal's states and torques at its steps."""
    march, robot = extremal.march, extremal.march.setting.problem.robot
    kept = np.append(True, march.h > 1e-9 * extremal.schedule.duration)
    x = np.vstack([march.start[:1], march.end])[kept]
    tau = np.vstack([march.tau[march.arc], march.tau[-1:]])[kept]
    return Trajectory(march.times[kept], x[:, : robot.nv], x[:, robot.nv :], tau, robot.joint_names, "extremal")
