"""The motion that a multi-phase solution stands for, as a trajectory."""

from collections.abc import Sequence
from functools import cache

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.optimal.arcs.arc import HELD, Arc, Mode
from armdyn.optimal.arcs.phases import TABLEAU
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.policy.refinement import ArcsPolicy
from armdyn.optimal.task.tableau import differentiation, lagrange
from armdyn.trajectory import Trajectory


def motion_of(
    problem: MinimumTimeProblem,
    arcs: Sequence[Arc],
    arc_of: Index,
    t: Array,
    states: Array,
    tau: Array,
    numbers: ArcsPolicy,
) -> Trajectory:
    """The polynomials of the intervals, sampled.

    Args:
        problem: says the limits, which no torque exceeds.
        arcs: the modes of the joints.
        arc_of: which arc an interval is in, shape (K,).
        t: knots [s], shape (K + 1,).
        states: (q, v) at the start of every interval and at its stages, shape (K, stages + 1, 2, nv).
        tau: torques at the stages [N m or N], shape (K, stages, nv).
        numbers: samples of an interval of constant torques, and of all others together, 4 to 16 on each.
    """
    limits = problem.limits
    varying = sum(any(mode not in HELD for mode in arcs[a].modes) for a in arc_of)
    samples = int(np.clip(numbers.samples // max(varying, 1), 4, 16))
    rows_t, rows_x, rows_tau = [], [], []
    for k, a in enumerate(arc_of):
        constant = all(mode in HELD for mode in arcs[a].modes)
        s, at_stages, at_nodes, curvature = _weights(numbers.on_interval if constant else samples)
        values = at_stages @ tau[k]
        if not constant:  # lines between the samples shall have the polynomial's impulse, not only its values
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
    # Where the torque does not jump the sample one ulp before a knot says nothing new.
    jump = np.append(np.any(np.abs(np.diff(values, axis=0)) > 0, axis=1) | (np.diff(times) > 1e-13), True)
    names = problem.robot.joint_names
    return Trajectory(times[jump], x[jump, 0], x[jump, 1], values[jump], names, "minimum time")


@cache
def _weights(steps: int) -> tuple[Array, Array, Array, Array]:
    """Parts of an interval, and there the weights of the stages, of its start and the stages, and of the curvature."""
    s = np.linspace(0, 1, steps + 1)
    at_stages, slopes = lagrange(TABLEAU.c, s), differentiation(TABLEAU.c)
    return s, at_stages, lagrange(np.append(0.0, TABLEAU.c), s), at_stages @ slopes @ slopes
