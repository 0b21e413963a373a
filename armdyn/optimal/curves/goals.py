"""Joint positions that reach a goal pose: sampled, slid along the pose, and chosen by a curve's program."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import linprog

from armdyn.arrays import Array
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.reaching import GoalPose, free_directions, slid
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.constraints.regions import GoalRegion
from armdyn.optimal.curves.curve import Curve
from armdyn.optimal.curves.layout import CurveSpec, finite
from armdyn.optimal.curves.solve import solve_curve, straight_curve
from armdyn.optimal.mesh.direct import solve_on_mesh
from armdyn.optimal.mesh.search import grouped
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.policy.search import GoalPolicy
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import stopping
from armdyn.optimal.problem.task import Task
from armdyn.reprs import brief


def slid_goals(problem: MinimumTimeProblem, numbers: GoalPolicy) -> list[Array]:
    """Goals of locally least time at the velocity limits among those that reach the pose, fastest first.

    Each of the problem's goals is moved by linear programs within a trust region, and projected onto the pose after
    each step. Empty without a goal pose, or if only isolated joint positions reach it.

    Args:
        problem: with or without a goal pose.
        numbers: settings of the descent.
    """
    goal = problem.goal_pose
    if goal is None or not free_directions(problem.robot, goal, problem.goals[0]).size:
        return []
    speed = finite(problem.limits.velocity)
    begin = problem.poses[-2]
    found = [slid_chain(problem.robot, [None, goal], [begin, q], problem.limits, numbers)[1] for q in problem.goals]
    found.sort(key=lambda q: _time([begin, q], speed, numbers))
    groups = grouped(found, lambda q, other: _apart(q, other) <= numbers.distinct)
    return [group[0] for group in groups][: numbers.slid]


def _apart(q: Array, other: Array) -> float:
    """Largest difference of a joint's positions [rad or m]; each of shape (nv,)."""
    return float(np.max(np.abs(q - other)))


def slid_chain(
    robot: Robot, goals: Sequence[GoalPose | None], positions: Sequence[Array], limits: JointLimits, numbers: GoalPolicy
) -> list[Array]:
    """Move joint positions along the self-motions of their goal poses to a local minimum of the travel time.

    The time is the sum of the times from each position to the next at the velocity limits, each the one of its slowest
    joint.

    Args:
        robot: the arm.
        goals: goal pose of each of the positions; None: the position is fixed. Positions of the same pose object at
            both ends of the chain stay equal.
        positions: in order [rad or m], each of shape (nv,).
        limits: limits of positions and velocities.
        numbers: settings of the descent.
    """
    at, speed, longest = list(positions), finite(limits.velocity), numbers.largest_step
    for _ in range(numbers.slides):
        step = _step(robot, goals, at, limits, longest, numbers.others)
        moved = None if step is None else _moved(robot, goals, at, step, limits)
        if moved is not None and _time(moved, speed, numbers) < _time(at, speed, numbers):
            at = moved
        else:
            longest /= 4
        if longest < numbers.least_step:
            break
    return at


def _time(positions: Sequence[Array], speed: Array, numbers: GoalPolicy) -> float:
    """Time of the slowest joint on every leg [s], plus a small part of all joints' times to break ties."""
    away = np.abs(np.diff(positions, axis=0)) / speed
    return float(np.sum(np.max(away, axis=1)) + numbers.others * np.sum(away))


def _moved(
    robot: Robot, goals: Sequence[GoalPose | None], at: Sequence[Array], steps: Array, limits: JointLimits
) -> list[Array] | None:
    """Joint positions `at` moved by steps, shape (positions, nv), and projected onto their goal poses.

    None: a projection failed.
    """
    moved = list(at)
    for k, (goal, q) in enumerate(zip(goals, at, strict=True)):
        if goal is None or not np.any(steps[k]):
            continue
        if k and k == len(at) - 1 and goal is goals[0]:  # a closed chain: see `slid_chain`
            moved[k] = moved[0]
            continue
        found = slid(robot, goal, q, steps[k], limits)
        if found is None:
            return None
        moved[k] = found
    return moved


