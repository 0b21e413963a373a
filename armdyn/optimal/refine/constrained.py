"""Minimum time with conditions along the way: obstacles, via points, limits of acceleration, speed and torque rate.

The answer is the mesh's, replayed: arcs between obstacles, and with them the certificate, are not resolved.
What the mesh asks for only at its points is checked everywhere on the replay, and asked for more strictly
where it does not hold there.
"""

from dataclasses import dataclass, replace

import numpy as np

from armdyn.optimal.conditions.demands import Checked, Demands
from armdyn.optimal.conditions.via import NEAR
from armdyn.optimal.landing.rollout import replay_torques
from armdyn.optimal.problem.status import Status
from armdyn.optimal.proof.certificate import certify
from armdyn.optimal.refine.arcs import Refined
from armdyn.optimal.search.candidates import Candidates, find_candidates
from armdyn.optimal.solve.direct import Attempt, solve_on_mesh
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

_ROUNDS = 8
_FAR = 0.1
"""Of the goal [rad or m]: the mesh was too coarse for what the arm does."""
_SETTLED = 5e-4
"""A duration that a mesh twice as fine changes by less than this part is the answer, up to three joints."""


@dataclass(frozen=True, eq=False)
class Constrained:
    """An optimum of the mesh, replayed and checked.

    Attributes:
        refined: the replay and its certificate, which says what was not checked.
        checked: the conditions along the way.
        attempt: the mesh's last.
        iterations: of IPOPT.
    """

    refined: Refined
    checked: Checked
    attempt: Attempt
    iterations: int

    @property
    def good(self) -> tuple[bool, bool, float]:
        """Sorts: those that keep the conditions first, then those that land, then by duration."""
        certificate = self.refined.certificate
        missed = certificate.goal_error > NEAR
        return bool(self.checked.reasons), missed, self.refined.trajectory.duration


def settle(task: Task, attempt: Attempt) -> Constrained:
    """Solve a mesh again, aimed and more strictly, until its replay lands and keeps all conditions.

    Args:
        task: a problem with conditions along the way.
        attempt: a converged solution to start from.
    """
    problem, options = task.problem, task.options
    demands, size, iterations = Demands.of(problem), options.intervals, 0
    best: Constrained | None = None
    settled = np.inf
    for k in range(_ROUNDS):
        if k or attempt.intervals != size:
            near = replace(options.fine(), barrier=1e-5)
            tried = solve_on_mesh(task, attempt.trajectory, size, near, demands)
            iterations += tried.iterations
            if tried.status is not Status.SOLVED:
                break
            attempt = tried
        replay = replay_torques(problem.robot, attempt.trajectory)
        found = _judged(task, replay, attempt, iterations)
        best = found if best is None or found.good <= best.good else best
        said = "".join(f"; {reason}" for reason in found.checked.reasons)
        task.tell(f"round {k + 1}: {attempt.trajectory.duration:.4f} s{said}")
        if task.stop:
            break
        if not any(found.good[:2]):
            duration = found.refined.trajectory.duration
            done = abs(duration / settled - 1) < _SETTLED or problem.robot.nv > 3
            if done or 2 * size > options.max_intervals:
                break
            size, settled, demands = 2 * size, duration, demands.on_finer_mesh()
            continue
        if np.max(np.abs(replay.q[-1] - problem.q_goal)) > _FAR:
            if 2 * size > options.max_intervals:
                break  # no motion of the arm, and no aim mends that
            size, demands = 2 * size, demands.stricter(problem, found.checked).on_finer_mesh()
        else:
            demands = demands.stricter(problem, found.checked).aimed(problem, replay, attempt.passing)
    if best is None:
        best = _judged(task, replay_torques(problem.robot, attempt.trajectory), attempt, iterations)
    return replace(best, iterations=iterations)


def _judged(task: Task, replay: Trajectory, attempt: Attempt, iterations: int) -> Constrained:
    problem = task.problem
    remark = f"arcs are not resolved, nor Pontryagin's conditions checked, with {', '.join(problem.along_the_way)}"
    named = replace(replay, name="minimum time")
    refined = Refined(named, certify(problem, named, None, remark), None)
    return Constrained(refined, Demands.of(problem).check(problem, named, attempt.passing), attempt, iterations)


def constrained_optima(task: Task) -> tuple[list[Constrained], Candidates]:
    """Optima of the mesh that keep the conditions along the way, as far as one that none left can beat."""
    stop, tell = task.stop, task.tell
    candidates = find_candidates(task.problem, task.dynamics, task.scheme, task.options, stop, tell)
    found: list[Constrained] = []
    listed = list(candidates.listed)
    for attempt in candidates.attempts if candidates.converged else ():
        best = min((each.refined.trajectory.duration for each in found if not any(each.good[:2])), default=np.inf)
        if found and (stop or attempt.trajectory.duration >= best):
            listed.append(attempt.trajectory.duration)
            continue
        tell(f"optimum {len(found) + 1}, about {attempt.trajectory.duration:.4f} s")
        found.append(settle(task, attempt))
    return found, replace(candidates, listed=tuple(listed))
