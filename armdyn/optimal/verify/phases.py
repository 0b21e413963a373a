"""Solved arcs: durations, states, costates, and the motion sampled from them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armdyn.arrays import Array, Index
from armdyn.optimal.problem.policy.refinement import ArcsPolicy
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.tableau import RADAU_5, differentiation, lagrange
from armdyn.optimal.verify.arc import HELD, Arc, Mode, bang_signs
from armdyn.optimal.verify.costates import Costates
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

TABLEAU = RADAU_5
"""Tableau of the arcs: motion is smooth within each, and order nine is exact to rounding on a few intervals."""


@brief
@dataclass(frozen=True, eq=False)
class Phases(Costates):
    """A solved multi-phase problem; the points of its costates are the stages of its intervals.

    Attributes:
        arcs: arcs with the solved durations.
        q: positions at the knots, shape (K + 1, nv).
        v: velocities, shape (K + 1, nv).
        tau: torques at the stages, shape (K, stages, nv).
        arc_of: index of each interval's arc, shape (K,).
        state_multiplier: ∂t_f/∂(q, v) at the inner stages [s/rad, s²/rad], shape (K, stages - 1, 2, nv).
        knot_multiplier: ∂t_f/∂(q, v) at the inner knots, shape (K - 1, 2, nv).
        torques: motion sampled from the collocation polynomials, for `replay_torques` and as a guess.
        mesh_density: density of this mesh; None: intervals in proportion to the arcs' lengths.
        density: density of the next mesh; None: unknown, as for an integrator's solution.
        iterations: iterations of IPOPT.
    """

    arcs: tuple[Arc, ...]
    q: Array
    v: Array
    tau: Array
    arc_of: Index
    state_multiplier: Array
    knot_multiplier: Array
    torques: Trajectory
    mesh_density: Any = None
    density: Any = None
    iterations: int = 0

    @property
    def modes(self) -> NDArray[np.str_]:
        """Modes of the joints in each interval, shape (K, nv)."""
        return np.array([arc.modes for arc in self.arcs])[self.arc_of]

    @property
    def duration(self) -> float:
        """t_f [s]."""
        return float(self.t[-1])

    @property
    def velocity(self) -> Array:
        """∂cost/∂(velocity limit) [s²/rad], shape (nv,); not positive."""
        modes, multiplier = self.modes, self.state_multiplier[:, :, 1].sum(axis=1)
        multiplier[:-1] += self.knot_multiplier[:, 1]
        forward = 1.0 * (modes == Mode.VELOCITY_UPPER) - (modes == Mode.VELOCITY_LOWER)
        return np.asarray(np.sum(multiplier * forward, axis=0))


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
    limits, modes = problem.limits.actuators, np.array([arc.modes for arc in arcs])
    held, bang = np.isin(modes, HELD), limits.extreme(bang_signs(modes))
    constant = np.all(held, axis=1)
    samples = int(np.clip(numbers.samples // max(int(np.sum(~constant[arc_of])), 1), 4, 16))
    rows_t, rows_x, rows_tau = [], [], []
    for k, a in enumerate(arc_of):
        s, at_stages, at_nodes, curvature = _weights(numbers.on_interval if constant[a] else samples)
        values = at_stages @ tau[k]
        if not constant[a]:  # linear interpolation must have the polynomial's impulse, too
            values -= curvature @ tau[k] / (12 * samples**2)
        values = np.where(held[a], bang[a], np.clip(values, limits.lower, limits.upper))
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
