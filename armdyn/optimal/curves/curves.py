"""Curves, for speed-limited motions and larger arms: refined, followed by feedback, replayed."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, islice

import numpy as np

from armdyn.arrays import Array
from armdyn.codegen.background import is_building
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.constraints.torque_limits import RmsTorque
from armdyn.optimal.curves.curve import Curve
from armdyn.optimal.curves.excess import sampled
from armdyn.optimal.curves.layout import CurveSpec
from armdyn.optimal.curves.planned_paths import NO_PATH, paths_through, refined_paths
from armdyn.optimal.curves.program import CurveInterval
from armdyn.optimal.curves.refinement import RefinedCurve, calm_curve, refine_curve, reports_on, slowed_to_limits
from armdyn.optimal.curves.solve import prepare_curve, straight_curve
from armdyn.optimal.mesh.direct import Attempt
from armdyn.optimal.mesh.search import SearchResult, grouped, within
from armdyn.optimal.mesh.starts import spline, via_guesses
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import GAP_TOLERANCE, LIMIT_TOLERANCE, ON_CURVE
from armdyn.optimal.verify.costates import RATE_LIMITS, Share, shares_of
from armdyn.optimal.verify.optimum import Optimum
from armdyn.optimal.verify.within_limits import can_be_slowed, constraints_mended, follow, least_factor, worst_violation
from armdyn.parallel import in_processes
from armdyn.reprs import percent
from armdyn.trajectory import Trajectory


def curves(task: Task) -> tuple[list[Optimum], SearchResult]:
    """The fastest curves, replayed in turn until one reaches the goal and satisfies the path constraints.

    Where the policy's strategy goes on with a mesh, it is the straight path's curve alone, in 0.05 s, for the lower
    bound to prove, and none if sequential convexification does not converge.

    Args:
        task: the problem and its settings.
    """
    numbers, alone = task.policy.curves, task.policy.strategy.curves_alone
    most = numbers.most_excess
    if not alone:
        first = refine_curve(task, straight_curve(task, numbers.intervals), only_sequential=True)
        found, planned = ([first] if first.solved.converged or task.stop else []), True
    elif task.problem.has_clearance or task.problem.has_regions:
        found, planned = _among_obstacles(task)
    else:
        starts = task.policy.search.guesses(task.options, numbers.starts)
        found, planned = _refined(task, _guesses(task, starts)), True
        hopeless = task.options.search == "quick" and bool(task.problem.weak_ends)
        if not (task.stop or hopeless) and all(_may_improve(task, one) for one in found):
            found += _refined(task, _guesses(task, numbers.more_starts)[1:])
    if is_building():
        task.progress("its machine code is being built in the background, once: later solves are faster")
    if not found:  # or the time was up before the first curve
        return [], SearchResult((), failed=(_without_path(task),) if alone else ())
    failed = () if planned else (_without_path(task),)
    found.sort(key=lambda one: (one.excess > most, not constraints_mended(task, one.reports), one.curve.duration))
    if found[0].excess > most and can_be_slowed(task.problem) and not task.stop:
        found[0] = slowed_to_limits(task, found[0].solved, found[0].spec, found[0].iterations)
    if found[0].excess > most:
        failed = failed or (_failed(task, found[0]),)
        return [], SearchResult((), failed=failed, iterations=sum(one.iterations for one in found))
    optima: list[Optimum] = []
    for one in found:
        optima.append(_calm(task, one))
        kept = constraints_mended(task, optima[-1].reports)
        if task.stop or (optima[-1].certificate.lands and kept):
            break
    others = tuple(one.curve.duration for one in found[len(optima) :])
    iterations, words = sum(one.iterations for one in found[len(optima) :]), _optima_met(task, found)
    return optima, SearchResult((), failed=failed, listed=others, iterations=iterations, remark=words)


def rough_motions(task: Task) -> list[Trajectory]:
    """Distinct curves of few intervals, the fastest first, perhaps beyond their limits between the points.

    They are guesses for a mesh, for the classes of problems for which the policy wants them.

    Args:
        task: the problem and its settings.
    """
    search, starts = task.policy.search, task.policy.curves.mesh_starts
    if not starts or task.stop:
        return []
    rough = replace(task, policy=task.policy.changed("curves", intervals=task.policy.curves.coarse, rounds=1))
    refined = _refined(rough, _guesses(rough, search.guesses(task.options, starts)))
    found = sorted((one.curve for one in refined if one.solved.converged), key=lambda one: one.duration)
    alike = within(task.policy.same.mesh)
    groups = grouped(found, lambda one, other: alike(one.duration, other.duration))
    return [group[0].trajectory(task.problem.robot) for group in groups[: search.refinements(task.options)]]


def _optima_met(task: Task, found: Sequence[RefinedCurve]) -> str:
    """Number of distinct optima met by the guesses, in words; empty if a bound judges the best.

    Args:
        task: the problem.
        found: refined curves of the guesses, best first.
    """
    most = task.policy.curves.most_excess
    durations = [one.curve.duration for one in found if one.excess <= most and not one.reports.reasons]
    if len(found) < 2 or not durations or _enough(task, found[0]):
        return ""
    problem = task.problem
    # Guesses through via points alone are the same for all seeds.
    seeded = problem.has_clearance or problem.has_regions or not problem.via
    words = optima_met(durations, len(found), task.policy.same.mesh)
    return f"{words}; other seeds may find a faster one" if seeded else words


def optima_met(durations: Sequence[float], guesses: int, same: float) -> str:
    """Number of distinct optima met by some guesses, in words.

    Args:
        durations: durations of the guesses' motions [s].
        guesses: number of guesses, including failed ones.
        same: largest relative difference of durations within one optimum.
    """
    optima = grouped(sorted(durations), within(same))
    several = f"{len(optima)} different optima were" if len(optima) > 1 else "one optimum was"
    times = f"the best one {len(optima[0])} times of {guesses} guesses"
    return f"{several} met, {times}"


def _among_obstacles(task: Task) -> tuple[list[RefinedCurve], bool]:
    """The fastest curve that satisfies all distances and regions, if any, and whether a path was planned.

    If the straight line is collision-free, so may be the fastest curve without obstacles.
    """
    task.progress("paths round the obstacles" if task.problem.has_clearance else "the path through the regions")
    planned = paths_through(task.problem, task.options.seed, task.stop)
    first = list(islice(planned, 1))
    straight = bool(first) and task.problem.has_clearance and all(len(leg) == 2 for leg in first[0])
    found = (_clear_of_obstacles(task) if straight else []) or refined_paths(task, chain(first, planned))
    return found, bool(first)


def _clear_of_obstacles(task: Task) -> list[RefinedCurve]:
    """The fastest curve without obstacles, if it keeps all clearances."""
    task.progress("the motion without obstacles")
    free = task.for_problem(task.problem.without_obstacles())
    best, constraints = refine_curve(free, _guesses(free, 1)[0], only_sequential=True), TightenedConstraints.of(task)
    if not best.solved.converged or best.excess > task.policy.curves.most_excess:
        return []
    reports = reports_on(task, best.curve, constraints)
    spec = replace(best.spec, constraints=constraints)
    return [replace(best, spec=spec, reports=reports)] if constraints_mended(task, reports) else []


def _may_improve(task: Task, refined: RefinedCurve) -> bool:
    """Whether another guess may lead to a better curve: this one did not converge, or was slowed down."""
    slowed, most = refined.curve.duration / refined.solved.curve.duration - 1, task.policy.curves.most_excess
    return not refined.solved.converged or refined.excess > most or slowed > most


def _guesses(task: Task, count: int) -> list[Curve]:
    """Initial guesses: the straight path, the options' guesses, then paths through random poses.

    Through via points the straight path alone, with jerk limits also slower and faster.

    Args:
        task: the problem and its settings.
        count: number of guesses besides the options'.
    """
    problem, numbers, options = task.problem, task.policy.curves, task.options
    guesses = [straight_curve(task, numbers.intervals)]
    basis = guesses[0].legs[0].basis
    if problem.via:
        paces = (numbers.pace, 1 / numbers.pace) if count > 1 and problem.jerk_limit is not None else ()
        return guesses + [guesses[0].slower(pace) for pace in paces]
    guesses += [Curve.from_motion(guess, basis) for guess in options.guesses]
    if count > 1:
        ways = via_guesses(problem, options.seed, count, policy=task.policy.search)[1:]
        guesses += [Curve.from_motion(spline(problem, way), basis) for way in ways]
    return guesses


def _refined(task: Task, guesses: Sequence[Curve]) -> list[RefinedCurve]:
    """The guesses' refined curves."""
    if len(guesses) < 2:
        return [refine_curve(task, guess) for guess in guesses]
    task.progress(f"{len(guesses)} guesses")
    prepare_curve(task, guesses[0], CurveSpec(TightenedConstraints.of(task)))  # built before the fork, for all workers
    found = []
    jobs = [partial(refine_curve, task, guess) for guess in guesses]
    for one in in_processes(jobs, task.workers):
        found.append(one)
        task.progress(f"{len(found)} of {len(guesses)}: {one.curve.duration:.4f} s")
        if _enough(task, one):
            break
    return found


