"""Solve from one guess on one mesh, by collocation."""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.locks import cached_property
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.constraints.rows import StageRows, numbers_of, row_bounds
from armdyn.optimal.mesh.assembly import CollocationInterval, Program, build_nlp
from armdyn.optimal.mesh.ipopt import Ipopt, NlpData, NlpResult, ipopt_for
from armdyn.optimal.mesh.layout import Layout, Parameters, bounds, mesh, to_trajectory, to_unknowns, worst_defect
from armdyn.optimal.mesh.starts import Guesses
from armdyn.optimal.problem.options import Acceptable, SolverSettings
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status, Stop, Violation
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.optimum import effort_cost
from armdyn.trajectory import Trajectory


@dataclass(frozen=True)
class Attempt:
    """Result of IPOPT, or of the stagewise method, from one guess on one mesh.

    Attributes:
        status: status of the solve.
        message: IPOPT's status in words.
        trajectory: the motion; the last iterate if it did not converge.
        intervals: number of intervals of the mesh.
        iterations: iterations of the solver.
        worst_violation: worst violation; None if the solve converged, or was not begun.
        passing: times of the via points [s], shape (vias,).
        knots: knots of the mesh as parts of the duration, shape (intervals + 1,); None: equal intervals.
        effort: cost of the torques, w/2 ∫ τᵀτ dt [s].
    """

    status: Status
    message: str
    trajectory: Trajectory
    intervals: int
    iterations: int
    worst_violation: Violation | None
    passing: Array = field(default_factory=lambda: np.empty(0))
    knots: Array | None = None
    effort: float = 0.0

    @classmethod
    def unbegun(cls, stop: Stop, guess: Trajectory, intervals: int) -> Self:
        """Result for a guess that was not solved, because of an earlier stop."""
        return cls(stop.status, stop.word, guess, intervals, 0, None)

    @property
    def mesh(self) -> Array:
        """Knots as parts of the duration, shape (intervals + 1,)."""
        return mesh(self.intervals) if self.knots is None else self.knots

    @property
    def cost(self) -> float:
        """Objective J = ∫ (1 + w/2 τᵀτ) dt [s]: the duration without a weight on effort."""
        return self.trajectory.duration + self.effort

    @cached_property
    def quarters(self) -> Array:
        """Positions at a quarter, a half and three quarters of the duration [rad or m], shape (3, nv)."""
        t = self.trajectory.t
        return self.trajectory(t[0] + np.array([0.25, 0.5, 0.75]) * (t[-1] - t[0])).q

    @property
    def ended_early(self) -> bool:
        """Whether the solver ended within its acceptable level, where the motion hardly became better."""
        return self.message == "Solved To Acceptable Level"

    @property
    def usable(self) -> bool:
        """Whether the attempt converged, so that it is a motion of the arm."""
        return self.status is Status.SOLVED


@dataclass(frozen=True, eq=False)
class Legs:
    """Distribution of a mesh's intervals over the legs between via points.

    Attributes:
        intervals: number of intervals of every leg.
        durations: durations of the legs in a guess [s], shape (legs,).
    """

    intervals: tuple[int, ...]
    durations: Array

    @property
    def of_interval(self) -> Index:
        """Leg of each interval, shape (N,)."""
        return np.repeat(np.arange(len(self.intervals)), self.intervals)

    @property
    def knots(self) -> Index:
        """The last knot of every leg, shape (legs,)."""
        return np.cumsum(self.intervals)


