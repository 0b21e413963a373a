"""Transversality at a goal pose: whether another of its joint positions would be reached sooner.

The costates at the end are how the duration answers to the goal, ∂t_f/∂q = −ρ_q(t_f). Where a continuum of joint
positions reaches a pose, an optimum has ρ_q(t_f) orthogonal to it (Bryson and Ho, Applied Optimal Control,
section 2.8).
"""

import numpy as np

from armdyn.arrays import Array
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.reaching import GoalPose, free_directions
from armdyn.optimal.arcs.phases import Phases
from armdyn.optimal.problem.problem import MinimumTimeProblem


def end_gradient(robot: Robot, goal: GoalPose, q: Array, phases: Phases) -> Array:
    """Gradient of the duration by the goal, along the joint positions that reach the pose [s/rad], shape (nv,).

    Args:
        robot: the arm.
        goal: where a frame is to be.
        q: joint positions at the goal [rad or m], shape (nv,).
        phases: of the motion there, with costates.
    """
    free = free_directions(robot, goal, q)
    return np.asarray(-free @ (free.T @ phases.costate[-1, : robot.nv]))


def transversality(problem: MinimumTimeProblem, goal: GoalPose | None, q: Array, phases: Phases | None) -> float | None:
    """Transversality error of the costates at the end; see `Certificate.transversality`.

    Args:
        problem: whose motion it is.
        goal: where a frame is to be; None: the goal is a point.
        q: joint positions at the goal [rad or m], shape (nv,).
        phases: of the motion there, with costates; None: they are not known.

    Returns:
        inf where it is not known, as in a region with tolerances; None: no other joint position is near.
    """
    if goal is None:
        return None
    if any(goal.tolerance):  # multipliers of its bounds are not checked
        return float("inf")
    if not free_directions(problem.robot, goal, q).size:
        return None
    if phases is None:
        return float("inf")
    way = np.linalg.norm(q - problem.poses[-2])
    return float(np.linalg.norm(end_gradient(problem.robot, goal, q, phases)) * way / phases.duration)
