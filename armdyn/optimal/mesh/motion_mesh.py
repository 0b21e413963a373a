"""Mesh refinement until the motion, not only its switching times, is the optimum's.

Intervals are divided wherever torques that are constant or linear in each cannot follow the optimum: constant ones at
jumps off their limits and along limits of velocity and position, where also the collocation's error is large; linear
ones where they bend or jump.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array, Flags, Index
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.mesh.condensed import solve_on_knots
from armdyn.optimal.mesh.direct import Attempt
from armdyn.optimal.mesh.layout import mesh
from armdyn.optimal.mesh.mesh_costates import MeshCostates, mesh_costates
from armdyn.optimal.mesh.shooting import Shooting, gaps, landed
from armdyn.optimal.problem.options import Acceptable, SolverSettings
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import LIMIT_TOLERANCE, OPTIMALITY_TOLERANCE, repeated
from armdyn.optimal.verify.costates import idle_joints
from armdyn.optimal.verify.optimum import MeshMargins, Optimum, excess
from armdyn.optimal.verify.rollout import replay_of
from armdyn.optimal.verify.within_limits import excesses
from armdyn.reprs import percent
from armdyn.trajectory import Trajectory


class MeshWork:
    """What one problem's meshes have in common: a budget, and the motions so far, which are refined once.

    Attributes:
        left: intervals times iterations left in the budget, the same on every machine.
        best: cost of the best usable motion; infinite: none.
    """

    def __init__(self, policy: Policy) -> None:
        self.left, self.best, self._policy = float(policy.motion_mesh.work), np.inf, policy
        self._known: list[tuple[Sequence[Attempt], Optimum | None]] = []

    def add(self, meshes: Sequence[Attempt], optimum: Optimum | None) -> None:
        """Record the result of solutions on successive meshes; None: no result."""
        self._known.append((meshes, optimum))

    def known(self, meshes: Sequence[Attempt]) -> tuple[Optimum | None] | None:
        """The result of solutions of which one was the same on the last of these meshes; None: there are none.

        Joints that time leaves idle in the result may move differently.
        """
        same, k, mesh = self._policy.same, len(meshes) - 1, meshes[-1]
        for others, optimum in self._known:
            if k < len(others) and abs(mesh.cost - others[k].cost) <= same.resolved * min(mesh.cost, others[k].cost):
                idle = optimum.certificate.idle if optimum else ()
                undecided = [i for i, name in enumerate(mesh.trajectory.joint_names) if name in idle]
                apart = np.delete(np.abs(mesh.quarters - others[k].quarters), undecided, axis=1)
                if np.max(apart, initial=0.0) <= same.distance:
                    return (optimum,)
        return None

    def beats(self, mesh: Attempt) -> bool:
        """Whether the best usable motion is better by more than a finer mesh may gain."""
        return mesh.cost > (1 + self._policy.motion_mesh.abandoned) * self.best


class _Meshes:
    """Solver of meshes with small margins of the velocity limits, within a budget of work.

    Attributes:
        task: the problem and its settings.
        work: the problem's budget.
        tie: index of the weight of full torques in the last solution, see `Parameters.sized`.
    """

    def __init__(self, task: Task, work: MeshWork) -> None:
        self.task, self.work, self.tie = task, work, 0
        self._rough = self._within(MeshMargins())

    def finer(self, attempt: Attempt) -> Iterator[Attempt]:
        """Rough solutions of one optimum on successively finer meshes."""
        numbers = self.task.policy.motion_mesh
        rough = SolverSettings(numbers.tolerance, numbers.iterations, numbers.barrier)

        def solve(guess: Trajectory, knots: Array) -> Attempt:
            begins = knots is first
            return self._solved(
                self._rough, guess, knots, rough if begins else self._settings(rough=True), int(not begins)
            )

        first = mesh(4 * self.task.policy.search.fine_mesh)
        yield from on_finer_meshes(self.task, attempt, first, solve, self.finer_knots)

    def finer_knots(self, one: Attempt) -> Array:
        """Knots of the next mesh of a rough solution; its own if the budget is spent."""
        return finer_knots(self._rough, one) if self.work.left > 0 else one.mesh

    def sharp(self, attempt: Attempt, knots: Array, margins: MeshMargins | None = None) -> Attempt | None:
        """Solve sharply from a solution, with margins of the limits; None without convergence.

        Args:
            attempt: a solution, the guess.
            knots: knots of the mesh, the attempt's or others, shape (N + 1,).
            margins: margins; None: none.
        """
        if self.task.stop or knots.size > self.task.policy.motion_mesh.most:
            return None
        within = self._within(margins or MeshMargins())
        found = self._solved(within, attempt.trajectory, knots, self._settings(), self.tie)
        return found if found.usable else None

    def _settings(self, rough: bool = False) -> SolverSettings:
        """Settings of a solve from the solution on another mesh: of the last mesh, or of the rough ones before.

        `MotionMeshPolicy` says why its numbers are multiplied.
        """
        numbers = self.task.policy.motion_mesh
        error, decrease = 100 * numbers.tolerance, numbers.decrease * (30 if rough else 1)
        return SolverSettings(
            numbers.tolerance if rough else numbers.tolerance / 100,
            numbers.iterations,
            numbers.barrier / (100 if rough else 1000),
            push=numbers.push,
            convex=numbers.convex,
            acceptable=Acceptable(error, error, decrease, numbers.patience),
        )

    def _solved(self, task: Task, guess: Trajectory, knots: Array, settings: SolverSettings, tie: int) -> Attempt:
        """A solution on a mesh, with a larger tie if long idle joints prevent convergence."""
        ties, self.tie = self.task.policy.motion_mesh.ties, tie
        found = solve_on_knots(task, guess, knots, settings, 0.0 if task.problem.pays_effort else ties[tie])
        self.work.left -= found.iterations * (knots.size - 1)
        if found.usable and found.iterations == settings.max_iterations:  # still becoming faster
            found = replace(found, status=Status.ITERATION_LIMIT)
        if found.usable or self.task.stop or tie + 1 == len(ties) or self.work.left <= 0:
            return found
        near = found.trajectory if found.status is Status.ITERATION_LIMIT else guess
        return self._solved(task, near, knots, settings, tie + 1)

    def _within(self, margins: MeshMargins) -> Task:
        fast = LIMIT_TOLERANCE / 2 + margins.velocity  # what lies between an interval's middle and its ends
        return replace(margins, velocity=fast).task_within(self.task)


def on_finer_meshes(
    task: Task,
    attempt: Attempt,
    knots: Array,
    solve: Callable[[Trajectory, Array], Attempt],
    finer: Callable[[Attempt], Array],
    settled: float = -np.inf,
) -> Iterator[Attempt]:
    """Solutions of one optimum on successively finer meshes, until one is not usable or no mesh is finer.

    Args:
        task: the problem and its settings; after a stop the last solution is dropped.
        attempt: a solution near the first.
        knots: of the first mesh as parts of the duration, shape (N + 1,).
        solve: maps a guess and knots to a solution.
        finer: maps a solution to its knots and further ones.
        settled: a mesh that gains less, as a part of the cost, is the last.
    """
    near, numbers = attempt, task.policy.motion_mesh
    for k in range(numbers.rounds):
        if k:
            more = finer(near)
            if more.size == knots.size or more.size > numbers.most:
                return
            knots = more
        found = solve(near.trajectory, knots)
        if not found.usable or task.stop:
            return
        yield found
        if found.cost > (1 - settled) * near.cost:
            return
        near = found


def finer_knots(task: Task, attempt: Attempt) -> Array:
    """The attempt's knots and further ones, at most `parts` in an interval, where its motion is not resolved."""
    numbers, knots, lengths = task.policy.motion_mesh, attempt.mesh, np.diff(attempt.mesh)
    own = _by_bends(attempt, numbers.bend) if task.scheme.control == "linear" else _by_jumps(task, attempt)
    parts = np.clip(np.ceil(np.maximum(own, _by_limits(task, attempt))), 1, numbers.parts)
    return _in_parts(knots, np.where(lengths > numbers.least, parts, 1).astype(int))


