"""`solve_indirect`: the paper's second approach, equations (16) to (21), for any arm.

The canonical system of `canonical` is solved as a boundary value problem with free final time, seeded by the
direct method's states and costates. With a weight on effort that is all. For minimum time the weight is let
fall, each solution seeding the next, until the saturated torque shows the arcs, whose durations multiple
shooting then finds exactly. A solution satisfies Pontryagin's conditions: it is a local optimum of any
basin it was started in, not proven to be the best one.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armdyn.arguments import expect
from armdyn.errors import ProblemError
from armdyn.locks import cached_property
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.mesh.direct import Attempt
from armdyn.optimal.mesh.mesh_costates import mesh_costates
from armdyn.optimal.mesh.motion_mesh import MeshWork, mesh_optimum
from armdyn.optimal.mesh.search import find
from armdyn.optimal.mesh.shooting import landed
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.problem import MinimumTimeProblem, expect_problem
from armdyn.optimal.problem.status import Status, Stop, stopping
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.costates import Costates
from armdyn.optimal.verify.rollout import replay_of
from armdyn.paper.indirect.bang_bang import BangBangProblem, guess_arcs
from armdyn.paper.indirect.boundary import BoundaryExtremal, BoundaryProblem, solve_lobatto, solve_trapezoidal
from armdyn.paper.indirect.canonical import CanonicalSystem, canonical_system
from armdyn.paper.indirect.policy import IndirectPolicy
from armdyn.paper.indirect.shooting import shoot
from armdyn.paper.indirect.solution import (
    ExtremalSamples,
    IndirectOptions,
    IndirectSolution,
    checked,
    from_arcs,
    from_extremal,
)


@dataclass(frozen=True, eq=False)
class _IndirectTask:
    """Problem, law and options of a solve.

    Attributes:
        problem: the motion.
        options: of the method.
        stop: polled by the solvers.
    """

    problem: MinimumTimeProblem
    options: IndirectOptions
    stop: Stop

    @cached_property
    def system(self) -> CanonicalSystem:
        """The canonical system of the robot under the options' law."""
        return canonical_system(self.problem.robot, self.options.law)

    @cached_property
    def numbers(self) -> IndirectPolicy:
        """The tuned numbers."""
        return IndirectPolicy()

    @property
    def fastest(self) -> bool:
        """Whether minimum time is requested, by a law that leads there."""
        return self.problem.effort_weight == 0 and self.options.law.minimises

    @property
    def enough(self) -> int:
        """Number of seeds that are followed even after a solution is found."""
        return self.options.continuations if self.fastest else 1

    @property
    def unit(self) -> float:
        """The effort weight [1/(N m)²] with which full torques cost as much as time."""
        limits = self.problem.limits
        return float(2 / np.sum(np.maximum(limits.effort_upper**2, limits.effort_lower**2)))

    @property
    def seed_weight(self) -> float:
        """The weight of the time-energy problem whose optimum is nearest."""
        law = self.options.law
        if law.seed_weight is not None:
            return law.seed_weight(self.problem)
        return self.problem.effort_weight or self.numbers.first_weight * self.unit

    def boundary(self, weight: float, guess: BoundaryExtremal) -> BoundaryProblem:
        """Boundary value problem with an effort weight [1/(N m)²], started from a guess."""
        problem = self.problem
        lower, upper = problem.limits.effort_lower, problem.limits.effort_upper
        if not self.options.bounded:
            motors = ~problem.limits.passive
            lower, upper = np.where(motors, -np.inf, 0.0), np.where(motors, np.inf, 0.0)
        return BoundaryProblem(self.system, problem.x_start, problem.x_goal, weight, lower, upper, guess, self.stop)


@dataclass(frozen=True, eq=False)
class _Seed:
    """Start of the continuation: an extremal, exact or approximate, for an effort weight [1/(N m)²]."""

    extremal: BoundaryExtremal
    weight: float
    direct: Costates | None

    @classmethod
    def of(cls, direct: Costates, weight: float) -> Self:
        """The direct method's solution."""
        y = np.hstack([direct.q, direct.v, direct.costate]).T
        return cls(BoundaryExtremal(direct.t / direct.duration, y, direct.duration), weight, direct)


def solve_indirect(
    problem: MinimumTimeProblem, seed: Solution | None = None, options: IndirectOptions | None = None
) -> IndirectSolution:
    """Pontryagin's conditions, solved as equations.

    A time-energy solution is the optimum of least J among those that the search found and the boundary value
    problem confirmed; a minimum-time solution the fastest of those that they lead to as w → 0.

    Args:
        problem: effort_weight > 0 asks for the time-energy optimum, 0 for minimum time. Limits on position
            and velocity are checked afterwards only.
        seed: a solution of this problem by the direct method, or of one with another weight; None: a few
            guesses are solved by the direct method first.
        options: by default for arms of one to three joints.

    Returns:
        An `IndirectSolution`; look at `success`. Without it, the message has the failure and its place.

    Raises:
        ProblemError: an argument is something else, minimum time is requested without torque limits, the problem has
            path constraints, or the seed is of another arm.
    """
    started = time.perf_counter()
    expect_problem(problem)
    options = IndirectOptions() if options is None else expect(options, IndirectOptions, "options")
    if seed is not None:
        expect(seed, Solution, "seed", "the result of solve_minimum_time")
    with stopping(options.time_limit) as stop:
        task = _IndirectTask(problem, options, stop)
        _refuse(task, seed)
        best = _best(task, _seeds(task, seed))
    return replace(best, solve_time=time.perf_counter() - started)


