"""Improvement of a curve by quadratic programs, until it satisfies all limits and becomes no shorter."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.curves.curve import CurveLeg
from armdyn.optimal.curves.curve_program import Iterate
from armdyn.optimal.curves.live_checking import SampledCurve, check, motion_of, within_limits
from armdyn.optimal.curves.live_program import LiveProblem, ProgramStep
from armdyn.optimal.curves.nlp_data import TorqueMargin
from armdyn.optimal.verify.within_limits import least_factor

Guess = tuple[CurveLeg, TorqueMargin]
"""Initial curve, and torque margins."""


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


def improve(live: LiveProblem, guesses: Sequence[Guess], until: float) -> tuple[Improved | None, Guess, int]:
    """Improve guesses; return the fastest motion found within its limits, the last curve, and the number of steps.

    Every step is a quadratic program. Then the limits are checked at fine samples, and the excess of a torque around a
    place becomes a margin of its limit there: curve and margins converge together. If steps prefer an excess of torque
    to a longer motion, the price of torques rises.

    Args:
        live: the problem with its program.
        guesses: initial curves, of which the one of least merit is used.
        until: deadline of the last step's end, by `time.perf_counter` [s].
    """
    policy = live.numbers.live
    best, k, over, began = None, 0, 0, time.perf_counter()
    # By the longest guess: the price would be zero for the rest of a motion that ends here.
    reach, price = 1.0, policy.torque * max(leg.duration for leg, _ in guesses)
    starts = [(live.at(leg), margins) for leg, margins in guesses]
    here, margins = min(starts, key=lambda one: live.merit(one[0], one[1], price))
    step_time = time.perf_counter() - began
    while k < policy.steps and (began := time.perf_counter()) + step_time < until - policy.hand_over:
        k += 1
        step, before = live.step(here, margins, reach, price), live.leg(here.x).duration
        longer = np.inf if step is None else step.leg.duration - before
        unmet = step is not None and step.promised - step.leg.duration > policy.unmet * price
        here, reach = _step_taken(live, here, step, margins, reach, price, k <= policy.eager)
        leg = live.leg(here.x)
        sampled = check(live, leg)
        over += sampled.torque > -policy.least_reserve and not unmet
        price *= policy.price_growth if unmet else 1.0
        reach = min(reach, policy.step_factor ** max(over - policy.excess_steps, 0))
        settled = abs(longer) <= policy.enough * leg.duration
        if (best is None or leg.duration < best.duration or settled) and within_limits(live, sampled):
            best = Improved(leg.duration, sampled, margins, settled and reach >= policy.stuck)
            if settled:
                break
        if best is None and not np.any(live.v) and k > policy.eager:
            best = _slowed(live, leg, sampled, margins)
        margins = _tightened(live, margins, here, sampled, settled or over > policy.decrease_steps)
        step_time = max(step_time, time.perf_counter() - began)
    return best, (live.leg(here.x), margins), k


def _step_taken(
    live: LiveProblem,
    here: Iterate,
    step: ProgramStep | None,
    margins: TorqueMargin,
    reach: float,
    price: float,
    eager: bool,
) -> tuple[Iterate, float]:
    """The next curve, or the same one if the step increases the merit; and the next step's size.

    Nocedal and Wright, Numerical Optimization, 2006, algorithm 4.1.

    Args:
        live: the problem with its program.
        here: the present curve.
        step: solution of the quadratic program there; None: it was not solved.
        margins: torque margins of the merit.
        reach: size of the step as a part of the greatest one.
        price: price of a torque beyond its limit by half its range [s].
        eager: whether a step that increases the merit is taken, too.
    """
    policy, usual = live.numbers.live, live.numbers.sequential
    if step is None:
        return here, max(reach / usual.shrink, policy.least_reach)
    there = live.at(step.leg)
    before, after = live.merit(here, margins, price), live.merit(there, margins, price)
    little = policy.enough * live.leg(here.x).duration
    if after > before + little and not eager:
        return here, max(step.part / usual.shrink, policy.least_reach)
    if before - after < usual.poor * (before - step.promised):
        reach = step.part / 2
    elif before - after > usual.good * (before - step.promised):
        reach = 2 * reach
    return there, float(np.clip(reach, policy.least_reach, 1.0))


def _slowed(live: LiveProblem, leg: CurveLeg, sampled: SampledCurve, margins: TorqueMargin) -> Improved | None:
    """Slow a motion from rest down along its path until it is within its limits; None if no pace is."""
    policy, problem = live.numbers.live, live.problem
    factor = least_factor(problem.robot, problem.limits, motion_of(live, sampled, "too fast"))
    factor = max(factor, 1 + sampled.other) * (1 + policy.slack)
    if not factor < policy.too_slow:
        return None
    slower = replace(leg, duration=factor * leg.duration)
    sampled = check(live, slower)
    return Improved(slower.duration, sampled, margins, False) if within_limits(live, sampled) else None


def _tightened(
    live: LiveProblem, margins: TorqueMargin, here: Iterate, sampled: SampledCurve, unchanged: bool
) -> TorqueMargin:
    """Torque margins for the next step, larger around places where torques exceed their limits.

    Args:
        live: the problem with its program.
        margins: margins so far.
        here: the linearised curve, with torques at the places.
        sampled: the curve at its samples.
        unchanged: whether the curve hardly changes, so that no margin is reduced.
    """
    policy, tau = live.numbers.live, here.torques.tau
    kept, (lower, upper) = 1.0 if unchanged else policy.margin_kept, live.torque_limits(here, TorqueMargin())

    def next_(margin: Array | float, beyond: Array, own: Array) -> Array:
        target = np.where(
            beyond + policy.torque_reserve > 0, policy.strict * (beyond - own) + policy.torque_reserve, 0.0
        )
        return np.minimum(np.maximum(target, kept * margin), policy.most_margin)

    return TorqueMargin(
        next_(margins.upper, sampled.upper, tau - upper), next_(margins.lower, sampled.lower, lower - tau)
    )
