"""What a problem asks along the way, as rows and bounds of a nonlinear program: `path` says which rows there are."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.exclusive import built_once
from armdyn.models.bodies import capsules
from armdyn.models.collision import collision_model
from armdyn.models.robot import Robot
from armdyn.optimal.conditions.distance import numbers_of
from armdyn.optimal.conditions.rows import Pair, PathRows, distances_at
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.assembly import Nlp
from armdyn.optimal.program.unknowns import Scales
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_MARGIN = 1e-3
"""Added to the clearance asked for [m]: for what is between the points at which it is asked."""
_RAMP = 0.2
"""Capsules that are too near at a given pose may come away from there within this part of the motion."""


@dataclass(frozen=True, eq=False)
class Course:
    """How the collocation is to be stricter than the problem, so that the replay is as the problem asks.

    Attributes:
        margins: added to the clearance of every pair of `path_rows` [m], shape (pairs,) or one for all.
        offsets: how far beside the via points and the goal to aim, q [rad or m], shape (legs, nv).
        end_velocity: the same for the velocity at the goal [rad/s or m/s], shape (nv,).
        points: of every interval, at which distances are asked for.
    """

    margins: Array | float = _MARGIN
    offsets: Array | float = 0.0
    end_velocity: Array | float = 0.0
    points: int = 2

    def changed(self, **changes: Array | int) -> "Course":
        """The same with something else."""
        return replace(self, **changes)  # type: ignore[arg-type]


PLAIN = Course()
"""As strict as the problem itself, but for the least margin."""


def path_rows(problem: MinimumTimeProblem, points: int = 2) -> PathRows | None:
    """The rows that a problem needs besides the equations of motion; None: none."""
    accelerates, jerks = problem.acceleration_limit is not None, problem.jerk_limit is not None
    obstacles = tuple(problem.obstacles)
    pairs = _pairs(problem.robot, len(obstacles), problem.self_collision, problem.poses.tobytes())
    if not (pairs or accelerates or jerks):
        return None
    return PathRows(pairs, tuple(map(type, obstacles)), points if pairs else 1, accelerates or jerks, jerks)


def scene_of(problem: MinimumTimeProblem) -> Array:
    """The obstacles as parameters of a program."""
    return np.array([number for obstacle in problem.obstacles for number in numbers_of(obstacle)])


@built_once(maxsize=16)
def _pairs(robot: Robot, obstacles: int, self_collision: bool, poses: bytes) -> tuple[Pair, ...]:
    """Every capsule against every obstacle; and capsules of links that must be apart, and are at given poses."""
    if not obstacles and not self_collision:
        return ()
    arm = capsules(robot)
    pairs = [Pair(name, joint, capsule, k) for name, joint, capsule in arm if joint for k in range(obstacles)]
    if self_collision:
        apart = {frozenset(names) for names in collision_model(robot, (), True).pairs}
        own = [
            Pair(name, joint, capsule, other, other_joint, other_name)
            for i, (name, joint, capsule) in enumerate(arm)
            for other_name, other_joint, other in arm[:i]
            if frozenset((name, other_name)) in apart and joint != other_joint
        ]
        function = distances_at(Dynamics(robot, free_last_body=True), tuple(own))
        given = [np.array(function(q, ())).ravel() for q in np.frombuffer(poses).reshape(-1, robot.nv)]
        # Round capsules around links that are near each other by design overlap: the real bodies are checked.
        pairs += [pair for pair, near in zip(own, np.min(given, axis=0), strict=True) if near > 0]
    return tuple(pairs)


@dataclass(frozen=True, eq=False)
class Legs:
    """How a mesh is dealt out to the legs between poses that are passed through.

    Attributes:
        intervals: of every leg.
        durations: of every leg in a guess [s], shape (legs,).
    """

    intervals: tuple[int, ...]
    durations: Array

    @property
    def of(self) -> NDArray[np.int_]:
        """Each interval's leg, shape (N,)."""
        return np.repeat(np.arange(len(self.intervals)), self.intervals)

    @property
    def knots(self) -> NDArray[np.int_]:
        """The last knot of every leg, shape (legs,)."""
        return np.cumsum(self.intervals)


