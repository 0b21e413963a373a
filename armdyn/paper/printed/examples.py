"""The paper's set-up: its six worked examples, arms, poses and figures."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from armdyn.models.values.spec import PlanarArmName

PAYLOAD = 0.1006
"""The payload of the paper's figures [kg]."""

PAYLOADS = (0.0212, 0.0312, 0.0518, 0.1006, 0.1219, 0.1307, 0.1505, 0.2, 0.5, 1.0)
"""Table 2: the payloads of Tables 3 to 7 [kg]."""

Kind = Literal["minimum_time", "time_energy", "pid"]
"""Kind of problem: minimum time under ±3 N m (Examples 1 to 3 as they are stated); the optimum of
∫ (1 + ½ τᵀτ) dt without a torque limit, whose law the paper prints as (19) to (21); a PID loop (Examples 4 to 6)."""

_TURN = np.pi / 84


@dataclass(frozen=True)
class Example:
    """One of section 5's worked examples.

    Attributes:
        number: 1 to 6.
        arm: its arm.
        kind: "minimum_time" (section 3) or "pid" (section 4).
        q_start: joint positions at the start [rad].
        q_goal: joint positions at the end [rad].
        figure: the paper's figure of it.
    """

    number: int
    arm: PlanarArmName
    kind: Kind
    q_start: tuple[float, ...]
    q_goal: tuple[float, ...]
    figure: int

    @property
    def folder(self) -> str:
        """The name of its folder."""
        return f"example{self.number}_{self.arm}_{'pid' if self.kind == 'pid' else 'mintime'}"


_POSES: dict[PlanarArmName, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "r": ((-np.pi / 2,), (np.pi / 20,)),
    "rr": ((-np.pi / 2, _TURN), (np.pi / 20, -_TURN)),
    "rrr": ((-np.pi / 2, _TURN, -_TURN), (np.pi / 20, -_TURN, _TURN)),
}

EXAMPLES = (
    Example(1, "r", "minimum_time", *_POSES["r"], 2),
    Example(2, "rr", "minimum_time", *_POSES["rr"], 4),
    Example(3, "rrr", "minimum_time", *_POSES["rrr"], 6),
    Example(4, "r", "pid", *_POSES["r"], 3),
    # Example 5 is printed with other states than Example 2.
    Example(5, "rr", "pid", (-_TURN, _TURN), (_TURN, -_TURN), 5),
    Example(6, "rrr", "pid", *_POSES["rrr"], 7),
)
"""Examples 1 to 6, with the states that the paper prints."""


def example(arm: str, kind: Kind) -> Example:
    """The example of an arm and a kind; time-energy has the states of minimum time."""
    wanted = "pid" if kind == "pid" else "minimum_time"
    return next(e for e in EXAMPLES if e.arm == arm and e.kind == wanted)
