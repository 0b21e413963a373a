"""From a mesh's motion to the fastest motion of its bang arcs, with exact switching times and costates.

The switches are read off the mesh: the sign of every torque, and the times at which one changes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.dynamics.numeric import joint_inertia
from armdyn.models.values.actuator_limits import ActuatorLimits
from armdyn.optimal.polish.bang_motion import BangMotion, carried, fastest
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import Arc, Mode
from armdyn.optimal.verify.certificate import GOAL_TOLERANCE, OPTIMALITY_TOLERANCE
from armdyn.optimal.verify.costates import Phases
from armdyn.optimal.verify.rollout import gauss_steps, replay_of, scales_of
from armdyn.optimal.verify.within_limits import BETWEEN
from armdyn.trajectory import Trajectory

_QUADRATURE = tuple((np.polynomial.legendre.leggauss(5) + np.array([[1.0], [0.0]])) / 2)
"""Gauss points in a segment, as parts of it, and their weights: of order ten, integrals are right to 1e-6."""

_Along = tuple[Array, Array, Array]
"""(q, v) and its costates [s/rad, s²/rad], shape (segments, points, 2 nv), and S [s/(N m)], shape (…, nv)."""
Structure = tuple[tuple[float, ...], tuple[int, ...]]
"""First signs of the torques, and the joints that switch, in order."""


@dataclass(frozen=True, eq=False)
class Switches:
    """Torques that are always on a limit: the first one of every joint, and when each changes to the other one.

    Attributes:
        first: 1 for the upper, -1 for the lower torque limit at the start, shape (nv,).
        times: switching times, increasing [s], shape (K - 1,).
        joint: joint of each switch, shape (K - 1,).
        duration: of the motion [s].
    """

    first: Array
    times: Array
    joint: Index
    duration: float

    @classmethod
    def ordered(cls, first: Array, times: Sequence[Array], duration: float) -> "Switches":
        """Switches from the times of each joint, of which two that met or crossed vanish, as do those beyond an end.

        Args:
            first: signs of the torques before any switch, shape (nv,).
            times: switching times of each joint, meant to increase [s].
            duration: of the motion [s].
        """
        signs, kept, joints = first.copy(), list[Array](), list[Index]()
        for i, own in enumerate(times):
            row: list[float] = []
            for time in own.tolist():
                if row and time <= row[-1]:
                    row.pop()
                else:
                    row.append(time)
            early = sum(time <= 0 for time in row)
            signs[i] *= (-1) ** early
            row = [time for time in row if 0 < time < duration]
            kept.append(np.array(row))
            joints.append(np.full(len(row), i))
        every = np.concatenate(kept)
        order = np.argsort(every, kind="stable")
        return cls(signs, every[order], np.concatenate(joints)[order], duration)

    @property
    def structure(self) -> Structure:
        """The switches without their times."""
        return tuple(self.first.tolist()), tuple(self.joint.tolist())

    @property
    def by_joint(self) -> list[Array]:
        """Switching times of each joint [s]."""
        return [self.times[self.joint == i] for i in range(self.first.size)]

    @property
    def signs(self) -> Array:
        """Signs of the torques in the arcs between switches, shape (K, nv)."""
        turned = np.cumsum(self.joint[:, None] == np.arange(self.first.size), axis=0)
        return np.vstack([self.first, self.first * (-1.0) ** turned])

    @property
    def lengths(self) -> Array:
        """Lengths of the arcs [s], shape (K,)."""
        return np.diff(np.concatenate([[0.0], self.times, [self.duration]]))


def switches_by(own: Switches, times: Array, switching: Array) -> Switches:
    """Switches with further ones where the torques have the wrong sign by the costates.

    A torque lowers H where it and its switching function S have opposite signs. Where it does not, an arc on the other
    limit is inserted: all of a stretch at an end of the motion; within a bang arc a quarter of the stretch; and where S
    touches zero at a switch, around that switch.

    Args:
        own: the switches.
        times: increasing, none of them at a switch [s], shape (m,).
        switching: S there, shape (m, nv).
    """
    first, found = own.first.copy(), list[Array]()
    for i, switches in enumerate(own.by_joint):
        signs = first[i] * (-1.0) ** np.searchsorted(switches, times)
        edges = np.diff(np.pad((signs * switching[:, i] > 0).astype(int), 1))
        added = list[list[float]]()
        begins, ends = np.flatnonzero(edges > 0).tolist(), np.flatnonzero(edges < 0).tolist()
        for k, m in zip(begins, ends, strict=True):
            begin, end = float(times[max(k - 1, 0)]), float(times[min(m, times.size - 1)])
            if k == 0:
                first[i] *= -1
                added.append([end])
            elif m == times.size:
                added.append([begin])
            else:
                inside = [one for one in switches.tolist() if begin < one < end]
                whole = end - begin
                within = [begin + 3 / 8 * whole, begin + 5 / 8 * whole]
                added.append([inside[0] - whole / 4, (inside[0] + end) / 2] if inside else within)
        found.append(np.sort(np.concatenate([switches, *added])))
    return Switches.ordered(first, found, own.duration)


def switches_of(motion: Trajectory, limits: ActuatorLimits, least: float = 0.0) -> Switches:
    """The switches of a motion with torques held between its samples.

    An interval whose torque is between its limits holds a switch, or two: its mean torque says where.

    Args:
        motion: motion with torques near their limits, but for intervals with a switch.
        limits: torque limits, constant ones.
        least: least part of an interval on the limit that neither neighbour is on, which is no rounding.
    """
    lengths = np.diff(motion.t)
    whole = np.flatnonzero(lengths > 1e-12 * motion.duration)
    begin, lengths = motion.t[whole], lengths[whole]
    levels = (motion(begin + lengths / 2).tau - limits.center) / limits.scale
    signs = np.where(levels > 0, 1.0, -1.0)
    found = [_switches(*columns, begin, lengths, least) for columns in zip(levels.T, signs.T, strict=True)]
    first = signs[0] * [turned for turned, _ in found]
    return Switches.ordered(first, [times for _, times in found], motion.duration)


def _switches(levels: Array, signs: Array, begin: Array, lengths: Array, least: float) -> tuple[float, Array]:
    """Switching times of one joint, and -1 if the torque begins on the limit opposite to the first interval's mean.

    Where the mean torque changes its sign from an interval to the next, the torque switches once. An interval away
    from such changes, of which a part is on the opposite limit while both neighbours are wholly on theirs, holds two
    switches, placed around its middle; the first and the last interval hold one.

    Args:
        levels: mean torques of the intervals, -1 and 1 on the limits, shape (K,).
        signs: their signs, shape (K,).
        begin: starts of the intervals [s], shape (K,).
        lengths: lengths of the intervals [s], shape (K,).
        least: see `switches_of`.
    """
    away = (1 - np.abs(levels)) / 2 * lengths  # time on the other limit
    last = np.flatnonzero(np.diff(signs) != 0)  # intervals before a change of sign
    times = [begin[last + 1] - away[last] + away[last + 1]]
    at_change = np.zeros(levels.size, bool)
    at_change[last] = at_change[last + 1] = True
    full = np.pad(np.abs(levels) > 1 - 2 * least, 1, constant_values=True)
    alone = (away > least * lengths) & full[:-2] & full[2:] & ~at_change
    at_start, at_end = bool(alone[0]), bool(alone[-1])
    times += [begin[:1] + away[:1]] * at_start + [begin[-1:] + lengths[-1:] - away[-1:]] * at_end
    alone[[0, -1]] = False
    middle = begin[alone] + lengths[alone] / 2
    times += [middle - away[alone] / 2, middle + away[alone] / 2]
    return -1.0 if at_start else 1.0, np.sort(np.concatenate(times))


def polished(task: Task, motion: Trajectory, solved: set[Structure]) -> Phases | None:
    """The fastest motion with a mesh's switches, or near ones, on the goal when replayed; None if there is none near.

    It satisfies Pontryagin's conditions at its switches; its certificate says whether it does so between them, and
    whether it keeps the limits of position and velocity.

    Args:
        task: problem with constant torque limits, whose cost is time alone.
        motion: motion with torques held between its samples.
        solved: structures whose fastest motion is no extremal, and is not sought again; extended here.
    """
    found = None if _touches(task, motion) else _solved(task, motion, solved)
    if found is None:
        return None
    numbers, goal = task.policy.polish, found[1].goal
    best, least = None, np.inf
    for _ in range(numbers.rounds):
        phases = _phases(task, *found)
        replay = replay_of(task, phases.torques)
        miss = task.problem.goal_error_of(replay)
        missed = float(np.max(np.abs(miss))) if replay.t[-1] == phases.duration else np.inf
        closer = missed < least / 2
        best, least = (phases, missed) if missed < least else (best, least)
        if missed <= GOAL_TOLERANCE / 100 or not closer or task.stop:
            break
        goal = goal - miss / found[1].size
        again, left = fastest(replace(found[1], goal=goal))
        if left is not None:
            break
        found = found[0], again, _along(task, again)
    return best


def _touches(task: Task, motion: Trajectory) -> bool:
    """Whether a motion touches a limit of position or velocity between its ends."""
    limits, near, inner = task.problem.limits, task.policy.arcs.touching, slice(1, -1)
    margin = np.minimum(motion.q - limits.position_lower, limits.position_upper - motion.q)[inner]
    fast = np.abs(motion.v[inner]) >= (1 - near) * limits.velocity
    return bool(np.any(margin <= near * np.ptp(motion.q, axis=0)) or np.any(fast))


def _solved(task: Task, motion: Trajectory, solved: set[Structure]) -> tuple[Switches, BangMotion, _Along] | None:
    """The fastest motion of the motion's switches, or of near ones, and what lies along it.

    Switches of a mesh that meet vanish; where a torque then has the wrong sign by its costates, it switches twice more.
    """
    problem, numbers = task.problem, task.policy.polish
    switches = switches_of(motion, problem.limits.actuators, numbers.brief)
    states = np.concatenate([motion.q, motion.v], axis=1)
    size = scales_of(np.ptp(motion.q, axis=0), np.ptp(motion.v, axis=0))
    t, asked = motion.t / motion.duration, None
    for _ in range(numbers.structures):
        if switches.times.size > numbers.most or switches.structure in solved:
            return None
        near = BangMotion.of(task, switches.signs, switches.lengths, (t, states), size).with_costates()
        if near is None:
            return None
        found, proposed = fastest(near)
        if proposed is None:
            along = _along(task, found)
            if (asked := _asked_for(task, switches, found, along)) is None:
                return switches, found, along
            solved.add(switches.structure)
            switches = asked
        else:
            ends = np.cumsum(proposed) * found.unit
            if asked or np.min(proposed) > 0 or ends[-1] <= 0 or task.stop:
                return None
            times = [ends[:-1][switches.joint == i] for i in range(problem.robot.nv)]
            switches = Switches.ordered(switches.first, times, float(ends[-1]))
        t = np.append(0.0, np.cumsum(found.seconds)) / np.sum(found.seconds)
        states = np.vstack([found.x, found.goal]) * size
    return None


def _asked_for(task: Task, own: Switches, motion: BangMotion, along: _Along) -> Switches | None:
    """The switches that a motion's costates ask for; None: its own."""
    h, (nodes, _), tau = motion.seconds, _QUADRATURE, motion.tau
    switching = along[2][:, 1:-1]
    excess = 2 * switching * (tau - task.problem.limits.actuators.center)[:, None]  # by which H could be lower
    if np.max(excess) <= OPTIMALITY_TOLERANCE:
        return None
    times = np.cumsum(h)[:, None] - h[:, None] * (1 - nodes)
    ends = np.cumsum(motion.lengths) * motion.unit
    moved = Switches(own.first, ends[:-1], own.joint, float(ends[-1]))
    return switches_by(moved, times.ravel(), switching.reshape(times.size, -1))


