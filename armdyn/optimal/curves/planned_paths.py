"""Curves among obstacles: planned paths, compared on a coarse mesh, the fastest refined on a fine one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import whole
from armdyn.arrays import Array
from armdyn.dynamics.numeric import joint_inertia
from armdyn.errors import ProblemError
from armdyn.models.scene.reaching import slid
from armdyn.optimal.constraints.regions import FrameRegion
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve import Basis, Curve, graded
from armdyn.optimal.curves.layout import CurveSpec
from armdyn.optimal.curves.refinement import RefinedCurve, refine_among_obstacles
from armdyn.optimal.curves.solve import solve_sequentially
from armdyn.optimal.problem.problem import MinimumTimeProblem, expect_problem
from armdyn.optimal.problem.status import Stop
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.within_limits import PLACES, least_factor
from armdyn.planning.paths import JointSpace, PlannerOptions, plan_paths

LegPaths = list[Array]
"""Path of each leg, shape (n, nv) [rad or m]."""

_TURN = np.pi
"""Range of a joint without limits around its given poses [rad or m]: half a turn in both directions."""
_FASTEST = 3.2
"""Velocity limit [rad/s or m/s] above which all are scaled down, to keep collision checks within 0.064 rad."""
_SLOWEST = 0.5
"""Velocity limit [rad/s or m/s] below which all are scaled up, if a joint turns: at 0.02 rad/s checks would be 4e-4 rad
apart, and their budget would end before there is a path."""
NO_PATH = f"no collision-free path was found in {PlannerOptions().checks} collision checks, the planner's budget"


def plan_path(problem: MinimumTimeProblem, seed: int = 0) -> Array:
    """Plan a collision-free path from start to goal, through the via points if there are any.

    Args:
        problem: the problem with poses, limits and obstacles.
        seed: the same seed gives the same path.

    Returns:
        Joint positions [rad or m], shape (n, nv), of a path of straight segments. The path is checked at poses
        0.02 s apart at the velocity limits, scaled to a fastest joint of 0.5 to 3.2 rad/s; `solve_minimum_time` proves
        its motions collision-free at all times.

    Raises:
        ProblemError: the argument is no problem, or no path was found.
    """
    candidates = list(paths_through(expect_problem(problem), whole(seed, "seed", least=0), Stop()))
    if not candidates:
        raise ProblemError(NO_PATH)
    speed = _speed(problem)
    best = min(candidates, key=lambda paths: sum(_times(paths, speed)))
    return np.vstack([leg[bool(k) :] for k, leg in enumerate(best)])


def paths_through(problem: MinimumTimeProblem, seed: int, stop: Stop) -> Iterator[LegPaths]:
    """Paths through all poses of a problem, planned lazily; empty: no path was found."""
    lines = [_line(problem, leg) for leg in range(len(problem.poses) - 1)]
    if not problem.has_clearance:
        yield lines
        return
    model, limits, poses = problem.collision_model(), problem.limits, np.asarray(problem.poses)
    lower = np.maximum(limits.position_lower, np.min(poses, axis=0) - _TURN)
    upper = np.minimum(limits.position_upper, np.max(poses, axis=0) + _TURN)
    speed = _speed(problem)
    ends = np.min([model.distances_of(model.touching, q) for q in poses], axis=0)
    least = np.minimum(ends - problem.clearance, 0.0)  # as for other pairs, the curve restores the clearance
    slowest = 0.0 if np.all(problem.robot.slides) else _SLOWEST
    speed *= np.clip(np.max(speed), slowest, _FASTEST) / np.max(speed)
    space = JointSpace(model, lower, upper, speed, least)
    legs = [
        plan_paths(space, line[0], line[-1], seed, stop=stop.__bool__) if len(line) == 2 else iter([line])
        for line in lines
    ]
    current: list[Array | None] = [next(leg, None) for leg in legs]
    while found := [path for path in current if path is not None]:
        if len(found) < len(legs):
            return
        yield found
        more = [next(leg, None) for leg in legs]
        if all(path is None for path in more):
            return
        current = [old if new is None else new for old, new in zip(current, more, strict=True)]


def _line(problem: MinimumTimeProblem, leg: int) -> Array:
    """Straight line in joint space along a leg, shape (n, nv), moved into the leg's frame regions."""
    first, last = problem.poses[leg : leg + 2]
    every = (one for one in problem.path_constraints if isinstance(one, FrameRegion))
    regions = [one.region for one in every if one.leg in (None, leg)]
    if not regions:
        return np.array([first, last])
    path = first + np.linspace(0, 1, PLACES)[:, None] * (last - first)
    for region in regions:
        half = replace(region, tolerance=tuple(0.5 * most for most in region.tolerance))
        near = [slid(problem.robot, half, q, np.zeros_like(q), problem.limits) for q in path[1:-1]]
        path[1:-1] = [q if moved is None else moved for q, moved in zip(path[1:-1], near, strict=True)]
    return np.asarray(path)


