"""Refinement of a curve until its limits hold between the points of the program, too."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.flat.curve import Curve, CurveLeg
from armdyn.optimal.flat.equations import POINTS
from armdyn.optimal.flat.follow import follow
from armdyn.optimal.flat.nlp_data import CurveSpec, TorqueMargin, torque_rates
from armdyn.optimal.flat.solve import Solved, solve_curve
from armdyn.optimal.landing.pace import can_be_slowed, least_factor, mended
from armdyn.optimal.path_constraints.tightened import ConstraintReports, TightenedConstraints
from armdyn.optimal.task.policy.sequential import SequentialPolicy
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_MOST = 0.95
"""Part of half the torque's range that room may take."""
_KEPT = -1.0
"""Excess of a rate that is zero, or has no limit."""
_PACES = 3
"""Rounds of slowing down: the first is exact but for friction, which the next knows at the new pace."""


@dataclass(frozen=True, eq=False)
class RefinedCurve:
    """A refined curve, and its remaining excess over the limits.

    Attributes:
        curve: the motion.
        solved: the program's last solution; the curve may be slower.
        spec: specification of the last round, with its tightened constraints and margins.
        iterations: of IPOPT, or quadratic programs, over all rounds.
        excess: of a torque between the points, as a part of half its range; not positive: none.
        reports: the path constraints.
        calm: time that was given for calm joints [s].
    """

    curve: Curve
    solved: Solved
    spec: CurveSpec
    iterations: int
    excess: float
    reports: ConstraintReports
    calm: float = 0.0


def refine_curve(task: Task, guess: Curve) -> RefinedCurve:
    """The fastest curve near a guess whose torques are within their limits everywhere, as path constraints are.

    What a torque exceeds its limit by between two points is taken off the limit there, and the program solved again.

    Args:
        task: what is to be solved.
        guess: the curve to start from.
    """
    spec = CurveSpec.of(task)
    return _in_rounds(task, solve_curve(task, guess, spec), spec)


def calm_curve(task: Task, fastest: RefinedCurve, share: float) -> RefinedCurve:
    """Refine a fastest curve to the calm one: slower by a share, with the least joint travel and torque changes.

    Where no such curve is found, or a slower one, the fastest curve is returned.

    Args:
        task: the problem and its options.
        fastest: the fastest curve, within its limits.
        share: part of the fastest duration that may be given [-].
    """
    numbers, duration = task.policy.curves, fastest.curve.duration
    least = (1 + share - numbers.little) * duration
    spec = replace(fastest.spec, smooth=0.0, travel=numbers.travel, steps=numbers.torque_steps, least=least)
    found = _in_rounds(task, solve_curve(task, fastest.curve, spec, fastest.solved), spec)
    given = found.curve.duration - duration
    kept = found.solved.converged and found.excess <= numbers.little and constraints_mended(task, found.reports)
    if task.stop or not kept or given > share * duration:
        return fastest
    return replace(found, solved=fastest.solved, iterations=fastest.iterations + found.iterations, calm=given)


def _in_rounds(task: Task, solved: Solved, spec: CurveSpec) -> RefinedCurve:
    """Tighten a specification and solve it again until the limits are kept between the points, too."""
    numbers, problem, iterations, last = task.policy.curves, task.problem, solved.result.iterations, np.inf
    for k in range(numbers.rounds):
        over, kept = excesses_of(task, solved.curve), reports_on(task, solved.curve, spec.constraints)
        enough, worst = numbers.little if can_be_slowed(problem) else 0.0, max(map(_worst, over))
        if (worst <= enough and constraints_mended(task, kept)) or task.stop or not solved.converged:
            break
        task.progress(f"round {k + 1}: {solved.curve.duration:.6f} s, torques {_percent(over)} beyond between points")
        margins = spec.margins or (TorqueMargin(),) * len(over)
        more = tuple(_larger_margin(task, margin, here) for margin, here in zip(margins, over, strict=True))
        tightened = spec.constraints.tightened(problem, kept)
        spec = replace(spec, margins=more, constraints=tightened)
        # Margins where torques are far from their limits change no step; IPOPT's barrier keeps away from them.
        solved, last = replace(solved, in_steps=solved.in_steps and worst < last), worst
        again = solve_curve(task, solved.curve, spec, solved)
        iterations += again.result.iterations
        if not again.converged:
            break
        solved = again
    curve = solved.curve
    if can_be_slowed(problem):
        curve = _slowed(task, curve)
    excess = max(map(_worst, excesses_of(task, curve)))
    return RefinedCurve(curve, solved, spec, iterations, excess, reports_on(task, curve, spec.constraints))


