"""Whether an arm's actuators can hold it still at its goal, and the largest payload."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from armdyn.models.values.spec import PLANAR_ARMS, PlanarArmName
from armdyn.paper.outcomes.case import READINGS, Case, Reading
from armdyn.paper.printed.examples import PAYLOADS

_EXAMPLE: dict[PlanarArmName, int] = {"r": 1, "rr": 2, "rrr": 3}


@dataclass(frozen=True)
class Holding:
    """Torques that hold an arm still at its goal.

    Attributes:
        arm: of the paper.
        payload: M [kg].
        reading: where the payload is.
        torque: of every joint [N m], nv numbers.
        limit: ± of every joint [N m].
    """

    arm: PlanarArmName
    payload: float
    reading: Reading
    torque: tuple[float, ...]
    limit: tuple[float, ...]

    @property
    def possible(self) -> bool:
        """Whether all torques are within their limits."""
        return all(abs(torque) <= limit for torque, limit in zip(self.torque, self.limit, strict=True))


def holding(arm: PlanarArmName, payload: float, reading: Reading = "tip") -> Holding:
    """The torque that holds an arm still at the goal of its minimum-time example: g(q_goal).

    Args:
        arm: of the paper.
        payload: M [kg].
        reading: where the payload is.
    """
    case = Case(_EXAMPLE[arm], arm, "minimum_time", payload, reading)
    robot = case.robot()
    torque = robot.holding_torque(case.q_goal)
    return Holding(arm, payload, reading, tuple(map(float, torque)), tuple(map(float, robot.limits.effort_upper)))


def largest_payload(arm: PlanarArmName, reading: Reading = "tip") -> float:
    """The largest payload that an arm's actuators can hold still at the goal [kg].

    In closed form: g(q) is linear in the payload, so two payloads tell all, and each joint bounds it by
    (limit - |g_0|) / |dg/dM| where, as here, both have one sign.

    Args:
        arm: of the paper.
        reading: where the payload is.
    """
    empty, loaded = holding(arm, 0.0, reading), holding(arm, 1.0, reading)
    own, limit = np.array(empty.torque), np.array(empty.limit)
    slope = np.array(loaded.torque) - own
    room = np.where(slope > 0, limit - own, limit + own)
    return float(np.min(room / np.abs(slope)))


@cache
def all_holdings() -> tuple[Holding, ...]:
    """Every arm with every payload of Table 2 in both readings."""
    return tuple(holding(arm, m, reading) for arm in PLANAR_ARMS for reading in READINGS for m in PAYLOADS)