def _along(task: Task, motion: BangMotion) -> _Along:
    """(q, v), costates and switching functions [SI] at the start, the Gauss points and the end of every segment."""
    problem, n, last = task.problem, task.problem.robot.nv, motion.states[-1]
    size, (nodes, _), h, tau = motion.size, _QUADRATURE, motion.seconds, motion.tau
    torques = np.tile(np.stack([tau, tau], axis=1), (nodes.size, 1, 1))
    starts = np.tile(motion.x * size, (nodes.size, 1))
    count = task.policy.polish.steps
    at_nodes, flow, _ = gauss_steps(problem.robot)((nodes[:, None] * h).ravel(), starts, torques, count)
    end_costate = motion.costate * motion.unit / size
    start_costate = np.einsum("sab,sa->sb", motion.flow[-1] * size[:, None] / size, end_costate)
    inner = carried(flow.reshape(nodes.size, h.size, 2 * n, 2 * n), start_costate)
    costate = np.concatenate([start_costate[None], inner, end_costate[None]]).swapaxes(0, 1)
    x = np.concatenate([motion.x[None] * size, at_nodes.reshape(nodes.size, h.size, 2 * n), last[None] * size])
    x = x.swapaxes(0, 1)
    return x, costate, np.linalg.solve(joint_inertia(problem.robot)(x[..., :n]), costate[..., n:, None])[..., 0]