def _by_jumps(task: Task, attempt: Attempt) -> Array:
    """Numbers of parts, shape (K,), in which constant torques switch, and the collocation's error is small."""
    numbers, shooting, actuators = task.policy.motion_mesh, task.policy.shooting, task.problem.limits.actuators
    knots, motion = attempt.mesh, attempt.trajectory
    level = motion(motion.duration * (knots[:-1] + knots[1:]) / 2).tau / actuators.scale
    jumps = np.pad(np.any(np.abs(np.diff(level, axis=0)) > numbers.jump, axis=1), 1)
    parts = np.where(jumps[:-1] | jumps[1:], numbers.parts, 1.0)  # a switch at a knot may be on either side
    missed, *_ = gaps(task.problem.robot, Shooting.of(task.problem, attempt, shooting.near), shooting.steps)
    gap = np.nan_to_num(np.max(np.abs(missed), axis=1))  # error of fifth order; NaN where a motion diverges
    return np.asarray(np.maximum(parts, (gap / numbers.gap) ** 0.2))


def _by_bends(attempt: Attempt, most: float) -> Array:
    """Numbers of parts, shape (K,), in which linear torques bend, or jump, by at most a part of half their range."""
    lengths, tau = np.diff(attempt.mesh), attempt.trajectory(attempt.trajectory.duration * attempt.mesh).tau
    used = np.ptp(tau, axis=0) / 2  # half the range, if both limits are reached
    level = tau / np.where(used > 0, used, 1.0)
    after = (lengths[:-1] / (lengths[:-1] + lengths[1:]))[:, None]
    bend = np.abs(level[1:-1] - (1 - after) * level[:-2] - after * level[2:]).max(axis=1)
    return np.asarray(np.sqrt(np.maximum(np.pad(bend, (1, 0)), np.pad(bend, (0, 1))) / most))


