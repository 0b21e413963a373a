"""From a collocation solution to exact switching times: arcs, their durations, their replay."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.arcs.arc import SWITCH, Arc, Mode, detect, merged
from armdyn.optimal.arcs.phases import Phases, Unresolved
from armdyn.optimal.arcs.posing import PhaseAim
from armdyn.optimal.arcs.solving import prepare_phases, solve_phases
from armdyn.optimal.arcs.structure import by_sign, with_overlooked, without_idle_touches, without_vanished
from armdyn.optimal.landing.aim import aimed
from armdyn.optimal.landing.rollout import replay_torques
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.program.mesh import mesh
from armdyn.optimal.proof.certificate import (
    HAMILTONIAN_TOLERANCE,
    SWITCHING_TOLERANCE,
    Certificate,
    certify,
    pontryagin,
)
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.policy import Policy
from armdyn.optimal.task.scheme import Scheme
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_INTERVALS = 24
"""Of the first multi-phase mesh."""
_MOST_INTERVALS = 100
_MOST_ARCS = 60
_BLUR = 20
"""A torque that is off its limits for less than this part of a fine mesh is taken for a switch."""
_ROUNDS = 12
_AIMS = 8
_LANDED = 1e-9
"""Goal error [rad or m] at which the replay has landed: a few of the integrator's own."""


@dataclass(frozen=True, eq=False)
class Refined:
    """What refinement made of a collocation solution.

    Attributes:
        trajectory: replayed torques: states and torques fit each other to the integrator's tolerance.
        certificate: of it.
        phases: None if the arcs could not be resolved; the certificate then says why.
    """

    trajectory: Trajectory
    certificate: Certificate
    phases: Phases | None


def refine(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    trajectory: Trajectory,
    intervals: int,
    stop: Stop,
) -> Refined:
    """Resolve the arcs of a collocation solution, or say why they resist.

    Args:
        problem: what is solved.
        dynamics: of its robot.
        scheme: says the form of the dynamics.
        trajectory: a collocation solution with constant torques between the knots of `mesh`.
        intervals: of its mesh.
        stop: asked every few iterations.
    """
    phases, remark = _structure(problem, dynamics, scheme, trajectory, intervals, stop)
    if phases is not None:
        resolved = land(problem, dynamics, scheme, phases, stop, remark)
        if resolved.certificate.ok:
            return resolved
        remark = resolved.certificate.remark
    motion, replay = aimed(problem, trajectory, stop)
    on_mesh = Refined(motion, certify(problem, replay, None, remark), None)
    # Arcs that are not certified are worth having only if their motion is the better one.
    return resolved if phases is not None and _error(resolved) <= _error(on_mesh) else on_mesh


def prepare_refinement(task: Task) -> None:
    """Build, if it is not there, what `refine` is most likely to need."""
    for intervals in (_INTERVALS, 2 * _INTERVALS):
        prepare_phases(task, intervals)


def land(
    problem: MinimumTimeProblem, dynamics: Dynamics, scheme: Scheme, phases: Phases, stop: Stop, remark: str = ""
) -> Refined:
    """Solve phases until their replay is on the goal, and certify it.

    Args:
        problem: what is solved.
        dynamics: of its robot.
        scheme: says the form of the dynamics.
        phases: a solution of theirs.
        stop: asked every few iterations.
        remark: what there is to say against them already.
    """
    phases, replay, landing = _land(problem, dynamics, scheme, phases, stop)
    replay = replace(replay, name="minimum time")
    return Refined(replay, certify(problem, replay, phases, remark or landing), phases)


def _error(refined: Refined) -> float:
    return max(refined.certificate.goal_error, refined.certificate.limit_violation)


