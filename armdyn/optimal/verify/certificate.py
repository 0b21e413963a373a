"""Certificate of a motion: end error, limits, Pontryagin's conditions, and the gap to a proven lower bound.

With H = 1 + w/2 τᵀτ + ρᵀf(x, τ) and free final time, an optimum has H = 0 throughout, and every torque is on the limit
towards which H falls: S_i = ∂H/∂τ_i is negative on the upper and positive on the lower limit, zero where the torque is
free (Pontryagin et al. 1962; Bryson and Ho, Applied Optimal Control, section 3.9 for limits on the state). Such a
motion is extremal: no small change makes it faster. A near lower bound on the duration proves more, about all motions.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, Self

import numpy as np

from armdyn.arguments import number
from armdyn.optimal.problem.checks import LANDING, LEAST_WAY
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.verify.costates import Phases, idle_joints, pontryagin
from armdyn.optimal.verify.rollout import ACCURACY, Segments, under_feedback
from armdyn.optimal.verify.within_limits import BETWEEN, worst_violation
from armdyn.reprs import brief, joint_unit, optimality_words, percent
from armdyn.trajectory import Trajectory

GOAL_TOLERANCE = LEAST_WAY
"""Largest error of the replay at the goal [rad or m] for a claim of optimality: a hundredth of good encoders'
resolution."""
VELOCITY_TOLERANCE = 0.02
"""Largest error of the replay's velocity at the goal [rad/s or m/s]: dry friction at light wrists leaves 0.01, else
1e-4."""
OPTIMALITY_TOLERANCE = 1e-4
"""Largest violation of Pontryagin's conditions, relative to time's 1: |H|, the decrease of H by moving one torque to a
limit that is not active, the residual of the adjoint equations as a change of H; without exact times the first-order
saving by a change of the motion, which is a mean of these, as a part of the duration. It is the accuracy of
collocation's multipliers on these meshes; planar arms leave 2e-5 at most of the adjoint equations."""
SEGMENT_TOLERANCE = GOAL_TOLERANCE / 10
"""Largest error of the state at the end of a segment [rad or m, and per second], integrated from the motion's sample
before: ten times the error of integrators of tolerance 1e-10 at 50 rad/s."""
LIMIT_TOLERANCE = GOAL_TOLERANCE
"""Largest excess over a limit, as a part of it; of a position's, whose scale is 1 rad or m at least, as at the goal."""
GAP_TOLERANCE = 1e-3
"""Largest proven gap, as a part of the duration: less than the effect of a few grams of payload. Likewise the largest
transversality error: the saving by moving the goal by the whole way at the rate of the end, along the joint positions
that reach a goal pose. The actual saving is of second order."""

OPEN_LOOP_GROWTH = 0.1 * GOAL_TOLERANCE / ACCURACY
"""Largest growth of a motion that is checked by its open-loop replay: beyond 1e4, `ACCURACY` times the growth exceeds a
tenth of the replay's tolerance."""
_LEFT = "a replay under feedback leaves the motion, and open loop it is unstable"
ON_CURVE = "Pontryagin's conditions are not checked: the switching times are not resolved"
"""Remark for motions along curves, which are proven by the gap."""


