"""Pontryagin's conditions, and costates checked by the adjoint equations.

ρ̇ = −∂H/∂x = −(∂f/∂x)ᵀρ, with ∂f/∂x from Pinocchio's derivatives of forward dynamics, integrated from the goal back to
the start. Only the program's multipliers of active state limits enter: on a limit of velocity or position, the
multiplier acts on the costate (Bryson and Ho, Applied Optimal Control, section 3.9).

Integrated backwards a difference grows as fast as the motion diverges, ten thousandfold on a heavily laden arm.
Therefore the costates are compared with the solution of the equations that is nearest to all of them: shadowing.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.dynamics.numeric import forward_dynamics, joint_inertia
from armdyn.models.robots.robot import Robot
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.tableau import lagrange
from armdyn.optimal.verify.arc import HELD, POSITION, UPPER_LIMITS, VELOCITY, outward
from armdyn.optimal.verify.costates import Costates
from armdyn.optimal.verify.phases import TABLEAU, Phases
from armdyn.optimal.verify.rollout import replay_torques, transitions
from armdyn.trajectory import Trajectory


def pontryagin(problem: MinimumTimeProblem, phases: Phases) -> tuple[Array, Array, float]:
    """H, shape (K + 1,), and S, shape (K + 1, nv), at the knots; largest violation of a sign condition."""
    robot, n, w = problem.robot, problem.robot.nv, problem.effort_weight
    tau, rates = _at_knots(phases), phases.costate[:, n:]  # the costates of the velocities
    acceleration = forward_dynamics(robot)(phases.q, phases.v, tau)
    switching = np.linalg.solve(joint_inertia(robot)(phases.q), rates[..., None])[..., 0] + w * tau
    hamiltonian = 1 + np.sum(w / 2 * tau**2 + phases.costate[:, :n] * phases.v + rates * acceleration, axis=1)
    lower, upper = problem.limits.actuators.range(phases.q, phases.v)
    up, down = upper - tau, tau - lower
    fall = np.maximum(switching, 0) * down + np.maximum(-switching, 0) * up
    if w > 0:  # H is a parabola in the torque: its minimum may be nearer than the limit
        fall = np.minimum(fall, switching**2 / (2 * w))
    within = np.append(False, np.diff(phases.arc_of) == 0)[:, None]
    # A free torque is extrapolated to the knot where its arc begins.
    worst = np.max(fall[:-1], where=np.isin(phases.modes, HELD) | within, initial=0.0)
    return hamiltonian, switching, float(max(worst, _worst_multiplier(phases)))


def idle_joints(problem: MinimumTimeProblem, costates: Costates, switching: Array, tolerance: float) -> tuple[str, ...]:
    """Joints that minimum time leaves undetermined for over half of the motion, with zero costates.

    Zero costates are the only ones that Pontryagin's conditions allow there: H does not depend on the joint's motion.

    Args:
        problem: the minimum-time problem.
        costates: costates of its optimum.
        switching: S at the knots, shape (K + 1, nv).
        tolerance: tolerance of a change of H, relative to time's 1.
    """
    if problem.effort_weight > 0:  # every torque costs
        return ()
    by_torque = np.abs(switching) * problem.limits.actuators.width
    by_position = np.abs(costates.costate[:, : problem.robot.nv]) * np.max(np.abs(costates.points[1]), axis=0)
    zero = np.maximum(by_torque, by_position) <= tolerance
    shares = np.diff(costates.t) @ (zero[:-1] & zero[1:]) / costates.t[-1]
    return tuple(name for name, share in zip(problem.robot.joint_names, shares, strict=True) if share > 1 / 2)


def _worst_multiplier(phases: Phases) -> float:
    """Largest inward multiplier of an active state limit, relative to its largest outward multiplier."""
    worst, K = 0.0, phases.arc_of.size
    for i, modes in enumerate(phases.modes.T):
        inside, sign = np.isin(modes, POSITION), np.where(np.isin(modes, UPPER_LIMITS), 1.0, -1.0)
        fast = list((-sign[:, None] * phases.state_multiplier[:, :, 1, i])[np.isin(modes, VELOCITY)])
        fast += _velocity_impulses(phases, i)
        stages, knots = _position_multipliers(phases, i, inside)
        met = np.zeros(K - 1)  # at the knots between intervals: contact on either side, or a touch
        met[inside[1:]], met[inside[:-1]] = sign[1:][inside[1:]], sign[:-1][inside[:-1]]
        for a, arc in enumerate(phases.arcs[:-1]):
            for joint, mode in arc.touches:
                if joint == i and mode in POSITION:
                    met[max(int(np.searchsorted(phases.arc_of, a, side="right")) - 1, 0)] = outward(mode)
        near = [*(-sign[:, None] * stages)[inside], -(met * knots)[met != 0]]
        for multipliers in (fast, near):
            if sum(map(len, multipliers)):
                every = np.concatenate(multipliers)
                worst = max(worst, -np.min(every) / max(np.max(np.abs(every)), 1e-300))
    return worst


def _velocity_impulses(phases: Phases, i: int) -> list[Array]:
    """Outward impulsive multipliers of a joint's velocity limits, at every knot between arcs on a limit."""
    impulses: list[Array] = []
    for a, (here, after) in enumerate(pairwise(phases.arcs)):
        at = [mode for mode in {here.modes[i], after.modes[i]} if mode in VELOCITY]
        at += [mode for joint, mode in here.touches if joint == i and mode in VELOCITY]
        knot = np.flatnonzero(phases.arc_of == a)[-1:]
        impulses += [-outward(mode) * phases.knot_multiplier[knot, 1, i] for mode in at]
    return impulses


