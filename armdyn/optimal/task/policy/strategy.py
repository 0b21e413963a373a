"""Strategy: refinement methods by the class of problem; speed-limited or torque-limited problems."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import pinocchio as pin

from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.policy.curves import TRAINED
from armdyn.optimal.task.policy.tuned import by_kind

Method = Literal["arcs", "time-energy", "mesh", "curves"]
"""Refinement methods: switching times of bang-bang torques; smooth torques where effort has a weight; collocation,
tightened until the replay satisfies the path constraints; B-splines with inverse dynamics."""


@dataclass(frozen=True, kw_only=True)
class StrategyPolicy:
    """Refinement methods, in the order in which they are tried."""

    cases: ClassVar = TRAINED

    methods: tuple[Method, ...] = by_kind(
        "methods",
        "tried in turn until an optimum is certified: beyond three joints idle joints leave arcs undetermined, and "
        "only curves are used; where velocity limits shape the motion curves are often proven, and come first",
    )
    fallback: tuple[Method, ...] = by_kind(
        "methods",
        "tried from landed motions if no optimum is usable: a curve is a motion even without convergence; it needs "
        "a motor at every joint, since a torque of zero would be an equation all along it",
        "by definition",
    )
    bounded: bool = by_kind("-", "velocity limits shape the motion: their lower bound is computed concurrently")

    @property
    def curves_alone(self) -> bool:
        """Whether curves are the only method."""
        return self.methods == ("curves",)


def is_speed_limited(problem: MinimumTimeProblem) -> bool:
    """Whether velocity limits shape the fastest motion, by an estimate.

    They do if the joint with the largest lower bound by its velocity limit reaches that limit: moving alone, from and
    to rest, with the inertia at the start of its leg and half its torque range.

    Args:
        problem: the problem.
    """
    ways, limits, robot = np.abs(np.diff(problem.poses, axis=0)), problem.limits, problem.robot
    times = ways / limits.velocity
    leg, j = np.unravel_index(int(np.argmax(times)), times.shape)
    if times[leg, j] == 0:
        return False
    inertia = pin.crba(robot.model, robot.model.createData(), robot.configuration(problem.poses[leg]))[j, j]
    torque = limits.actuators.half_range[j]
    return bool(limits.velocity[j] ** 2 * inertia <= ways[leg, j] * torque)