def _step(
    robot: Robot,
    goals: Sequence[GoalPose | None],
    at: Sequence[Array],
    limits: JointLimits,
    longest: float,
    others: float,
) -> Array | None:
    """Steps along free directions, shape (positions, nv), that minimise the sum of the legs' slowest times.

    None: the linear program was not solved.
    """
    nv, legs, speed = robot.nv, len(at) - 1, finite(limits.velocity)
    same = goals[0] is not None and goals[-1] is goals[0]
    free = [
        np.zeros((nv, 0)) if goal is None else free_directions(robot, goal, q)
        for goal, q in zip(goals, at, strict=True)
    ]
    ends = np.cumsum([0, *(each.shape[1] for each in free)])
    # Unknowns: the steps along all directions, every joint's time on every leg, every leg's slowest time.
    own = [np.zeros((nv, ends[-1])) for _ in at]
    for k, each in enumerate(free):
        own[k][:, ends[k] : ends[k + 1]] = each
    if same:
        own[-1] = own[0]
    way = np.vstack([after - before for before, after in pairwise(own)])
    away = np.concatenate([after - before for before, after in pairwise(at)])
    times, slowest = np.diag(np.tile(speed, legs)), np.zeros((nv * legs, legs))
    above = np.block([[way, -times, slowest], [-way, -times, slowest]])
    every = np.hstack([np.zeros((nv * legs, ends[-1])), np.eye(nv * legs), -np.kron(np.eye(legs), np.ones((nv, 1)))])
    moving = [k for k, each in enumerate(free) if each.shape[1] and not (same and k == legs)]
    if not moving:
        return None
    bounded = np.vstack([own[k] for k in moving])
    least = np.concatenate([np.maximum(limits.position_lower - at[k], -longest) for k in moving])
    most = np.concatenate([np.minimum(limits.position_upper - at[k], longest) for k in moving])
    inside = np.hstack([np.vstack([bounded, -bounded]), np.zeros((2 * len(least), legs * (nv + 1)))])
    solved = linprog(
        np.concatenate([np.zeros(ends[-1]), np.full(nv * legs, others), np.ones(legs)]),
        A_ub=np.vstack([above, every, inside]),
        b_ub=np.concatenate([-away, away, np.zeros(nv * legs), np.maximum(most, 0.0), np.maximum(-least, 0.0)]),
        bounds=[(None, None)] * (ends[-1] + legs * (nv + 1)),
        method="highs",
    )
    return None if solved.status != 0 else np.array([each @ solved.x[: ends[-1]] for each in own])


@brief
@dataclass(frozen=True, eq=False)
class GoalResult:
    """One of the joint positions that reach a goal, and its duration.

    Attributes:
        q: joint positions [rad or m], shape (nv,).
        duration: duration of the motion found there [s]; inf if none was found.
        refined: whether it was solved in full; else from one guess on a coarse mesh, or as a coarse curve.
    """

    q: Array
    duration: float
    refined: bool = False


@dataclass(frozen=True, eq=False)
class _Screened:
    """A problem with one of the goals, and its coarse solution: duration [s], inf without a motion, and curve, if any.

    Attributes:
        chosen: whether a curve's program chose its goal.
    """

    branch: MinimumTimeProblem
    duration: float = np.inf
    curve: Curve | None = None
    chosen: bool = False

    @property
    def result(self) -> GoalResult:
        return GoalResult(np.asarray(self.branch.q_goal), self.duration)

    def rank(self) -> tuple[bool, float]:
        """Sort key: goals at which the arm can stay first, then by duration."""
        return self.branch.holding_deficit is not None, self.duration

    def under(self, task: Task) -> Task:
        """Task for the full solve, with the curve that chose the goal as a guess, too."""
        task = task.for_problem(self.branch)
        if self.curve is None or not self.chosen:
            return task
        motion = self.curve.trajectory(self.branch.robot)
        return task.with_options(guesses=(*task.options.guesses, motion))