def _enough(task: Task, refined: RefinedCurve) -> bool:
    """Whether a near lower bound makes further guesses useless."""
    if not constraints_mended(task, refined.reports) or _may_improve(task, refined):
        return False
    bound = task.lower_bound()
    return bound is not None and refined.curve.duration <= (1 + GAP_TOLERANCE) * bound


def _calm(task: Task, fastest: RefinedCurve) -> Optimum:
    """Motion with little joint travel, as slow as the options and a nearby proven bound allow; else the fastest."""
    share, duration, problem = task.options.calm, fastest.curve.duration, task.problem
    if not share or problem.pays_effort or problem.has_regions or task.stop or not fastest.solved.converged:
        return _landed(task, fastest)
    task.progress(f"{duration:.6f} s; up to {100 * share:.2g} % of that may be spent on calm joints")
    calm = _landed(task, calm_curve(task, fastest, share)) if task.workers != 1 else None  # parallel to the bound
    bound = task.lower_bound()
    if bound is not None and duration <= (1 + GAP_TOLERANCE) * bound < (1 + share) * duration:
        share, calm = (1 + GAP_TOLERANCE) * bound / duration - 1, None
    return calm or _landed(task, calm_curve(task, fastest, share))


def _without_path(task: Task) -> Attempt:
    """Attempt without a collision-free path."""
    motion, intervals = spline(task.problem, []), task.policy.curves.intervals
    if task.stop:
        return Attempt.unbegun(task.stop, motion, intervals)
    return Attempt(Status.INFEASIBLE, NO_PATH, motion, intervals, 0, None)


