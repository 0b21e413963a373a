"""Improvement of a curve by quadratic programs, until it satisfies all limits and becomes no shorter."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import StateFunction
from armdyn.models.robots.robot import Robot
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.linear_rows import ClearanceRows, TorqueRows, clearance_rows
from armdyn.optimal.flat.nlp_data import TorqueMargin
from armdyn.optimal.landing.limit_violations import least_factor
from armdyn.optimal.live.checking import SampledCurve, between_samples, check
from armdyn.optimal.live.program import Ends, Iterate, ProgramStep, StepControl, StepProgram
from armdyn.optimal.path_constraints.clearance import ClearanceConstraint
from armdyn.optimal.path_constraints.constraint import ConstraintReport
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.proof.certificate import LIMIT_TOLERANCE
from armdyn.optimal.task.policy.curves import SequentialPolicy
from armdyn.trajectory import Trajectory

Guess = tuple[Array, float, TorqueMargin]
"""Initial control points [rad or m], shape (basis.size, nv), duration [s], and torque margins."""


@dataclass(eq=False)
class Distances:
    """Clearance constraint of a live motion.

    Attributes:
        problem: problem with the obstacles.
        constraint: clearance constraint, with the places at which curves violated it.
        policy: settings of the clearance rows.
        report: report on the last checked motion.
    """

    problem: MinimumTimeProblem
    constraint: ClearanceConstraint
    policy: SequentialPolicy
    report: ConstraintReport | None = None

    @classmethod
    def of(cls, problem: MinimumTimeProblem, policy: SequentialPolicy) -> Self | None:
        """Distances that a problem requires; None: no distances."""
        constraint = ClearanceConstraint.from_problem(problem)
        return None if constraint is None else cls(problem, constraint, policy)

    def rows(self, curve: Curve) -> ClearanceRows:
        """Rows of a program near a curve."""
        return clearance_rows(self.constraint.required_distances(self.problem), curve, self.policy)

    def kept(self, motion: Trajectory) -> bool:
        """Whether a motion provably satisfies all distances; if not, the constraint is tightened for the next step."""
        self.report = self.constraint.check(self.problem, motion, np.empty(0))
        self.constraint = self.constraint.tightened(self.problem, self.report)
        return not self.report.reasons


@dataclass(frozen=True, eq=False)
class LimitedArm:
    """An arm with its limits and the program of a step.

    Attributes:
        robot: the arm.
        program: program of a step, with the limits.
        torque: inverse dynamics.
        inertia: inertia as a function of positions; see `joint_inertia`.
        torques: linearised torques at the places of a curve.
        distances: required distances; None: no distances.
    """

    robot: Robot
    program: StepProgram
    torque: StateFunction
    inertia: Callable[[Array], Array]
    torques: TorqueRows
    distances: Distances | None = None

    def sampled(self, points: Array, duration: float) -> SampledCurve:
        """A curve at its samples."""
        return check(self.program, points, duration, self.torque)

    def motion(self, sampled: SampledCurve, name: str) -> Trajectory:
        """The samples as a motion."""
        names, model = self.robot.joint_names, self.robot.model_hash
        return Trajectory(sampled.t, sampled.q, sampled.v, sampled.tau, names, self.robot.marked(name), model)

    def clear(self, motion: Trajectory) -> bool:
        """Whether a motion provably satisfies all distances."""
        return self.distances is None or self.distances.kept(motion)

    def within_limits(self, sampled: SampledCurve) -> bool:
        """Whether a curve satisfies all limits and distances."""
        kept = sampled.kept(self.program.policy.least_reserve, LIMIT_TOLERANCE)
        kept = kept and between_samples(sampled, self.program.limits, self.inertia) <= LIMIT_TOLERANCE
        return kept and self.clear(self.motion(sampled, "checked"))


@dataclass(frozen=True, eq=False)
class Improved:
    """A curve within its limits.

    Attributes:
        duration: duration of the curve [s].
        sampled: the curve at its samples.
        margins: torque margins of the last step.
        settled: whether the last step, without a short trust region, changed the duration by less than
            `LivePolicy.enough`.
    """

    duration: float
    sampled: SampledCurve
    margins: TorqueMargin
    settled: bool


def improve(arm: LimitedArm, ends: Ends, guesses: Sequence[Guess], until: float) -> tuple[Improved | None, Guess, int]:
    """Improve guesses; return the fastest motion found within its limits, the last curve, and the number of steps.

    Every step is a quadratic program. Then the limits are checked at fine samples, and the excess of a torque around a
    place becomes a margin of its limit there: curve and margins converge together. If steps prefer an excess of torque
    to a longer motion, the price of torques rises.

    Args:
        arm: the arm with its limits.
        ends: start state and goal.
        guesses: initial curves, of which the one of least merit is used.
        until: deadline of the last step's end, by `time.perf_counter` [s].
    """
    program, policy = arm.program, arm.program.policy
    best, k, over, began = None, 0, 0, time.perf_counter()
    # By the longest guess: the price would be zero for the rest of a motion that ends here.
    control = StepControl(1.0, policy.torque * max(duration for _, duration, _ in guesses))
    starts = [(_at(arm, ends, points, T), margins) for points, T, margins in guesses]
    here, margins = min(starts, key=lambda one: program.merit(one[0], one[1], control.price))
    step_time = time.perf_counter() - began
    while k < policy.steps and (began := time.perf_counter()) + step_time < until - policy.hand_over:
        k += 1
        step = program.step(here, margins, ends, control)
        longer = np.inf if step is None else step.longer
        unmet = step is not None and step.promised - here.duration - longer > policy.unmet * control.price
        here, reach = _step_taken(arm, ends, here, step, margins, control, k <= policy.eager)
        sampled = arm.sampled(here.points, here.duration)
        over += sampled.torque > -policy.least_reserve and not unmet
        price = policy.price_growth * control.price if unmet else control.price
        control = StepControl(min(reach, policy.step_factor ** max(over - policy.excess_steps, 0)), price)
        settled = abs(longer) <= policy.enough * here.duration
        if (best is None or here.duration < best.duration or settled) and arm.within_limits(sampled):
            best = Improved(here.duration, sampled, margins, settled and control.reach >= policy.stuck)
            if settled:
                break
        if best is None and not np.any(ends.v) and k > policy.eager:
            best = _slowed(arm, here, sampled, margins)
        margins = _tightened(program, margins, here, sampled, settled or over > policy.decrease_steps)
        step_time = max(step_time, time.perf_counter() - began)
    return best, (here.points, here.duration, margins), k


def _at(arm: LimitedArm, ends: Ends, points: Array, duration: float) -> Iterate:
    """Linearise a curve from the start state to the goal."""
    program = arm.program
    points = program.with_ends(points, duration, ends)
    rows = None if arm.distances is None else arm.distances.rows(program.curve(points, duration))
    return program.linearise(points, duration, ends, arm.torques, rows)


def _step_taken(
    arm: LimitedArm,
    ends: Ends,
    here: Iterate,
    step: ProgramStep | None,
    margins: TorqueMargin,
    control: StepControl,
    eager: bool,
) -> tuple[Iterate, float]:
    """The next curve, or the same one if the step increases the merit; and the next step's size.

    Nocedal and Wright, Numerical Optimization, 2006, algorithm 4.1.

    Args:
        arm: the arm with its program.
        ends: start state and goal.
        here: the present curve.
        step: solution of the quadratic program there; None: it was not solved.
        margins: torque margins of the merit.
        control: size of the step, and price of torques.
        eager: whether a step that increases the merit is taken, too.
    """
    program, policy, reach = arm.program, arm.program.policy, control.reach
    if step is None:
        return here, max(reach / policy.shrink, policy.least_reach)
    there = _at(arm, ends, here.points + step.points, here.duration + step.longer)
    before, after = program.merit(here, margins, control.price), program.merit(there, margins, control.price)
    little = policy.enough * here.duration
    if after > before + little and not eager:
        return here, max(step.part / policy.shrink, policy.least_reach)
    if before - after < policy.poor * (before - step.promised):
        reach = step.part / 2
    elif before - after > policy.good * (before - step.promised):
        reach = 2 * reach
    return there, float(np.clip(reach, policy.least_reach, 1.0))


def _slowed(arm: LimitedArm, here: Iterate, sampled: SampledCurve, margins: TorqueMargin) -> Improved | None:
    """Slow a motion from rest down along its path until it is within its limits; None if no pace is."""
    program = arm.program
    factor = least_factor(arm.robot, program.limits, arm.motion(sampled, "too fast"))
    factor = max(factor, 1 + sampled.other) * (1 + program.policy.slack)
    if not factor < program.policy.too_slow:
        return None
    slower = arm.sampled(here.points, factor * here.duration)
    return Improved(factor * here.duration, slower, margins, False) if arm.within_limits(slower) else None


def _tightened(
    program: StepProgram, margins: TorqueMargin, here: Iterate, sampled: SampledCurve, unchanged: bool
) -> TorqueMargin:
    """Torque margins for the next step, larger around places where torques exceed their limits.

    Args:
        program: of the steps.
        margins: margins so far.
        here: the linearised curve, with torques at the places.
        sampled: the curve at its samples.
        unchanged: whether the curve hardly changes, so that no margin is reduced.
    """
    policy, kept = program.policy, 1.0 if unchanged else program.policy.margin_kept

    def next_(margin: Array | float, beyond: Array, own: Array) -> Array:
        target = np.where(
            beyond + policy.torque_reserve > 0, policy.strict * (beyond - own) + policy.torque_reserve, 0.0
        )
        return np.minimum(np.maximum(target, kept * margin), policy.most_margin)

    over, under = program.violations(here, TorqueMargin())
    return TorqueMargin(next_(margins.upper, sampled.upper, over), next_(margins.lower, sampled.lower, under))
