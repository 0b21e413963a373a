"""What comes out of a solve, converged or not."""

from dataclasses import dataclass
from enum import StrEnum

from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory


class Status(StrEnum):
    """How a solve ended."""

    SOLVED = "solved"
    """Converged, and the replay lands on the goal."""
    REPLAY_MISSED = "replay_missed"
    """Converged on every mesh that was tried, but the replay does not land on the goal."""
    INFEASIBLE = "infeasible"
    """No motion was found that satisfies all constraints."""
    ITERATION_LIMIT = "iteration_limit"
    """The solver used up its iterations."""
    TIME_LIMIT = "time_limit"
    """The solve used up its time."""
    INTERRUPTED = "interrupted"
    """Stopped by Ctrl-C; the best so far is kept."""
    FAILED = "failed"
    """The solver gave up for a numerical reason; the message has its word."""


@dataclass(frozen=True)
class Violation:
    """The constraint that is worst violated, in scaled numbers (1 is as large as a limit or a whole motion).

    Attributes:
        constraint: what it is: "position defect", "velocity defect", "dynamics", "torque limit", …
        joint: name of the joint.
        time: in the motion [s].
        value: by how much, scaled.
    """

    constraint: str
    joint: str
    time: float
    value: float

    def __str__(self) -> str:
        return f"{self.constraint} of joint {self.joint!r} at t = {self.time:.4g} s by {self.value:.3g} (scaled)"


@dataclass(frozen=True, eq=False)
class Solution:
    """A motion and how far to trust it.

    Attributes:
        success: converged and replayed to the goal.
        status: a `Status`.
        message: the same for people.
        problem: what was asked.
        duration: t_f [s]; of the last iterate if the solve failed.
        trajectory: the motion; the last iterate if the solve failed.
        replay_error: largest joint position error at the goal [rad or m] after the torques were
            replayed through `pin.aba` by an independent integrator.
        replay_velocity_error: the same for the velocities [rad/s or m/s].
        intervals: of the last mesh.
        iterations: of the solver, over all meshes and starts.
        solve_time: wall time [s].
        worst_violation: None if the solver converged.
    """

    success: bool
    status: Status
    message: str
    problem: MinimumTimeProblem
    duration: float
    trajectory: Trajectory
    replay_error: float
    replay_velocity_error: float
    intervals: int
    iterations: int
    solve_time: float
    worst_violation: Violation | None = None
