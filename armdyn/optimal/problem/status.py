"""Status of a solve and its worst violation."""

from dataclasses import dataclass
from enum import StrEnum

from armdyn.arguments import shown
from armdyn.errors import ProblemError


class Status(StrEnum):
    """Status of a solve."""

    SOLVED = "solved"
    """Converged, and the replay reaches the goal."""
    REPLAY_MISSED = "replay_missed"
    """Converged on every mesh that was tried, but the replay does not reach the goal."""
    CONDITION_MISSED = "condition_missed"
    """The replay reaches the goal, but collides, misses a via point, or exceeds an acceleration or jerk limit."""
    LIMIT_EXCEEDED = "limit_exceeded"
    """The replay reaches the goal, but exceeds a limit of torque, velocity or position."""
    INFEASIBLE = "infeasible"
    """No motion was found that satisfies all constraints; among obstacles the planner may have found no path."""
    ITERATION_LIMIT = "iteration_limit"
    """The solver reached its iteration limit."""
    TIME_LIMIT = "time_limit"
    """The time limit ended the search or its proof: the best motion so far may be usable, and is not certified."""
    FOLLOWED = "followed"
    """Of a `Resolver`: no motion to the goal was found in time; the rest of the last motion, to its own goal."""
    STOPPED = "stopped"
    """Of a `Resolver`: no motion to the goal was found in time; a stop within all limits."""
    INTERRUPTED = "interrupted"
    """Stopped by Ctrl-C; the best motion so far is kept."""
    FAILED = "failed"
    """The solver failed numerically; the message has its status."""

    @classmethod
    def _missing_(cls, value: object) -> None:
        raise ProblemError(f"status is {shown(value)}; it is one of {', '.join(cls)}")


@dataclass(frozen=True)
class Violation:
    """The worst violation, scaled (1: as large as a limit or the whole motion).

    Attributes:
        constraint: kind: "position defect", "velocity defect", "dynamics", "torque limit", "jerk limit", …
        joint: name of the joint, or of the limited frame or body.
        time: time of the violation [s].
        value: size, scaled.
    """

    constraint: str
    joint: str
    time: float
    value: float

    def __str__(self) -> str:
        return f"{self.constraint} of joint {self.joint!r} at t = {self.time:.4g} s by {self.value:.3g} (scaled)"
