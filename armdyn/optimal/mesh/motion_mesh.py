"""Mesh refinement until the motion, not only its switching times, is the optimum's.

Intervals are divided wherever torques that are constant or linear in each cannot follow the optimum: constant ones at
jumps off their limits and along limits of velocity and position, where also the collocation's error is large; linear
ones where they bend or jump.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array, Flags, Index
from armdyn.optimal.mesh.condensed import solve_on_knots
from armdyn.optimal.mesh.direct import Attempt
from armdyn.optimal.mesh.mesh_costates import MeshCostates, mesh_costates
from armdyn.optimal.mesh.multistart import distinct
from armdyn.optimal.mesh.shooting import Shooting, gaps, landed
from armdyn.optimal.mesh.unknowns import mesh
from armdyn.optimal.problem.options import Acceptable, SolverSettings
from armdyn.optimal.problem.policy.refinement import MotionMeshPolicy
from armdyn.optimal.problem.policy.search import SamePolicy
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
    """Budget of meshes of one problem, and their motions so far: similar solutions are solved once.

    Attributes:
        left: intervals times iterations left in the budget, the same on every machine.
        best: duration of the fastest usable motion of the problem [s]; infinite: no such motion.
    """

    def __init__(self, numbers: MotionMeshPolicy) -> None:
        self.left, self.best, self._numbers = float(numbers.work), np.inf, numbers
        self._known: list[tuple[Sequence[Attempt], Optimum | None]] = []

    @property
    def spent(self) -> bool:
        """Whether the budget is spent, but for divided meshes."""
        return self.left < self.reserve

    @property
    def reserve(self) -> float:
        """Part of the budget that is left for divided meshes."""
        return self._numbers.work / 4

    def beats(self, mesh: Attempt) -> bool:
        """Whether the best usable motion is so much faster than a mesh's motion that the mesh is skipped."""
        return mesh.cost > (1 + self._numbers.abandoned) * self.best

    def usable_by(self, duration: float) -> bool:
        """Whether a motion of at most this duration is usable."""
        known = (optimum for _, optimum in self._known if optimum is not None and optimum.cost <= duration)
        return any(one.usable for one in known)

    def add(self, meshes: Sequence[Attempt], optimum: Optimum | None) -> None:
        """Record the result of solutions on successive meshes; None: no result."""
        self._known.append((meshes, optimum))

    def like(self, meshes: Sequence[Attempt], same: SamePolicy) -> tuple[Optimum | None] | None:
        """Recorded result of the same solution on the last of these meshes; None: not recorded."""
        k = len(meshes) - 1
        for known, optimum in self._known:
            if k < len(known) and len(distinct([known[k], meshes[k]], same.resolved, same.distance)) == 1:
                return (optimum,)
        return None


