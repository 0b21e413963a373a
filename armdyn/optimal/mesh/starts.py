"""Initial guesses of a solve: a `Trajectory`, as for a coarse solution, or a `Curve`."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Self

import numpy as np
import pinocchio as pin
from scipy.interpolate import BPoly

from armdyn.arrays import Array, Index
from armdyn.dynamics.numeric import joint_inertia
from armdyn.models.reading.urdf_arm import configurations
from armdyn.optimal.constraints.registry import path_constraints_of
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.policy.search import SearchPolicy
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory
from armdyn.trajectory.interpolation import cubic

SAMPLES = 51
"""Samples of a guess: twice as many lead to the same optima on the search's meshes, and take twice as long."""


@dataclass(frozen=True, eq=False)
class Guesses:
    """Motions as initial guesses, all with the same number of samples.

    Attributes:
        t: times [s], from 0, shape (k, samples).
        q: joint positions [rad or m], shape (k, samples, nv).
        v: joint velocities [rad/s or m/s], shape (k, samples, nv).
        tau: joint torques [N m or N], shape (k, samples, nv).
    """

    t: Array
    q: Array
    v: Array
    tau: Array

    @property
    def durations(self) -> Array:
        """Duration of each guess [s], shape (k,)."""
        return np.asarray(self.t[:, -1])

    @classmethod
    def of(cls, motion: Trajectory) -> Self:
        """One guess, with a motion's samples."""
        return cls(motion.t[None] - motion.t[0], motion.q[None], motion.v[None], motion.tau[None])

    @classmethod
    def sampled(cls, motions: Sequence[Trajectory], samples: int) -> Self:
        """Sample motions at evenly spaced times, the same number for each."""
        t = [np.linspace(0, 1, samples) * motion.duration for motion in motions]
        at = [motion(motion.t[0] + times) for motion, times in zip(motions, t, strict=True)]
        return cls(np.stack(t), *(np.stack(parts) for parts in zip(*at, strict=True)))

    @classmethod
    def joined(cls, several: Sequence["Guesses"]) -> Self:
        """Concatenate guesses that have the same number of samples."""
        parts = zip(*((one.t, one.q, one.v, one.tau) for one in several), strict=True)
        return cls(*(np.concatenate(part) for part in parts))

    def chosen(self, which: Sequence[int]) -> "Guesses":
        """The guesses at given indices."""
        at: Index = np.array(which)
        return Guesses(self.t[at], self.q[at], self.v[at], self.tau[at])

    def motion(self, k: int, joint_names: tuple[str, ...]) -> Trajectory:
        """One guess as a motion."""
        return Trajectory(self.t[k], self.q[k], self.v[k], self.tau[k], joint_names, "start")

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and torques at times of each guess, shape (k, n); each result has shape (k, n, nv).

        Bitwise equal to `Trajectory`: last bits decide between optima that lie close together.
        """
        t, at = self.t, np.minimum(times, self.t[:, -1:])
        found = [np.searchsorted(own, some, side="right") - 1 for own, some in zip(t, at, strict=True)]
        k = np.clip(found, 0, self.q.shape[1] - 2)
        each = np.arange(len(k))[:, None]
        left, h = t[each, k], (t[each, k + 1] - t[each, k])[..., None]
        s = (at - left)[..., None] / h
        (q0, q1), (v0, v1), (tau0, tau1) = ((own[each, k], own[each, k + 1]) for own in (self.q, self.v, self.tau))
        return *cubic(s, h, (q0, q1), (v0, v1)), tau0 + s * (tau1 - tau0)


def via_guesses(
    problem: MinimumTimeProblem,
    seed: int,
    count: int,
    wide: tuple[float, float] = (1.0, 0.0),
    policy: SearchPolicy | None = None,
) -> list[list[Array]]:
    """Via poses of `spline`'s guesses: first the straight path, then paths through random poses.

    Args:
        problem: the minimum-time problem.
        seed: the same seed gives the same guesses.
        count: number of guesses.
        wide: distance of random poses from the middle of the path: standard deviation, in parts of the path's length,
            and the bound of a further uniform offset [rad or m].
        policy: settings of the search; None: those of the problem's policy.

    Returns:
        For each guess the via poses [rad or m], each of shape (nv,).
    """
    random, policy = np.random.default_rng(seed), policy or Policy.of(problem).search
    reach = np.maximum(np.abs(np.asarray(problem.q_goal) - np.asarray(problem.q_start)), policy.least_spread)
    middle = (np.asarray(problem.q_goal) + np.asarray(problem.q_start)) / 2
    lower, upper = problem.limits.position_lower, problem.limits.position_upper
    (spread, turn), size = wide, (count - 1, reach.size)
    vias = middle + spread * random.normal(size=size) * reach
    if turn:
        vias += random.uniform(-turn, turn, size)
    vias, straight = np.clip(vias, lower, upper), list(problem.poses[1:-1])
    if problem.via:  # a further pose on one of the legs
        legs = [int(random.integers(len(straight) + 1)) for _ in vias]
        return [straight, *([*straight[:leg], via, *straight[leg:]] for leg, via in zip(legs, vias, strict=True))]
    to_and_fro = swing_up_guesses(problem, random, (count - 1) // 2, policy.swing_ups, policy.midpoint_spread)
    through = [[via] for via in vias]
    through[1 : 2 * len(to_and_fro) : 2] = to_and_fro
    return [straight, *through]


def crossover(
    problem: MinimumTimeProblem,
    parents: Guesses,
    random: np.random.Generator,
    number: int,
    policy: SearchPolicy,
) -> Guesses:
    """A child of one of some motions, most often of one of the first, slowed down a little.

    A child has a small bend added to all joints, a detour of one joint, or the motions of some joints from another
    optimum. (Leary, Global optimization on funneling landscapes, 2000; of trajectories Vasile, Minisci and Locatelli,
    2011.)

    Args:
        problem: problem with the position limits that the child keeps.
        parents: motions, best first.
        random: random generator.
        number: index of the child: the kinds of change are used in turn.
        policy: sizes of the changes.
    """
    many = len(parents.t)
    chosen, other = random.exponential(policy.selection_scale, 2).astype(int) % many
    duration = parents.durations[chosen]
    q, v, tau = (part[chosen].copy() for part in (parents.q, parents.v, parents.tau))
    offset = np.zeros(q.shape[1])
    if number % 3 == 0:
        way = np.abs(np.asarray(problem.q_goal) - np.asarray(problem.q_start))
        offset = policy.midpoint_spread * random.normal(size=offset.size) * np.maximum(way, policy.least_spread)
    elif number % 3 == 1 and many > 1 and offset.size > 1:
        mate = other if other != chosen else (chosen + 1) % many
        taken = random.permutation(offset.size) < random.integers(1, offset.size)
        q[:, taken], tau[:, taken] = parents.q[mate][:, taken], parents.tau[mate][:, taken]
        v[:, taken] = parents.v[mate][:, taken] * parents.durations[mate] / duration
    else:
        offset[random.integers(offset.size)] = policy.joint_offset * random.uniform(-1, 1)
    s = np.linspace(0, 1, len(q))
    bump = 4 * s * (1 - s)
    q += (bump**3)[:, None] * offset
    v += (12 * bump**2 * (1 - 2 * s))[:, None] * offset / duration
    q[1:-1] = np.clip(q[1:-1], problem.limits.position_lower, problem.limits.position_upper)
    return Guesses(
        s[None] * (policy.mutation_duration * duration), q[None], v[None] / policy.mutation_duration, tau[None]
    )


def _path(problem: MinimumTimeProblem, way: list[Array], samples: int) -> tuple[Array, ...]:
    """Samples of a smooth path from start to goal through poses at equal fractions of s: q, dq/ds, d²q/ds²."""
    poses = np.array([problem.q_start, *way, problem.q_goal])
    return tuple(blend @ poses for blend in _blends(len(poses), samples))


@cache
def _blends(poses: int, samples: int) -> tuple[Array, Array, Array]:
    """Weights of poses in a path's samples, first and second derivatives, each of shape (samples, poses).

    Between poses the path is of fifth degree, with zero second derivative at them and zero first derivative at the
    ends.
    """
    fraction, one = np.linspace(0, 1, poses), np.eye(poses)
    derivatives = np.zeros_like(one)
    if poses > 2:
        derivatives[1:-1] = np.asarray(np.gradient(one, fraction, axis=0))[1:-1]
    path = BPoly.from_derivatives(fraction, np.stack([one, derivatives, np.zeros_like(one)], axis=1))
    s = np.linspace(0, 1, samples)
    return path(s), path.derivative()(s), path.derivative(2)(s)


def spline(problem: MinimumTimeProblem, via: list[Array], duration_factor: float = 1.0) -> Trajectory:
    """A smooth path from start to goal through poses, timed so that the torques roughly fit their limits.

    Args:
        problem: problem with start, goal and limits.
        via: via poses [rad or m], each of shape (nv,), at equal fractions of the time; none: the
            problem's own.
        duration_factor: duration of the guess over that at which its torques fit.
    """
    return splines(problem, [via], duration_factor).motion(0, problem.robot.joint_names)


def splines(problem: MinimumTimeProblem, vias: Sequence[list[Array]], duration_factor: float = 1.0) -> Guesses:
    """`spline` through the poses of each path."""
    each = [_path(problem, via or list(problem.poses[1:-1]), SAMPLES) for via in vias]
    q, dq, ddq = paths = tuple(np.stack(part) for part in zip(*each, strict=True))
    # Torque along a path is static + inertial / T² + friction.
    friction, rest = problem.robot.friction, np.zeros_like(q)
    static = _torques(problem, q, rest, rest)
    inertial = _torques(problem, q, dq, ddq) - friction.torque(dq) - static
    durations = _fitting_durations(problem, paths, inertial)
    for k, via in enumerate(vias):
        if len(via) != 1:  # no swing through a single random pose
            durations[k] = max(durations[k], swinging_time(problem, static[k], inertial[k]))
    T = durations[:, None, None]
    v = dq / T
    tau = static + inertial / T**2 + friction.torque(v)
    tau = problem.limits.actuators.clip(tau, q, v)
    v[:, 0], v[:, -1] = problem.v_start, problem.v_goal
    shares = np.maximum(duration_factor, problem.duration_bound() / durations)
    v[:, 1:-1] /= shares[:, None, None]
    return Guesses(np.linspace(0, shares * durations, SAMPLES, axis=1), q, v, tau)


def _torques(problem: MinimumTimeProblem, q: Array, v: Array, a: Array) -> Array:
    """Torques by `pin.rnea`: near-equal optima depend on their last bits."""
    robot, model = problem.robot, problem.robot.model
    data, at, n = model.createData(), configurations(model), robot.nv
    rows = zip(*(part.reshape(-1, n) for part in (q, v, a)), strict=True)
    torques = np.array([pin.rnea(model, data, at(x), y, z) for x, y, z in rows])
    return torques.reshape(q.shape) + robot.friction.torque(v)


def _fitting_durations(problem: MinimumTimeProblem, paths: tuple[Array, ...], inertial: Array) -> Array:
    """Times [s] in which paths' inertial torques reach their limits, within limits of speed and path constraints.

    Torque along a path is I/T² + F/T, inertial and viscous, without gravity, which a dynamic motion may overcome, and
    dry friction: only scalable parts are fitted.
    """
    limits, (_, dq, _) = problem.limits, paths
    viscous = np.maximum(np.sign(inertial) * np.asarray(problem.robot.friction.damping) * dq, 0)
    bound = np.where(inertial > 0, limits.actuators.upper, -limits.actuators.lower)
    bound = np.maximum(bound, 2e-3 * limits.actuators.scale)
    bound[..., limits.passive] = np.inf  # without a motor: no torque keeps these on the path
    half = viscous / (2 * bound)
    by_torque = np.max(half + np.sqrt(half**2 + np.abs(inertial) / bound), axis=(1, 2))
    by_speed = np.max(np.abs(dq) / limits.velocity, axis=(1, 2))
    least = max(problem.duration_bound(), _stopping_time(problem), 1e-6)
    required = [
        max([constraint.least_duration(problem, *path) for constraint in path_constraints_of(problem)], default=least)
        for path in zip(*paths, strict=True)
    ]
    return np.asarray(np.maximum.reduce([by_torque, by_speed, np.array(required), np.full(len(dq), least)]))


def _stopping_time(problem: MinimumTimeProblem) -> float:
    """Time [s] in which torques of half their ranges change the velocity, each joint alone, at the start."""
    motors, inertia = ~problem.limits.passive, np.diag(joint_inertia(problem.robot)(problem.poses[0]))
    change = np.abs(np.asarray(problem.v_goal) - np.asarray(problem.v_start))
    times = change[motors] * inertia[motors] / problem.limits.actuators.half_range[motors]
    return float(np.max(times))


_ALIKE = 0.1
"""Cosine between gravity's and the required torques along a path, below which gravity does not drive the motion."""


