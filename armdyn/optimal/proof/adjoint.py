"""Independent check of the costates: the adjoint equations integrated along the replay.

ρ̇ = −∂H/∂x = −(∂f/∂x)ᵀρ, with ∂f/∂x from Pinocchio's derivatives of forward dynamics, integrated from the goal back to
the start. Only the program's multipliers of active state limits enter: on a limit of velocity or position, the
multiplier acts on the costate (Bryson and Ho, Applied Optimal Control, section 3.9).

Integrated backwards a difference grows as fast as the motion diverges, ten thousandfold on a heavily laden arm.
Therefore the costates are compared with the solution of the equations that is nearest to all of them: shadowing.
"""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.dynamics.numeric import forward_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.optimal.arcs.arc import POSITION, VELOCITY
from armdyn.optimal.arcs.phases import TABLEAU, Phases
from armdyn.optimal.landing.rollout import replay_torques
from armdyn.optimal.landing.segments import transitions
from armdyn.optimal.task.policy.refinement import AdjointPolicy
from armdyn.trajectory import Trajectory


def adjoint_error(robot: Robot, replay: Trajectory, phases: Phases, numbers: AdjointPolicy) -> float:
    """Residual of the costates in the adjoint equations, as a change of H, relative to time's 1.

    A difference in ρ_q is weighted by the joint's largest velocity, one in ρ_v by its largest acceleration.

    Args:
        robot: the robot.
        replay: replay of the motion.
        phases: the arcs, with costates.
        numbers: tolerances of the integration.

    Returns:
        The largest difference at any knot, of any joint; infinite if the replay or the integration broke off.
    """
    inner, knots, on_limit = _impulses(phases)
    stops = phases.t[:-1, None] + np.diff(phases.t)[:, None] * TABLEAU.c[:-1]  # where multipliers of state limits act
    duration = phases.duration
    if abs(replay.duration - duration) > 1e-12 * duration:
        return float("inf")
    t = np.union1d(replay.t, np.minimum(np.append(phases.t, stops[on_limit].ravel()), replay.t[-1]))
    at = replay(t)
    motion = replay_torques(robot, replace(replay, t=t, q=at.q, v=at.v, tau=at.tau))
    if motion.t[-1] != t[-1]:
        return float("inf")
    a = forward_dynamics(robot)(motion.q, motion.v, motion.tau)
    peaks = [np.max(np.abs(each), axis=0) for each in (motion.v, a)]
    size = np.concatenate([np.maximum(each, numbers.least_speed * np.max(each)) for each in peaks])
    precise = numbers.precise / max(float(np.max(np.abs(phases.costate * size))), 1.0)
    x, tau = np.concatenate([motion.q, motion.v], axis=1), np.stack([motion.tau[:-1], motion.tau_end], axis=1)
    steps = transitions(robot, np.diff(t), x[:-1], tau, precise, size)
    if steps is None:
        return float("inf")
    place, own = np.searchsorted(t, np.minimum(phases.t, t[-1])), size.size
    found = np.empty((*phases.costate.shape, own + 1))  # a solution, and its derivatives in the goal's costates
    found[-1] = np.column_stack([phases.costate[-1], np.diag(1 / size)])
    for k in range(phases.arc_of.size - 1, -1, -1):
        here = found[k + 1].copy()
        if k < phases.arc_of.size - 1:
            here[:, 0] -= knots[k]
        impulses = dict(zip(np.searchsorted(t, stops[k]).tolist(), inner[k], strict=True)) if on_limit[k] else {}
        for step in range(place[k + 1] - 1, place[k] - 1, -1):
            here = steps[step].T @ here
            if step in impulses:
                here[:, 0] -= impulses[step]
        found[k] = here
    if not np.all(np.isfinite(found)):
        return float("inf")
    apart, freedom = (found[:, :, 0] - phases.costate) * size, found[:, :, 1:] * size[:, None]
    shift = np.linalg.lstsq(freedom.reshape(apart.size, -1), apart.ravel(), rcond=None)[0]
    return float(np.max(np.abs(apart - freedom @ shift)))


def _impulses(phases: Phases) -> tuple[Array, Array, Flags]:
    """Impulses of the state limits on the costates; zero for limits that no arc has.

    Impulses at the stages follow from the collocation's quadrature of an active limit. A touch has its impulse at the
    knot, and by IPOPT's barrier partly at the neighbouring stages.

    Returns:
        At the inner stages, shape (K, stages - 1, 2 nv); at the inner knots, shape (K - 1, 2 nv); and whether any
        stage of an interval has an impulse, shape (K,).
    """
    K, n = phases.q.shape[0] - 1, phases.q.shape[1]
    modes = np.array([phases.arcs[a].modes for a in phases.arc_of], dtype=object)
    slow = np.isin(modes, POSITION)
    held = np.stack([slow, slow | np.isin(modes, VELOCITY)], axis=1)  # (K, 2, nv): positions, velocities
    met = held[:-1] | held[1:]
    for a, k in enumerate(np.flatnonzero(np.diff(phases.arc_of))):
        for i, mode in phases.arcs[a].touches:
            rows = slice(None) if mode in POSITION else slice(1, 2)
            met[k, rows, i] = held[k : k + 2, rows, i] = True
    inner = (phases.state_multiplier * held[:, None]).reshape(K, -1, 2 * n)
    return inner, (phases.knot_multiplier * met).reshape(K - 1, 2 * n), np.asarray(np.any(held, axis=(1, 2)))
