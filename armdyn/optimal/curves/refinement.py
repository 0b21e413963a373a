"""Refinement of a curve until its limits hold between the program's points, too."""

from dataclasses import dataclass, replace
from operator import is_

import numpy as np

from armdyn.optimal.constraints.constraint import ConstraintReports
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve import Curve
from armdyn.optimal.curves.excess import (
    Tightening,
    accepted_excess,
    excesses_of,
    larger_margin,
    round_words,
    sampled,
    worst_excess,
)
from armdyn.optimal.curves.layout import CurveSpec, TorqueMargin
from armdyn.optimal.curves.solve import Solved, solve_curve
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.within_limits import can_be_slowed, constraints_mended, follow, least_factor


@dataclass(frozen=True, eq=False)
class RefinedCurve:
    """A refined curve, and its remaining excess over the limits.

    Attributes:
        curve: the motion.
        solved: the program's last solution; the curve may be slower.
        spec: specification of the last round, with its tightened constraints and margins.
        iterations: iterations of IPOPT, or quadratic programs, over all rounds.
        excess: largest excess of a torque between the points, as a part of half its range; not positive: no excess.
        reports: reports on the path constraints.
        calm: time spent on calm joints [s].
    """

    curve: Curve
    solved: Solved
    spec: CurveSpec
    iterations: int
    excess: float
    reports: ConstraintReports
    calm: float = 0.0


def refine_curve(
    task: Task, guess: Curve, only_sequential: bool = False, spec: CurveSpec | None = None, near: Solved | None = None
) -> RefinedCurve:
    """The fastest curve near a guess, within its torque limits and path constraints everywhere.

    An excess of a torque between two points becomes a margin of the limit there, and the program is solved again, until
    the limits hold between the points, too.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        only_sequential: do not fall back on IPOPT if sequential convexification does not converge.
        spec: requirements of the curve; None: the problem's.
        near: result of a similar specification by IPOPT, for a warm start.
    """
    spec = CurveSpec.of(task) if spec is None else spec
    tightening = Tightening(task, guess, spec)
    solved = solve_curve(task, guess, spec, near, tightening, only_sequential)
    spec = tightening.spec if solved.sequential else spec
    numbers, iterations, enough = task.policy.curves, solved.result.iterations, accepted_excess(task)
    worst = last = np.inf
    for k in range(numbers.rounds):
        over = excesses_of(task, solved.curve)
        kept = reports_on(task, solved.curve, spec.constraints)
        worst = worst_excess(over)
        if (worst <= enough and constraints_mended(task, kept)) or task.stop or not solved.converged:
            break
        task.progress(round_words(k + 1, solved.curve, over))
        before, spec = spec.constraints.path_constraints, _tighter(task, spec, over, kept)
        if worst <= enough and all(map(is_, before, spec.constraints.path_constraints)):
            break  # no constraint can be tightened further
        # Margins of limits that are not active do not change steps; IPOPT's barrier responds to them.
        solved, last = replace(solved, sequential=solved.sequential and worst < last), worst
        again = solve_curve(task, solved.curve, spec, solved)
        iterations += again.result.iterations
        if not again.converged:
            break
        solved = again
    return slowed_to_limits(task, solved, spec, iterations, numbers.small_excess)


def calm_curve(task: Task, fastest: RefinedCurve, share: float) -> RefinedCurve:
    """Refine a fastest curve to the calm one: slower by a share, with the least joint travel and torque changes.

    Without such a curve, or if it is slower, the fastest curve is returned.

    Args:
        task: the problem and its settings.
        fastest: the fastest curve, within its limits.
        share: part of the fastest duration that may be spent [-].
    """
    numbers, duration = task.policy.curves, fastest.curve.duration
    least = (1 + share - numbers.small_excess) * duration
    spec = replace(fastest.spec, smooth=0.0, travel=numbers.calm, steps=numbers.calm, least=least)
    near = None if fastest.solved.sequential else fastest.solved
    found = refine_curve(task, fastest.curve, spec=spec, near=near)
    given = found.curve.duration - duration
    kept = found.solved.converged and found.excess <= numbers.small_excess and constraints_mended(task, found.reports)
    if task.stop or not kept or given > share * duration:
        return fastest
    return replace(found, solved=fastest.solved, iterations=fastest.iterations + found.iterations, calm=given)


