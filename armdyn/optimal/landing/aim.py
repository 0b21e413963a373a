"""Brings the replay of a mesh's torques onto the goal, by changing them as little as that takes.

A mesh's torques are constant between knots. Where the motion ends depends on them through the variational
equations δẋ = ∂f/∂x δx + ∂f/∂τ δτ along the replay (Bryson and Ho, Applied Optimal Control, section 2.4): the
smallest change within the torque limits that cancels the miss, and Newton's method by repeating it.
"""

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from armdyn.models.robot import Robot
from armdyn.optimal.landing.feedback import Step, tracked
from armdyn.optimal.landing.pace import paced, paced_torques
from armdyn.optimal.landing.rollout import replay_torques
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.proof.certificate import excess
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_ROUNDS = 8
_LANDED = 1e-9
"""Miss of the goal [rad or m] that is a few of the integrator's own."""
_LEADS = 12
"""Rounds of feedback; each halves the miss or so."""
_ASTRAY = 1e-3
"""Miss of the goal [rad or m, and their rates] that Newton's method cannot have left where it converges."""
_FAR = 0.1
"""Miss beyond which the replay is no neighbour of what is sought."""
_STEPS = 600
"""Steps of the variational equations, about: a step of 1 ms resolves a turn through dry friction."""
_SAMPLES = 8
"""Of the motion under each constant torque."""
_BELOW = 1e-8
"""Part of a velocity limit that is kept from it: what interpolation between samples may be off."""
_NEAR = 1e-3
"""Part of a velocity limit within which a velocity is held where it is while the goal is corrected."""
_RANK = 1e-10
"""Of what the torques can do about the goal and the velocities, as a part of the most that they can: rounding."""
_LONGER = 10.0
"""Cost of a change of the duration against that of all torques by the same part of their limits."""


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Torques that are constant piece by piece.

    Attributes:
        t: their ends [s], shape (P + 1,).
        tau: shape (P, nv).
    """

    t: Array
    tau: Array

    def trajectory(self, like: Trajectory) -> Trajectory:
        """The same as samples, with the states of a trajectory that they are near to."""
        times, torques = [], []
        for k, tau in enumerate(self.tau):
            last = k == len(self.tau) - 1
            within = np.linspace(self.t[k], self.t[k + 1], _SAMPLES + 1)
            times += [*within[:-1], within[-1] if last else np.nextafter(within[-1], 0)]
            torques += [tau] * (_SAMPLES + 1)
        part = np.array(times) / self.t[-1]
        at = like(like.t[0] + part * like.duration)
        return replace(like, t=np.array(times), q=at.q, v=at.v, tau=np.array(torques))


def aimed(problem: MinimumTimeProblem, trajectory: Trajectory, stop: Stop) -> tuple[Trajectory, Trajectory]:
    """A motion whose replay lands, and that replay; unchanged where torques are not constant or far from it.

    Where the replay of a larger arm goes astray, feedback leads it along the mesh's motion, as much slower as its
    velocity limits ask; up to three joints a finer mesh is the better answer.

    Args:
        problem: its goal, and limits of torque and velocity.
        trajectory: a collocation solution.
        stop: asked at every step.
    """
    replay = replay_torques(problem.robot, trajectory)
    best = _by_newton(problem, trajectory, replay, stop)
    if problem.robot.nv > 3 and not stop and _astray(problem, *best[:2]):
        best = min(best, led_home(problem, trajectory, stop), key=lambda found: found[2])
    return best[:2]


def _astray(problem: MinimumTimeProblem, wanted: Trajectory, replay: Trajectory) -> bool:
    return bool(replay.t[-1] != wanted.t[-1] or np.max(np.abs(problem.beside_goal(replay))) > _ASTRAY)


def led_home(problem: MinimumTimeProblem, mesh: Trajectory, stop: Stop) -> tuple[Trajectory, Trajectory, float]:
    """The mesh's motion led by feedback, aimed beside the goal by what it missed before.

    Args:
        problem: its goal, and limits of torque and velocity.
        mesh: a collocation solution.
        stop: asked before every round.

    Returns:
        The motion, its replay, and the largest error of goal or velocity; infinite if there is nothing to lead.
    """
    pieces, factor, offset = _pieces(mesh), 1.0, np.zeros(2 * problem.robot.nv)
    best, rank = (mesh, mesh, np.inf), (True, np.inf)
    for _ in range(_LEADS):
        led = None if pieces is None else _led(problem, mesh, pieces, factor, offset)
        if led is None:
            break
        replay = replay_torques(problem.robot, led)
        miss = _miss(problem, led, replay)
        over = float(np.max(excess(problem, replay).velocity / problem.limits.velocity))
        if (over > _BELOW, miss) < rank:
            rank, best = (over > _BELOW, miss), (replace(replay, name=mesh.name), replay, miss)
        error = problem.beside_goal(replay)
        if miss <= _LANDED or stop or replay.t[-1] != led.t[-1] or np.max(np.abs(error)) > _FAR:
            break
        offset = offset - error
        if over > 0 and problem.from_rest_to_rest:
            factor *= 1 + over + _BELOW
    return best


def _led(
    problem: MinimumTimeProblem, mesh: Trajectory, pieces: _Pieces, factor: float, offset: Array
) -> Trajectory | None:
    """The mesh's motion, its time scaled by a factor, led by feedback to beside the goal; None if it was lost."""
    motion, limits, tau = paced(mesh, factor), problem.limits, pieces.tau
    if factor != 1:
        middles = mesh((pieces.t[:-1] + pieces.t[1:]) / 2)
        tau = paced_torques(problem.robot, middles, tau, factor)
        tau = np.asarray(np.clip(tau, limits.effort_lower, limits.effort_upper))
    eased = _Pieces(factor * pieces.t, tau)
    led = tracked(problem, motion, eased.t, tau, _steps(problem.robot, eased, motion), offset)
    return None if led is None else _Pieces(eased.t, led).trajectory(motion)