def _structure(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    trajectory: Trajectory,
    intervals: int,
    stop: Stop,
) -> tuple[Phases | None, str]:
    """Phases whose switching functions agree with their modes, or the last ones and why they do not."""
    # The torques of a fine mesh need not be on their limits where time hardly tells.
    switch = max(SWITCH, intervals // _BLUR)
    task = Task(problem, dynamics, scheme, MinimumTimeOptions(), Policy.of(problem), stop)
    arcs = merged(detect(problem, trajectory, mesh(intervals, task.policy.graded), switch))
    idle = _idle(problem, arcs)
    if problem.robot.nv > 3 and idle:
        return None, f"time does not determine {', '.join(idle)}: on no limit for most of the motion"

    guess, seen = trajectory, set()
    last: Phases | None = None
    for _ in range(_ROUNDS):
        if len(arcs) > _MOST_ARCS:
            return last, f"{len(arcs)} arcs: more than {_MOST_ARCS}"
        size = max(_INTERVALS, 3 * len(arcs))
        laid = last.density if last else None
        phases = solve_phases(task, arcs, guess, size, PhaseAim(density=laid))
        if isinstance(phases, Unresolved):
            return last, f"the durations of {len(arcs)} arcs did not converge ({phases.message})"
        guess = phases.torques
        structure = tuple((arc.modes, arc.touches) for arc in phases.arcs)
        if structure not in seen and (fewer := without_vanished(phases)):
            seen.add(structure)
            arcs = fewer
            continue
        last = phases
        arcs = with_overlooked(problem, phases) or without_idle_touches(phases)
        if arcs and structure not in seen and not stop:
            seen.add(structure)
            continue
        _, switching, worst = pontryagin(problem, phases)
        if worst <= SWITCHING_TOLERANCE:
            return phases, ""
        arcs = by_sign(phases, switching)
        if structure in seen or stop or structure == tuple((arc.modes, arc.touches) for arc in arcs):
            break
        seen.add(structure)
    return last, "the switching structure did not settle"


def _idle(problem: MinimumTimeProblem, arcs: list[Arc]) -> list[str]:
    """Joints that are on no limit for more than half of the motion."""
    total = sum(arc.duration for arc in arcs)
    free = [sum(arc.duration for arc in arcs if arc.modes[i] is Mode.FREE) for i in range(problem.robot.nv)]
    return [name for name, time in zip(problem.robot.joint_names, free, strict=True) if time > total / 2]


def _land(
    problem: MinimumTimeProblem, dynamics: Dynamics, scheme: Scheme, phases: Phases, stop: Stop
) -> tuple[Phases, Trajectory, str]:
    """Finer while H strays; then aim beside the goal by the collocation's own error until the replay hits it."""
    size, n = phases.arc_of.size, problem.robot.nv
    task = Task(problem, dynamics, scheme, MinimumTimeOptions(), Policy.of(problem), stop)
    while 2 * size <= _MOST_INTERVALS and _strays(problem, phases) and not stop:
        size *= 2
        laid = phases.density
        tried = solve_phases(task, phases.arcs, phases.torques, size, PhaseAim(near=True, density=laid))
        if isinstance(tried, Unresolved):
            remark = f"the arcs did not converge on {size} intervals ({tried.message})"
            return phases, replay_torques(problem.robot, phases.torques), remark
        phases = tried
    best, offset = (phases, replay_torques(problem.robot, phases.torques)), np.zeros(2 * n)
    for _ in range(_AIMS):
        error = problem.beside_goal(best[1])
        if np.max(np.abs(error[:n])) <= _LANDED or stop:
            break
        offset = offset - error
        # Where time leaves torques free another solution has others, and the error is not the same again.
        keep = best[0] if problem.effort_weight == 0 and len(best[0].arcs) > 2 * n else None
        arcs, guess = best[0].arcs, best[0].torques
        aim = PhaseAim(offset=offset, near=True, density=phases.laid, keep=keep)
        tried = solve_phases(task, arcs, guess, size, aim)
        if isinstance(tried, Unresolved):
            return *best, f"the replay could not be brought onto the goal ({tried.message})"
        replayed = replay_torques(problem.robot, tried.torques)
        if replayed.t[-1] != tried.torques.t[-1]:
            return *best, "the replay left what numbers can hold"
        best = tried, replayed
    return *best, ""


def _strays(problem: MinimumTimeProblem, phases: Phases) -> bool:
    """H is not as good as it could be."""
    return float(np.max(np.abs(pontryagin(problem, phases)[0]))) > 0.01 * HAMILTONIAN_TOLERANCE
