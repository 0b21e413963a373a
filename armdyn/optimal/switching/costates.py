"""Extremals as phases: motion, costates and multipliers of state limits at the stages of intervals."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array, Flags, Index
from armdyn.dynamics.numeric import inverse_dynamics, joint_inertia
from armdyn.optimal.arcs.arc import POSITION, VELOCITY
from armdyn.optimal.arcs.phases import TABLEAU, Phases, motion_of
from armdyn.optimal.switching.extremal.flow import STEPS
from armdyn.optimal.switching.extremal.quadratic_model import LinearRollout
from armdyn.optimal.switching.extremal.rollout import Rollout
from armdyn.optimal.task.tableau import differentiation

NODES = np.append(0.0, TABLEAU.c)
"""Places of an interval's start and stages, as parts of the interval."""

_DIFFERENTIATION = differentiation(NODES)


def phases_of(extremal: LinearRollout) -> Phases:
    """Arcs of an extremal with its costates, for certificates and sensitivities.

    Args:
        extremal: extremal with rollout and costates.
    """
    numbers = extremal.shooting.policy.arcs
    problem, whole = extremal.shooting.problem, SampledExtremal.of(extremal)
    arcs = extremal.structure.arcs(extremal.shooting.policy.rollout.touch)
    n, (K, nodes), lengths = problem.robot.nv, whole.tau.shape[:2], np.diff(whole.t)
    ends, middle = np.cumsum([arc.duration for arc in arcs]), (whole.t[:-1] + whole.t[1:]) / 2
    arc_of = np.minimum(np.searchsorted(ends, middle), len(arcs) - 1)
    weights = lengths[:, None, None] * TABLEAU.b[:, None]
    impulses = weights * whole.state_multipliers[:, 1:]
    knots = whole.costate[1:, 0] - whole.costate[:-1, -1] + impulses[:-1, -1]
    states = whole.x.reshape(K, nodes, 2, n)
    tau = whole.tau[:, 1:]
    return Phases(
        arcs=tuple(arcs),
        t=whole.t,
        q=np.vstack([states[:, 0, 0], states[-1:, -1, 0]]),
        v=np.vstack([states[:, 0, 1], states[-1:, -1, 1]]),
        costate=np.vstack([whole.costate[:, 0], whole.costate[-1:, -1]]),
        tau=tau,
        arc_of=arc_of,
        points=np.stack([states[:, 1:, 0], states[:, 1:, 1], tau]).reshape(3, -1, n),
        pushed=(weights * whole.costate[:, 1:, n:]).reshape(-1, n),
        switched=np.where(problem.limits.passive, 0.0, weights * whole.switching[:, 1:]).reshape(-1, n),
        state_multiplier=impulses[:, :-1].reshape(K, -1, 2, n),
        knot_multiplier=knots.reshape(K - 1, 2, n),
        torques=motion_of(problem, arcs, arc_of, whole.t, states, tau, numbers),
    )


