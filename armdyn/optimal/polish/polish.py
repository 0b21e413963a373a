"""From a mesh's motion to the fastest motion of its bang arcs, with exact switching times and costates."""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import joint_inertia
from armdyn.optimal.polish.newton import BangMotion, bang_motion, fastest
from armdyn.optimal.polish.shooting import BangShooting, carried
from armdyn.optimal.polish.structure import Switches, switches_of
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import Arc, Mode
from armdyn.optimal.verify.phases import TABLEAU, Phases, motion_of
from armdyn.optimal.verify.rollout import gauss_steps, replay_of, transitions
from armdyn.trajectory import Trajectory


def polished(task: Task, motion: Trajectory) -> Phases | None:
    """The fastest motion with a mesh's switches, or near ones, on the goal when replayed; None if there is none near.

    It satisfies Pontryagin's conditions at its switches; its certificate says whether it does so between them, and
    whether it keeps the limits of position and velocity.

    Args:
        task: problem with constant torque limits, whose cost is time alone.
        motion: motion with torques held between its samples.
    """
    found = None if _touches(task, motion) else _solved(task, motion)
    if found is None:
        return None
    numbers, goal = task.policy.polish, found[1].goal
    best, least = None, np.inf
    for _ in range(numbers.corrections):
        phases = _phases(task, *found)
        replay = replay_of(task, phases.torques)
        miss = task.problem.goal_error_of(replay)
        missed = float(np.max(np.abs(miss))) if replay.t[-1] == phases.duration else np.inf
        closer = missed < least / 2
        best, least = (phases, missed) if missed < least else (best, least)
        if missed <= numbers.landed or not closer or task.stop:
            break
        goal = goal - miss / found[1].shooting.size
        again, left = fastest(replace(found[1], goal=goal), task.stop)
        if left is not None:
            break
        found = found[0], again
    return best


def _touches(task: Task, motion: Trajectory) -> bool:
    """Whether a motion touches a limit of position or velocity between its ends."""
    limits, near, inner = task.problem.limits, task.policy.polish.near, slice(1, -1)
    margin = np.minimum(motion.q - limits.position_lower, limits.position_upper - motion.q)[inner]
    fast = np.abs(motion.v[inner]) >= (1 - near) * limits.velocity
    return bool(np.any(margin <= near * np.ptp(motion.q, axis=0)) or np.any(fast))


def _solved(task: Task, motion: Trajectory) -> tuple[Switches, BangMotion] | None:
    """The fastest motion of the motion's switches, or of those that remain where some meet."""
    problem, numbers = task.problem, task.policy.polish
    switches = switches_of(motion, problem.limits.actuators, numbers.brief)
    states = np.concatenate([motion.q, motion.v], axis=1)
    size = _sizes(states)
    t = motion.t / motion.duration
    for _ in range(numbers.structures):
        if switches.times.size > numbers.most:
            return None
        shooting = BangShooting.of(problem, task.policy, switches, size)
        lengths = switches.lengths / shooting.unit
        begins = np.append(0.0, np.cumsum(lengths[shooting.arc_of] * shooting.share)[:-1])
        x = np.stack([np.interp(begins, t, each) for each in states.T], axis=1)
        x[0] = np.concatenate([problem.q_start, problem.v_start])
        near = bang_motion(shooting, lengths, x / size, problem.x_goal / size)
        if near is None:
            return None
        found, proposed = fastest(near, task.stop)
        if proposed is None:
            return switches, found
        ends = np.cumsum(proposed) * shooting.unit
        if np.min(proposed) > 0 or ends[-1] <= 0 or task.stop:
            return None
        times = [ends[:-1][switches.joint == i] for i in range(problem.robot.nv)]
        t = np.append(0.0, np.cumsum(found.lengths[shooting.arc_of] * shooting.share)) / np.sum(found.lengths)
        states = np.vstack([found.x, found.goal]) * size
        switches = Switches.ordered(switches.first, times, float(ends[-1]))
    return None


def _sizes(states: Array) -> Array:
    """Scale of each state, shape (2 nv,): its range, or a thousandth of the largest of its kind."""
    ranges = np.ptp(states, axis=0).reshape(2, -1)
    return np.asarray(np.maximum(ranges, 1e-3 * ranges.max(axis=1, keepdims=True))).ravel()


def _phases(task: Task, switches: Switches, motion: BangMotion) -> Phases:
    """The motion's arcs with costates at the starts and stages of its segments."""
    problem, shooting, n = task.problem, motion.shooting, task.problem.robot.nv
    size, unit, arc_of = shooting.size, shooting.unit, shooting.arc_of
    h, nodes, tau = shooting.seconds(motion.lengths), TABLEAU.c[:-1], shooting.tau
    torques = np.tile(np.stack([tau, tau], axis=1), (nodes.size, 1, 1))
    lengths, starts = (nodes[:, None] * h).ravel(), np.tile(motion.x * size, (nodes.size, 1))
    inner = gauss_steps(problem.robot)(lengths, starts, torques, task.policy.polish.steps)
    exact = transitions(problem.robot, lengths, starts, torques, shooting.precise, size)
    flow = (inner[1] if exact is None else exact).reshape(nodes.size, h.size, 2 * n, 2 * n)
    end = motion.costate * unit / size
    by_start = motion.ends.by_start * size[:, None] / size
    first = np.einsum("sab,sa->sb", by_start, end)
    costate = np.concatenate([first[None], carried(flow, first), end[None]]).swapaxes(0, 1)
    x = np.concatenate([motion.x[None] * size, inner[0].reshape(nodes.size, h.size, 2 * n), motion.ends.x[None] * size])
    states = x.swapaxes(0, 1).reshape(h.size, -1, 2, n)
    switching = np.linalg.solve(joint_inertia(problem.robot)(states[:, :, 0]), costate[..., n:, None])[..., 0]
    weights = h[:, None, None] * TABLEAU.b[:, None]
    held, t = np.repeat(tau[:, None], TABLEAU.c.size, axis=1), np.append(0.0, np.cumsum(h))
    arcs = _arcs(task, switches, motion.lengths * unit)
    return Phases(
        arcs=arcs,
        t=t,
        q=np.vstack([states[:, 0, 0], states[-1:, -1, 0]]),
        v=np.vstack([states[:, 0, 1], states[-1:, -1, 1]]),
        costate=np.vstack([costate[:, 0], costate[-1:, -1]]),
        tau=held,
        arc_of=arc_of,
        points=np.stack([states[:, 1:, 0], states[:, 1:, 1], held]).reshape(3, -1, n),
        pushed=(weights * costate[:, 1:, n:]).reshape(-1, n),
        switched=np.where(problem.limits.passive, 0.0, weights * switching[:, 1:]).reshape(-1, n),
        state_multiplier=np.zeros((h.size, nodes.size, 2, n)),
        knot_multiplier=np.zeros((h.size - 1, 2, n)),
        torques=motion_of(problem, arcs, arc_of, t, states, held, task.policy.arcs),
    )


def _arcs(task: Task, switches: Switches, durations: Array) -> tuple[Arc, ...]:
    """Arcs of these durations [s]."""
    modes = np.where(switches.signs > 0, Mode.UPPER, Mode.LOWER).astype(object)
    modes[:, task.problem.limits.passive] = Mode.PASSIVE
    return tuple(Arc(float(d), tuple(Mode(one) for one in row)) for d, row in zip(durations, modes, strict=True))
