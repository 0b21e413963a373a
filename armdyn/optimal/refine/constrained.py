"""Minimum time with conditions along the way: obstacles, via points, limits of acceleration and jerk.

The answer is the mesh's, replayed: arcs between obstacles, and with them the certificate, are not resolved.
What the mesh asks for only at its points is checked everywhere on the replay, and asked for more strictly
where it does not hold there.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.numeric import forward_dynamics
from armdyn.dynamics.symbolic import Dynamics
from armdyn.models.collision import Clearance, collision_model
from armdyn.optimal.conditions.course import PLAIN, Course, path_rows
from armdyn.optimal.landing.rollout import replay_torques
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.proof.certificate import certify
from armdyn.optimal.refine.arcs import Refined
from armdyn.optimal.search.candidates import Candidates, find_candidates
from armdyn.optimal.solve.attempt import Attempt
from armdyn.optimal.solve.direct import solve_on_mesh
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.scheme import Scheme
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_ROUNDS = 8
_MOST_POINTS = 8
_NEAR = 1e-4
"""Of via points and goal [rad or m]: near enough that no further round is worth its seconds."""
_FAR = 0.1
"""Of the goal [rad or m]: the mesh was too coarse for what the arm does."""
_SPARE = 5e-4
"""What a margin is raised by beyond what was missing [m]."""
_SETTLED = 5e-4
"""A duration that a mesh twice as fine changes by less than this part is the answer, up to three joints."""
_DEEP = 5e-3
"""Bodies overlap by more than this [m] where the motion went through one between two points."""
_RATE_TOLERANCE = 0.02
"""Of an acceleration or jerk limit, as a part of it: the mesh keeps them at its points, not between."""


@dataclass(frozen=True, eq=False)
class Checked:
    """How a replayed motion keeps the conditions along the way.

    Attributes:
        clearance: where it comes nearest to touching; None if nothing was to be kept clear of.
        nearest: least distance of every pair of the collision model [m].
        via_errors: how far beside each via point it passes, q [rad or m], shape (vias, nv).
        acceleration: its largest, as a part of the limit; 0 without one.
        jerk: likewise.
        reasons: what does not hold, for people.
    """

    clearance: Clearance | None
    nearest: Array
    via_errors: Array
    acceleration: float
    jerk: float
    reasons: tuple[str, ...]


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
        missed = certificate.goal_error > _NEAR
        return bool(self.checked.reasons), missed, self.refined.trajectory.duration


def scheme_for(problem: MinimumTimeProblem, scheme: Scheme) -> Scheme:
    """A jerk limit forbids jumps of the torque: it is then linear between knots."""
    return scheme if problem.jerk_limit is None else replace(scheme, control="linear")


def settle(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    attempt: Attempt,
    stop: Stop,
    tell: Callable[[str], None] = lambda text: None,
) -> Constrained:
    """Solve a mesh again, aimed and with margins, until its replay lands and keeps all conditions.

    Args:
        problem: with conditions along the way.
        dynamics: of its robot.
        scheme: of `scheme_for`.
        options: tolerances and meshes.
        attempt: a converged solution to start from.
        stop: asked every few iterations.
        tell: told in words what is being tried.
    """
    course, size, iterations = PLAIN, options.intervals, 0
    best: Constrained | None = None
    settled = np.inf
    for k in range(_ROUNDS):
        if k or attempt.intervals != size:
            near = replace(options.fine(), barrier=1e-5)
            tried = solve_on_mesh(problem, attempt.trajectory, dynamics, scheme, size, near, stop, course)
            iterations += tried.iterations
            if tried.status is not Status.SOLVED:
                break
            attempt = tried
        replay = replay_torques(problem.robot, attempt.trajectory)
        found = _judged(problem, replay, attempt, iterations)
        best = found if best is None or found.good <= best.good else best
        tell(f"round {k + 1}: {attempt.trajectory.duration:.4f} s{''.join(f'; {x}' for x in found.checked.reasons)}")
        if stop:
            break
        if not any(found.good[:2]):
            duration = found.refined.trajectory.duration
            done = abs(duration / settled - 1) < _SETTLED or problem.robot.nv > 3
            if done or 2 * size > options.max_intervals:
                break
            size, settled, course = 2 * size, duration, replace(course, offsets=0.0, end_velocity=0.0)
            continue
        if np.max(np.abs(replay.q[-1] - problem.q_goal)) > _FAR:
            if 2 * size > options.max_intervals:
                break  # no motion of the arm, and no aim mends that
            size, course = 2 * size, replace(course, offsets=0.0, end_velocity=0.0)
        else:
            course = _aimed(problem, course, replay, found.checked)
        course = _stricter(problem, course, found.checked)
    if best is None:
        replay = replay_torques(problem.robot, attempt.trajectory)
        best = _judged(problem, replay, attempt, iterations)
    return replace(best, iterations=iterations)


def _judged(problem: MinimumTimeProblem, replay: Trajectory, attempt: Attempt, iterations: int) -> Constrained:
    remark = f"arcs are not resolved, nor Pontryagin's conditions checked, with {', '.join(problem.conditions)}"
    named = replace(replay, name="minimum time")
    refined = Refined(named, certify(problem, named, None, remark), None)
    return Constrained(refined, check(problem, named, attempt.passing), attempt, iterations)


def check(problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> Checked:
    """How a motion keeps the conditions along the way, looked at everywhere.

    Args:
        problem: with its conditions.
        motion: whose torques and states fit each other.
        passing: when it should be at the via points [s], shape (vias,).
    """
    reasons = []
    clearance, nearest = None, np.empty(0)
    if problem.obstacles or problem.self_collision:
        model = collision_model(problem.robot, tuple(problem.obstacles), problem.self_collision)
        clearance, nearest = model.along(motion)
        if clearance.distance < problem.clearance:
            reasons.append(f"{clearance}; clearance is {1e3 * problem.clearance:g} mm")
    errors = motion(passing).q - np.array(problem.via).reshape(-1, problem.robot.nv)
    for i, error in enumerate(np.max(np.abs(errors), axis=1)):
        if error > _NEAR:
            reasons.append(f"it passes {error:.2g} rad beside via point {i}")
    acceleration, jerk = _rates(problem, motion)
    for what, share in (("acceleration", acceleration), ("jerk", jerk)):
        if share > 1 + _RATE_TOLERANCE:
            reasons.append(f"a joint's {what} exceeds its limit by {100 * (share - 1):.2g} %")
    return Checked(clearance, nearest, errors, acceleration, jerk, tuple(reasons))


def _rates(problem: MinimumTimeProblem, motion: Trajectory, dense: int = 5) -> tuple[float, float]:
    """Largest acceleration and jerk as parts of their limits; jerks are differences within and between samples."""
    if problem.acceleration_limit is None and problem.jerk_limit is None:
        return 0.0, 0.0
    function = forward_dynamics(problem.robot)
    steps = np.diff(motion.t)
    flows = steps > 2 * np.spacing(motion.t[1:])  # no jump of the torque
    part = np.linspace(0, 1, dense)
    t = (motion.t[:-1, None] + steps[:, None] * part)[flows]
    at = motion(t)
    # At its end a sample's torque is its own, not that after the jump.
    tau = motion.tau[:-1][flows][:, None] + part[:, None] * np.diff(motion.tau, axis=0)[flows][:, None]
    n = problem.robot.nv
    states = zip(at.q.reshape(-1, n), at.v.reshape(-1, n), tau.reshape(-1, n), strict=True)
    a = np.array([function(*state) for state in states]).reshape(*t.shape, n)
    acceleration = 0.0 if problem.acceleration_limit is None else float(np.max(np.abs(a) / problem.acceleration_limit))
    if problem.jerk_limit is None:
        return acceleration, 0.0
    jerks = np.diff(a, axis=1) / np.diff(t, axis=1)[..., None]
    return acceleration, float(np.max(np.abs(jerks) / problem.jerk_limit))


def _aimed(problem: MinimumTimeProblem, course: Course, replay: Trajectory, checked: Checked) -> Course:
    """Aim beside via points and goal by what the replay misses them by."""
    missed = np.vstack([checked.via_errors, replay.q[-1] - problem.q_goal])
    return replace(
        course,
        offsets=np.broadcast_to(course.offsets, missed.shape) - missed,
        end_velocity=course.end_velocity - (replay.v[-1] - np.asarray(problem.v_goal)),
    )


def _stricter(problem: MinimumTimeProblem, course: Course, checked: Checked) -> Course:
    """Raise the margins of pairs that come too near; ask at more points where something is hit all the same."""
    rows = path_rows(problem)
    if checked.clearance is None or rows is None or checked.clearance.distance >= problem.clearance:
        return course
    model = collision_model(problem.robot, tuple(problem.obstacles), problem.self_collision)
    short: dict[tuple[str, str], float] = {}
    for names, distance in zip(model.pairs, checked.nearest, strict=True):
        for key in (names, names[::-1]):
            short[key] = max(short.get(key, 0.0), problem.clearance - float(distance))
    others = [
        problem.obstacles[pair.other].name if isinstance(pair.other, int) else pair.other_link for pair in rows.pairs
    ]
    missing = np.array([short.get((pair.link, other), 0.0) for pair, other in zip(rows.pairs, others, strict=True)])
    if checked.clearance.distance < -_DEEP and course.points < _MOST_POINTS:
        return replace(course, points=2 * course.points)
    margins = np.broadcast_to(course.margins, missing.shape) + np.where(missing > 0, missing + _SPARE, 0)
    return replace(course, margins=margins)


def constrained_optima(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    options: MinimumTimeOptions,
    stop: Stop,
    tell: Callable[[str], None],
) -> tuple[list[Constrained], Candidates]:
    """Optima of the mesh that keep the conditions along the way, as far as one that none left can beat.

    Args:
        problem: with conditions along the way.
        dynamics: of its robot.
        scheme: the transcription.
        options: how many guesses, on which meshes.
        stop: asked every few iterations.
        tell: told in words what is being tried.
    """
    scheme = scheme_for(problem, scheme)
    candidates = find_candidates(problem, dynamics, scheme, options, stop, tell)
    found: list[Constrained] = []
    listed = list(candidates.listed)
    for attempt in candidates.attempts if candidates.converged else ():
        best = min((each.refined.trajectory.duration for each in found if not any(each.good[:2])), default=np.inf)
        if found and (stop or attempt.trajectory.duration >= best):
            listed.append(attempt.trajectory.duration)
            continue
        tell(f"optimum {len(found) + 1}, about {attempt.trajectory.duration:.4f} s")
        found.append(settle(problem, dynamics, scheme, options, attempt, stop, tell))
    return found, replace(candidates, listed=tuple(listed))