@dataclass(frozen=True, eq=False)
class SampledExtremal:
    """An extremal at the starts and stages of intervals, with the whole arm's costates.

    The rollout's own costates are those of an arm whose held joints are locked. The held joints' costates follow from
    zero switching functions, by multipliers η: the costate is p + η ∂v, on a position limit minus η̇ ∂q, and the limit
    acts on the velocity's costate with η̇, or on the position's with −η̈ (Hartl, Sethi and Vickson, SIAM Review 37,
    1995: indirect and direct adjoining).

    Attributes:
        t: knots [s], shape (K + 1,).
        x: (q, v), shape (K, stages + 1, 2 nv).
        tau: torques, including those that hold a joint, shape (K, stages + 1, nv).
        costate: ρ, shape (K, stages + 1, 2 nv).
        switching: S, shape (K, stages + 1, nv).
        state_multipliers: multipliers of active state limits, per second, shape (K, stages + 1, 2 nv).
        position: whether a joint is on a position limit, shape (K, nv).
        velocity: whether a joint is on a velocity limit, likewise.
    """

    t: Array
    x: Array
    tau: Array
    costate: Array
    switching: Array
    state_multipliers: Array
    position: Flags
    velocity: Flags

    @classmethod
    def of(cls, extremal: LinearRollout) -> Self:
        """Sample an extremal."""
        rollout, robot = extremal.rollout, extremal.shooting.problem.robot
        (t, step, part), n = _grid(rollout), robot.nv
        x, state_transition, rate = _carried(rollout, step, part)
        at_steps = extremal.costates[0][step][..., None]
        costate = np.asarray(np.linalg.solve(np.swapaxes(state_transition, -1, -2), at_steps)[..., 0], float)
        first, last = (tau[step] for tau in rollout.torques.tau)
        tau, inertia = first + part[..., None] * (last - first), joint_inertia(robot)(x[..., :n])
        arcs = rollout.arc[step[:, 0]]
        modes, state_multipliers = np.array(extremal.structure.modes())[arcs], np.zeros_like(costate)
        position, velocity = np.isin(modes, POSITION), np.isin(modes, VELOCITY)
        for k in np.flatnonzero(np.any(position | velocity, axis=1)):
            held = np.flatnonzero(position[k] | velocity[k])
            tau[k][:, held] = inverse_dynamics(robot)(x[k, :, :n], x[k, :, n:], rate[k, :, n:])[:, held]
            inverse = np.linalg.inv(inertia[k])
            pushed = inverse[:, held] @ costate[k, :, n:, None]
            eta = -np.linalg.solve(inverse[:, held[:, None], held], pushed)[..., 0]
            length, on_position = t[k + 1] - t[k], position[k, held]
            derivative = _DIFFERENTIATION @ eta / length
            costate[k][:, n + held] += eta
            costate[k][:, held] -= np.where(on_position, derivative, 0.0)
            state_multipliers[k][:, held] = np.where(on_position, -_DIFFERENTIATION @ derivative / length, 0.0)
            state_multipliers[k][:, n + held] = np.where(on_position, 0.0, derivative)
        switching = np.asarray(np.linalg.solve(inertia, costate[..., n:, None])[..., 0], float)
        return cls(t, x, tau, costate, switching, state_multipliers, position, velocity)


def _grid(rollout: Rollout) -> tuple[Array, Index, Array]:
    """Group a rollout's steps into intervals, of one step where a torque is free; skip arcs without length.

    Returns:
        Knots [s], shape (K + 1,); index of the step at the start and the stages of intervals, shape (K, stages + 1);
        place within that step, likewise.
    """
    first: list[int] = []
    count: list[int] = []
    curved = np.any(rollout.torques.free_mask > 0, axis=1)
    for arc in range(rollout.structure.size + 1):
        own = np.flatnonzero(rollout.arc == arc)
        if rollout.h[own].sum() <= 1e-12 * rollout.structure.duration:
            continue
        parts = own.size if curved[own[0]] else rollout.shooting.policy.rollout.groups(own.size)
        for steps in np.array_split(own, parts):
            first.append(int(steps[0]))
            count.append(steps.size)
    along = np.array(count)[:, None] * NODES
    inside = np.minimum(along.astype(int), np.array(count)[:, None] - 1)
    t = np.append(rollout.times[first], rollout.times[-1])
    return t, np.array(first)[:, None] + inside, along - inside


def _carried(rollout: Rollout, steps: Index, parts: Array) -> tuple[Array, Array, Array]:
    """States within steps, their sensitivities to the steps' starts, and ẋ there; steps and parts of one shape."""
    first, last = rollout.torques.tau
    some, s = (np.pad(each.ravel(), (0, -steps.size % STEPS), mode="edge") for each in (steps, parts))
    there = first[some] + s[:, None] * (last[some] - first[some])
    rows = rollout.start[some], np.ones(some.size), s * rollout.h[some], first[some], there
    body = np.tile(rollout.shooting.body, (some.size, 1))
    x, state_transition, _, rate = rollout.shooting.flow.rolled_out(
        *rows, rollout.torques.free_mask[some], rollout.torques.held[some], body
    )
    x, state_transition, rate = (
        each[: steps.size].reshape(*steps.shape, *each.shape[1:]) for each in (x, state_transition, rate)
    )
    return x, state_transition, rate