class _Meshes:
    """Solver of meshes with small margins of the velocity limits.

    Attributes:
        task: the problem and its settings.
        work: budget of the problem, and its motions so far.
        tie: index of the tie of the last solution.
    """

    def __init__(self, task: Task, work: MeshWork) -> None:
        self.task, self.work, self.tie = task, work, 0

    def finer(self, attempt: Attempt) -> Iterator[Attempt]:
        """Rough solutions of one optimum on successively finer meshes."""
        numbers, within = self.task.policy.motion_mesh, self._within(MeshMargins())
        rough = SolverSettings(numbers.tolerance, numbers.iterations, numbers.barrier)

        def solve(guess: Trajectory, knots: Array) -> Attempt:
            begins = knots is first
            return self._solved(within, guess, knots, rough if begins else self._settings(rough=True), int(not begins))

        def finer(one: Attempt) -> Array:
            knots = finer_knots(within, one, numbers)
            return knots if self.affordable(knots, self.work.reserve) else one.mesh

        first = finer(attempt) if self.task.scheme.control == "linear" else mesh(4 * self.task.policy.search.fine_mesh)
        yield from on_finer_meshes(self.task, attempt, first, numbers, solve, finer)

    def sharp(self, rough: Attempt) -> Attempt:
        """Solve on the mesh of a rough solution; the rough one without convergence or budget."""
        if not self.affordable(rough.mesh) or self.task.stop:
            return rough
        found = self._once(self._within(MeshMargins()), rough.trajectory, rough.mesh, self._settings(), self.tie)
        return found if found.usable else rough

    def divided(self, attempt: Attempt, to_divide: Flags, margins: MeshMargins) -> Attempt | None:
        """Solve on a mesh with the flagged intervals, shape (K,), divided; None without convergence or budget."""
        numbers = self.task.policy.motion_mesh
        knots = _in_parts(attempt.mesh, np.where(to_divide, numbers.parts, 1))
        divide = np.any(to_divide) and knots.size <= numbers.most and self.affordable(knots)
        return self.again(attempt, knots, margins) if divide else None

    def again(self, attempt: Attempt, knots: Array, margins: MeshMargins) -> Attempt | None:
        """Solve on other knots, with margins of the limits; None without convergence."""
        if self.task.stop:
            return None
        found = self._solved(self._within(margins), attempt.trajectory, knots, self._settings(), self.tie)
        return found if found.usable else None

    def affordable(self, knots: Array, spare: float = 0) -> bool:
        """Whether the budget left is more than a mesh needs."""
        return self.work.left - spare >= self.task.policy.motion_mesh.fewest * (knots.size - 1)

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
        numbers, self.tie = self.task.policy.motion_mesh, tie
        found = self._once(task, guess, knots, settings, tie)
        if found.usable and found.iterations == settings.max_iterations:  # still becoming faster
            found = replace(found, status=Status.ITERATION_LIMIT)
        if (
            found.usable
            or self.task.stop
            or tie + 1 == len(numbers.ties)
            or not self.affordable(knots, self.work.reserve)
        ):
            return found
        near = found.trajectory if found.status is Status.ITERATION_LIMIT else guess
        return self._solved(task, near, knots, settings, tie + 1)

    def _once(self, task: Task, guess: Trajectory, knots: Array, settings: SolverSettings, tie: int) -> Attempt:
        """Result of one solve on a mesh."""
        numbers, size = self.task.policy.motion_mesh, knots.size - 1
        granted = max(numbers.fewest, int(max(self.work.left, 0) // size))
        most = min(settings.max_iterations, granted)
        weight = 0.0 if task.problem.pays_effort else numbers.ties[tie]
        found = solve_on_knots(task, guess, knots, replace(settings, max_iterations=most), weight)
        self.work.left -= found.iterations * size
        return found

    def _within(self, margins: MeshMargins) -> Task:
        fast = LIMIT_TOLERANCE / 2 + margins.velocity  # what lies between an interval's middle and its ends
        return replace(margins, velocity=fast).task_within(self.task)


def on_finer_meshes(
    task: Task,
    attempt: Attempt,
    knots: Array,
    numbers: MotionMeshPolicy,
    solve: Callable[[Trajectory, Array], Attempt],
    finer: Callable[[Attempt], Array],
    settled: float = -np.inf,
) -> Iterator[Attempt]:
    """Solutions of one optimum on successively finer meshes, until one is not usable or no mesh is finer.

    Args:
        task: the problem and its settings; after a stop the last solution is dropped.
        attempt: a solution near the first.
        knots: of the first mesh as parts of the duration, shape (N + 1,).
        numbers: numbers of meshes and knots, and the tolerance for another optimum.
        solve: maps a guess and knots to a solution.
        finer: maps a solution to its knots and further ones.
        settled: gain by a mesh, as a part of the duration, that ends them.
    """
    near = attempt
    for _ in range(numbers.rounds):
        found = solve(near.trajectory, knots)
        slower = found.cost > (1 + numbers.slower) * near.cost
        if not found.usable or slower or task.stop:
            return
        yield found
        if found.cost > (1 - settled) * near.cost:
            return
        near, more = found, finer(found)
        if more.size == knots.size or more.size > numbers.most:
            return
        knots = more


def finer_knots(task: Task, attempt: Attempt, numbers: MotionMeshPolicy) -> Array:
    """The attempt's knots and further ones; with a larger collocation error if these would be too many."""
    if task.scheme.control == "linear":
        return _bent(task, attempt, numbers)
    more = _divided(task, attempt, numbers)
    return more if more.size <= numbers.most else _divided(task, attempt, replace(numbers, gap=10 * numbers.gap))


def _divided(task: Task, attempt: Attempt, numbers: MotionMeshPolicy) -> Array:
    limits, knots, motion = task.problem.limits, attempt.mesh, attempt.trajectory
    lengths = np.diff(knots)
    middle = motion(motion.duration * (knots[:-1] + knots[1:]) / 2)
    level = (middle.tau - limits.actuators.center) / limits.actuators.scale
    off = np.abs(level) < 1 - task.policy.arcs.near
    jumps = np.pad(np.any(np.abs(np.diff(level, axis=0)) > numbers.jump, axis=1), 1)
    parts = np.where(jumps[:-1] | jumps[1:], numbers.parts, 1.0)  # a switch at a knot may be on either side
    brief = np.zeros(level.shape, bool)
    brief[1:-1] = off[1:-1] & (level[:-2] * level[2:] < 2 * task.policy.arcs.near - 1)
    alone = np.any(brief, axis=1) & (off.sum(axis=1) == 1)
    parts[alone] = 1.0
    shooting = task.policy.shooting
    missed, *_ = gaps(task.problem.robot, Shooting.of(task.problem, attempt, shooting.near), shooting.steps)
    gap = np.nan_to_num(np.max(np.abs(missed), axis=1))  # error of fifth order; NaN where a motion diverges
    parts = np.maximum(parts, np.maximum(_by_limits(task, attempt, numbers), (gap / numbers.gap) ** 0.2))
    counts = np.where(lengths > numbers.least, np.ceil(np.minimum(parts, numbers.parts)), 1).astype(int)
    more = [_in_parts(knots, counts)]
    around = numbers.shrink * np.array([-0.5, 0.5])
    for k, joint in zip(*np.nonzero(brief & (lengths > numbers.least)[:, None]), strict=True):
        share = (1 + level[k, joint] * np.sign(level[k - 1, joint])) / 2  # part of the interval before the switch
        place = np.clip(share, numbers.shrink, 1 - numbers.shrink) + around
        more.append(knots[k] + lengths[k] * place)
    found = np.unique(np.concatenate([knots, *more]))
    apart = np.append(np.diff(found) > numbers.least / 20, True)
    return np.asarray(found[apart | (found == 0)])


def _by_limits(task: Task, attempt: Attempt, numbers: MotionMeshPolicy) -> Array:
    """Numbers of parts, shape (K,), in which intervals on limits of velocity and position bow by the tolerance."""
    limits, near, motion = task.problem.limits, task.policy.arcs, attempt.trajectory
    knots = attempt.mesh
    at, middle = motion(motion.duration * knots), motion(motion.duration * (knots[:-1] + knots[1:]) / 2)
    excesses = [np.abs(mean - (ends[:-1] + ends[1:]) / 2) for mean, ends in ((middle.v, at.v), (middle.q, at.q))]
    fast = np.maximum(np.abs(at.v[:-1]), np.abs(at.v[1:])) > (1 - near.near_speed) * limits.velocity
    steady = np.abs(np.diff(at.v, axis=0)) < near.in_contact * limits.velocity
    margin = np.minimum(at.q - limits.position_lower, limits.position_upper - at.q)
    close = np.minimum(margin[:-1], margin[1:]) < near.in_contact
    bow = np.where(fast & steady, excesses[0] / (numbers.velocity_excess * limits.velocity), 0.0)
    bow = np.maximum(bow, np.where(close, excesses[1] / LIMIT_TOLERANCE, 0.0))
    return np.asarray(np.sqrt(bow.max(axis=1)))


def _bent(task: Task, attempt: Attempt, numbers: MotionMeshPolicy) -> Array:
    """The attempt's knots, and further ones where torques linear in an interval bend, or jump."""
    knots, motion = attempt.mesh, attempt.trajectory
    lengths, tau = np.diff(attempt.mesh), motion(motion.duration * knots).tau
    used = np.ptp(tau, axis=0) / 2  # half the range, if both limits are reached
    level = tau / np.where(used > 0, used, 1.0)
    after = (lengths[:-1] / (lengths[:-1] + lengths[1:]))[:, None]
    bend = np.abs(level[1:-1] - (1 - after) * level[:-2] - after * level[2:]).max(axis=1)
    parts = np.sqrt(np.maximum(np.pad(bend, (1, 0)), np.pad(bend, (0, 1))) / numbers.bend)
    parts = np.maximum(parts, _by_limits(task, attempt, numbers))
    return _in_parts(knots, np.where(lengths > numbers.least, np.clip(np.ceil(parts), 1, numbers.parts), 1).astype(int))


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
        faster.
    """
    meshes, tried, best = _Meshes(task, work), list[Attempt](), None
    for rough in meshes.finer(attempt):
        tried.append(rough)
        if (known := work.like(tried, task.policy.same)) is not None:
            return known[0]
        if len(tried) > 1 and work.beats(rough):
            break
        if len(tried) > 1 and (best := exact(rough)) is not None:
            break
    else:
        sharp = meshes.sharp(tried[-1]) if tried else None
        best = None if sharp is None else exact(sharp) or _divided_until_certified(meshes, sharp)
    work.add(tried, best)
    return best


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


def _divided_until_certified(meshes: _Meshes, mesh: Attempt) -> Optimum | None:
    """Best motion of a mesh, divided repeatedly until certified; None if none reaches the goal."""
    task, most = meshes.task, meshes.task.policy.motion_mesh.further_meshes
    best = _judged(task, mesh, by_limits=True)
    if best is None:
        return None
    for k in range(most):
        velocity, position = excess(task, best.optimum)
        margins = MeshMargins(velocity if k else 0.0, position)  # shorter intervals: smaller excess
        divided = meshes.divided(mesh, best.to_divide, margins)
        by_limits = k + 1 < most and not np.isfinite(best.saving)  # else the savings are compared
        found = None if divided is None else _judged(task, divided, by_limits)
        if divided is None or found is None or found.saving > max(best.saving, OPTIMALITY_TOLERANCE):
            break
        mesh, best = divided, found
    best = best if np.isfinite(best.saving) else _judged(task, mesh) or best
    early = not task.problem.pays_effort and best.saving > OPTIMALITY_TOLERANCE / 5
    if best.optimum.certificate.ok and early:
        best = _settled(meshes, mesh, best)
    return _within_margins(meshes, mesh, best.optimum)


def _settled(meshes: _Meshes, mesh: Attempt, best: _Judged) -> _Judged:
    """A certified motion solved again from itself: its solve ended where it hardly became faster."""
    again = meshes.again(mesh, mesh.mesh, MeshMargins())
    found = None if again is None else _judged(meshes.task, again)
    if found is None or not found.optimum.certificate.ok:
        return best
    return min(best, found, key=lambda one: one.optimum.cost)


def _within_margins(meshes: _Meshes, mesh: Attempt, optimum: Optimum) -> Optimum:
    """Solve on the same mesh with wider margins of the limits until the motion is usable.

    The given motion is returned if none is, or if a usable one that is as fast is known.

    The torque limits get a margin if the replay misses the goal: an unstable motion can be repeated only under
    feedback, for which torques on their limits leave no range.
    """
    task, margins, last = meshes.task, MeshMargins(), optimum
    if meshes.work.usable_by(optimum.cost):
        return optimum
    for kept in task.policy.motion_mesh.kept:
        if last.usable:
            break
        margins = margins.wider(task, last, margins.torque if last.landed else kept)
        again = meshes.again(mesh, mesh.mesh, margins)
        found = None if again is None else _judged(task, again)
        if again is None or found is None:
            break
        mesh, last = again, found.optimum
    return last if last.usable else optimum


def _judged(task: Task, attempt: Attempt, by_limits: bool = False) -> _Judged | None:
    """Motion of a mesh, corrected to reach the goal, with its certificate; None if it does not reach the goal.

    Args:
        task: the problem and its settings.
        attempt: solution on the mesh.
        by_limits: whether a motion that exceeds a limit is judged by that alone.
    """
    problem, motion = task.problem, landed(task, attempt)
    if motion is None:
        return None
    shot = motion.trajectory(problem.robot.joint_names)
    replay = replay_of(task, shot)
    found = Optimum.of(problem, replay, len(motion.tau))
    if not found.certificate.on_goal:  # unstable beyond rounding: `repeated` checks its segments
        replay, found = shot, Optimum.of(problem, shot, len(motion.tau))
    to_divide = _beyond_limits(task, motion, replay)
    if by_limits and np.any(to_divide):
        return _Judged(found, np.inf, to_divide)
    costates = mesh_costates(problem, motion, replay, task.policy)
    to_divide = _with_most_saving(task, motion, to_divide, costates)
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
    return _Judged(replace(found, certificate=certificate, costates=known), saving, to_divide)


def _beyond_limits(task: Task, motion: Shooting, replay: Trajectory) -> Flags:
    """Intervals in which a motion is slightly beyond a limit of the state or the torque, shape (K,)."""
    flags, beyond = np.zeros(len(motion.tau), bool), excesses(task.problem.limits, replay)
    if max(one.share for one in beyond) > 4 * OPTIMALITY_TOLERANCE:
        return flags
    for one in beyond:
        at = one.t[np.any(one.beyond > LIMIT_TOLERANCE * one.size, axis=1)]
        flags[np.clip(np.searchsorted(motion.t, at, side="right") - 1, 0, flags.size - 1)] = True
    return _long_enough(task, motion, flags)


def _with_most_saving(task: Task, motion: Shooting, flags: Flags, costates: MeshCostates | None) -> Flags:
    """The flags, and those intervals of a nearly certified motion that have most of the saving; else none."""
    if costates is None or costates.saving > 4 * OPTIMALITY_TOLERANCE:
        return np.zeros_like(flags)
    if costates.saving <= OPTIMALITY_TOLERANCE:
        return flags
    order, more = np.argsort(costates.missed)[::-1], flags.copy()
    left = costates.saving - np.cumsum(costates.missed[order])
    more[order[: 1 + np.searchsorted(-left, -OPTIMALITY_TOLERANCE / task.policy.motion_mesh.parts)]] = True
    return _long_enough(task, motion, more)


def _long_enough(task: Task, motion: Shooting, flags: Flags) -> Flags:
    """Flags of intervals that may be divided."""
    return np.asarray(flags & (np.diff(motion.t) > task.policy.motion_mesh.least * motion.t[-1]))
