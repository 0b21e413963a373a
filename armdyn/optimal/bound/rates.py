"""Bounds by rate limits: least times of joints, and ranges of accelerations and torques near the ends of a motion.

If a motion begins and ends with zero acceleration under a jerk limit, an acceleration is at most the jerk limit times
the time to the nearer end. Likewise torques stay near the holding torques at the ends.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.optimal.bound.enclosure import terms_over
from armdyn.optimal.bound.interval import TURN, Interval, down, up
from armdyn.optimal.problem.profile import Profiles

if TYPE_CHECKING:
    from armdyn.optimal.bound.cells import Cells
    from armdyn.optimal.bound.leg import BoundLeg


_ROUNDED = 1e-12
"""Part by which a time in closed form is reduced: its twenty operations err by 1e-15 each."""


def least_times(way: Array, velocity: Array, acceleration: Array, jerk: Array) -> Array:
    """Least times of single joints from rest to rest, with zero acceleration at both ends [s], rounded down.

    Args:
        way: distances [rad or m], shape (…, nv), not negative.
        velocity: velocity limits [rad/s or m/s], shape (nv,); these and the others may be infinite.
        acceleration: acceleration limits [rad/s² or m/s²], shape (nv,).
        jerk: jerk limits [rad/s³ or m/s³], shape (nv,).
    """
    return Profiles.of(way, velocity, acceleration, jerk).durations * (1 - _ROUNDED)


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