def swing_up_guesses(
    problem: MinimumTimeProblem, random: np.random.Generator, count: int, swings: Sequence[int], spread: float
) -> list[list[Array]]:
    """Paths on which joints without a motor swing further and further, until the last swing reaches the goal.

    Weak motors need that many swings, and guesses straight to the goal then lead to no motion.

    Args:
        problem: the minimum-time problem.
        random: random generator of amplitudes, and of the poses of joints with a motor.
        count: number of paths.
        swings: numbers of swings, used in turn.
        spread: of the paths: standard deviation of the logarithm of a swing, and of other poses [rad or m].

    Returns:
        For each path the via poses [rad or m], each of shape (nv,); empty if no such joint moves.
    """
    start, away = np.asarray(problem.q_start), np.asarray(problem.q_goal) - np.asarray(problem.q_start)
    passive, limits = problem.limits.passive, problem.limits
    if not np.any(away[passive]):
        return []
    vias = []
    for k in range(count):
        most = swings[k % len(swings)]
        parts = np.arange(1, most + 1)[:, None] / (most + 1)
        sides = np.where((most - np.arange(most))[:, None] % 2, -1.0, 1.0)  # the last swing is away from the goal
        swung = parts * sides * away * random.lognormal(0, spread, (most, away.size))
        moved = parts * away + random.normal(0, spread, (most, away.size))
        poses = start + np.where(passive, swung, moved)
        vias.append(list(np.clip(poses, limits.position_lower, limits.position_upper)))
    return vias


def swinging_time(problem: MinimumTimeProblem, static: Array, inertial: Array) -> float:
    """Duration [s] in which gravity comes nearest to driving joints without a motor along a path; 0: none.

    The required torque of such a joint is static + inertial / T²: least squares for 1 / T².

    Args:
        problem: problem with the limits.
        static: torques that hold the arm along the path [N m or N], shape (samples, nv).
        inertial: torques that move it along the path in one second, likewise.
    """
    passive = problem.limits.passive
    held, moved = static[:, passive], inertial[:, passive]
    against, size = -float(np.sum(held * moved)), float(np.linalg.norm(held) * np.linalg.norm(moved))
    return float(np.linalg.norm(moved) / np.sqrt(against)) if against > _ALIKE * size else 0.0