def _failed(task: Task, refined: RefinedCurve) -> Attempt:
    """Attempt of a curve whose torques exceed their limits at any pace."""
    problem, result = task.problem, refined.solved.result
    motion = refined.curve.trajectory(problem.robot)
    message = result.message
    if result.status is Status.SOLVED:
        beyond = f"exceed their limits by {percent(refined.excess)} between its points"
        message = f"a curve of {motion.duration:.4g} s is the best; its torques, or their rates, {beyond}"
    status = Status.INFEASIBLE if result.status is Status.SOLVED else result.status
    worst = worst_violation(problem.robot, problem.limits, motion, dense=1)
    return Attempt(status, message, motion, refined.curve.legs[0].basis.intervals, refined.iterations, worst)


def _deciding(task: Task, refined: RefinedCurve) -> tuple[Share, ...]:
    """The limits that decide a curve's duration, by its program's multipliers, largest share first."""
    problem, solved, shape = task.problem, refined.solved, refined.solved.shape
    if problem.pays_effort or not solved.converged:
        return ()
    by_joint, half = dict[str, Array](), problem.limits.actuators.half_range
    for leg in shape.legs:
        torques, multiplier = shape.torques(leg), solved.result.lam_x[shape.torques(leg)]
        size = np.where(multiplier > 0, problem.limits.actuators.upper, problem.limits.actuators.lower) / half
        parts = {"torque limit": np.sum(multiplier * size, axis=0)} if torques.size else {}
        if shape.lines:
            lines = solved.result.lam_g[shape.torque_speeds(leg)]
            parts["torque-speed curve"] = np.sum(lines * solved.result.x[torques][:, None], axis=(0, 1))
        for order in shape.orders:
            rates = shape.rates(leg, order)
            parts[RATE_LIMITS[order]] = np.sum(np.abs(solved.result.lam_g[rates]) * solved.limits[rates], axis=0)
        for limit, part in parts.items():
            by_joint[limit] = by_joint.get(limit, 0.0) + part * solved.guessed / solved.curve.duration
    return shares_of(by_joint | _heating(task, refined), problem.robot.joint_names, task.policy.curves.least_share)


