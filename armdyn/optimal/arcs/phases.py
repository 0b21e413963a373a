"""Solution of a multi-phase problem: durations of its arcs, costates, and its motion as a trajectory."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.optimal.arcs.arc import HELD, Arc, Mode
from armdyn.optimal.arcs.grid import Density
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.task.policy.refinement import ArcsPolicy
from armdyn.optimal.task.tableau import RADAU_5, differentiation, lagrange
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

TABLEAU = RADAU_5
"""Tableau of the arcs: motion is smooth within each, and order nine is exact to rounding on a few intervals."""


@brief
@dataclass(frozen=True, eq=False)
class Phases:
    """A solved multi-phase problem.

    Attributes:
        arcs: arcs with the solved durations.
        t: times of the knots [s], shape (K + 1,).
        q: positions at the knots, shape (K + 1, nv).
        v: velocities, shape (K + 1, nv).
        costate: ρ = ∂(time to go)/∂(q, v) at the knots, from the multipliers, shape (K + 1, 2 nv).
        tau: torques at the stages, shape (K, stages, nv).
        arc_of: index of each interval's arc, shape (K,).
        stage_q: positions at the stages, shape (K, stages, nv).
        stage_v: velocities at the stages, shape (K, stages, nv).
        stage_costate: ∫ρ over each stage's share of the time, shape (K, stages, 2 nv): multiplier of a change of the
            rates.
        torque_multiplier: ∂t_f/∂tau at the stages [s/(N m)], shape (K, stages, nv); 0 where the torque is free.
        state_multiplier: ∂t_f/∂(q, v) at the inner stages [s/rad, s²/rad], shape (K, stages - 1, 2, nv).
        knot_multiplier: ∂t_f/∂(q, v) at the inner knots, shape (K - 1, 2, nv).
        torques: motion sampled from the collocation polynomials, for `replay_torques` and as a guess.
        mesh_density: density of this mesh; None: intervals in proportion to the arcs' lengths.
        density: density of the next mesh; None: unknown, as for an integrator's solution.
        iterations: iterations of IPOPT.
    """

    arcs: tuple[Arc, ...]
    t: Array
    q: Array
    v: Array
    costate: Array
    tau: Array
    arc_of: Index
    stage_q: Array
    stage_v: Array
    stage_costate: Array
    torque_multiplier: Array
    state_multiplier: Array
    knot_multiplier: Array
    torques: Trajectory
    mesh_density: Density | None = None
    density: Density | None = None
    iterations: int = 0

    @property
    def duration(self) -> float:
        """t_f [s]."""
        return float(self.t[-1])


@dataclass(frozen=True, eq=False)
class Unresolved:
    """Phases that did not converge.

    Attributes:
        message: IPOPT's status in words.
        status: status of the solve.
        iterations: iterations of IPOPT.
        last: last iterate: at best a guess of a solution.
    """

    message: str
    status: Status
    iterations: int
    last: Phases


def motion_of(
    problem: MinimumTimeProblem,
    arcs: Sequence[Arc],
    arc_of: Index,
    t: Array,
    states: Array,
    tau: Array,
    numbers: ArcsPolicy,
) -> Trajectory:
    """Sample the intervals' polynomials as a motion.

    Args:
        problem: problem with the limits, to which torques are clipped.
        arcs: the modes of the joints.
        arc_of: index of each interval's arc, shape (K,).
        t: knots [s], shape (K + 1,).
        states: (q, v) at the start of every interval and at its stages, shape (K, stages + 1, 2, nv).
        tau: torques at the stages [N m or N], shape (K, stages, nv).
        numbers: number of samples of an interval of constant torques, and of all other intervals together, 4 to 16 on
            each.
    """
    limits = problem.limits
    varying = sum(any(mode not in HELD for mode in arcs[a].modes) for a in arc_of)
    samples = int(np.clip(numbers.samples // max(varying, 1), 4, 16))
    rows_t, rows_x, rows_tau = [], [], []
    for k, a in enumerate(arc_of):
        constant = all(mode in HELD for mode in arcs[a].modes)
        s, at_stages, at_nodes, curvature = _weights(numbers.on_interval if constant else samples)
        values = at_stages @ tau[k]
        if not constant:  # linear interpolation must have the polynomial's impulse, too
            values -= curvature @ tau[k] / (12 * samples**2)
        values = np.clip(values, limits.actuators.lower, limits.actuators.upper)
        for i, mode in enumerate(arcs[a].modes):
            if mode in HELD:
                values[:, i] = (limits.actuators.upper if mode is Mode.UPPER else limits.actuators.lower)[i]
        times = t[k] + s * (t[k + 1] - t[k])
        times[-1] = np.nextafter(t[k + 1], 0) if k < arc_of.size - 1 else t[k + 1]
        rows_t.append(times)
        rows_tau.append(values)
        rows_x.append(np.einsum("sj,jxi->sxi", at_nodes, states[k]))
    times, values, x = (np.concatenate(rows) for rows in (rows_t, rows_tau, rows_x))
    # Where the torque does not jump the sample one ulp before a knot is redundant.
    jump = np.append(np.any(np.abs(np.diff(values, axis=0)) > 0, axis=1) | (np.diff(times) > 1e-13), True)
    names = problem.robot.joint_names
    return Trajectory(times[jump], x[jump, 0], x[jump, 1], values[jump], names, "minimum time")


@cache
def _weights(steps: int) -> tuple[Array, Array, Array, Array]:
    """Points of an interval, and weights there of the stages, of start and stages, and of the curvature."""
    s = np.linspace(0, 1, steps + 1)
    at_stages, derivatives = lagrange(TABLEAU.c, s), differentiation(TABLEAU.c)
    return s, at_stages, lagrange(np.append(0.0, TABLEAU.c), s), at_stages @ derivatives @ derivatives