def _by_limits(task: Task, attempt: Attempt) -> Array:
    """Numbers of parts, shape (K,), of intervals on a limit, so that their middles lie near enough to their chords."""
    limits, numbers, motion, knots = task.problem.limits, task.policy.arcs, attempt.trajectory, attempt.mesh
    at, middle = motion(motion.duration * knots), motion(motion.duration * (knots[:-1] + knots[1:]) / 2)
    bows = [np.abs(mid - (ends[:-1] + ends[1:]) / 2) for mid, ends in ((middle.v, at.v), (middle.q, at.q))]
    fast = np.maximum(np.abs(at.v[:-1]), np.abs(at.v[1:])) > (1 - numbers.near_speed) * limits.velocity
    steady = np.abs(np.diff(at.v, axis=0)) < numbers.in_contact * limits.velocity
    margin = np.minimum(at.q - limits.position_lower, limits.position_upper - at.q)
    close = np.minimum(margin[:-1], margin[1:]) < numbers.in_contact
    bow = np.where(fast & steady, bows[0] / (task.policy.motion_mesh.velocity_excess * limits.velocity), 0.0)
    bow = np.maximum(bow, np.where(close, bows[1] / LIMIT_TOLERANCE, 0.0))
    return np.asarray(np.sqrt(bow.max(axis=1)))


def _in_parts(knots: Array, counts: Index) -> Array:
    """Knots of a mesh with each interval divided into `counts` equal parts."""
    own = np.repeat(np.arange(counts.size), counts)
    part = np.arange(own.size) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.append(knots[own] + np.diff(knots)[own] * (part / counts[own]), knots[-1])


