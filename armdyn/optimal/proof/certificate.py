"""Certificate of a motion: end error, limits, Pontryagin's conditions, and the gap to a proven lower bound.

With H = 1 + w/2 τᵀτ + ρᵀf(x, τ) and free final time, an optimum has H = 0 throughout, and every
torque on its limit is there because H falls outward: S_i = ∂H/∂τ_i is negative on the upper and
positive on the lower limit, zero where the torque is free (Pontryagin et al. 1962; Bryson and Ho,
Applied Optimal Control, section 3.9 for limits on the state). Such a motion is extremal: no small change of it is
faster. A lower bound on the duration says more, of all motions, where it is near.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, Self

import numpy as np

from armdyn.arguments import number
from armdyn.arrays import Array
from armdyn.optimal.arcs.phases import Phases
from armdyn.optimal.landing.limit_violations import worst_violation
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.proof.pontryagin import idle_joints, pontryagin
from armdyn.optimal.task.options import REPLAY_TOLERANCE
from armdyn.reprs import brief, percent
from armdyn.trajectory import Trajectory

GOAL_TOLERANCE = 1e-6
"""Of the replay at the goal [rad or m] where optimality is claimed: a hundredth of what good encoders resolve."""
VELOCITY_TOLERANCE = 0.02
"""Of the replay's velocity at the goal [rad/s or m/s]: dry friction at light wrists leaves 0.01, other motions 1e-4."""
HAMILTONIAN_TOLERANCE = 1e-4
"""Of |H|, against the 1 that time costs: what multipliers from collocation on these meshes resolve."""
SWITCHING_TOLERANCE = 1e-4
"""Of what H could still fall by if one torque went to a limit that it is not on, against the 1 that time costs."""
ADJOINT_TOLERANCE = 1e-4
"""Of what H feels of costates that are beside the adjoint equations: as of |H|, for the same reason. Planar arms
come to 2e-5 at the most, where a torque limit or a touch bends the motion within an interval."""
SAVING_TOLERANCE = 1e-4
"""Of the duration, that a change of the motion saves to first order at most: a mean of |H| and of wrong signs."""
SEGMENT_TOLERANCE = 1e-7
"""Of the state at the end of a segment [rad or m, and per second], integrated from the motion's own sample before: a
tenth of the goal's tolerance, and ten times what integrators of relative tolerance 1e-10 leave at 50 rad/s."""
TRANSVERSALITY_TOLERANCE = 1e-3
"""Of the duration: what moving the goal by as much as the whole way would save at the rate of the end, along the joint
positions that reach a goal pose. Moving it until that is zero saves some square of it."""
LIMIT_TOLERANCE = 1e-6
"""Of a limit, as a part of it."""
GAP_TOLERANCE = 1e-3
"""Of the duration, above a proven lower bound: less than a change of payload by a few grams makes."""

ON_CURVE = "Pontryagin's conditions are not checked: the switching times are not resolved"
"""Remark of motions that are curves: what proves them is the gap."""


