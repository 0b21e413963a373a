"""Fallbacks without a motion to the goal: the rest of the last returned motion, a stop, or rest."""

from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.curves.curve import CurveLeg
from armdyn.optimal.curves.live import LiveProblem, acceleration_excess
from armdyn.optimal.problem.checks import held
from armdyn.optimal.problem.status import Status
from armdyn.optimal.verify.certificate import LIMIT_TOLERANCE
from armdyn.optimal.verify.within_limits import limit_violation
from armdyn.trajectory import Trajectory

_SECONDS = 0.1
"""Time that weighs velocities against positions in the search for a state on a motion, and a rest's duration [s]."""
_LEAST = 1e-6
"""Remaining time of a motion below which the motion counts as finished [s]."""
_NEWTON = 4
"""Number of refinements of that time from the nearest sample: the last one is below a nanosecond."""


@dataclass(frozen=True, eq=False)
class LastMotion:
    """A motion that the arm may be executing.

    Attributes:
        motion: from its start to rest.
        settled: whether the motion converged to its least duration.
    """

    motion: Trajectory
    settled: bool = True

    def passed(self, q: Array, v: Array) -> float:
        """Time on the motion at which it is nearest to a state [s]; states of shape (nv,)."""
        motion = self.motion
        far = np.sum((motion.q - q) ** 2, axis=1) + _SECONDS**2 * np.sum((motion.v - v) ** 2, axis=1)
        t = float(motion.t[np.argmin(far)])
        for _ in range(_NEWTON):
            h = 1e-4 * motion.duration
            before, after = max(t - h, motion.t[0]), min(t + h, motion.t[-1])
            at = motion(np.array([before, t, after]))
            own, speed, a = at.q[1], at.v[1], (at.v[2] - at.v[0]) / (after - before)
            derivative = (q - own) @ speed + _SECONDS**2 * (v - speed) @ a
            size = speed @ speed + _SECONDS**2 * a @ a
            t = float(np.clip(t + derivative / size if size > 0 else t, motion.t[0], motion.t[-1]))
        return t


def fallback(live: LiveProblem, last: LastMotion | None) -> tuple[Status, Trajectory] | None:
    """A motion to rest within all limits, and its status; None if none of those tried is within them.

    Args:
        live: the problem.
        last: last returned motion.
    """
    rest = None if last is None else rest_of_last(live, last)
    if rest is not None:
        return Status.FOLLOWED if np.any(rest.v) else Status.STOPPED, rest
    stop = _brake(live) if np.any(live.v) else at_rest(live, live.problem.poses[0])
    return None if stop is None else (Status.STOPPED, stop)


def rest_of_last(live: LiveProblem, last: LastMotion) -> Trajectory | None:
    """The rest of the last motion from the start state on; None: the state is not on it, or a limit is violated now."""
    q = live.problem.poses[0]
    t, end = last.passed(q, live.v), float(last.motion.t[-1])
    at = last.motion(t)
    far = max(np.max(np.abs(at.q - q)), np.max(np.abs(at.v - live.v)) / 100)
    on_it = far <= live.numbers.live.same_position and last.motion.model_hash == live.problem.robot.model_hash
    if not on_it or end - t < _LEAST:
        return None
    left = last.motion.slice(t, end)
    rest = replace(left, t=left.t - t, name="rest of the last motion")
    return rest if _within_limits(live, rest) else None


def at_rest(live: LiveProblem, q: Array) -> Trajectory | None:
    """Rest at joint positions, shape (nv,); None: the motors cannot hold the arm there."""
    robot = live.problem.robot
    hold = robot.holding_torque(q)
    stay = Trajectory.at_rest(q, hold, _SECONDS, robot.joint_names, name="stays", model_hash=robot.model_hash)
    return stay if _within_limits(live, stay) else None


def _brake(live: LiveProblem) -> Trajectory | None:
    """The shortest of the tried stops within all limits, along the straight line of the velocity.

    Its accelerations are constant: after the time T the arm rests at q + v T / 2. T grows by a factor, from half of
    the time of the weakest joint by its inertia.
    """
    policy, basis, v = live.numbers.live, live.basis, live.v
    robot, start = live.problem.robot, live.problem.poses[0]
    duration = float(np.max(np.abs(v) * np.diag(live.inertia(start)) / live.half)) / 2
    places = basis.places  # splines have all parabolas: interpolation is exact
    shape = np.linalg.solve(basis.values(places, 0), places - places**2 / 2)[:, None]
    for _ in range(policy.brakes):
        sampled = live.check(CurveLeg(basis, start + shape * v * duration, duration))
        end = sampled.q[-1]
        if live.within_limits(sampled) and np.all(held(robot, live.problem.limits, end, np.zeros_like(end))[1]):
            return live.motion_of(sampled, "stop")
        duration *= policy.longer
    return None


def _within_limits(live: LiveProblem, motion: Trajectory) -> bool:
    """Whether a motion satisfies limits of torque, velocity, position and acceleration, and distances."""
    faster = acceleration_excess(motion.t, motion.q, motion.v, live.problem.rates[0])
    kept = max(limit_violation(live.problem.limits, motion), faster) <= LIMIT_TOLERANCE
    return kept and live.clear(motion)