def _refuse(task: _IndirectTask, seed: Solution | None) -> None:
    """Raise a ProblemError where this method does not apply."""
    problem = task.problem
    if task.fastest and not task.options.bounded:
        raise ProblemError("minimum time needs torque limits: bounded=False needs effort_weight > 0")
    if seed is not None and seed.problem.robot.nv != problem.robot.nv:
        raise ProblemError(f"the seed moves {seed.problem.robot.nv} joints, the problem {problem.robot.nv}")
    if problem.path_constraint_names:
        raise ProblemError(f"the indirect method knows no {', '.join(problem.path_constraint_names)}")


def _best(task: _IndirectTask, seeds: Iterator[_Seed]) -> IndirectSolution:
    """The best solution from the seeds, of which no more are made than needed; without one, the best failure."""
    best: IndirectSolution | None = None
    given_up: list[str] = []
    tried = 0
    while best is None or not (task.stop or (best.success and tried >= task.enough)):
        seed = next(seeds, None)
        if seed is None:
            break
        tried += 1
        found = _minimum_time(task, seed) if task.fastest else _time_energy(task, seed)
        if best is None or (not found.success, found.cost) < (not best.success, best.cost):
            best = found
        if not found.success:
            given_up.append(found.message)
    if best is None:
        return _no_seed(task)
    if best.success and given_up:
        more = f"{len(given_up)} of {tried} seeds were given up, the first as: {given_up[0]}"
        return replace(best, message=f"{best.message}; {more}")
    return best


def _seeds(task: _IndirectTask, seed: Solution | None) -> Iterator[_Seed]:
    """Initial guesses of the boundary value problem, the most promising first."""
    problem, options, stop = task.problem, task.options, task.stop
    if seed is not None and seed.costates is not None and options.law.minimises:
        yield _Seed.of(seed.costates, seed.problem.effort_weight)
        return
    numbers, weight = task.numbers, task.seed_weight
    wider, limits = 1.0 if options.bounded else numbers.wider, problem.limits
    bound = wider * limits.effort_lower, wider * limits.effort_upper
    smooth = problem.variant(effort_weight=weight, effort_limit=bound, reserve=0.0)  # the bound is less it already
    direct_task = Task.of(smooth, MinimumTimeOptions(seed=options.seed, workers=1), stop)
    starts = options.starts or direct_task.policy.search.starts
    most = max(numbers.candidates, options.continuations)
    if seed is not None:
        starts, most, direct_task = 1, 1, direct_task.with_options(guesses=(seed.trajectory,))
    policy = direct_task.policy.changed("search", starts=starts, refined=most)
    direct_task = replace(direct_task, policy=policy)
    for attempt in find(direct_task).attempts:
        if (costates := _costates(direct_task, attempt)) is not None:
            yield _Seed.of(costates, weight)


def _costates(task: Task, attempt: Attempt) -> Costates | None:
    """Costates of the time-energy optimum near a mesh's solution, or of that solution; None: it does not land."""
    optimum = mesh_optimum(task, attempt, MeshWork(task.policy), lambda mesh: None)
    if optimum is not None and optimum.costates is not None:
        return optimum.costates
    motion = landed(task, attempt)
    if motion is None:
        return None
    replay = replay_of(task, motion.trajectory(task.problem.robot.joint_names))
    return mesh_costates(task.problem, motion, replay, task.policy)


def _time_energy(task: _IndirectTask, seed: _Seed) -> IndirectSolution:
    """The boundary value problem of the problem's own weight."""
    problem, options = task.problem, task.options
    boundary = task.boundary(problem.effort_weight, seed.extremal)
    if options.method == "lobatto":
        found = solve_lobatto(boundary, options.tolerance, options.max_nodes)
    else:
        found = solve_trapezoidal(boundary, options.intervals, options.tolerance)
    return from_extremal(problem, boundary, found, options, seed.direct)


def _minimum_time(task: _IndirectTask, seed: _Seed) -> IndirectSolution:
    """Continuation w → 0, then shooting; a seed of minimum time needs no continuation."""
    problem, options, numbers = task.problem, task.options, task.numbers
    unit = task.unit
    weight, last, reached = seed.weight, seed.extremal, np.inf
    while weight > 0 and reached > numbers.last_weight * unit:
        found = solve_lobatto(task.boundary(weight, last), numbers.rough, numbers.rough_nodes)
        if found.status is not Status.SOLVED:
            break
        last, reached, weight = found, weight, numbers.fall * weight
    bounds = problem.limits.effort_lower, problem.limits.effort_upper
    shooting = BangBangProblem(task.system, problem.x_start, problem.x_goal, *bounds, numbers.shot, task.stop)
    bang = shoot(shooting, guess_arcs(shooting, last.s * last.duration, last.y))
    if bang.status is Status.SOLVED:
        return from_arcs(problem, shooting, bang, options, seed.direct)
    how = f"continuation came to w = {reached:.2g} (N m)^-2" if seed.weight > 0 else "from the seed's costates"
    failed = replace(last, status=bang.status, message=f"{how}; {bang.message}", residual=bang.residual)
    return from_extremal(
        problem, task.boundary(min(reached, numbers.last_weight * unit), last), failed, options, seed.direct
    )


def _no_seed(task: _IndirectTask) -> IndirectSolution:
    """A failure that shows a guess."""
    problem, stop = task.problem, task.stop
    status = stop.status if stop else Status.FAILED
    motion = spline(problem, [])
    y = np.hstack([motion.q, motion.v, np.zeros((motion.t.size, 2 * problem.robot.nv))])
    message = f"{status.replace('_', ' ')}: the direct method found nothing to start from"
    nowhere = np.full(motion.t.size, np.nan)
    samples = ExtremalSamples(motion.t, y, motion.tau, nowhere, np.inf, status, message, np.inf)
    return checked(problem, task.options, samples, direct=None)