@brief
@dataclass(frozen=True, eq=False)
class Certificate:
    """Results of the checks of a motion. Infinite: could not be checked.

    `lands` and `keeps_limits`: it is `usable`. `extremal`, or a proven `gap` of no more than `GAP_TOLERANCE`, besides:
    it is certified, `ok`.

    Attributes:
        goal_error: largest joint position error at the goal [rad or m]: open loop the worst of two integrators of
            different families, and what their accuracy grows to; by segments that of the replay under feedback. Of
            candidates on the way to an answer: of `replay_torques` alone.
        goal_velocity_error: the same for the velocities [rad/s or m/s].
        hamiltonian_spread: largest |H| at the knots; 0 at an optimum.
        switching_violation: what H could still fall by if one torque went to a limit that it is not on, by
            the sign of its switching function; for held velocities, the wrong sign of their multiplier
            relative to its peak.
        adjoint_error: how far the costates are from a solution of the adjoint equations along the replay, by an
            integration of its own: as a change of H; see `adjoint.adjoint_error`. None: not asked for, as of the
            candidates on the way to an answer, or there are no costates.
        saving: bound on what a change of the motion saves to first order, as a part of the duration, by costates of
            the motion itself: see `mesh_costates`. It takes the place of the two before where the arcs are not
            resolved, and it is known where it is within the tolerance. None: it is not.
        transversality: where many joint positions reach a goal pose: how fast the duration falls where the goal moves
            along them, by the costates at the end, as a share of the duration for as much as the whole way; infinite:
            the costates are not known. None: the goal is a point.
        limit_violation: largest excess of a torque, velocity or position over its limit anywhere in the
            replay, relative to the limit (position: to the range, or 1 rad or m where that is less).
        exceeded: which limit that is, of which joint, and when; None: all are kept.
        singular: some arc has a joint on no limit.
        idle: joints that time does not determine for most of the motion: their costates are zero.
        landing: the largest goal error that counts as landed [rad or m].
        replay: "open loop": the torques alone lead to the goal, by whatever integrator. "segments": without feedback
            the motion is too unstable for that; every segment between samples was integrated from the motion's own
            state, and the motion was replayed under feedback (`proof.repeat`). "curve": the motion was not replayed;
            its torques are those of inverse dynamics at the samples (`Resolver`).
        growth: largest singular value of the derivative of the end state by the start state, open loop, with states in
            rad or m, and per second. None, as the next: not asked for, as of candidates.
        segment_error: largest distance of a segment's end from the motion's next sample [rad or m, and per second].
        correction: largest torque that feedback adds [N m or N]; None: open loop.
        correction_share: the same as a part of half the joint's torque range; None likewise.
        lower_bound: proven, on the duration of all motions to any joint positions at the goal [s]; None: unknown.
        gap: how far this one is above it, as a part of it.
        remark: what there is to say besides, such as why there are no costates.
        t: times at which the costates are known [s], shape (K,).
        costate: ρ at those times, for (q, v), shape (K, 2 nv).
        switching: S = ∂H/∂τ at those times, shape (K, nv).
    """

    goal_error: float
    goal_velocity_error: float
    limit_violation: float
    hamiltonian_spread: float = float("inf")
    switching_violation: float = float("inf")
    adjoint_error: float | None = None
    saving: float | None = None
    transversality: float | None = None
    singular: bool = False
    idle: tuple[str, ...] = ()
    remark: str = ""
    exceeded: Violation | None = None
    landing: float = REPLAY_TOLERANCE
    replay: Literal["open loop", "segments", "curve"] = "open loop"
    growth: float | None = None
    segment_error: float | None = None
    correction: float | None = None
    correction_share: float | None = None
    lower_bound: float | None = None
    gap: float | None = None
    t: Array = field(default_factory=lambda: np.empty(0), repr=False)
    costate: Array = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    switching: Array = field(default_factory=lambda: np.empty((0, 0)), repr=False)

    @property
    def lands(self) -> bool:
        """Whether the replay ends near the goal, at its velocity, and its torques reproduce its states."""
        return self.ends_within(self.landing)

    def ends_within(self, tolerance: float) -> bool:
        """Whether the replay ends within a tolerance of the goal, and its torques reproduce its states.

        Args:
            tolerance: of the position [rad or m]; that of the velocity is `VELOCITY_TOLERANCE`.
        """
        return self.goal_error <= tolerance and self.goal_velocity_error <= VELOCITY_TOLERANCE and self.repeats

    @property
    def repeats(self) -> bool:
        """Every segment ends within `SEGMENT_TOLERANCE` of the next sample; of candidates this is not asked."""
        return self.segment_error is None or self.segment_error <= SEGMENT_TOLERANCE

    @property
    def keeps_limits(self) -> bool:
        """Whether the replay exceeds no limit of torque, velocity or position by more than `LIMIT_TOLERANCE` of it."""
        return self.limit_violation <= LIMIT_TOLERANCE

    @property
    def usable(self) -> bool:
        """Whether the replay reaches the goal and keeps all limits. Says nothing about optimality."""
        return self.lands and self.keeps_limits

    @property
    def on_goal(self) -> bool:
        """Whether the replay ends close enough to the goal to have the duration of a motion to the goal."""
        return self.ends_within(min(GOAL_TOLERANCE, self.landing))

    @property
    def extremal(self) -> bool:
        """Whether the costates are known and keep Pontryagin's conditions, and the motion ends on the goal.

        Where arcs are not resolved, they count as kept if `saving` is at most `SAVING_TOLERANCE`.
        Of a goal pose that a continuum of joint positions reaches, `transversality` is asked, too. Other branches that
        reach the pose may be faster: they are motions of their own.
        Of a candidate the adjoint equations are not asked: see `adjoint_error`.
        A joint whose costates are zero keeps them, too: see `idle`.
        """
        return self.on_goal and not self._against_pontryagin

    @property
    def gap_proven(self) -> bool:
        """Whether the gap is between a motion that ends on the goal within its limits and a bound below it."""
        return self.gap is not None and self.on_goal and self.keeps_limits and self.gap >= -LIMIT_TOLERANCE

    @property
    def ok(self) -> bool:
        """Certified: usable, and extremal or proven to be within `GAP_TOLERANCE` of the least duration of all."""
        near = self.gap is not None and self.gap_proven and self.gap <= GAP_TOLERANCE
        return self.usable and (self.extremal or near)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reasons why the motion is not certified; empty if it is."""
        if self.ok:
            return ()
        if not np.isfinite(self.goal_error):
            return (self.remark or "there is no motion to check",)
        wrong = _beyond(
            ("the replay misses the goal by {:.2g} rad", self.goal_error, min(GOAL_TOLERANCE, self.landing)),
            ("the replay misses the goal's velocity by {:.2g} rad/s", self.goal_velocity_error, VELOCITY_TOLERANCE),
            ("a segment ends {:.2g} from the next sample", self.segment_error or 0.0, SEGMENT_TOLERANCE),
            ("a limit is exceeded by {:.2g} of it", self.limit_violation, LIMIT_TOLERANCE),
        )
        if self.saving is not None or np.isfinite(self.hamiltonian_spread):
            wrong += self._against_pontryagin
        elif not (wrong or self.remark):
            wrong = ("no costates: the arcs were not resolved",)
        remark = "" if self.remark == ON_CURVE and self.gap is not None else self.remark  # the gap says more
        return (*((remark,) if remark else ()), *wrong, *self._against_gap)

    def bounded(self, lower_bound: float | None, duration: float) -> Self:
        """The certificate with a lower bound on the duration of all motions.

        Args:
            lower_bound: proven [s]; None: none is known.
            duration: of this motion [s].

        Raises:
            ProblemError: it is no positive number.
        """
        if lower_bound is None:
            return replace(self, lower_bound=None, gap=None)
        bound = number(lower_bound, "lower_bound", unit="s", sign="positive")
        return replace(self, lower_bound=bound, gap=duration / bound - 1)

    @property
    def _against_pontryagin(self) -> tuple[str, ...]:
        apart = self.transversality or 0.0
        unchecked = ("whether another joint position of the goal is faster is not checked",) if apart == np.inf else ()
        by_arcs = (
            ("the Hamiltonian strays from 0 by {:.2g}", self.hamiltonian_spread, HAMILTONIAN_TOLERANCE),
            ("a switching function has the wrong sign by {:.2g}", self.switching_violation, SWITCHING_TOLERANCE),
        )
        by_motion = (("a change may save {:.2g} of the duration", self.saving or 0.0, SAVING_TOLERANCE),)
        return unchecked + _beyond(
            *(by_arcs if self.saving is None else by_motion),
            ("the costates stray from the adjoint equations by {:.2g}", self.adjoint_error or 0.0, ADJOINT_TOLERANCE),
            (
                "another joint position that reaches the goal pose is faster: transversality is missed by {:.2g}",
                0.0 if unchecked else apart,
                TRANSVERSALITY_TOLERANCE,
            ),
        )

    @property
    def _against_gap(self) -> tuple[str, ...]:
        if self.gap is None:
            return ()
        if self.gap < -LIMIT_TOLERANCE:
            return (f"it is faster than the lower bound of {self.lower_bound:.9g} s: one of the two is wrong",)
        return _beyond((f"it is up to {percent(self.gap)} above the lower bound", self.gap, GAP_TOLERANCE))


def _beyond(*checks: tuple[str, float, float]) -> tuple[str, ...]:
    """Texts of the values that exceed their bounds, NaN included."""
    return tuple(text.format(value) for text, value, bound in checks if not value <= bound)


def certify(
    problem: MinimumTimeProblem,
    replay: Trajectory,
    phases: Phases | None,
    remark: str = "",
) -> Certificate:
    """Check a replayed motion, and its costates if its arcs are known; the adjoint equations are `adjoint_error`'s.

    Args:
        problem: the minimum-time problem.
        replay: what the torques do under `replay_torques`.
        phases: the arcs solved; None: only the replay is checked.
        remark: why there are no arcs.
    """
    goal = float(np.max(np.abs(replay.q[-1] - problem.q_goal)))
    goal_velocity = float(np.max(np.abs(replay.v[-1] - problem.v_goal)))
    exceeded = worst_violation(problem.limits, replay, problem.robot.joint_names)
    limit = exceeded.value if exceeded else 0.0
    plain = Certificate(goal, goal_velocity, limit, remark=remark, exceeded=exceeded)
    if phases is None:
        return plain
    hamiltonian, switching, sign = pontryagin(problem, phases)
    return replace(
        plain,
        hamiltonian_spread=float(np.max(np.abs(hamiltonian))),
        switching_violation=sign,
        singular=problem.effort_weight == 0 and any(arc.singular for arc in phases.arcs),
        idle=idle_joints(problem, phases, switching, SWITCHING_TOLERANCE),
        t=phases.t,
        costate=phases.costate,
        switching=switching,
    )