def _by_newton(
    problem: MinimumTimeProblem, trajectory: Trajectory, replay: Trajectory, stop: Stop
) -> tuple[Trajectory, Trajectory, float]:
    """A motion, its replay and its miss, which Newton's method makes as small as it can."""
    miss, pieces = _miss(problem, trajectory, replay), _pieces(trajectory)
    for _ in range(_ROUNDS):
        if pieces is None or miss <= _LANDED or miss > _FAR or stop:
            break
        pieces = _corrected(problem, pieces, replay)
        tried = pieces.trajectory(replay)
        replayed = replay_torques(problem.robot, tried)
        closer = _miss(problem, tried, replayed)
        if closer > 0.5 * miss:
            break
        trajectory = replace(replayed, name=trajectory.name)
        replay, miss = replayed, closer
    return trajectory, replay, miss


def _miss(problem: MinimumTimeProblem, wanted: Trajectory, replay: Trajectory) -> float:
    """Largest error of the goal state, or excess of a velocity [rad, m, and their rates]; infinite if it broke off."""
    if replay.t[-1] != wanted.t[-1]:
        return float("inf")
    error = np.max(np.abs(problem.beside_goal(replay)))
    return float(max(error, np.max(np.abs(replay.v) - problem.limits.velocity)))


def _pieces(trajectory: Trajectory) -> _Pieces | None:
    t, tau = trajectory.t, trajectory.tau
    passes = np.diff(t) > 2 * np.spacing(t[1:])
    if not np.array_equal(tau[1:][passes], tau[:-1][passes]):
        return None
    first = np.append(True, np.any(tau[1:] != tau[:-1], axis=1))[:-1] & passes
    first[0] = True
    starts = np.flatnonzero(first)
    return _Pieces(np.append(t[starts], t[-1]), tau[starts])


def _corrected(problem: MinimumTimeProblem, pieces: _Pieces, replay: Trajectory) -> _Pieces:
    """One step of Newton's method: the smallest change that, to first order, lands and keeps velocity limits."""
    limits, n = problem.limits, problem.robot.nv
    half = (limits.effort_upper - limits.effort_lower) / 2
    by_torque, by_time = _sensitivity(problem.robot, pieces, replay)
    columns = np.concatenate([by_torque * np.tile(half, len(pieces.tau)), by_time[..., None] / _LONGER], axis=2)
    # A velocity is steered at the knots, so that it keeps its limit within the pieces on either side, too.
    within = np.linspace(pieces.t[:-1], pieces.t[1:], _SAMPLES + 1)
    v = replay(np.minimum(within, replay.t[-1])).v
    room = limits.velocity * (1 - _BELOW) - np.max(np.abs(v), axis=0)
    room = np.minimum(room[:-1], room[1:])
    fast = room < _NEAR * np.where(np.isinf(limits.velocity), 0.0, limits.velocity)
    slower = np.sign(v[-1, :-1]) * np.minimum(room, 0.0)
    rows = np.concatenate([columns[:-1, n:][fast], columns[-1]])
    target = np.concatenate([slower[fast], -problem.beside_goal(replay)])
    lower = np.append(((limits.effort_lower - pieces.tau) / half).ravel(), -0.5)
    upper = np.append(((limits.effort_upper - pieces.tau) / half).ravel(), 0.5)
    change = _smallest(rows, target, lower, upper)
    tau = pieces.tau + change[:-1].reshape(pieces.tau.shape) * half
    return _Pieces(pieces.t * (1 + change[-1] / _LONGER), np.clip(tau, limits.effort_lower, limits.effort_upper))