def mesh_optimum(
    task: Task, attempt: Attempt, work: MeshWork, exact: Callable[[Attempt], Optimum | None]
) -> Optimum | None:
    """Resolved motion of a mesh, landed by multiple shooting, with the bound on its first-order saving.

    Args:
        task: the problem and its settings.
        attempt: a solution near the motion.
        work: budget of the problem, and its motions so far; extended here.
        exact: maps a solution on a mesh to the exact motion near it, if there is one.

    Returns:
        The exact motion, or the mesh's; None if no mesh converges, the motion does not land, or a usable one is much
        better.
    """
    meshes, tried, best = _Meshes(task, work), list[Attempt](), None
    for rough in meshes.finer(attempt):
        tried.append(rough)
        if (known := work.known(tried)) is not None:
            return known[0]
        if len(tried) > 1 and (work.beats(rough) or (best := exact(rough)) is not None):
            break
    else:
        last = _last(meshes, tried) if tried else None
        best = None if last is None else exact(last) or _divided_until_certified(meshes, last)
    work.add(tried, best)
    return best


def _last(meshes: _Meshes, rough: Sequence[Attempt]) -> Attempt:
    """The sharp solution after rough ones: on a finer mesh if all of these converged."""
    last = rough[-1]
    if len(rough) == meshes.task.policy.motion_mesh.rounds:
        knots = meshes.finer_knots(last)
        if knots.size > last.mesh.size and (found := meshes.sharp(last, knots)) is not None:
            return found
    return meshes.sharp(last, last.mesh) or last


@dataclass(frozen=True, eq=False)
class _Judged:
    """Landed motion of a mesh, with the data for its refinement.

    Attributes:
        optimum: the motion, with its certificate.
        saving: bound on the first-order saving, as a part of the duration; infinite: unknown.
        to_divide: intervals to divide if the motion is nearly certified, shape (K,).
    """

    optimum: Optimum
    saving: float
    to_divide: Flags


def _within_limits(meshes: _Meshes, mesh: Attempt) -> Attempt:
    """Divide intervals within which a sharp solution exceeds a limit, until none does or a solve fails."""
    numbers, limits = meshes.task.policy.motion_mesh, meshes.task.problem.limits
    for _ in range(numbers.further_meshes):
        # A landed motion differs by less than half the tolerance.
        beyond = _exceeding(limits, mesh.trajectory, mesh.mesh * mesh.trajectory.duration, LIMIT_TOLERANCE / 2)
        if not np.any(beyond) or meshes.work.left <= 0:
            break
        divided = meshes.sharp(mesh, _in_parts(mesh.mesh, np.where(beyond, numbers.parts, 1)))
        if divided is None:
            break
        mesh = divided
    return mesh


def _divided_until_certified(meshes: _Meshes, mesh: Attempt) -> Optimum | None:
    """Best motion of a mesh, divided repeatedly until certified; None if none reaches the goal."""
    task, numbers, mesh = meshes.task, meshes.task.policy.motion_mesh, _within_limits(meshes, mesh)
    judged = _judged(task, mesh)
    if judged is None:
        return None
    best = judged
    for k in range(numbers.further_meshes):
        if not np.any(best.to_divide) or meshes.work.left <= 0:
            break
        velocity, position = excess(task.problem.limits, best.optimum.trajectory)
        margins = MeshMargins(velocity if k else 0.0, position)  # shorter intervals: smaller excess
        divided = meshes.sharp(mesh, _in_parts(mesh.mesh, np.where(best.to_divide, numbers.parts, 1)), margins)
        judged = None if divided is None else _judged(task, divided)
        if divided is None or judged is None or judged.saving > max(best.saving, OPTIMALITY_TOLERANCE):
            break
        mesh, best = divided, judged
    early = mesh.ended_early and best.saving > OPTIMALITY_TOLERANCE / 5
    if best.optimum.certificate.ok and early and (again := meshes.sharp(mesh, mesh.mesh)) is not None:
        judged = _judged(task, again)
        if judged is not None and judged.optimum.certificate.ok and judged.optimum.cost < best.optimum.cost:
            best = judged
    return _within_margins(meshes, mesh, best.optimum)


