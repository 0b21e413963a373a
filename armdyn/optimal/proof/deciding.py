"""Elasticity of the minimum time with respect to each limit: the limit's share in the duration."""

from dataclasses import dataclass

import numpy as np

from armdyn.arguments import check_fields, checked, number, text
from armdyn.optimal.arcs.phases import Phases
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.proof.sensitivity import by_limits


@dataclass(frozen=True)
class Share:
    """A limit's share in the duration: −∂ln t_f/∂ln(limit). Raising it by 1 % saves that share of 1 %.

    Of a speed limit all that a cruise at it takes. Torques decide by their root: without gravity and speed limits all
    torque limits together have one half.

    Attributes:
        limit: "torque limit" or "velocity limit".
        joint: its name.
        part: of the time.

    Raises:
        ProblemError: no text, or no number.
    """

    limit: str = checked(text)
    joint: str = checked(text)
    part: float = checked(number)

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """Name of the limit in messages."""
        return f"{self.joint}'s {self.limit}"


def deciding(problem: MinimumTimeProblem, phases: Phases, least: float) -> tuple[Share, ...]:
    """The limits that decide the time of an optimum whose arcs are known, most first; none where effort is paid for.

    Args:
        problem: the minimum-time problem.
        phases: its optimum.
        least: smaller shares are left out.
    """
    if problem.effort_weight > 0:  # its multipliers speak of the cost, not of the time
        return ()
    names, limits = problem.robot.joint_names, problem.limits
    upper, lower, velocity = by_limits(phases)
    torque = -(upper * limits.actuators.upper + lower * limits.actuators.lower) / phases.duration
    speed = -velocity * np.where(velocity == 0, 0.0, limits.velocity) / phases.duration
    shares = [Share("torque limit", name, float(part)) for name, part in zip(names, torque, strict=True)]
    shares += [Share("velocity limit", name, float(part)) for name, part in zip(names, speed, strict=True)]
    return tuple(sorted((one for one in shares if one.part > least), key=lambda one: -one.part))