def _heating(task: Task, refined: RefinedCurve) -> dict[str, Array]:
    """Elasticities of the duration in the continuous torques L, shape (nv,), from the rows ∫ (τ/L)² dt - T ≤ …."""
    solved, found, end = refined.solved, dict[str, Array](), 0
    place, legs = CurveInterval(task.dynamics, task.scheme.compile), solved.shape.intervals
    rms_limits = (each for each in refined.spec.constraints.path_constraints if isinstance(each, RmsTorque))
    heated = {rows: each.dwell for each in rms_limits for rows in each.rows(task.problem)}
    for rows in reversed(solved.rows):  # the last equations
        begin = end - rows.bounds(place, legs)[0].size
        if rows in heated:
            multipliers = solved.result.lam_g[slice(begin, end or None)]
            part = 2 * multipliers * solved.guessed * (1 + heated[rows] / solved.curve.duration)
            found["continuous-torque limit"] = part
        end = begin
    return found


def _landed(task: Task, refined: RefinedCurve) -> Optimum:
    """Replay a curve's motion, which is slowed down where its replay exceeds limits or path constraints."""
    problem, curve, numbers, constraints = task.problem, refined.curve, task.policy.curves, refined.spec.constraints
    task.progress(f"replaying a motion of {curve.duration:.6f} s")
    if can_be_slowed(problem):  # velocities have a reserve for the replay's error
        fastest = max(float(np.max(leg.fastest / problem.limits.velocity)) for leg in curve.legs)
        curve = curve.slower(max((1 + numbers.velocity_error) * fastest, 1.0))
    # `follow` integrates as `replay_torques` does, sample by sample; `repeated` uses another integrator.
    replay = follow(task, sampled(task, curve))
    # Where friction jumps, or the arm is unstable, `slowed`, which slows down the replay, would end off the goal.
    for _ in range(numbers.rounds if can_be_slowed(problem) else 0):
        factor = least_factor(problem.robot, problem.limits, replay, LIMIT_TOLERANCE)
        if not 1 < factor < 1 + numbers.most_excess:
            break
        curve = curve.slower(factor)
        replay = follow(task, sampled(task, curve))
    reports = constraints.check(problem, replay, curve.passing)
    # Lines between samples miss the bend of the torque of Coulomb friction, which shakes light joints beyond their jerk
    # limits: such a curve is sampled finer before it is slowed down.
    rubs = bool(np.any(np.asarray(problem.robot.friction.coulomb) > 0))
    finer, paths = numbers.finer[1:] if rubs else (), task.policy.path_constraints
    needed = can_be_slowed(problem) and (rubs or not constraints_mended(task, reports))
    for k in range(len(finer) + paths.rounds if needed else 0):
        if reports.slowing == 1 or not np.isfinite(reports.slowing):
            break
        if k >= len(finer):
            curve = curve.slower(reports.slowing + paths.slower)
        replay = follow(task, sampled(task, curve, max(finer[: k + 1], default=1)))
        reports = constraints.check(problem, replay, curve.passing)
    result = refined.solved.result
    remark = ON_CURVE if refined.solved.converged else f"the curve did not converge ({result.message})"
    shares = _deciding(task, refined)
    idle = problem.robot.joint_names if shares else ()
    passing, intervals = tuple(map(float, curve.passing)), curve.legs[0].basis.intervals
    found = Optimum.of(problem, replay, intervals, None, remark, idle, reports=reports, via_times=passing)
    return replace(found, iterations=refined.iterations, decides=shares, calm=refined.calm)