def _tighter(task: Task, spec: CurveSpec, over: tuple[TorqueMargin, ...], reports: ConstraintReports) -> CurveSpec:
    """Specification with larger torque margins and tightened constraints, by the excesses."""
    more = tuple(larger_margin(spec.margin(k), here, task.policy.curves) for k, here in enumerate(over))
    return replace(spec, margins=more, constraints=spec.constraints.tightened(task.problem, reports))


def slowed_to_limits(
    task: Task, solved: Solved, spec: CurveSpec, iterations: int, most: float = np.inf
) -> RefinedCurve:
    """Slow a curve down to its limits, as far as that helps; unchanged where no motion can be slowed down.

    Args:
        task: task with the limits.
        solved: the curve.
        spec: its requirements, whose path constraints are checked.
        iterations: iterations so far.
        most: largest excess of a torque between samples that slowing down removes, as a part of half the range.
    """
    curve, problem, numbers = solved.curve, task.problem, task.policy.curves
    rounds = numbers.rounds if can_be_slowed(problem) else 0
    exact = problem.limits.actuators.constant and not problem.robot.friction.present
    for _ in range(min(rounds, 1) if exact else rounds):
        factor = least_factor(problem.robot, problem.limits, sampled(task, curve))
        if factor == 1 or not np.isfinite(factor):
            break
        curve = curve.slower(factor)
    excess = worst_excess(excesses_of(task, curve))
    for _ in range(rounds):  # excesses between samples
        if not 0 < excess <= most:
            break
        curve = curve.slower(1 + numbers.slower * excess)
        excess = worst_excess(excesses_of(task, curve))
    return RefinedCurve(curve, solved, spec, iterations, excess, reports_on(task, curve, spec.constraints))


def refine_among_obstacles(task: Task, guess: Curve) -> RefinedCurve:
    """The fastest curve near a guess within its distances, slowed down to its limits: the best of some rounds.

    Args:
        task: task with required distances.
        guess: initial guess.
    """
    numbers, most_excess = task.policy.sequential, task.policy.curves.most_excess
    spec = CurveSpec(TightenedConstraints.of(task))
    found, solved, iterations = list[RefinedCurve](), None, 0

    def rank(one: RefinedCurve) -> tuple[bool, bool, float]:
        broken = np.any(one.curve.velocity_jumps(task.problem.limits.velocity) > numbers.enough)
        broken |= not constraints_mended(task, one.reports)
        return bool(broken), one.excess > most_excess, one.curve.duration

    for k in range(task.policy.curves.rounds):
        solved = solve_curve(task, guess if solved is None else solved.curve, spec, solved)
        iterations += solved.result.iterations
        found.append(slowed_to_limits(task, solved, spec, iterations, most_excess))
        curve, reports = found[-1].curve, found[-1].reports
        little = curve.duration < (1 + numbers.enough * 2**k) * solved.curve.duration
        good = not any(rank(found[-1])[:2])
        task.progress(f"round {k + 1}: {curve.duration:.4f} s{'' if good else ', limits are not satisfied yet'}")
        if task.stop or (good and little):
            break
        spec = _tighter(task, spec, excesses_of(task, solved.curve), reports)
    return replace(min(found, key=rank), iterations=iterations)


def reports_on(task: Task, curve: Curve, constraints: TightenedConstraints) -> ConstraintReports:
    """Reports on a curve's path constraints.

    Args:
        task: the problem and its settings.
        curve: the motion.
        constraints: the path constraints.
    """
    if not constraints.path_constraints:
        return ConstraintReports(())
    motion = sampled(task, curve)
    if not can_be_slowed(task.problem):  # the feedback's corrections are not removed later
        motion = follow(task, motion)
    return constraints.check(task.problem, motion, curve.passing)
