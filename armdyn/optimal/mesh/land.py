"""Terminal correction of arcs: offset their goal until the replay reaches the original goal."""

from dataclasses import replace

import numpy as np

from armdyn.optimal.constraints.registry import Aim
from armdyn.optimal.mesh.phases import Unresolved, solve_phases
from armdyn.optimal.mesh.unknowns import doubled
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import repeated
from armdyn.optimal.verify.optimum import Optimum
from armdyn.optimal.verify.phases import Phases
from armdyn.optimal.verify.pontryagin import adjoint_error, pontryagin
from armdyn.optimal.verify.rollout import replay_of
from armdyn.trajectory import Trajectory


def land(task: Task, phases: Phases) -> Optimum:
    """Solve arcs with an offset goal until their replay is on the goal; certify the replay.

    Args:
        task: the problem and its settings.
        phases: solved arcs.
    """
    phases, replay, failure = _finer(task, phases)
    if not failure:
        phases, replay, failure = _on_goal(task, phases, replay)
    return Optimum.of(task.problem, replay, phases.arc_of.size, phases, failure, iterations=phases.iterations)


def as_replayed(task: Task, optimum: Optimum) -> Optimum:
    """Complete an optimum's certificate by `repeated`; states that do not repeat give way to those of a replay.

    Args:
        task: the problem and its settings.
        optimum: a landed optimum.
    """
    motion, certificate = optimum.trajectory, optimum.certificate
    if certificate.growth is None:  # else it was repeated by its refinement method
        certificate = repeated(task.problem, motion, certificate)
    if not certificate.repeats and (replay := replay_of(task, motion)).t[-1] == motion.t[-1]:
        motion = replace(replay, name=motion.name)
        certificate = repeated(task.problem, motion, optimum.certificate)
    return replace(optimum, trajectory=motion, certificate=certificate)


def with_adjoint_check(task: Task, optimum: Optimum) -> Optimum:
    """Add the adjoint equations' error to an extremal's certificate, unless it is known.

    Args:
        task: the problem and its settings.
        optimum: a landed optimum.
    """
    known = optimum.certificate.adjoint_error is not None
    if optimum.phases is None or known or not optimum.certificate.extremal:
        return optimum
    error = adjoint_error(task.problem.robot, optimum.trajectory, optimum.phases)
    return replace(optimum, certificate=replace(optimum.certificate, adjoint_error=error))


def _finer(task: Task, phases: Phases) -> tuple[Phases, Trajectory, str]:
    """Solve on finer meshes while |H| is too large; the replay, and the reason of a failure."""
    numbers = task.policy.refinement
    finest = max(numbers.most_intervals, numbers.most_per_arc * len(phases.arcs))
    while (size := doubled(phases.arc_of.size, finest)) and not task.stop:
        if np.max(np.abs(pontryagin(task.problem, phases)[0])) <= numbers.hamiltonian_tolerance:
            break
        tried = solve_phases(task, phases.arcs, phases.torques, size, warm=True, density=phases.density)
        if isinstance(tried, Unresolved):
            remark = f"the arcs did not converge on {size} intervals ({tried.message})"
            return phases, replay_of(task, phases.torques), remark
        phases = tried
    return phases, replay_of(task, phases.torques), ""


def _on_goal(task: Task, phases: Phases, replay: Trajectory) -> tuple[Phases, Trajectory, str]:
    """Offset the goal by the collocation's error until the replay reaches it."""
    problem, numbers, n = task.problem, task.policy.refinement, task.problem.robot.nv
    best, aim = phases, Aim()
    for _ in range(numbers.corrections):
        if np.max(np.abs(problem.goal_error_of(replay)[:n])) <= numbers.landed or task.stop:
            break
        aim = aim.corrected(problem, replay)
        offset = aim.at_goal(n)
        tried = solve_phases(task, best.arcs, best.torques, best.arc_of.size, True, offset, best.mesh_density)
        if isinstance(tried, Unresolved):
            return best, replay, f"the replay could not be brought onto the goal ({tried.message})"
        replayed = replay_of(task, tried.torques)
        if replayed.t[-1] != tried.torques.t[-1]:
            return best, replay, "the replay diverged"
        best, replay = tried, replayed
    return best, replay, ""
