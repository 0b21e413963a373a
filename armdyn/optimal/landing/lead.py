"""A mesh's motion led home by feedback, where open loop it would go astray."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.landing.feedback import tracked
from armdyn.optimal.landing.limits import miss_of, overspeed
from armdyn.optimal.landing.pace import paced, paced_torques
from armdyn.optimal.landing.pieces import Pieces
from armdyn.optimal.landing.rollout import replay_of
from armdyn.optimal.landing.variation import steps_along
from armdyn.optimal.problem.aim import Aim
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


def led_home(task: Task, mesh: Trajectory) -> tuple[Trajectory, Trajectory, float]:
    """The mesh's motion led by feedback, aimed beside the goal by what it missed before.

    Args:
        task: its goal, and limits of torque and velocity.
        mesh: a collocation solution.

    Returns:
        The motion, its replay, and the largest error of goal or velocity; infinite if there is nothing to lead.
    """
    problem, numbers = task.problem, task.policy.landing
    pieces, factor, aim = Pieces.of(mesh), 1.0, Aim()
    best, rank = (mesh, mesh, np.inf), (True, np.inf)
    for _ in range(numbers.leads):
        led = None if pieces is None else _led(task, mesh, pieces, factor, aim)
        if led is None:
            break
        replay = replay_of(task, led)
        miss = miss_of(problem, led, replay)
        over = overspeed(problem.limits, replay)
        if (over > numbers.below, miss) < rank:
            rank, best = (over > numbers.below, miss), (replace(replay, name=mesh.name), replay, miss)
        error = problem.beside_goal(replay)
        if miss <= numbers.landed or task.stop or replay.t[-1] != led.t[-1] or np.max(np.abs(error)) > numbers.far:
            break
        aim = aim.corrected(problem, replay)
        if over > 0 and problem.from_rest_to_rest:
            factor *= 1 + over + numbers.below
    return best


def _led(task: Task, mesh: Trajectory, pieces: Pieces, factor: float, aim: Aim) -> Trajectory | None:
    """The mesh's motion, its time scaled by a factor, led by feedback to beside the goal; None if it was lost."""
    problem, limits = task.problem, task.problem.limits
    motion, tau = paced(mesh, factor), pieces.tau
    if factor != 1:
        middles = mesh((pieces.t[:-1] + pieces.t[1:]) / 2)
        tau = paced_torques(problem.robot, middles, tau, factor)
        tau = np.asarray(np.clip(tau, limits.effort_lower, limits.effort_upper))
    slower, numbers = Pieces(factor * pieces.t, tau), task.policy.landing
    steps = steps_along(problem.robot, slower, motion, numbers.steps)
    led = tracked(task, motion, slower, steps, aim.at_goal(problem.robot.nv))
    return None if led is None else led.trajectory(motion, numbers.samples)
