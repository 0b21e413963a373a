"""Mesh refinement until the motion, not only its switches, is that of the optimum.

`switch_mesh` finds brief switches. Here intervals are divided wherever torques constant in them cannot do what the
optimum does: about jumps of a torque that is off its limits, along limits of velocity and position, from which a
constant torque strays, and where collocation is not exact enough.
"""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.landing.rollout import replay_of
from armdyn.optimal.landing.shooting import Shooting, gaps, landed
from armdyn.optimal.program.unknowns import mesh
from armdyn.optimal.proof.certificate import SAVING_TOLERANCE
from armdyn.optimal.proof.mesh_costates import mesh_costates
from armdyn.optimal.refine.optimum import Optimum
from armdyn.optimal.refine.switch_mesh import on_finer_meshes
from armdyn.optimal.solve.attempt import Attempt
from armdyn.optimal.solve.condensed import has_stagewise, solve_on_knots
from armdyn.optimal.task.policy.refinement import MotionMeshPolicy
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory


def resolved_motion(task: Task, attempt: Attempt) -> Attempt | None:
    """Solve an optimum on finer and finer meshes, a little within limits of velocity; None: none converges.

    Args:
        task: its problem; torques are constant in the intervals.
        attempt: a solution near it.
    """
    numbers = task.policy.motion_mesh
    if not has_stagewise(task):
        return None
    inside = task.problem.variant(velocity_limit=(1 - numbers.inside) * task.problem.limits.velocity)
    within = replace(task, problem=inside)
    settings = replace(task.sharp(), max_iterations=numbers.iterations, barrier=numbers.barrier)

    def solve(guess: Trajectory, knots: Array) -> Attempt:
        return solve_on_knots(within, guess, knots, settings, numbers.tie)

    knots = mesh(numbers.intervals)
    found = list(on_finer_meshes(task, attempt, knots, numbers, solve, lambda one: _finer(within, one, numbers)))
    return found[-1] if found else None


def _finer(task: Task, attempt: Attempt, numbers: MotionMeshPolicy) -> Array:
    """The attempt's knots, and more; where they would be too many, with a larger error of collocation."""
    more = _divided(task, attempt, numbers)
    return more if more.size <= numbers.most else _divided(task, attempt, replace(numbers, gap=numbers.rough))


def _divided(task: Task, attempt: Attempt, numbers: MotionMeshPolicy) -> Array:
    limits, knots, motion = task.problem.limits, attempt.mesh, attempt.trajectory
    lengths = np.diff(knots)
    at, middle = motion(motion.duration * knots), motion(motion.duration * (knots[:-1] + knots[1:]) / 2)
    level = (middle.tau - limits.actuators.center) / limits.actuators.scale
    off = np.abs(level) < 1 - task.policy.arcs.near
    jumps = np.pad(np.abs(np.diff(level, axis=0)) > numbers.jump, ((1, 1), (0, 0)))
    parts = np.where(np.any(off & (jumps[:-1] | jumps[1:]), axis=1), numbers.parts, 1.0)
    brief = np.zeros(level.shape, bool)
    brief[1:-1] = off[1:-1] & (level[:-2] * level[2:] < 2 * task.policy.arcs.near - 1)
    alone = np.any(brief, axis=1) & (off.sum(axis=1) == 1)
    parts[alone] = 1.0
    bows = [np.abs(mean - (ends[:-1] + ends[1:]) / 2) for mean, ends in ((middle.v, at.v), (middle.q, at.q))]
    fast = np.maximum(np.abs(at.v[:-1]), np.abs(at.v[1:])) > (1 - task.policy.arcs.near_speed) * limits.velocity
    steady = np.abs(np.diff(at.v, axis=0)) < task.policy.arcs.in_contact * limits.velocity
    room = np.minimum(at.q - limits.position_lower, limits.position_upper - at.q)
    close = np.minimum(room[:-1], room[1:]) < task.policy.arcs.in_contact
    bow = np.where(fast & steady, bows[0] / (numbers.bow * limits.velocity), 0.0)
    bow = np.maximum(bow, np.where(close, bows[1] / numbers.beyond, 0.0)).max(axis=1)
    shooting = task.policy.shooting
    missed, *_ = gaps(task.problem.robot, Shooting.of(task.problem, attempt, shooting.near), shooting.steps)
    gap = np.nan_to_num(np.max(np.abs(missed), axis=1))  # of the fifth order; not known where a motion diverges
    parts = np.maximum(parts, np.maximum(np.sqrt(bow), (gap / numbers.gap) ** 0.2))
    counts = np.where(lengths > numbers.least, np.ceil(np.minimum(parts, numbers.parts)), 1).astype(int)
    more = [knots[k] + lengths[k] * np.arange(1, counts[k]) / counts[k] for k in np.flatnonzero(counts > 1)]
    beside = task.policy.switch_mesh.shrink * np.array([-0.5, 0.5])
    for k, joint in zip(*np.nonzero(brief & (lengths > numbers.least)[:, None]), strict=True):
        share = (1 + level[k, joint] * np.sign(level[k - 1, joint])) / 2  # of the interval, before the switch
        place = np.clip(share, numbers.margin, 1 - numbers.margin) + beside
        more.append(knots[k] + lengths[k] * place)
    found = np.unique(np.concatenate([knots, *more]))
    apart = np.append(np.diff(found) > numbers.least / 20, True)
    return np.asarray(found[apart | (found == 0)])


def mesh_optimum(task: Task, attempt: Attempt, remark: str) -> Optimum | None:
    """The motion of a resolved mesh, landed by multiple shooting, with what a change of it could save to first order.

    Args:
        task: the problem and its settings.
        attempt: a solution near it.
        remark: why its arcs are not known.

    Returns:
        None: no mesh converges, or its motion does not land.
    """
    problem = task.problem
    mesh = resolved_motion(task, attempt)
    motion = None if mesh is None else landed(task, mesh)
    if motion is None:
        return None
    replay = replay_of(task, motion.trajectory(problem.robot.joint_names))
    found = Optimum.of(problem, replay, len(motion.tau), None, remark)
    if not found.certificate.on_goal:
        return None
    costates = mesh_costates(problem, motion, replay, task.policy)
    if costates is None or costates.saving > SAVING_TOLERANCE:
        return found
    certificate = replace(
        found.certificate,
        remark="",
        saving=costates.saving,
        t=costates.t,
        costate=costates.costate,
        switching=costates.switching,
    )
    return replace(found, certificate=certificate)