def screened(task: Task) -> tuple[list[Task], list[GoalResult]]:
    """Tasks for the most promising goals, best first; and all goals with coarse durations, best first.

    A curve's program moves its end along the joint positions that reach the pose: on a coarse mesh from every goal, on
    a fine one from the best. The best sampled goal is among the tasks, too.

    Args:
        task: its problem has several `goals`; at most a third of its time limit is used, and its `stop` records if that
            was too short.
    """
    problem, numbers, whole = task.problem, task.policy.goals, task.stop
    sampled: list[_Screened] = []
    with stopping(numbers.tried * task.options.time_limit, whole) as stop:
        task = replace(task, stop=stop)
        goals = [*slid_goals(problem, numbers), *problem.goals]
        for i, q in enumerate(goals, start=1):
            one = _Screened(problem.variant(q_goal=q, goal_pose=None, wrap=False))
            least = min((other.duration for other in sampled), default=np.inf)
            slow = one.branch.duration_bound() > task.policy.search.too_coarse * least
            if not (stop or one.branch.holding_deficit or slow):
                task.progress(f"goal {i} of {len(goals)}")
                one = _solved_coarsely(task.for_problem(one.branch))
            sampled.append(one)
        sampled.sort(key=_Screened.rank)
        moved = sorted((_with_free_end(task, one, task.policy.curves.coarse) for one in sampled), key=_Screened.rank)
        held = [one for one in (moved[0], sampled[0], *moved[1:]) if one.branch.holding_deficit is None] or moved
        groups = grouped(held, lambda one, other: _apart(one.result.q, other.result.q) <= numbers.distinct)
        best = [group[0] for group in groups][: numbers.solved]
        results = [one.result for one in best] + [one.result for one in moved if one not in best]
        best = [
            _with_free_end(task, one, task.policy.curves.intervals) if one is not sampled[0] else one for one in best
        ]
    if stop.cut_short:
        whole.cut()
    return [one.under(task) for one in best], results


def _solved_coarsely(task: Task) -> _Screened:
    """Solve a goal coarsely from the straight path; the duration is inf without convergence."""
    if not task.policy.strategy.curves_alone:
        attempt = solve_on_mesh(task, spline(task.problem, []), task.policy.search.meshes[0], task.coarse()[-1])
        return _Screened(task.problem, attempt.trajectory.duration if attempt.usable else np.inf)
    guess = straight_curve(task, task.policy.curves.coarse)
    solved = solve_curve(task, guess, CurveSpec.of(task))
    if solved.converged:
        return _Screened(task.problem, solved.curve.duration, solved.curve)
    return _Screened(task.problem, curve=guess)


def _with_free_end(task: Task, one: _Screened, intervals: int) -> _Screened:
    """The goal that a curve chooses near a given one among all that reach the pose; the given one without a choice.

    Args:
        task: task with the goal pose.
        one: the given goal, with an initial curve.
        intervals: number of intervals per leg of the curve.
    """
    pose, problem, spec = task.problem.goal_pose, one.branch, CurveSpec.of(task.for_problem(one.branch))
    fixed = spec.constraints.required_distances(problem) is not None or problem.continuous_torque
    if task.stop or pose is None or one.curve is None or fixed or not problem.from_rest_to_rest:
        return one
    if not free_directions(problem.robot, pose, np.asarray(problem.q_goal)).size:
        return one
    regions = (*spec.constraints.path_constraints, GoalRegion(pose))
    spec = replace(spec, constraints=replace(spec.constraints, path_constraints=regions))
    guess = one.curve.on([leg.basis for leg in straight_curve(task.for_problem(problem), intervals).legs])
    solved = solve_curve(task.for_problem(problem), guess, spec)
    nothing, end = np.zeros(problem.robot.nv), solved.curve.legs[-1].points[-1]
    exact = slid(problem.robot, pose, end, nothing, problem.limits) if solved.converged else None
    if exact is not None and solved.curve.duration < one.duration:
        return _Screened(problem.variant(q_goal=exact), solved.curve.duration, solved.curve, chosen=True)
    return one