def legs_of(problem: MinimumTimeProblem, guess: Trajectory, intervals: int, knots: Array | None = None) -> Legs:
    """Distribute the intervals of a mesh over the legs between via points.

    The guess passes a via point at its sample nearest to it, of those after the via point before. Without knots a leg
    gets intervals in proportion to its time, at least four if there are enough.

    Args:
        problem: problem with the via points.
        guess: motion whose times at the via points divide the duration.
        intervals: number of intervals; ignored with `knots`.
        knots: knots of a mesh as parts of the duration, shape (intervals + 1,): each leg gets the intervals between the
            knots nearest to its ends; None: no knots are given.

    Raises:
        ValueError: fewer intervals than legs, without knots.
    """
    marks, first = [float(guess.t[0])], 0
    inner = problem.poses[1:-1]
    for i, pose in enumerate(inner):
        last = guess.t.size - (len(inner) - i)
        first = min(first + 1, last - 1)
        away = np.max(np.abs(guess.q[first:last] - pose), axis=1)
        first += int(np.argmin(away))
        marks.append(float(guess.t[first]))
    durations = np.maximum(np.diff([*marks, guess.t[-1]]), 1e-3 * guess.duration)
    if knots is not None:
        ends = np.searchsorted((knots[:-1] + knots[1:]) / 2, np.append(0.0, np.cumsum(durations)) / durations.sum())
        return Legs(tuple(np.diff(ends).tolist()), durations)
    least = max(min(4, intervals // durations.size), 1)
    spare = intervals - least * durations.size
    if spare < 0:
        raise ValueError(f"{intervals} intervals are too few for {durations.size} legs")
    edges = np.round(spare * np.append(0.0, np.cumsum(durations)) / durations.sum()).astype(int)
    return Legs(tuple((np.diff(edges) + least).tolist()), durations)


@dataclass(frozen=True, eq=False)
class MeshNlpData(NlpData):
    """Initial guess, bounds and parameters of the program of a mesh.

    Attributes:
        layout: layout of the unknowns.
        legs: number of intervals of every leg between via points.
        by: parameters of the interval's equations; fractions are of the legs.
    """

    layout: Layout
    legs: tuple[int, ...]
    by: Parameters

    def motion(self, x: Array, joint_names: tuple[str, ...]) -> Trajectory:
        """The motion of unknowns."""
        return to_trajectory(x, self.layout, self.by, joint_names, self.legs)

    def attempt(self, problem: MinimumTimeProblem, result: NlpResult, x: Array, defects: Array) -> Attempt:
        """The result of a solver.

        Args:
            problem: the minimum-time problem.
            result: the solver's result.
            x: the unknowns.
            defects: violation of every equation of motion, read if the solver did not converge.
        """
        N, motion = self.by.fraction.size, self.motion(x, problem.robot.joint_names)
        ends = np.cumsum(self.legs)
        own = np.maximum(x[self.layout.times(N)[np.append(0, ends[:-1])]] * self.by.time, 0)
        times = np.append(0.0, np.cumsum(np.repeat(own, self.legs) * self.by.fraction))
        landed = result.status is Status.SOLVED
        return Attempt(
            status=result.status,
            message=result.message,
            trajectory=motion,
            intervals=N,
            iterations=result.iterations,
            worst_violation=None if landed else worst_defect(problem, self.layout, x, defects.reshape(N, -1), self.by),
            passing=np.cumsum(own)[:-1],
            knots=None if len(own) == 1 else times / times[-1],
            effort=effort_cost(problem, motion),
        )


def assemble_mesh(
    task: Task,
    guess: Trajectory,
    intervals: int,
    constraints: TightenedConstraints | None = None,
    knots: Array | None = None,
    tie: float = 0.0,
) -> MeshNlpData:
    """Data of the nonlinear program of a mesh, whose equations are those of `build_nlp`.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        intervals: number of intervals, distributed over the legs between via points.
        constraints: tightened path constraints; None: not tightened.
        knots: knots of the mesh as parts of the duration, shape (intervals + 1,), via points among them; None: equal
            intervals in every leg.
        tie: see `Parameters.sized`.
    """
    problem, layout, guesses = task.problem, Layout(task.dynamics.nv, task.scheme), Guesses.of(guess)
    constraints = TightenedConstraints.of(task) if constraints is None else constraints
    legs, rows = legs_of(problem, guess, intervals, knots), constraints.rows(problem)
    fractions = np.concatenate([np.diff(mesh(size)) for size in legs.intervals])
    if knots is not None:
        fractions = np.diff(knots) / np.add.reduceat(np.diff(knots), legs.knots - legs.intervals)[legs.of_interval]
    (by,) = Parameters.sized(task, guesses, fractions, tie).each()
    lower, upper = (side[0] for side in bounds(problem, layout, by))
    shares = fractions * (legs.durations / legs.durations.sum())[legs.of_interval]
    x = to_unknowns(guesses, layout, replace(by, fraction=shares))[0]
    _fix_legs(problem, layout, legs, constraints, by, x, (lower, upper))
    sides = row_bounds(rows, CollocationInterval(task.dynamics, task.scheme), intervals)
    lbg, ubg = (np.concatenate(both) for both in zip(_equations(layout, legs), sides, strict=True))
    p = np.concatenate([by.packed(), numbers_of(rows)])
    return MeshNlpData(np.clip(x, lower, upper), p, (lower, upper), (lbg, ubg), layout, legs.intervals, by)


def solve_on_mesh(
    task: Task,
    guess: Trajectory,
    intervals: int,
    settings: SolverSettings,
    constraints: TightenedConstraints | None = None,
    knots: Array | None = None,
    tie: float = 0.0,
) -> Attempt:
    """Solve one guess on one mesh.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        intervals: number of intervals, distributed over the legs between via points.
        settings: iteration limit, tolerance, verbosity.
        constraints: tightened path constraints; None: not tightened.
        knots: knots of the mesh as parts of the duration, shape (intervals + 1,), via points among them; None: equal
            intervals in every leg.
        tie: see `Parameters.sized`.
    """
    if task.stop:
        return Attempt.unbegun(task.stop, guess, intervals)
    constraints = TightenedConstraints.of(task) if constraints is None else constraints
    solver = _solver(task, intervals, settings, constraints.rows(task.problem))
    data = assemble_mesh(task, guess, intervals, constraints, knots, tie)
    result, (lbg, ubg) = solver.solve(data, task.stop), data.g_bounds
    g = solver.equations(result.x, data.p)
    # Rows after the equations of motion are not checked.
    beyond = np.maximum(g - ubg, lbg - g)[: intervals * data.layout.rows]
    attempt = data.attempt(task.problem, result, result.x, beyond)
    return attempt if knots is None or len(data.legs) > 1 else replace(attempt, knots=knots)


def _equations(layout: Layout, legs: Legs) -> tuple[Array, Array]:
    """Lower and upper bounds of the equations of motion."""
    lower = np.zeros((legs.knots[-1], layout.rows))
    lower[legs.knots[:-1] - 1, -1] = -np.inf  # every leg has a duration of its own
    return lower.ravel(), -lower.ravel()


def _fix_legs(
    problem: MinimumTimeProblem,
    layout: Layout,
    legs: Legs,
    constraints: TightenedConstraints,
    by: Parameters,
    x: Array,
    sides: tuple[Array, Array],
) -> None:
    """Write the legs' durations into a guess, and via points with their corrections into the bounds."""
    (lower, upper), N = sides, int(legs.knots[-1])
    knots, times = layout.knots(N), layout.times(N)
    of_knot = np.append(legs.of_interval, legs.of_interval[-1])
    x[times] = legs.durations[of_knot] / by.time
    lower[times] = np.maximum(problem.leg_bounds() / by.time, 1e-3)[of_knot]
    offsets = np.broadcast_to(constraints.offsets, (len(legs.intervals), layout.nv))
    for knot, q, offset in zip(legs.knots, problem.poses[1:], offsets, strict=True):
        place = knots[knot, layout.knot.q]
        lower[place] = upper[place] = (q + offset) / by.length
    for bound in sides:
        bound[knots[N, layout.knot.v]] += np.asarray(constraints.end_velocity) / by.speed


def prepare(task: Task, intervals: int, settings: SolverSettings) -> None:
    """Build the functions that `solve_on_mesh` needs, if there is time."""
    if not task.stop:
        _solver(task, intervals, settings, TightenedConstraints.of(task).rows(task.problem))


def _solver(task: Task, intervals: int, settings: SolverSettings, rows: tuple[StageRows, ...]) -> Ipopt[Program]:
    if (flat := task.policy.program.flat) is not None:
        settings = replace(settings, acceptable=Acceptable(flat, settings.tolerance))
    return task.in_time(lambda scheme: ipopt_for(settings, build_nlp, task.dynamics, scheme, intervals, rows))
