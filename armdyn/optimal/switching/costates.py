"""Extremals as phases: motion, costates and multipliers of state limits at the stages of intervals."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array, Flags, Index
from armdyn.dynamics.numeric import inverse_dynamics, joint_inertia
from armdyn.models.robots.robot import Robot
from armdyn.optimal.arcs.arc import POSITION, VELOCITY
from armdyn.optimal.arcs.phases import TABLEAU, Phases, motion_of
from armdyn.optimal.switching.extremal.descent import Extremal
from armdyn.optimal.switching.extremal.flow import STEPS
from armdyn.optimal.switching.extremal.rollout import Rollout
from armdyn.optimal.task.tableau import differentiation

NODES = np.append(0.0, TABLEAU.c)
"""Places of an interval's start and stages, as parts of the interval."""

_DIFFERENTIATION = differentiation(NODES)


def phases_of(extremal: Extremal) -> Phases:
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
        stage_q=states[:, 1:, 0],
        stage_v=states[:, 1:, 1],
        stage_costate=weights * whole.costate[:, 1:],
        torque_multiplier=weights * whole.switching[:, 1:],
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
    def of(cls, extremal: Extremal) -> Self:
        """Sample an extremal."""
        (t, step, part), robot = _grid(extremal.rollout), extremal.shooting.problem.robot
        at = _At.of(extremal, step, part)
        costate, state_multipliers = _adjoined(at, np.diff(t), robot.nv)
        switching = np.asarray(np.linalg.solve(at.inertia, costate[..., robot.nv :, None])[..., 0], float)
        return cls(t, at.x, _torques(at, robot), costate, switching, state_multipliers, at.position, at.velocity)


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


@dataclass(frozen=True, eq=False)
class _At:
    """The motion at the start and the stages of intervals, shape (K, stages + 1, ...).

    Attributes:
        x: (q, v), shape (..., 2 nv).
        rate: ẋ, likewise.
        p: costates of the rollout, likewise.
        tau: torques, 0 for held joints, shape (..., nv).
        inertia: M(q), shape (..., nv, nv).
        position: whether a joint is held on a position limit, shape (K, nv).
        velocity: whether a joint is held on a velocity limit, likewise.
        holder: index of the joint whose torque holds each joint; its own index if not held, likewise.
    """

    x: Array
    rate: Array
    p: Array
    tau: Array
    inertia: Array
    position: Flags
    velocity: Flags
    holder: Index

    @classmethod
    def of(cls, extremal: Extremal, steps: Index, parts: Array) -> Self:
        """Sample an extremal at places within its steps, both of shape (K, stages + 1)."""
        rollout, robot = extremal.rollout, extremal.shooting.problem.robot
        step, part, n = steps.ravel(), parts.ravel(), robot.nv
        x, state_transition, rate = _carried(rollout, step, part)
        p = np.linalg.solve(state_transition.transpose(0, 2, 1), extremal.costates[0][step][:, :, None])[..., 0]
        first, last = (tau[step] for tau in rollout.torques.tau)
        tau = first + part[:, None] * (last - first)
        inertia = joint_inertia(robot)(x[:, :n])
        modes = extremal.structure.modes()
        own = [modes[a] for a in rollout.arc[steps[:, 0]]]
        shape, carriers = steps.shape, extremal.structure.carriers()
        holder = np.tile(np.arange(n), (shape[0], 1))
        for k, a in enumerate(rollout.arc[steps[:, 0]]):
            for joint, carrier in carriers[a].items():
                holder[k, joint] = carrier.joint
        return cls(
            x.reshape(*shape, 2 * n),
            rate.reshape(*shape, 2 * n),
            np.asarray(p, float).reshape(*shape, 2 * n),
            tau.reshape(*shape, n),
            inertia.reshape(*shape, n, n),
            np.array([[mode in POSITION for mode in each] for each in own]),
            np.array([[mode in VELOCITY for mode in each] for each in own]),
            holder,
        )


def _carried(rollout: Rollout, step: Index, part: Array) -> tuple[Array, Array, Array]:
    """States within steps, their sensitivities to the steps' starts, and ẋ there."""
    first, last = rollout.torques.tau
    some = np.pad(step, (0, -step.size % STEPS), mode="edge")
    s = np.pad(part, (0, -step.size % STEPS))
    there = first[some] + s[:, None] * (last[some] - first[some])
    rows = rollout.start[some], np.ones(some.size), s * rollout.h[some], first[some], there
    body = np.tile(rollout.shooting.body, (some.size, 1))
    x, state_transition, _, rate = rollout.shooting.flow.rolled_out(
        *rows, rollout.torques.free_mask[some], rollout.torques.kept[some], body
    )
    return x[: step.size], state_transition[: step.size], rate[: step.size]


def _adjoined(at: _At, lengths: Array, n: int) -> tuple[Array, Array]:
    """Costates of the whole arm, and the limits' multipliers per second, both of `_At.x`'s shape."""
    costate, state_multipliers = at.p.copy(), np.zeros_like(at.p)
    for k in np.flatnonzero(np.any(at.position | at.velocity, axis=1)):
        held = np.flatnonzero(at.position[k] | at.velocity[k])
        inverse, holder = np.linalg.inv(at.inertia[k]), at.holder[k, held]
        pushed = inverse[:, holder] @ at.p[k, :, n:, None]
        eta = -np.linalg.solve(inverse[:, holder[:, None], held], pushed)[..., 0]
        derivative = _DIFFERENTIATION @ eta / lengths[k]
        costate[k][:, n + held] += eta
        on_position = at.position[k, held]
        costate[k][:, held] -= np.where(on_position, derivative, 0.0)
        state_multipliers[k][:, held] = np.where(on_position, -_DIFFERENTIATION @ derivative / lengths[k], 0.0)
        state_multipliers[k][:, n + held] = np.where(on_position, 0.0, derivative)
    return costate, state_multipliers


def _torques(at: _At, robot: Robot) -> Array:
    """Torques, including those that hold a joint on its limit."""
    n, tau, needed = robot.nv, at.tau.copy(), inverse_dynamics(robot)
    for k in np.flatnonzero(np.any(at.position | at.velocity, axis=1)):
        held = at.holder[k, at.position[k] | at.velocity[k]]
        tau[k][:, held] = needed(at.x[k][:, :n], at.x[k][:, n:], at.rate[k][:, n:])[:, held]
    return tau