def _within_margins(meshes: _Meshes, mesh: Attempt, optimum: Optimum) -> Optimum:
    """Solve on the same mesh with wider margins of the limits until the motion is usable; the given one if none is.

    The torque limits get a margin if the replay misses the goal: an unstable motion can be repeated only under
    feedback, for which torques on their limits leave no range.
    """
    task, margins, last = meshes.task, MeshMargins(), optimum
    for kept in task.policy.motion_mesh.kept:
        if last.usable:
            break
        margins = margins.wider(task, last, margins.torque if last.certificate.lands else kept)
        again = meshes.sharp(mesh, mesh.mesh, margins)
        judged = None if again is None else _judged(task, again)
        if again is None or judged is None:
            break
        mesh, last = again, judged.optimum
    return last if last.usable else optimum


def _judged(task: Task, attempt: Attempt) -> _Judged | None:
    """Motion of a mesh, corrected to reach the goal, with its certificate; None if it does not reach the goal."""
    problem, motion = task.problem, landed(task, attempt)
    if motion is None:
        return None
    shot = motion.trajectory(problem.robot.joint_names)
    replay = replay_of(task, shot)
    found = Optimum.of(problem, replay, len(motion.tau))
    if not found.certificate.on_goal:  # unstable beyond rounding: `repeated` checks its segments
        replay, found = shot, Optimum.of(problem, shot, len(motion.tau))
    costates = mesh_costates(problem, motion, replay, task.policy)
    certificate, saving = found.certificate, np.inf if costates is None else costates.saving
    if costates is not None and saving > OPTIMALITY_TOLERANCE:
        most, enough = percent(saving), percent(OPTIMALITY_TOLERANCE)
        what = "cost" if problem.pays_effort else "time"
        remark = f"a small change may save up to {most} of its {what}; at most {enough} counts as locally optimal"
        certificate = replace(certificate, remark=remark)
    elif costates is not None:
        idle = idle_joints(problem, costates, costates.switching, OPTIMALITY_TOLERANCE)
        certificate = replace(certificate, remark="", saving=saving, idle=idle)
    certificate = repeated(problem, found.trajectory, certificate)  # not repeatable: try another optimum
    known = costates if saving <= OPTIMALITY_TOLERANCE else None
    to_divide = _to_divide(task, motion, replay, costates)
    return _Judged(replace(found, certificate=certificate, costates=known), saving, to_divide)


def _to_divide(task: Task, motion: Shooting, replay: Trajectory, costates: MeshCostates | None) -> Flags:
    """Intervals of a nearly certified motion that are slightly beyond a limit, or have most of its saving."""
    flags = np.zeros(len(motion.tau), bool)
    if costates is None or costates.saving > 4 * OPTIMALITY_TOLERANCE:
        return flags
    flags |= _exceeding(task.problem.limits, replay, motion.t, LIMIT_TOLERANCE)
    if costates.saving > OPTIMALITY_TOLERANCE:
        order = np.argsort(costates.missed)[::-1]
        left = costates.saving - np.cumsum(costates.missed[order])
        enough = OPTIMALITY_TOLERANCE / task.policy.motion_mesh.parts
        flags[order[: 1 + np.searchsorted(-left, -enough)]] = True
    return flags


def _exceeding(limits: JointLimits, motion: Trajectory, knots: Array, most: float) -> Flags:
    """Intervals, shape (K,), in which a motion exceeds limits by more than `most`, a part of them, but not far."""
    flags, beyond = np.zeros(knots.size - 1, bool), excesses(limits, motion)
    if max(one.share for one in beyond) <= 4 * OPTIMALITY_TOLERANCE:
        for one in beyond:
            at = one.t[np.any(one.beyond > most * one.size, axis=1)]
            flags[np.clip(np.searchsorted(knots, at, side="right") - 1, 0, flags.size - 1)] = True
    return flags
