"""Synchronous profiles of single joints: the fastest motion wherever torques stay within their limits.

Every joint moves as fast as its own limits of velocity, acceleration and jerk allow, slowed down to the time of the
slowest one: no motion within these limits is faster, whatever its torques.
"""

from itertools import pairwise
from math import comb

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve import DEGREE, Basis, Curve, CurveLeg
from armdyn.optimal.curves.excess import excesses_of, forced_snap, worst_excess
from armdyn.optimal.curves.layout import rate_limits
from armdyn.optimal.mesh.search import SearchResult
from armdyn.optimal.problem.checks import ROUNDING
from armdyn.optimal.problem.planning_limits import Profiles
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import ON_CURVE
from armdyn.optimal.verify.costates import RATE_LIMITS, Share, shares_of
from armdyn.optimal.verify.optimum import Optimum
from armdyn.optimal.verify.within_limits import follow

_STEP = 1e-6
"""Part by which a limit is changed for the elasticity of the duration in it: the difference is exact to 1e-9."""
_APART = 1e-5
"""Least time between two changes of jerks, as a part of the duration: of nearer ones each is moved by less than that,
which changes accelerations by 1e-4 of their limits at most; the jerk of a leg of microseconds is rounding."""
_BERNSTEIN = np.array([[comb(i, k) / comb(DEGREE, k) for k in range(DEGREE)] for i in range(DEGREE + 1)])
"""Control points of the monomials to s³ on the basis of one interval, shape (DEGREE + 1, DEGREE)."""
_ACCELERATIONS = np.array([0, 1, 1, 0, 0, -1, -1])[:, None]
"""Accelerations at the beginning of the phases, as parts of the largest ones, shape (7, 1)."""
_JERKS = np.array([1, 0, -1, 0, -1, 0, 1])[:, None]
"""Jerks in the phases, as parts of the largest ones, shape (7, 1)."""


def profiles(task: Task) -> tuple[list[Optimum], SearchResult]:
    """The motion along all joints' profiles, replayed; none if a torque would exceed its limit.

    Args:
        task: a problem from rest to rest without via points, with limits of acceleration or jerk of all joints.
    """
    problem, numbers = task.problem, task.policy.curves
    original, found = TightenedConstraints.of(task), list[Optimum]()
    constraints, decides = original, _deciding(problem, original)
    for _ in range(numbers.rounds):
        velocity, *rates = rate_limits(problem, constraints).values()
        curve = synchronous(problem, ((1 - numbers.velocity_error) * velocity, *rates))
        if task.stop or worst_excess(excesses_of(task, curve)) > 0:
            break
        task.progress(f"replaying the joints' profiles of {curve.duration:.6f} s")
        target = curve.trajectory(problem.robot, _samples(task, curve), jumps=not problem.continuous_torque)
        replay = follow(task, target)
        reports = original.check(problem, replay, np.empty(0))
        every = problem.robot.joint_names
        found = [Optimum.of(problem, replay, len(curve.legs), None, ON_CURVE, every, reports=reports, decides=decides)]
        if not reports.reasons:
            break
        constraints = constraints.tightened(problem, reports)
    return found, SearchResult(())


def synchronous(problem: MinimumTimeProblem, limits: tuple[Array, ...]) -> Curve:
    """The joints' profiles with a common duration, a leg for every time in which no jerk changes.

    Args:
        problem: from rest to rest.
        limits: limits of velocity, acceleration and jerk [rad or m, s], each of shape (nv,).
    """
    way = problem.poses[-1] - problem.poses[0]
    found = Profiles.of(np.abs(way), *limits)
    T, moves = float(np.max(found.durations)), found.durations > 0
    phases = found.phases[:, moves] * (T / found.durations[moves])
    rising, steady, _, cruising, *_ = phases
    acceleration = way[moves] / (2 * rising + steady + cruising) / (rising + steady)
    jerk = np.divide(acceleration, rising, out=np.zeros_like(rising), where=rising > 0)
    a, j, starts = _ACCELERATIONS * acceleration, _JERKS * jerk, _before(phases)
    v = _before(a * phases + j * phases**2 / 2)
    q = _before(v * phases + a * phases**2 / 2 + j * phases**3 / 6)
    times = np.unique(starts)
    apart = _APART if np.all(rising > 0) else ROUNDING
    times = np.append(times[np.diff(times, append=T) > apart * T], T)
    legs = []
    for begin, end in pairwise(times):
        phase = np.sum(starts[1:] <= (begin + end) / 2, axis=0)
        at = tuple(np.take_along_axis(each, phase[None], axis=0)[0] for each in (q, v, a, j, starts))
        legs.append(_leg(problem.poses[0], moves, at, float(begin), float(end - begin)))
    return Curve(tuple(legs))


def _leg(start: Array, moves: Flags, at: tuple[Array, ...], begin: float, duration: float) -> CurveLeg:
    """Leg of cubics.

    Args:
        start: start of the motion [rad or m], shape (nv,).
        moves: joints that move, shape (nv,).
        at: these joints' distances from the start, velocities, accelerations, jerks and times where their phases begin.
        begin: start of the leg [s].
        duration: duration of the leg [s].
    """
    q, v, a, j, since = at
    t = begin - since
    q, v, a = q + v * t + a * t**2 / 2 + j * t**3 / 6, v + a * t + j * t**2 / 2, a + j * t
    points = np.tile(start, (DEGREE + 1, 1))
    points[:, moves] += _BERNSTEIN @ [q, v * duration, a * duration**2 / 2, j * duration**3 / 6]
    return CurveLeg(Basis(np.array([0.0, 1.0])), points, duration)


def _before(parts: Array) -> Array:
    """Sums of the rows before each row, shape (rows, columns)."""
    return np.concatenate([np.zeros_like(parts[:1]), np.cumsum(parts[:-1], axis=0)])


def _samples(task: Task, curve: Curve) -> list[int]:
    """Number of samples of every leg. Between samples h apart a jerk is off by up to h/2 M⁻¹τ''."""
    problem, numbers, (_, jerk) = task.problem, task.policy.curves, task.problem.rates
    least = task.policy.path_constraints.slow_samples / curve.duration
    counts = []
    for leg in curve.legs:
        off = float(np.max(np.abs(forced_snap(problem.robot, leg)) / jerk)) / 2
        density = np.clip(off / numbers.profile_jerk_error, least, 10 * least)
        counts.append(max(int(np.ceil(leg.duration * density)), numbers.samples))
    return counts


def _deciding(problem: MinimumTimeProblem, constraints: TightenedConstraints) -> tuple[Share, ...]:
    """The limits that decide the slowest joint's duration, largest share first."""
    way, limits = np.abs(problem.poses[-1] - problem.poses[0]), rate_limits(problem, constraints)
    times = Profiles.of(way, *limits.values()).durations
    joint = int(np.argmax(times))
    parts = {}
    for order, limit in RATE_LIMITS.items():
        changed = Profiles.of(way, *(limits | {order: limits[order] * (1 + _STEP)}).values()).durations
        parts[limit] = (1 - changed[[joint]] / times[joint]) / _STEP
    return shares_of(parts, (problem.robot.joint_names[joint],), _STEP)
