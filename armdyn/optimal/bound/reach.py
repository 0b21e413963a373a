"""Bounds by rate limits and momentum: least times, and ranges of accelerations, torques and velocities near the ends.

If a motion begins and ends with zero acceleration under a jerk limit, an acceleration is at most the jerk limit times
the time to the nearer end. Likewise torques stay near the holding torques at the ends.

For any multipliers w, constant in time, wᵀM(q) v = wᵀp, and the change of wᵀp since the start is bounded by its rate.
The velocity of joint b is therefore, with its unit vector e_b,

    v_b(t) = wᵀp(t) + (e_b − M(q) w)ᵀ v(t),

and every w gives a bound. The w tried here solve M_FF w_F = e_b for sets F of free joints, with all others at any speed
up to their limits: F is the slowest joint alone, the two slowest, and so on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import StopCondition
from armdyn.arrays import Array, Flags
from armdyn.optimal.bound.enclosure import terms_over
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.interval import TURN, Interval, down, up

if TYPE_CHECKING:
    from armdyn.optimal.bound.cells import Cells
    from armdyn.optimal.bound.leg import BoundLeg


def least_time(starts: Interval, goals: Interval, velocity: Array, turning: Flags | None = None) -> Array:
    """Times by velocity limits from boxes to boxes [s], rounded down, of their broadcast shape without nv.

    Args:
        starts: shape (…, nv).
        goals: likewise.
        velocity: velocity limits [rad/s or m/s], shape (nv,); infinite: no limit.
        turning: whether a joint's positions are meant modulo 2π, less than two turns apart, shape (nv,); None: none.
    """
    found: Array = np.zeros(())
    for joint, most in enumerate(velocity):  # joint by joint: there may be millions of pairs
        way = goals[..., joint] - starts[..., joint]
        away = way.mignitude
        if turning is not None and turning[joint]:
            away = np.minimum(away, np.minimum((way + TURN).mignitude, (way - TURN).mignitude))
        found = np.maximum(found, down(away / most))
    return found


def accelerations(leg: BoundLeg, cells: Cells) -> Array:
    """Largest accelerations in every cell [rad/s² or m/s²], shape (n, nv); infinite: no limit."""
    if leg.start.v is None or leg.goal.v is None or cells.passed:  # at a via point any acceleration is allowed
        return np.broadcast_to(leg.acceleration, cells.v.lower.shape)
    since = np.minimum(np.minimum(*_since_ends(cells)), up(np.array(cells.longest / 2)))
    return np.minimum(leg.acceleration, up(since[:, None] * leg.jerk))


def torques(leg: BoundLeg, cells: Cells) -> Interval:
    """Torques in every cell [N m or N], shape (n, nv)."""
    actuators = leg.torque.actuators
    found = Interval(actuators.lower, actuators.upper).spread(cells.v.lower.shape)
    if cells.passed or not np.any(np.isfinite(leg.torque_rate)):
        return found
    for end, since in zip((leg.start, leg.goal), _since_ends(cells), strict=True):
        terms = terms_over(leg.dynamics, end.q[None])
        open_ = up(np.sum(terms.gravity_gradient.magnitude[0], axis=0))
        hold = terms.gravity[0] + Interval(-open_, open_)
        held = (hold.lower >= actuators.lower) & (hold.upper <= actuators.upper)  # else any initial torque
        if end.at_rest and np.all(held):
            margin = up(since[:, None] * leg.torque_rate)
            found = found.meet(Interval(hold.lower - margin, hold.upper + margin))
    return found.outward()


def _since_ends(cells: Cells) -> tuple[Array, Array]:
    """Largest time since the start, and to the goal, in every cell [s], rounded up, each of shape (n,)."""
    times = Interval.at(cells.times.upper)
    return times.running().upper[1:], times[::-1].running().upper[:0:-1]


_HUGE = 1e100
"""Acceleration [rad/s² or m/s²] that replaces infinity, whose sums are undefined."""


@dataclass(frozen=True, eq=False)
class End:
    """End of a leg, with time and motion measured from it.

    Attributes:
        inertia: M at the end [kg m²], shape (nv, nv).
        v: velocity at the end [rad/s or m/s], shape (nv,).
        outward: 1 if time runs forward from the end, -1 if backward.
    """

    inertia: Interval
    v: Array
    outward: int

    @classmethod
    def at(cls, leg: BoundLeg, outward: int) -> End | None:
        """A leg's start (outward 1) or goal (-1); None if any velocity is allowed."""
        v = (leg.start if outward > 0 else leg.goal).v
        return None if v is None else cls(leg.inertia[0 if outward > 0 else 1], v, outward)

    @property
    def momentum(self) -> Interval:
        """Momentum M v [N m s], shape (nv,)."""
        return self.inertia.times(self.v[:, None])[:, 0]