def _phases(task: Task, switches: Switches, motion: BangMotion, along: _Along) -> Phases:
    """The motion's arcs with costates at the starts and Gauss points of its segments."""
    problem, n = task.problem, task.problem.robot.nv
    h, x, (_, shares) = motion.seconds, motion.x * motion.size, _QUADRATURE
    whole, costate, switching = along
    inner, tau, t = whole[:, 1:-1].reshape(-1, 2 * n), motion.tau, np.append(0.0, np.cumsum(h))
    weights = (h[:, None] * shares).reshape(-1, 1)
    arcs, states = _arcs(task, switches, motion.lengths * motion.unit), np.vstack([x, whole[-1:, -1]])
    return Phases(
        t=t,
        q=states[:, :n],
        v=states[:, n:],
        tau=np.stack([tau, tau], axis=1),
        costate=np.vstack([costate[:, 0], costate[-1:, -1]]),
        points=np.stack([inner[:, :n], inner[:, n:], np.repeat(tau, shares.size, axis=0)]),
        pushed=weights * costate[:, 1:-1, n:].reshape(-1, n),
        switched=np.where(problem.limits.passive, 0.0, weights * switching[:, 1:-1].reshape(-1, n)),
        velocity=np.zeros(n),
        arcs=arcs,
        torques=_sampled(problem.robot.joint_names, t, states, tau),
    )