def _times(paths: LegPaths, speed: Array) -> list[float]:
    """Times of the legs at joint speeds, shape (nv,) [rad/s or m/s]."""
    return [float(np.sum(np.max(np.abs(np.diff(path, axis=0)) / speed, axis=1))) for path in paths]


def _speed(problem: MinimumTimeProblem) -> Array:
    """Velocity limits [rad/s or m/s], shape (nv,); the largest for a joint without a limit, 1 if there are none."""
    limits = problem.limits.velocity
    return np.where(np.isfinite(limits), limits, np.max(limits[np.isfinite(limits)], initial=1.0))


def refined_paths(task: Task, planned: Iterator[LegPaths]) -> list[RefinedCurve]:
    """Solve from planned paths and the options' guesses, and refine the fastest curve; empty if none was solved.

    Args:
        task: task with distance constraints.
        planned: paths of `paths_through`, planned only as far as they are tried.
    """
    numbers, spec = task.policy.sequential, CurveSpec(TightenedConstraints.of(task))
    best, iterations, bound = None, 0, task.problem.duration_bound()
    for guess in guesses_along(task, planned):
        if task.stop or (best and best.converged and best.curve.duration < numbers.near_bound * bound):
            break
        solved = solve_sequentially(task, guess, spec, numbers.enough)
        iterations += solved.result.iterations
        task.progress(f"a path of {solved.curve.duration:.4f} s")
        if best is None or (not solved.converged, solved.curve.duration) < (not best.converged, best.curve.duration):
            best = solved
    if best is None:
        return []
    fine = _bases(task, [leg.duration for leg in best.curve.legs], fine=True)
    refined = refine_among_obstacles(task, best.curve.on(fine))
    return [replace(refined, iterations=iterations + refined.iterations)]


def guesses_along(task: Task, planned: Iterator[LegPaths]) -> Iterator[Curve]:
    """Curves along the first path and the shortest of the others, then the options' guesses."""
    numbers, speed = task.policy.sequential, _speed(task.problem)
    yield from (_guess(task, paths) for paths in islice(planned, 1))
    others = sorted(planned, key=lambda paths: sum(_times(paths, speed)))
    yield from (_guess(task, paths) for paths in others[: numbers.paths - 1])
    if len(task.problem.poses) == 2:
        (basis,) = _bases(task, [1.0])
        yield from (Curve.from_motion(guess, basis) for guess in task.options.guesses)


def _guess(task: Task, paths: LegPaths) -> Curve:
    """A curve along a path, slow enough for the torques where these shape the motion."""
    problem, speed = task.problem, _speed(task.problem)
    times = np.array(_times(paths, speed))
    if problem.has_regions:  # the slowest joint, alone and from rest, accelerates over each leg
        inertia = np.diag(joint_inertia(problem.robot)(problem.poses[0]))
        travel, half = np.abs(np.diff(problem.poses, axis=0)), problem.limits.actuators.half_range
        times = np.maximum(times, np.max(np.sqrt(2 * travel * inertia / half), axis=1))
    durations = task.policy.curves.slack * times
    curve = Curve.along(paths, _bases(task, durations), durations, speed, flying=problem.has_regions)
    if task.policy.curves.cruises:
        return curve
    factor = least_factor(problem.robot, problem.limits, curve.trajectory(problem.robot))
    return curve.slower(float(np.clip(factor, 0.1, 10.0)) if np.isfinite(factor) else 1.0)


def _bases(task: Task, durations: ArrayLike, fine: bool = False) -> list[Basis]:
    """Splines of the legs; coarse ones for the comparison of paths.

    With regions, short legs have fewer intervals, which are short only at the motion's ends.
    """
    numbers, times = task.policy.sequential, np.asarray(durations, dtype=float)
    coarser = 1 if fine else 2
    most, shortest = task.policy.curves.intervals // coarser, coarser * numbers.shortest
    longest = coarser * numbers.longest
    if not task.problem.has_regions:
        return [Basis(graded(most, shortest, longest))] * times.size
    parts, last = times / np.max(times), times.size - 1
    counts = np.clip(np.ceil(most * parts), numbers.least, most).astype(int)
    return [
        Basis(graded(int(count), min(shortest / part, 1 / count), longest, (k == 0, k == last)))
        for k, (count, part) in enumerate(zip(counts, parts, strict=True))
    ]
