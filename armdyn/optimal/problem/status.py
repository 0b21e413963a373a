"""How a solve ended, and its worst violation."""

from dataclasses import dataclass
from enum import StrEnum

from armdyn.arguments import shown
from armdyn.errors import ProblemError


class Status(StrEnum):
    """How a solve ended."""

    SOLVED = "solved"
    """Converged, and the replay lands on the goal."""
    REPLAY_MISSED = "replay_missed"
    """Converged on every mesh that was tried, but the replay does not land on the goal."""
    CONDITION_MISSED = "condition_missed"
    """It lands on the goal, but touches something, passes beside a via point, or exceeds an acceleration or jerk."""
    LIMIT_EXCEEDED = "limit_exceeded"
    """It lands on the goal, but exceeds a limit of torque, velocity or position."""
    INFEASIBLE = "infeasible"
    """No motion was found that satisfies all constraints; among obstacles no collision-free path by the planner."""
    ITERATION_LIMIT = "iteration_limit"
    """The solver used up its iterations."""
    TIME_LIMIT = "time_limit"
    """The clock ended the search or its proof: the best so far may be usable, and is not certified."""
    FOLLOWED = "followed"
    """Of a `Resolver`: no motion to the goal was found in time; it is the rest of the last motion, to its own goal."""
    STOPPED = "stopped"
    """Of a `Resolver`: no motion to the goal was found in time; it brings the arm to rest within all limits."""
    INTERRUPTED = "interrupted"
    """Stopped by Ctrl-C; the best so far is kept."""
    FAILED = "failed"
    """The solver gave up for a numerical reason; the message has its word."""

    @classmethod
    def _missing_(cls, value: object) -> None:
        raise ProblemError(f"status is {shown(value)}; it is one of {', '.join(cls)}")


@dataclass(frozen=True)
class Violation:
    """The worst violation, scaled (1 is as large as a limit or a whole motion).

    Attributes:
        constraint: what it is: "position defect", "velocity defect", "dynamics", "torque limit", "jerk limit", …
        joint: name of the joint; of the frame or body, where that is limited.
        time: in the motion [s].
        value: by how much, scaled.
    """

    constraint: str
    joint: str
    time: float
    value: float

    def __str__(self) -> str:
        return f"{self.constraint} of joint {self.joint!r} at t = {self.time:.4g} s by {self.value:.3g} (scaled)"