def reached(leg: BoundLeg, cells: Cells, forces: Forces, stop: StopCondition) -> Interval:
    """Bounds of the velocities in every cell, from both ends, shape (n, nv); wider ones once stopped."""
    lower, upper = cells.v.lower.copy(), cells.v.upper.copy()
    times, fastest = cells.times, accelerations(leg, cells)
    for outward in (1, -1):
        end, own = End.at(leg, outward), np.arange(len(lower))[::outward]
        later = np.flatnonzero(cells.elastic[own[1:]])
        own = own[: later[0] + 2] if later.size else own  # beyond an elastic cell momentum is unbounded
        if end is not None:
            found = by_momentum(leg, end, times[own], forces[own], stop)
            met = found.meet(_accelerated(end, times.upper[own], fastest[own]))
            lower[own], upper[own] = np.maximum(lower[own], met.lower), np.minimum(upper[own], met.upper)
    return Interval(lower, upper)


_AT_ONCE = 2**25
"""Products of one call that nothing stops: some seconds of arms of 30 joints, which have 500 multipliers."""


def by_momentum(leg: BoundLeg, end: End, times: Interval, forces: Forces, stop: StopCondition) -> Interval:
    """Bounds of the velocities in consecutive cells, shape (k, nv).

    Args:
        leg: leg with the end.
        end: end at which the first cell begins.
        times: lengths of the cells [s], shape (k,).
        forces: forces over the cells, in order from the end.
        stop: stopping condition, polled between multipliers of large arms; once true, the bounds so far are returned.
    """
    each, joint = multipliers(leg, end)
    lower, upper = forces.v.lower.copy(), forces.v.upper.copy()
    many = max(1, _AT_ONCE // forces.terms.inertia_derivatives.lower.size)
    for first in range(0, len(joint), many):
        if first and stop():
            break
        w, own = each[:, first : first + many], joint[first : first + many]
        units = np.zeros_like(w)
        units[own, np.arange(len(own))] = 1.0
        rate = forces.rate(w)
        changes = (times[:, None] * (rate if end.outward > 0 else -rate)).running()
        at_nodes = end.momentum[None].times(w) + changes
        momentum = at_nodes[:-1].hull(at_nodes[1:])
        bounds = momentum + forces.rate(np.zeros_like(w), Interval.at(units), Interval.at(-w))
        np.maximum.at(lower.T, own, bounds.lower.T)
        np.minimum.at(upper.T, own, bounds.upper.T)
    return forces.v.meet(Interval(lower, upper))


def _accelerated(end: End, times: Array, most: Array) -> Interval:
    """Bounds by the largest accelerations, shape (k, nv)."""
    margin = (Interval.at(times[:, None]) * Interval.at(np.minimum(most, _HUGE))).running().upper[1:]
    return Interval.at(end.v) + Interval(-margin, margin)


def multipliers(leg: BoundLeg, end: End) -> tuple[Array, NDArray[np.intp]]:
    """Multipliers, shape (nv, m), and the joint bounded by each, shape (m,)."""
    inertia = end.inertia.lower / 2 + end.inertia.upper / 2
    nv = len(inertia)
    torque = leg.torque.actuators.strongest
    times = leg.velocity / (np.abs(np.linalg.inv(inertia)) @ torque)  # [s] to the greatest speed, roughly
    slowest = np.argsort(-times)
    columns, joints = [], []
    for size in range(1, nv + 1):
        free = slowest[:size]
        solved = np.zeros((nv, size))
        solved[free] = np.linalg.inv(inertia[np.ix_(free, free)])
        columns.append(solved)
        joints.append(free)
    return np.concatenate(columns, axis=1), np.concatenate(joints)


def at_ends(leg: BoundLeg, w: Array, speed: Array) -> Interval:
    """w(0)ᵀ p(0) − w(T)ᵀ p(T), and likewise for velocities under acceleration limits, if there are multipliers.

    Args:
        leg: leg with the ends.
        w: multipliers of the momentum at the nodes, shape (nodes, nv).
        speed: multipliers of the velocities, likewise.
    """
    total = Interval.at(0.0)
    for outward, node in ((1, 0), (-1, -1)):
        end = End.at(leg, outward)
        if end is not None:
            share = (end.momentum * Interval.at(w[node])).sum(0)
            share = share + (Interval.at(end.v) * Interval.at(speed[node])).sum(0)
            total = total + (share if outward > 0 else -share)
    return total
