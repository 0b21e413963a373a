"""Mesh refinement at the switches: knots close in on the times at which torques leave their limits.

On a mesh of equal intervals a torque that switches within an interval has a mean value between its limits there, and
the state's error is quadratic in the interval's length. The mean gives the switching time: knots are inserted around
it, a tenth of the interval apart, and the program is solved again from its solution. At the ends of a singular arc or a
contact the torque next to the interval is extrapolated linearly into it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.optimal.arcs.arc import runs_of
from armdyn.optimal.program.unknowns import mesh
from armdyn.optimal.solve.condensed import has_stagewise, solve_on_knots
from armdyn.optimal.solve.direct import Attempt
from armdyn.optimal.task.policy.refinement import MotionMeshPolicy, SwitchMeshPolicy
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory


def at_switches(task: Task, attempt: Attempt) -> Attempt:
    """Solve an optimum on meshes refined at its switches; the attempt itself if none converges.

    Args:
        task: task with torques constant in the intervals.
        attempt: a solution on equal intervals.
    """
    numbers = task.policy.switch_mesh
    if not has_stagewise(task):
        return attempt

    def solve(guess: Trajectory, knots: Array) -> Attempt:
        return solve_on_knots(task, guess, knots, task.sharp())

    best, knots = attempt, mesh(max(attempt.intervals, numbers.intervals))
    for found in on_finer_meshes(task, attempt, knots, numbers, solve, lambda one: _finer(task, one, numbers)):
        best = replace(found, iterations=best.iterations + found.iterations)
    return best


def on_finer_meshes(
    task: Task,
    attempt: Attempt,
    knots: Array,
    numbers: SwitchMeshPolicy | MotionMeshPolicy,
    solve: Callable[[Trajectory, Array], Attempt],
    finer: Callable[[Attempt], Array],
) -> Iterator[Attempt]:
    """Solutions of one optimum on successively finer meshes, until one is not usable or no mesh is finer.

    Args:
        task: the problem and its settings; after a stop the last solution is dropped.
        attempt: a solution near the first.
        knots: of the first mesh as parts of the duration, shape (N + 1,).
        numbers: numbers of meshes and knots, and the tolerance for another optimum.
        solve: maps a guess and knots to a solution.
        finer: maps a solution to its knots and further ones.
    """
    near = attempt
    for _ in range(numbers.rounds):
        found = solve(near.trajectory, knots)
        slower = found.trajectory.duration > (1 + numbers.slower) * near.trajectory.duration
        if not found.usable or slower or task.stop:
            return
        yield found
        near, more = found, finer(found)
        if more.size == knots.size or more.size > numbers.most:
            return
        knots = more


def _finer(task: Task, attempt: Attempt, numbers: SwitchMeshPolicy) -> Array:
    """The attempt's knots and further ones around the switches, as parts of the duration."""
    limits, knots = task.problem.limits, attempt.mesh
    lengths = np.diff(knots)
    middle = attempt.trajectory(attempt.trajectory.duration * (knots[:-1] + knots[1:]) / 2)
    levels = (middle.tau - limits.actuators.center) / limits.actuators.scale
    more = [float(time) for time in _beyond_limits(task, attempt, numbers)]
    for level in levels.T[~limits.passive]:
        for run in runs_of(np.flatnonzero(np.abs(level) < 1 - task.policy.arcs.near)):
            free = _FreeRun.of(level, knots, run)
            times = free.switches() if run.size <= task.policy.arcs.switch else free.ends()
            for time in times:
                k = int(np.clip(np.searchsorted(knots, time, side="right") - 1, run[0], run[-1]))
                if lengths[k] > numbers.least:
                    half = numbers.shrink / 2 * lengths[k]
                    inside = knots[k] + numbers.margin * lengths[k], knots[k + 1] - numbers.margin * lengths[k]
                    more += [float(np.clip(time + side * half, *inside)) for side in (-1, 1)]
    return np.unique(np.concatenate([knots, more]))


def _beyond_limits(task: Task, attempt: Attempt, numbers: SwitchMeshPolicy) -> Array:
    """Times at which a position limit is exceeded between the mesh's points, as parts of the duration."""
    limits, knots, motion = task.problem.limits, attempt.mesh, attempt.trajectory
    lengths = np.diff(knots)
    points = (knots[:-1, None] + lengths[:, None] * np.array([0.25, 0.75]))[lengths > numbers.least].ravel()
    q = motion(points * motion.duration).q
    beyond = np.maximum(q - limits.position_upper, limits.position_lower - q)
    return np.asarray(points[np.any(beyond > numbers.beyond * (limits.position_upper - limits.position_lower), axis=1)])


@dataclass(frozen=True, eq=False)
class _FreeRun:
    """Consecutive intervals on which a joint's torque is on no limit.

    Attributes:
        knots: knots as parts of the duration, shape (k + 1,).
        level: torques from -1 at the lower to 1 at the upper limit, shape (k,).
        before: active torque limit before, -1 or 1; 0: the motion starts there.
        after: active torque limit after, -1 or 1; 0: the motion ends there.
    """

    knots: Array
    level: Array
    before: float
    after: float

    @classmethod
    def of(cls, level: Array, knots: Array, run: Index) -> "_FreeRun":
        before = np.sign(level[run[0] - 1]) if run[0] else 0.0
        after = np.sign(level[run[-1] + 1]) if run[-1] + 1 < level.size else 0.0
        return cls(knots[run[0] : run[-1] + 2], level[run], float(before), float(after))

    def switches(self) -> list[float]:
        """Switching times of bang-bang torques with the same mean."""
        before = self.before or -self.after or 1.0
        after, lengths = self.after or -before, np.diff(self.knots)
        away = (before - self.level) / (2 * before) * lengths  # time on the other limit
        if before != after:
            return [float(self.knots[-1] - np.sum(away))]
        centre = np.sum(away * (self.knots[:-1] + self.knots[1:]) / 2) / np.sum(away)
        return [float(centre + side * np.sum(away) / 2) for side in (-1, 1)]

    def ends(self) -> list[float]:
        """Times at which the torque leaves its limit and reaches the next one."""
        begin = _left(self.level, np.diff(self.knots), self.before)
        end = _left(self.level[::-1], np.diff(self.knots)[::-1], self.after)
        return [
            time for time, limit in ((self.knots[0] + begin, self.before), (self.knots[-1] - end, self.after)) if limit
        ]


def _left(level: Array, lengths: Array, limit: float) -> float:
    """Time for which the torque is still on its limit in the first interval, extrapolated from the next two."""
    middles = np.cumsum(lengths) - lengths / 2
    slope = (level[2] - level[1]) / (middles[2] - middles[1])
    beyond = level[1] + slope * (middles[0] - middles[1])
    if abs(limit - beyond) < abs(limit - level[0]) or limit == beyond:
        return float(lengths[0] / 2)
    return float(np.clip((level[0] - beyond) / (limit - beyond), 0, 1) * lengths[0])