def refine_among_obstacles(task: Task, guess: Curve) -> RefinedCurve:
    """The fastest curve near a guess that keeps its distances, slowed down to keep its limits: the best of some rounds.

    Args:
        task: a problem with distances to be kept.
        guess: the curve to start from.
    """
    numbers, hopeless = task.policy.sequential, task.policy.curves.hopeless
    constraints = TightenedConstraints.of(task)
    margins = () if task.problem.regional else tuple(_at_the_ends(leg, numbers) for leg in guess.legs)
    spec = CurveSpec(constraints, margins=margins)
    found, solved, iterations = list[RefinedCurve](), None, 0

    def rank(one: RefinedCurve) -> tuple[bool, bool, float]:
        return not constraints_mended(task, one.reports), one.excess > hopeless, one.curve.duration

    for k in range(numbers.rounds):
        solved = solve_curve(task, guess if solved is None else solved.curve, spec, solved)
        iterations += solved.result.iterations
        over, curve = excesses_of(task, solved.curve), solved.curve
        excess = max(map(_worst, over))
        if excess > 0 and can_be_slowed(task.problem):
            curve = _slowed(task, curve)
            excess = max(map(_worst, excesses_of(task, curve)))
        kept = reports_on(task, curve, spec.constraints)
        found.append(RefinedCurve(curve, solved, spec, iterations, excess, kept))
        little = curve.duration < (1 + numbers.slowed * 2**k) * solved.curve.duration
        good = not any(rank(found[-1])[:2])
        task.progress(f"round {k + 1}: {curve.duration:.4f} s{'' if good else ', limits are not kept yet'}")
        if task.stop or (good and little):
            break
        margins = spec.margins or (TorqueMargin(),) * len(over)
        more = tuple(_larger_margin(task, margin, here) for margin, here in zip(margins, over, strict=True))
        spec = replace(spec, margins=more, constraints=spec.constraints.tightened(task.problem, kept))
    return replace(min(found, key=rank), iterations=iterations)


def _at_the_ends(leg: CurveLeg, numbers: SequentialPolicy) -> TorqueMargin:
    """Margins near the ends, where torques change fast, and in the first and the last interval."""
    margin = np.zeros((POINTS * leg.basis.intervals, leg.points.shape[1]))
    near = POINTS * numbers.switching
    margin[:near] = margin[-near:] = numbers.switch_margin
    margin[:POINTS] = margin[-POINTS:] = numbers.end_margin
    return TorqueMargin(margin, margin)


def excesses_of(task: Task, curve: Curve) -> tuple[TorqueMargin, ...]:
    """How far torques, and how fast they change, exceed their limits near every point of every leg, as parts of these.

    Args:
        task: its limits, and at how many places they are looked at.
        curve: a motion.
    """
    problem, looks = task.problem, task.policy.curves.looks
    limits, limit = problem.limits, torque_rates(task, TightenedConstraints.of(task))
    half = limits.actuators.half_range
    found = []
    for leg in curve.legs:
        breaks = leg.basis.breaks
        s = breaks[:-1, None] + np.diff(breaks)[:, None] * np.linspace(0, 1, looks + 1)
        tau = leg.torques(problem.robot, s.ravel()).reshape(*s.shape, -1)
        weakest, strongest = limits.actuators.range(*(x.reshape(tau.shape) for x in leg.at(s.ravel())[:2]))
        # What the limits lose with speed is added to the torque: 0 where they are constant.
        least = -tops((weakest - limits.actuators.lower) - tau)
        most = tops(tau + (limits.actuators.upper - strongest))
        marks = np.linspace(0, looks, POINTS + 1).astype(int)
        halves = [slice(first, last + 1) for first, last in pairwise(marks)]  # every point has its half of an interval
        upper = (
            np.stack([np.max(most[:, half_of], axis=1) - limits.actuators.upper for half_of in halves], axis=1) / half
        )
        lower = (
            np.stack([limits.actuators.lower - np.min(least[:, half_of], axis=1) for half_of in halves], axis=1) / half
        )
        rates = _KEPT if limit is None else _rate_excess(leg, s, tau, limit)
        found.append(TorqueMargin(upper.reshape(-1, half.size), lower.reshape(-1, half.size), rates))
    return tuple(found)