def _sampled(names: tuple[str, ...], t: Array, states: Array, tau: Array) -> Trajectory:
    """Samples of segments of constant torque; where it jumps, one sample lies an ulp before the knot.

    Args:
        names: names of the joints.
        t: knots [s], shape (S + 1,).
        states: (q, v) at the knots, shape (S + 1, 2 nv).
        tau: torques of the segments, shape (S, nv).
    """
    n = tau.shape[1]
    knots = Trajectory(t, states[:, :n], states[:, n:], np.vstack([tau, tau[-1:]]), names, "minimum time")
    times = t[:-1, None] + np.linspace(0, 1, BETWEEN + 1) * np.diff(t)[:, None]
    times[:, -1] = np.append(np.nextafter(t[1:-1], 0), t[-1])
    times, held = times.ravel(), np.repeat(tau, BETWEEN + 1, axis=0)
    kept = np.append(np.any(np.diff(held, axis=0) != 0, axis=1) | (np.diff(times) > 1e-13), True)
    return replace(knots, t=times[kept], q=knots(times[kept]).q, v=knots(times[kept]).v, tau=held[kept])


def _arcs(task: Task, switches: Switches, durations: Array) -> tuple[Arc, ...]:
    """Arcs of these durations [s]."""
    modes = np.where(switches.signs > 0, Mode.UPPER, Mode.LOWER).astype(object)
    modes[:, task.problem.limits.passive] = Mode.PASSIVE
    return tuple(Arc(float(d), tuple(Mode(one) for one in row)) for d, row in zip(durations, modes, strict=True))
