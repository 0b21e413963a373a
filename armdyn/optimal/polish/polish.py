"""From a mesh's motion to the fastest motion of its bang arcs, with exact switching times and costates."""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import joint_inertia
from armdyn.optimal.polish.newton import BangMotion, bang_motion, fastest
from armdyn.optimal.polish.shooting import BangShooting, carried
from armdyn.optimal.polish.structure import Structure, Switches, switches_by, switches_of
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import Arc, Mode
from armdyn.optimal.verify.certificate import GOAL_TOLERANCE, OPTIMALITY_TOLERANCE
from armdyn.optimal.verify.phases import TABLEAU, Phases, motion_of
from armdyn.optimal.verify.rollout import gauss_steps, replay_of
from armdyn.trajectory import Trajectory


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


def _solved(task: Task, motion: Trajectory, solved: set[Structure]) -> tuple[Switches, BangMotion] | None:
    """The fastest motion of the motion's switches, or of near ones.

    Switches of a mesh that meet vanish; where a torque then has the wrong sign by its costates, it switches twice more.
    """
    problem, numbers = task.problem, task.policy.polish
    switches = switches_of(motion, problem.limits.actuators, numbers.brief)
    states = np.concatenate([motion.q, motion.v], axis=1)
    size = _sizes(states)
    t, asked = motion.t / motion.duration, None
    for _ in range(numbers.structures):
        if switches.times.size > numbers.most or switches.structure in solved:
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
            if (asked := _asked_for(task, switches, found)) is None:
                return switches, found
            solved.add(switches.structure)
            switches = asked
        else:
            ends = np.cumsum(proposed) * shooting.unit
            if asked or np.min(proposed) > 0 or ends[-1] <= 0 or task.stop:
                return None
            times = [ends[:-1][switches.joint == i] for i in range(problem.robot.nv)]
            switches = Switches.ordered(switches.first, times, float(ends[-1]))
        t = np.append(0.0, np.cumsum(found.lengths[shooting.arc_of] * shooting.share)) / np.sum(found.lengths)
        states = np.vstack([found.x, found.goal]) * size
    return None


def _asked_for(task: Task, own: Switches, motion: BangMotion) -> Switches | None:
    """The switches that a motion's costates ask for; None: its own."""
    h, nodes, tau = motion.shooting.seconds(motion.lengths), TABLEAU.c[:-1], motion.shooting.tau
    switching = _along(task, motion)[2][:, 1:-1]
    excess = 2 * switching * (tau - task.problem.limits.actuators.center)[:, None]  # by which H could be lower
    if np.max(excess) <= OPTIMALITY_TOLERANCE:
        return None
    times = np.cumsum(h)[:, None] - h[:, None] * (1 - nodes)
    ends = np.cumsum(motion.lengths) * motion.shooting.unit
    moved = Switches(own.first, ends[:-1], own.joint, float(ends[-1]))
    return switches_by(moved, times.ravel(), switching.reshape(times.size, -1))


def _sizes(states: Array) -> Array:
    """Scale of each state, shape (2 nv,): its range, or a thousandth of the largest of its kind."""
    ranges = np.ptp(states, axis=0).reshape(2, -1)
    return np.asarray(np.maximum(ranges, 1e-3 * ranges.max(axis=1, keepdims=True))).ravel()


def _along(task: Task, motion: BangMotion) -> tuple[Array, Array, Array]:
    """States, costates and switching functions at the start, the nodes and the end of every segment.

    Returns:
        (q, v) and its costates [s/rad, s²/rad], shape (segments, nodes + 2, 2 nv), and S [s/(N m)], shape (…, nv).
    """
    problem, shooting, n = task.problem, motion.shooting, task.problem.robot.nv
    size, nodes, h, tau = shooting.size, TABLEAU.c[:-1], shooting.seconds(motion.lengths), shooting.tau
    torques = np.tile(np.stack([tau, tau], axis=1), (nodes.size, 1, 1))
    starts = np.tile(motion.x * size, (nodes.size, 1))
    ends, flow, _ = gauss_steps(problem.robot)((nodes[:, None] * h).ravel(), starts, torques, task.policy.polish.steps)
    end = motion.costate * shooting.unit / size
    first = np.einsum("sab,sa->sb", motion.ends.by_start * size[:, None] / size, end)
    inner = carried(flow.reshape(nodes.size, h.size, 2 * n, 2 * n), first)
    costate = np.concatenate([first[None], inner, end[None]]).swapaxes(0, 1)
    x = np.concatenate([motion.x[None] * size, ends.reshape(nodes.size, h.size, 2 * n), motion.ends.x[None] * size])
    x = x.swapaxes(0, 1)
    return x, costate, np.linalg.solve(joint_inertia(problem.robot)(x[..., :n]), costate[..., n:, None])[..., 0]


def _phases(task: Task, switches: Switches, motion: BangMotion) -> Phases:
    """The motion's arcs with costates at the starts and stages of its segments."""
    problem, shooting, n = task.problem, motion.shooting, task.problem.robot.nv
    h, nodes, tau, arc_of = shooting.seconds(motion.lengths), TABLEAU.c[:-1], shooting.tau, shooting.arc_of
    x, costate, switching = _along(task, motion)
    states = x.reshape(h.size, -1, 2, n)
    weights = h[:, None, None] * TABLEAU.b[:, None]
    held, t = np.repeat(tau[:, None], TABLEAU.c.size, axis=1), np.append(0.0, np.cumsum(h))
    arcs = _arcs(task, switches, motion.lengths * shooting.unit)
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