@brief
@dataclass(frozen=True, eq=False)
class Certificate:
    """Results of the checks of a motion. Infinite: could not be checked.

    It is `usable` if `lands` and `keeps_limits` hold, and certified (`ok`) if it is also `extremal` or has a proven
    `gap` of at most `GAP_TOLERANCE`.

    Attributes:
        goal_error: largest joint position error at the goal [rad or m]: open loop the larger one of two integrators of
            different families, with their amplified accuracy; by segments that of the replay under feedback. For
            candidates: by `replay_torques` alone.
        goal_velocity_error: largest joint velocity error at the goal [rad/s or m/s], likewise.
        hamiltonian_spread: largest |H| at the knots; 0 at an optimum.
        switching_violation: largest decrease of H by moving one torque to a limit that is not active, by the sign of
            its switching function; for active state limits, the wrong sign of their multiplier relative to its peak.
        adjoint_error: residual of the costates in the adjoint equations along the replay, by a separate integration, as
            a change of H; see `adjoint.adjoint_error`. None: not computed, for candidates, or without costates.
        saving: bound on the first-order saving by a change of the motion, as a part of the duration, by costates of the
            motion itself: see `mesh_costates`. Replaces the two above where the arcs are not resolved and it is within
            tolerance. None: unknown.
        transversality: decrease of the duration by moving the goal by the whole way, at the rate of the end, along the
            joint positions that reach the goal pose, as a share of the duration; infinite: no costates. None: the goal
            is a point.
        limit_violation: largest excess of a torque, velocity or position over its limit anywhere in the
            replay, relative to the limit (position: to the range, or 1 rad or m where that is less).
        exceeded: largest violation, with its joint and time; None: all limits are kept.
        idle: joints that minimum time leaves undetermined for most of the motion; none decides a share of time.
        landing: largest goal error that counts as landed [rad or m].
        replay: "open loop": the torques alone reach the goal, with any integrator. "segments": the motion is too
            unstable for that; every segment between samples was integrated from the motion's own state, and the motion
            was replayed under feedback (`repeated`). "curve": the motion was not replayed; its torques are those of
            inverse dynamics at the samples (`Resolver`). "accelerations": of a kinematic problem; accelerations were
            integrated in place of torques.
        growth: largest singular value of ∂(end state)/∂(start state), open loop, with states in
            rad or m, and per second. None, also for the next: not computed, for candidates.
        segment_error: largest distance of a segment's end from the motion's next sample [rad or m, and per second].
        correction: largest torque that feedback adds [N m or N]; None: open loop.
        correction_share: `correction` over half the joint's torque range; None: open loop.
        lower_bound: proven lower bound on the duration of all motions to any joint positions at the goal [s]; None:
            unknown.
        gap: (duration - lower_bound) / lower_bound.
        remark: further remark, such as why there are no costates.
        slides: whether each joint slides, for the units in `reasons`; empty: unknown.
    """

    goal_error: float
    goal_velocity_error: float
    limit_violation: float
    hamiltonian_spread: float = float("inf")
    switching_violation: float = float("inf")
    adjoint_error: float | None = None
    saving: float | None = None
    transversality: float | None = None
    idle: tuple[str, ...] = ()
    remark: str = ""
    exceeded: Violation | None = None
    landing: float = LANDING
    replay: Literal["open loop", "segments", "curve", "accelerations"] = "open loop"
    growth: float | None = None
    segment_error: float | None = None
    correction: float | None = None
    correction_share: float | None = None
    lower_bound: float | None = None
    gap: float | None = None
    slides: tuple[bool, ...] = field(default=(), repr=False)

    @property
    def lands(self) -> bool:
        """Whether the replay ends near the goal, at its velocity, and its torques reproduce its states."""
        return self.ends_within(self.landing)

    def ends_within(self, tolerance: float) -> bool:
        """Whether the replay ends within a tolerance of the goal, and its torques reproduce its states.

        Args:
            tolerance: tolerance of the position [rad or m]; the velocity's is `VELOCITY_TOLERANCE`.
        """
        return self.goal_error <= tolerance and self.goal_velocity_error <= VELOCITY_TOLERANCE and self.repeats

    @property
    def repeats(self) -> bool:
        """Whether every segment ends within `SEGMENT_TOLERANCE` of the next sample; unchecked for candidates."""
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
        """Whether the costates are known and satisfy Pontryagin's conditions, and the motion ends on the goal.

        Without resolved arcs, the conditions count as satisfied if `saving` is within tolerance. For a goal pose
        reached by a continuum of joint positions, `transversality` is required, too; other branches that reach the pose
        may be faster. The adjoint equations are not required of a candidate: see `adjoint_error`. A joint with
        zero costates satisfies the conditions: see `idle`.
        """
        return self.on_goal and not self._against_pontryagin

    @property
    def gap_proven(self) -> bool:
        """Whether the gap is between a motion that ends on the goal within its limits and a bound below it."""
        return self.gap is not None and self.on_goal and self.keeps_limits and self.gap >= -LIMIT_TOLERANCE

    @property
    def ok(self) -> bool:
        """Whether the motion is certified: usable, and extremal or with a gap of at most `GAP_TOLERANCE`."""
        near = self.gap is not None and self.gap_proven and self.gap <= GAP_TOLERANCE
        return self.usable and (self.extremal or near)

    @property
    def claims(self) -> str:
        """Claims on the motion's optimality in words: locally optimal, proven within x %."""
        return optimality_words(self.extremal, self.gap if self.gap_proven else None, self.saving)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reasons why the motion is not certified; empty if it is."""
        if self.ok:
            return ()
        if not np.isfinite(self.goal_error):
            return (self.remark or "there is no motion to check",)
        missed, unit = "the replay misses the goal", joint_unit(self.slides)
        speed = joint_unit(self.slides, "rad/s", "m/s")
        wrong = _beyond(
            (f"{missed} by {{:.2g}} {unit}", self.goal_error, min(GOAL_TOLERANCE, self.landing)),
            (f"{missed}'s velocity by {{:.2g}} {speed}", self.goal_velocity_error, VELOCITY_TOLERANCE),
            ("a segment ends {:.2g} from the next sample", self.segment_error or 0.0, SEGMENT_TOLERANCE),
            ("a limit is exceeded by {:.2g} of it", self.limit_violation, LIMIT_TOLERANCE),
        )
        if self.saving is not None or np.isfinite(self.hamiltonian_spread):
            wrong += self._against_pontryagin
        elif not (wrong or self.remark):
            wrong = ("no costates: the arcs were not resolved",)
        remark = "" if self.remark == ON_CURVE and self.gap is not None else self.remark  # superseded by the gap
        return (*((remark,) if remark else ()), *wrong, *self._against_gap)

    def bounded(self, lower_bound: float | None, duration: float) -> Self:
        """The certificate with a lower bound on the duration of all motions.

        Args:
            lower_bound: proven lower bound [s]; None: unknown.
            duration: duration of this motion [s].

        Raises:
            ProblemError: the lower bound is no positive number.
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
            ("the Hamiltonian strays from 0 by {:.2g}", self.hamiltonian_spread, OPTIMALITY_TOLERANCE),
            ("a switching function has the wrong sign by {:.2g}", self.switching_violation, OPTIMALITY_TOLERANCE),
        )
        by_motion = (("a change may save {:.2g} of the duration", self.saving or 0.0, OPTIMALITY_TOLERANCE),)
        return unchecked + _beyond(
            *(by_arcs if self.saving is None else by_motion),
            (
                "the costates stray from the adjoint equations by {:.2g}",
                self.adjoint_error or 0.0,
                OPTIMALITY_TOLERANCE,
            ),
            (
                "another joint position that reaches the goal pose is faster: transversality is missed by {:.2g}",
                0.0 if unchecked else apart,
                GAP_TOLERANCE,
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
    """Texts for the values that exceed their bounds, including NaN."""
    return tuple(text.format(value) for text, value, bound in checks if not value <= bound)


def certify(
    problem: MinimumTimeProblem, replay: Trajectory, phases: Phases | None, remark: str = "", dense: int = BETWEEN
) -> Certificate:
    """Check a replayed motion, and its costates if its arcs are known, without the adjoint equations.

    Args:
        problem: the minimum-time problem.
        replay: replay of the torques by `replay_torques`.
        phases: the solved arcs; None: only the replay is checked.
        remark: reason for missing arcs.
        dense: see `excesses`.
    """
    goal = float(np.max(np.abs(replay.q[-1] - problem.q_goal)))
    goal_velocity = float(np.max(np.abs(replay.v[-1] - problem.v_goal)))
    exceeded = worst_violation(problem.robot, problem.limits, replay, dense)
    limit = exceeded.value if exceeded else 0.0
    slides = tuple(problem.robot.slides.tolist())
    plain = Certificate(
        goal, goal_velocity, limit, remark=remark, exceeded=exceeded, landing=problem.landing, slides=slides
    )
    if phases is None:
        return plain
    hamiltonian, switching, sign = pontryagin(problem, phases)
    return replace(
        plain,
        hamiltonian_spread=float(np.max(np.abs(hamiltonian))),
        switching_violation=sign,
        idle=idle_joints(problem, phases, switching, OPTIMALITY_TOLERANCE),
    )


def repeated(problem: MinimumTimeProblem, motion: Trajectory, certificate: Certificate) -> Certificate:
    """Check a motion by integrating its torques with an integrator of another family.

    Open loop up to `OPEN_LOOP_GROWTH`: the goal errors are the worse of both integrators', plus growth times
    `ACCURACY`. Beyond: those of a replay under feedback, `under_feedback`, which must satisfy the limits, too.

    Args:
        problem: goal and limits.
        motion: states and torques.
        certificate: certificate of the motion's replay by `replay_torques`, or of the motion if it is a replay itself.
    """
    robot, n = problem.robot, problem.robot.nv
    segments = Segments.of(robot, motion)
    judged = replace(certificate, growth=segments.growth, segment_error=segments.largest + ACCURACY)
    error = problem.goal_error_of(motion)
    if segments.growth <= OPEN_LOOP_GROWTH:
        missed = np.abs(error + segments.end()) + segments.growth * ACCURACY
        return replace(
            judged,
            goal_error=max(certificate.goal_error, float(np.max(missed[:n]))),
            goal_velocity_error=max(certificate.goal_velocity_error, float(np.max(missed[n:]))),
        )
    judged = replace(judged, replay="segments")
    followed = under_feedback(robot, problem.limits, motion, segments)
    if followed is None:
        return replace(judged, goal_error=np.inf, goal_velocity_error=np.inf, remark=_LEFT)
    replay, correction = followed
    exceeded = worst_violation(robot, problem.limits, replay)
    if exceeded is None or exceeded.value <= certificate.limit_violation:
        exceeded = certificate.exceeded
    missed = np.abs(problem.goal_error_of(replay)) + ACCURACY
    return replace(
        judged,
        goal_error=float(np.max(missed[:n])),
        goal_velocity_error=float(np.max(missed[n:])),
        limit_violation=exceeded.value if exceeded else certificate.limit_violation,
        exceeded=exceeded,
        correction=float(np.max(correction)),
        correction_share=float(np.max(correction / problem.limits.actuators.scale)),
    )