def legs_of(problem: MinimumTimeProblem, guess: Trajectory, intervals: int) -> Legs:
    """Legs by when a guess passes nearest to the via points, in their order.

    Every leg gets a part of the mesh by its part of the time, and a few intervals at least.
    """
    marks, first = [float(guess.t[0])], 0
    for i, pose in enumerate(problem.via):
        last = guess.t.size - (len(problem.via) - i)
        first = min(first + 1, last - 1)
        away = np.max(np.abs(guess.q[first:last] - np.asarray(pose)), axis=1)
        first += int(np.argmin(away))
        marks.append(float(guess.t[first]))
    durations = np.maximum(np.diff([*marks, guess.t[-1]]), 1e-3 * guess.duration)
    least = max(min(4, intervals // durations.size), 1)
    spare = intervals - least * durations.size
    if spare < 0:
        raise ValueError(f"{intervals} intervals are too few for {durations.size} legs")
    edges = np.round(spare * np.append(0.0, np.cumsum(durations)) / durations.sum()).astype(int)
    return Legs(tuple((np.diff(edges) + least).tolist()), durations)


def row_bounds(
    problem: MinimumTimeProblem,
    nlp: Nlp,
    rows: PathRows | None,
    legs: Legs,
    course: Course,
    scales: Scales,
    when: Array,
) -> tuple[Array, Array]:
    """Lower and upper bounds of all rows, those of the equations of motion first.

    Args:
        problem: what is asked.
        nlp: its program.
        rows: of the program.
        legs: of the mesh.
        course: margins.
        scales: of the unknowns.
        when: about the knots' parts of the motion, shape (N + 1,), from 0 to 1.
    """
    N = nlp.intervals
    lower = np.zeros((N, nlp.defects))
    lower[legs.knots[:-1] - 1, -1] = -np.inf  # every leg has a duration of its own
    lows, highs = [lower.ravel()], [-lower.ravel()]
    if rows is not None and rows.pairs:
        low = _least_distances(problem, rows, legs, course, when)
        lows.append(low.ravel())
        highs.append(np.full(low.size, np.inf))
    if rows is not None and rows.accelerations:
        stages = nlp.layout.scheme.tableau.c.size
        bound = _over(problem.acceleration_limit, scales.speed / scales.time, problem.robot.nv)
        rising = np.tile(bound, (N, stages))
        if rows.jerks:  # before and after the motion the arm is at rest
            rising[0, : bound.size] = rising[-1, -bound.size :] = 0.0
            jerk = _over(problem.jerk_limit, scales.speed / scales.time**2, problem.robot.nv)
            rising = np.hstack([rising, np.tile(jerk, (N, stages - 1))])
        lows.append(-rising.ravel())
        highs.append(rising.ravel())
    return np.concatenate(lows), np.concatenate(highs)


def _over(limit: object, unit: float, joints: int) -> Array:
    return np.full(joints, np.inf) if limit is None else np.asarray(limit) / unit


def _least_distances(problem: MinimumTimeProblem, rows: PathRows, legs: Legs, course: Course, when: Array) -> Array:
    """What every distance must be at least [m], shape (points, N, pairs)."""
    function = distances_at(Dynamics(problem.robot, free_last_body=True), rows.pairs, rows.kinds)
    scene = scene_of(problem)
    need = problem.clearance + np.broadcast_to(course.margins, (len(rows.pairs),))
    part = np.arange(rows.points)[:, None] / rows.points
    at = when[:-1] + part * np.diff(when)
    low = np.broadcast_to(need, (*at.shape, need.size)).copy()
    for knot, q in zip([0, *legs.knots], problem.poses, strict=True):
        short = np.maximum(need - np.array(function(q, scene)).ravel() + 1e-6, 0)
        share = np.maximum(1 - np.abs(at - when[knot]) / _RAMP, 0)
        low = np.minimum(low, need - short * share[..., None])
        if knot < at.shape[1]:
            low[0, knot] = -np.inf  # this pose is given
    return low
