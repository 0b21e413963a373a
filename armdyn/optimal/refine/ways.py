"""Curves among obstacles: planned ways, the fastest of them on a coarse mesh, refined on a fine one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import whole
from armdyn.errors import ProblemError
from armdyn.optimal.flat.basis import Basis, graded
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.nlp_data import CurveSpec
from armdyn.optimal.flat.refinement import RefinedCurve, refine_curve
from armdyn.optimal.flat.solve import Solved, solve_among_obstacles
from armdyn.optimal.landing.pace import least_factor
from armdyn.optimal.path_constraints.tightened import TightenedConstraints
from armdyn.optimal.problem.problem import MinimumTimeProblem, expect_problem
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.task.policy.policy import Policy
from armdyn.optimal.task.policy.search import SearchPolicy
from armdyn.optimal.task.policy.sequential import SequentialPolicy
from armdyn.optimal.task.task import Task
from armdyn.planning.paths import JointSpace, plan_paths

Array = NDArray[np.float64]

_TURN = np.pi
"""Bounds of a joint without limits, beyond its given poses [rad or m]: half a turn either way."""
_FASTEST = 3.2
"""Velocity limit [rad/s or m/s] above which all are scaled down, lest collision checks be more than 0.064 rad apart."""


def plan_path(problem: MinimumTimeProblem, seed: int = 0) -> Array:
    """Plan a collision-free path from start to goal, through the via points if there are any.

    Args:
        problem: its poses, limits and obstacles.
        seed: the same seed gives the same path.

    Returns:
        Joint positions [rad or m], shape (n, nv), to be joined by straight segments. The path is checked at poses
        0.02 s apart at the velocity limits; `solve_minimum_time` proves its motions clear at all times.

    Raises:
        ProblemError: the problem is none, or no path was found.
    """
    ways = ways_through(expect_problem(problem), Policy.of(problem).search, whole(seed, "seed", least=0), Stop())
    if not ways:
        raise ProblemError("no collision-free path was found within the planner's budget of collision checks")
    return np.vstack([leg[bool(k) :] for k, leg in enumerate(ways[0])])


def ways_through(problem: MinimumTimeProblem, policy: SearchPolicy, seed: int, stop: Stop) -> list[list[Array]]:
    """Ways through all poses of a problem, the shortest first: for each leg a path of shape (n, nv); empty: none."""
    model, limits, poses = problem.collision_model(), problem.limits, np.asarray(problem.poses)
    lower = np.maximum(limits.position_lower, np.min(poses, axis=0) - _TURN)
    upper = np.minimum(limits.position_upper, np.max(poses, axis=0) + _TURN)
    speed = _speed(problem, policy)
    space = JointSpace(model.is_free, lower, upper, speed * min(1.0, _FASTEST / float(np.max(speed))))
    legs = [plan_paths(space, a, b, seed, stop=stop.__bool__) for a, b in pairwise(poses)]
    count = max(map(len, legs)) if all(legs) else 0
    return [[paths[min(k, len(paths) - 1)] for paths in legs] for k in range(count)]


def _speed(problem: MinimumTimeProblem, policy: SearchPolicy) -> Array:
    """Velocity limits [rad/s or m/s], shape (nv,); of a joint without one its share of a brisk motion."""
    limits = problem.limits.velocity
    return np.where(np.isfinite(limits), limits, policy.brisk)


def refined_ways(task: Task, planned: Sequence[Sequence[Array]]) -> list[RefinedCurve]:
    """The fastest curve along planned ways, refined; empty if there is no way.

    Args:
        task: a problem with distances to be kept.
        planned: for each way its legs' joint positions, as `ways_through` gives them.
    """
    numbers, bound = task.policy.sequential, task.problem.duration_bound()
    ways = [_guess(task, way) for way in planned[: numbers.ways]]
    ways += [Curve.near(guess, _coarse(numbers)) for guess in task.options.guesses]
    spec = CurveSpec(TightenedConstraints.of(task))
    best: Solved | None = None
    for k, way in enumerate(ways):
        beaten = np.inf if best is None or not best.converged else best.curve.duration
        if task.stop or beaten < numbers.near_bound * bound:
            break
        solved = solve_among_obstacles(task, way, spec, numbers.trust, numbers.coarse_enough, beaten)
        task.progress(f"way {k + 1} of {len(ways)}: {solved.curve.duration:.4f} s")
        if best is None or (not solved.converged, solved.curve.duration) < (not best.converged, best.curve.duration):
            best = solved
    if best is None:
        return []
    fine = Basis(graded(numbers.intervals, numbers.shortest, numbers.longest))
    refined = refine_curve(task, best.curve.on(fine))
    return [replace(refined, curve=refined.curve.slower(1 + numbers.kept))]


def _guess(task: Task, way: Sequence[Array]) -> Curve:
    """A curve along a way, so slow that torques are about within their limits where these shape the motion."""
    problem, numbers, speed = task.problem, task.policy.sequential, _speed(task.problem, task.policy.search)
    times = [float(np.sum(np.max(np.abs(np.diff(path, axis=0)) / speed, axis=1))) for path in way]
    curve = Curve.along(way, _coarse(numbers), task.policy.curves.slack * np.array(times), speed)
    if task.policy.curves.cruises:
        return curve
    factor = least_factor(problem.robot, problem.limits, curve.trajectory(problem.robot, 1, 0))
    return curve.slower(float(np.clip(factor, 0.1, 10.0)) if np.isfinite(factor) else 1.0)


def _coarse(numbers: SequentialPolicy) -> Basis:
    """Splines on which ways are compared."""
    return Basis(graded(numbers.coarse, numbers.coarse_shortest, numbers.coarse_longest))
