"""Whether a motion is what it claims to be: it lands, it keeps the limits, and Pontryagin agrees.

With H = 1 + w/2 τᵀτ + ρᵀf(x, τ) and free final time, an optimum has H = 0 throughout, and every
torque on its limit is there because H falls outward: S_i = ∂H/∂τ_i is negative on the upper and
positive on the lower limit, zero where the torque is free (Pontryagin et al. 1962; Bryson and Ho,
Applied Optimal Control, section 3.9 for limits on the state).
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.arcs.phases import Phases
from armdyn.optimal.landing.limits import worst_violation
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.proof.pontryagin import pontryagin
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

GOAL_TOLERANCE = 1e-6
"""Of the replay at the goal [rad or m]: a hundredth of what encoders of good arms resolve."""
HAMILTONIAN_TOLERANCE = 1e-4
"""Of |H|, against the 1 that time costs: what multipliers from collocation on these meshes resolve."""
SWITCHING_TOLERANCE = 1e-4
"""Of what H could still fall by if one torque went to a limit that it is not on, against the 1 that time costs."""
LIMIT_TOLERANCE = 1e-6
"""Of a limit, as a part of it."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """What was checked, and how it came out. Infinite: could not be checked.

    Attributes:
        ok: everything within its tolerance.
        goal_error: largest joint position error of the replay at the goal [rad or m].
        goal_velocity_error: the same for the velocities [rad/s or m/s].
        hamiltonian_spread: largest |H| at the knots; 0 at an optimum.
        switching_violation: what H could still fall by if one torque went to a limit that it is not on, by
            the sign of its switching function; for held velocities, the wrong sign of their multiplier
            relative to its peak.
        limit_violation: largest excess of a torque, velocity or position over its limit anywhere in the
            replay, relative to the limit (position: to the range).
        exceeded: which limit that is, of which joint, and when; None: all are kept.
        singular: some arc has a joint on no limit.
        reasons: why it is not ok.
        t: times at which the costates are known [s], shape (K,).
        costate: ρ at those times, for (q, v), shape (K, 2 nv).
        switching: S = ∂H/∂τ at those times, shape (K, nv).
    """

    goal_error: float
    goal_velocity_error: float
    limit_violation: float
    hamiltonian_spread: float = float("inf")
    switching_violation: float = float("inf")
    singular: bool = False
    remark: str = ""
    exceeded: Violation | None = None
    t: Array = field(default_factory=lambda: np.empty(0), repr=False)
    costate: Array = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    switching: Array = field(default_factory=lambda: np.empty((0, 0)), repr=False)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it is not ok, for people; empty if it is."""
        checks = (
            ("the replay misses the goal by {:.2g} rad", self.goal_error, GOAL_TOLERANCE),
            ("a limit is exceeded by {:.2g} of it", self.limit_violation, LIMIT_TOLERANCE),
            ("the Hamiltonian strays from 0 by {:.2g}", self.hamiltonian_spread, HAMILTONIAN_TOLERANCE),
            ("a switching function has the wrong sign by {:.2g}", self.switching_violation, SWITCHING_TOLERANCE),
        )
        if not np.isfinite(self.goal_error):
            return (self.remark or "there is no motion to check",)
        unknown = not np.isfinite(self.hamiltonian_spread)
        known = checks[:2] if unknown else checks
        wrong = tuple(text.format(value) for text, value, bound in known if not value <= bound)
        return (*((self.remark,) if self.remark and (wrong or unknown) else ()), *wrong) or (
            ("no costates: the arcs were not resolved",) if unknown else ()
        )

    @property
    def ok(self) -> bool:
        """Everything within its tolerance."""
        return not self.reasons


def certify(problem: MinimumTimeProblem, replay: Trajectory, phases: Phases | None, remark: str = "") -> Certificate:
    """Check a replayed motion, and its costates if its arcs are known.

    Args:
        problem: what was asked.
        replay: what the torques do under `replay_torques`.
        phases: the arcs solved; None: only the replay is checked.
        remark: why there are no arcs.
    """
    goal = float(np.max(np.abs(replay.q[-1] - problem.q_goal)))
    goal_velocity = float(np.max(np.abs(replay.v[-1] - problem.v_goal)))
    exceeded = worst_violation(problem.limits, replay, problem.robot.joint_names)
    limit = exceeded.value if exceeded else 0.0
    if phases is None:
        return Certificate(goal, goal_velocity, limit, remark=remark, exceeded=exceeded)
    hamiltonian, switching, sign = pontryagin(problem, phases)
    return Certificate(
        goal_error=goal,
        goal_velocity_error=goal_velocity,
        limit_violation=limit,
        hamiltonian_spread=float(np.max(np.abs(hamiltonian))),
        switching_violation=sign,
        singular=problem.effort_weight == 0 and any(arc.singular for arc in phases.arcs),
        remark=remark,
        exceeded=exceeded,
        t=phases.t,
        costate=phases.costate,
        switching=switching,
    )
