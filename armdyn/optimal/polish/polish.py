"""From a mesh's motion to the fastest motion of its bang arcs, with exact switching times and costates."""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import joint_inertia
from armdyn.models.values.actuator_limits import ActuatorLimits
from armdyn.optimal.polish.bang_motion import BangMotion, carried, fastest
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import Arc, Mode
from armdyn.optimal.verify.costates import Phases
from armdyn.optimal.verify.rollout import gauss_steps, scales_of
from armdyn.optimal.verify.within_limits import BETWEEN
from armdyn.trajectory import Trajectory

_QUADRATURE = tuple((np.polynomial.legendre.leggauss(5) + np.array([[1.0], [0.0]])) / 2)
"""Gauss points in a segment, as parts of it, and their weights: of order ten, integrals are right to 1e-6."""


def polished(task: Task, motion: Trajectory) -> Phases | None:
    """The fastest motion with a mesh's switches; None if there is none near.

    It satisfies Pontryagin's conditions at its switches; its certificate says whether it does so between them, and
    whether it keeps the limits of position and velocity.

    Args:
        task: problem with constant torque limits, whose cost is time alone.
        motion: motion with torques held between its samples.
    """
    problem, (signs, lengths) = task.problem, bang_arcs(motion, task.problem.limits.actuators)
    if _touches(task, motion) or lengths.size > task.policy.polish.most:
        return None
    states = motion.t / motion.duration, np.concatenate([motion.q, motion.v], axis=1)
    size = scales_of(np.ptp(motion.q, axis=0), np.ptp(motion.v, axis=0))
    near = BangMotion.of(problem, task.policy, (signs, lengths), states, size).with_costates()
    found = None if near is None else fastest(near, task.stop)
    return None if found is None else _phases(task, signs, found)


def bang_arcs(motion: Trajectory, limits: ActuatorLimits) -> tuple[Array, Array]:
    """Bang arcs of a motion with torques held between its samples.

    Where the mean torque changes its sign from an interval to the next, the torque switches once; the two means say
    when.

    Args:
        motion: motion with torques near their limits, but for intervals with a switch.
        limits: torque limits, constant ones.

    Returns:
        Signs of the torques in the arcs, 1 on the upper and -1 on the lower limit, shape (K, nv), and the lengths of
        the arcs [s], shape (K,).
    """
    lengths = np.diff(motion.t)
    whole = np.flatnonzero(lengths > 1e-12 * motion.duration)
    begin, lengths = motion.t[whole], lengths[whole]
    levels = (motion(begin + lengths / 2).tau - limits.center) / limits.scale
    away, signs = (1 - np.abs(levels)) / 2 * lengths[:, None], np.where(levels > 0, 1.0, -1.0)  # time on the other
    before, joint = np.nonzero(np.diff(signs, axis=0))
    times = begin[before + 1] - away[before, joint] + away[before + 1, joint]
    order = np.argsort(times, kind="stable")
    turned = np.cumsum(joint[order, None] == np.arange(levels.shape[1]), axis=0)
    own = signs[0] * (-1.0) ** np.vstack([np.zeros(levels.shape[1]), turned])
    return own, np.diff(np.concatenate([[0.0], times[order], [motion.duration]]))


def _touches(task: Task, motion: Trajectory) -> bool:
    """Whether a motion touches a limit of position or velocity between its ends."""
    limits, near, inner = task.problem.limits, task.policy.arcs.touching, slice(1, -1)
    margin = np.minimum(motion.q - limits.position_lower, limits.position_upper - motion.q)[inner]
    fast = np.abs(motion.v[inner]) >= (1 - near) * limits.velocity
    return bool(np.any(margin <= near * np.ptp(motion.q, axis=0)) or np.any(fast))


def _phases(task: Task, signs: Array, motion: BangMotion) -> Phases:
    """The motion's arcs with costates at the starts and Gauss points of its segments."""
    problem, n, tau, size = task.problem, task.problem.robot.nv, motion.tau, motion.size
    h, x, (nodes, shares) = motion.seconds, motion.x * size, _QUADRATURE
    torques, starts = np.tile(np.stack([tau, tau], axis=1), (nodes.size, 1, 1)), np.tile(x, (nodes.size, 1))
    inner, flow, _ = gauss_steps(problem.robot)((nodes[:, None] * h).ravel(), starts, torques, task.policy.polish.steps)
    end = motion.costate * motion.unit / size
    first = np.einsum("sab,sa->sb", motion.flow[-1] * size[:, None] / size, end)
    costate = carried(flow.reshape(nodes.size, h.size, 2 * n, 2 * n), first).swapaxes(0, 1)[..., n:].reshape(-1, n)
    inner = inner.reshape(nodes.size, h.size, 2 * n).swapaxes(0, 1).reshape(-1, 2 * n)
    switching = np.linalg.solve(joint_inertia(problem.robot)(inner[:, :n]), costate[..., None])[..., 0]
    t, weights = np.append(0.0, np.cumsum(h)), (h[:, None] * shares).reshape(-1, 1)
    arcs = _arcs(task, signs, motion.lengths * motion.unit)
    states = np.vstack([x, motion.states[-1, -1:] * size])
    return Phases(
        t=t,
        q=states[:, :n],
        v=states[:, n:],
        tau=np.stack([tau, tau], axis=1),
        costate=np.vstack([first, end[-1:]]),
        points=np.stack([inner[:, :n], inner[:, n:], np.repeat(tau, shares.size, axis=0)]),
        pushed=weights * costate,
        switched=np.where(problem.limits.passive, 0.0, weights * switching),
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


def _arcs(task: Task, signs: Array, durations: Array) -> tuple[Arc, ...]:
    """Arcs of these durations [s]."""
    modes = np.where(signs > 0, Mode.UPPER, Mode.LOWER).astype(object)
    modes[:, task.problem.limits.passive] = Mode.PASSIVE
    return tuple(Arc(float(d), tuple(Mode(one) for one in row)) for d, row in zip(durations, modes, strict=True))