def tops(tau: Array) -> Array:
    """Torques in an interval, raised to the top of the parabola through three of them where that lies between.

    Args:
        tau: shape (intervals, places, nv).
    """
    first, second = tau[:, 2:] - tau[:, :-2], tau[:, 2:] - 2 * tau[:, 1:-1] + tau[:, :-2]
    near = np.abs(first) < -2 * second  # the top is no farther than the next place
    tops = tau.copy()
    tops[:, 1:-1] += np.where(near, first**2, 0.0) / (8 * np.where(near, -second, 1.0))
    return tops


def _rate_excess(leg: CurveLeg, s: Array, tau: Array, limit: Array) -> Array:
    """How far torques change too fast between a leg's points, as parts of the limits, shape (points + 1, nv).

    Args:
        leg: its points and its duration.
        s: places of every interval, shape (intervals, places).
        tau: torques there [N m or N], shape (intervals, places, nv).
        limit: [N m/s or N/s], shape (nv,).
    """
    rates = np.abs(np.diff(tau, axis=1)) / (leg.duration * np.diff(s, axis=1)[..., None]) / limit - 1
    middle = (s[:, 1:] + s[:, :-1]).ravel() / 2
    which = np.searchsorted(leg.basis.gauss(POINTS)[0].ravel(), middle)
    over = np.full((leg.basis.intervals * POINTS + 1, limit.size), _KEPT)
    rates = rates.reshape(-1, limit.size)
    for beside in (-1, 0, 1):  # a step that has no room left leaves the excess to its neighbours
        np.maximum.at(over, np.clip(which + beside, 0, len(over) - 1), rates)
    return over


def _worst(over: TorqueMargin) -> float:
    return float(max(np.max(over.upper), np.max(over.lower), np.max(over.rates)))


def _percent(over: tuple[TorqueMargin, ...]) -> str:
    return f"{100 * max(max(map(_worst, over)), 0.0):.2g} %"


def _larger_margin(task: Task, margin: TorqueMargin, over: TorqueMargin) -> TorqueMargin:
    """More room where a torque exceeds its limit; a point that has no room left takes it from both its neighbours."""
    numbers = task.policy.curves

    def more(beyond: Array | float) -> Array:
        return np.asarray(np.maximum(np.asarray(beyond) + numbers.spare, 0) * numbers.eager)

    upper, lower, rates = more(over.upper), more(over.lower), more(over.rates)
    left = np.pad(np.maximum(upper * (margin.upper >= _MOST), lower * (margin.lower >= _MOST)), ((1, 1), (0, 0)))
    beside = np.maximum(left[:-2], left[2:])
    upper, lower = margin.upper + upper + beside, margin.lower + lower + beside
    return TorqueMargin(np.minimum(upper, _MOST), np.minimum(lower, _MOST), np.minimum(margin.rates + rates, _MOST))


def reports_on(task: Task, curve: Curve, constraints: TightenedConstraints) -> ConstraintReports:
    """How a curve keeps the path constraints.

    Args:
        task: what is asked.
        curve: the motion.
        constraints: the conditions.
    """
    if not constraints.path_constraints:
        return ConstraintReports(())
    motion = sampled(task, curve)
    if not can_be_slowed(task.problem):  # nothing later mends what feedback to the curve adds
        motion = follow(task, motion)
    return constraints.check(task.problem, motion, curve.passing)


def sampled(task: Task, curve: Curve) -> Trajectory:
    """Samples of a curve, between which torques are linear."""
    numbers, problem = task.policy.curves, task.problem
    finer = numbers.finer_with_friction if np.any(np.asarray(problem.robot.friction.coulomb) > 0) else 1
    samples = finer * numbers.samples
    return curve.trajectory(problem.robot, samples, numbers.steps, jumps=not problem.continuous_torque)


def constraints_mended(task: Task, kept: ConstraintReports) -> bool:
    """Whether the path constraints are kept, or would be by slowing down at little cost."""
    return mended(task.problem, kept.slowing, task.policy.path_constraints.slower)


def _slowed(task: Task, curve: Curve) -> Curve:
    """The same path, slowed down until torques and speeds keep their limits; unchanged if no pace does."""
    for _ in range(_PACES):
        factor = least_factor(task.problem.robot, task.problem.limits, sampled(task, curve))
        if factor == 1 or not np.isfinite(factor):
            break
        curve = curve.slower(factor)
    return curve