def _position_multipliers(phases: Phases, i: int, inside: Flags) -> tuple[Array, Array]:
    """A position limit's ∂t_f/∂q_i at the inner stages, shape (K, stages - 1), and inner knots, shape (K - 1,).

    In contact the program fixes the velocity, too, so that q's defects are void. Here the limit is one of position
    alone: multipliers of the defects replace the multipliers of the velocities.
    """
    K, s = phases.arc_of.size, TABLEAU.c.size
    stages, knots = phases.state_multiplier[:, :, 0, i].copy(), phases.knot_multiplier[:, 0, i].copy()
    lengths = np.diff(phases.t)
    for k in np.flatnonzero(inside):
        last = phases.knot_multiplier[k, 1, i] if k < K - 1 else 0.0
        costate = np.linalg.solve(lengths[k] * TABLEAU.A.T, np.append(phases.state_multiplier[k, :, 1, i], last))
        stages[k] += costate[: s - 1]
        if k < K - 1:
            knots[k] += costate[-1]
        if k > 0:
            knots[k - 1] -= costate.sum()
    return stages, knots


def _at_knots(phases: Phases) -> Array:
    """Torque at the knots, from the interval after each; at the end from the one before."""
    # A Radau interval ends with its last stage; the stages are extrapolated to its start.
    start, end = np.einsum("j,kji->ki", lagrange(TABLEAU.c, 0.0)[0], phases.tau), phases.tau[:, -1]
    return np.vstack([start, end[-1:]])


def adjoint_error(robot: Robot, replay: Trajectory, phases: Phases) -> float:
    """Residual of the costates in the adjoint equations, as a change of H, relative to time's 1.

    A difference in ρ_q is weighted by the joint's largest velocity, one in ρ_v by its largest acceleration.

    Args:
        robot: the robot.
        replay: replay of the motion.
        phases: the arcs, with costates.

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
    size = np.concatenate([np.maximum(each, 1e-3 * np.max(each)) for each in peaks])
    x, tau = np.concatenate([motion.q, motion.v], axis=1), np.stack([motion.tau[:-1], motion.tau_end], axis=1)
    steps = transitions(robot, np.diff(t), x[:-1], tau, size)
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
    modes = phases.modes
    slow = np.isin(modes, POSITION)
    held = np.stack([slow, slow | np.isin(modes, VELOCITY)], axis=1)  # (K, 2, nv): positions, velocities
    met = held[:-1] | held[1:]
    for a, k in enumerate(np.flatnonzero(np.diff(phases.arc_of))):
        for i, mode in phases.arcs[a].touches:
            rows = slice(None) if mode in POSITION else slice(1, 2)
            met[k, rows, i] = held[k : k + 2, rows, i] = True
    inner = (phases.state_multiplier * held[:, None]).reshape(K, -1, 2 * n)
    return inner, (phases.knot_multiplier * met).reshape(K - 1, 2 * n), np.asarray(np.any(held, axis=(1, 2)))