def _smallest(rows: Array, target: Array, lower: Array, upper: Array) -> Array:
    """The least-norm y of rows y = target; what leaves its bounds is held on them and the rest solved again."""
    free, y = np.ones(lower.size, dtype=bool), np.zeros(lower.size)
    while True:
        y[free] = np.linalg.lstsq(rows[:, free], target - rows[:, ~free] @ y[~free], rcond=_RANK)[0]
        beyond = free & ((y < lower) | (y > upper))
        if not np.any(beyond):
            return y
        y[beyond] = np.clip(y, lower, upper)[beyond]
        free &= ~beyond


def _sensitivity(robot: Robot, pieces: _Pieces, replay: Trajectory) -> tuple[Array, Array]:
    """∂x at the pieces' ends by all torques, shape (P, 2 nv, P nv), and by a stretch of time, shape (P, 2 nv)."""
    n, P = robot.nv, len(pieces.tau)
    by_torque, by_time = np.zeros((P, 2 * n, P * n)), np.zeros((P, 2 * n))
    for k, step in enumerate(_steps(robot, pieces, replay)):
        if k:
            by_torque[k], by_time[k] = step.through @ by_torque[k - 1], step.through @ by_time[k - 1]
        by_torque[k, :, n * k : n * (k + 1)] = step.forced
        by_time[k] += step.stretched
    return by_torque, by_time


def _steps(robot: Robot, pieces: _Pieces, motion: Trajectory) -> list[Step]:
    """From every piece's start to its end, along a motion."""
    n, duration = robot.nv, pieces.t[-1]
    model, data, friction = robot.model, robot.model.createData(), robot.friction
    counts = np.maximum(np.ceil(_STEPS * np.diff(pieces.t) / duration).astype(int), 2)
    found = []
    for k, count in enumerate(counts.tolist()):
        h = (pieces.t[k + 1] - pieces.t[k]) / count
        middles = motion(np.minimum(pieces.t[k] + h * (np.arange(count) + 0.5), motion.t[-1]))
        through, forced, stretched = np.eye(2 * n), np.zeros((2 * n, n)), np.zeros(2 * n)
        rates = np.zeros((count, 2 * n))
        blocks = np.zeros((count, 3 * n, 3 * n))
        blocks[:, :n, n : 2 * n] = np.eye(n)
        for block, rate, q, v in zip(blocks, rates, middles.q, middles.v, strict=True):
            pin.computeABADerivatives(model, data, robot.configuration(q), v, pieces.tau[k] - friction.torque(v))
            inverse = np.triu(data.Minv) + np.triu(data.Minv, 1).T
            block[n : 2 * n, :n] = data.ddq_dq
            block[n : 2 * n, n : 2 * n] = data.ddq_dv - inverse * friction.slope(v)
            block[n : 2 * n, 2 * n :] = inverse
            rate[:n], rate[n:] = v, data.ddq
        for part, rate in zip(_exponentials(h * blocks), rates, strict=True):
            own = part[: 2 * n, : 2 * n]
            through, forced = own @ through, own @ forced + part[: 2 * n, 2 * n :]
            stretched = own @ stretched + h * rate
        found.append(Step(through, forced, stretched))
    return found


def _exponentials(matrices: Array) -> Array:
    """The exponential of every matrix, shape (m, k, k): four terms for a sixteenth of it, squared four times."""
    small, one = matrices / 16, np.eye(matrices.shape[-1])
    power = one + small @ (one + small / 2 @ (one + small / 3 @ (one + small / 4)))
    for _ in range(4):
        power = power @ power
    return np.asarray(power)
