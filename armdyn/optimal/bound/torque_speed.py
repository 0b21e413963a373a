"""Torque-speed curves in the bound: a line |τ + s v| ≤ c of a curve is a torque of at most c, and a damping s.

For w ≥ 0 a torque's w τ is at most w (c - s v), for w < 0 at most -w (c + s v). So is any average over a joint's lines,
the limits that are the same at all speeds among them. Near the speed limit that is less than the largest torque,
wherever the proof prices velocity, too.
"""

from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.models.values.actuator_limits import ActuatorLimits
from armdyn.optimal.bound.enclosure.interval import Interval, down, up
from armdyn.optimal.bound.forces import Forces

_ROUNDED = 1e-9
"""Part of the shares that is taken off, so that rounded they never exceed the whole."""


@dataclass(frozen=True, eq=False)
class Line:
    """One line of all joints' torque-speed curves.

    Attributes:
        slope: s [N m s/rad or N s/m], shape (nv,).
        torque: τ + s v of all torques in the boxes [N m or N], shape (boxes, nv).
        given: which joints have such a line, shape (nv,); of the others s is 0.
    """

    slope: Array
    torque: Interval
    given: Flags


def lines_of(actuators: ActuatorLimits, forces: Forces) -> tuple[Line, ...]:
    """Lines of the torque-speed curves over boxes of velocities; none where torque limits are the same at all speeds.

    Raises:
        SpecError: the actuators have no lines, see `ActuatorLimits.lines`.
    """
    found, same, v = [], forces.torque, forces.v
    for slope, rest in zip(*actuators.lines, strict=True):
        given = np.isfinite(rest)
        # Beyond the speed at which nothing is left to drive, a joint brakes with all its torque, but no more.
        upper = np.maximum(rest, up(actuators.lower + up(slope * v.upper)))
        lower = np.minimum(-rest, down(actuators.upper + down(slope * v.lower)))
        torque = Interval(np.where(given, lower, same.lower), np.where(given, upper, same.upper))
        found.append(Line(np.where(given, slope, 0.0), torque, given))
    return tuple(found)


def shares_of(lines: Array, whole: Array) -> Array:
    """Shares of the lines in multipliers w, shape (lines, nodes, nv); their sum over the lines is at most 1.

    Args:
        lines: multipliers of the lines, shape (lines, nodes, nv).
        whole: w, shape (nodes, nv).
    """
    shares = np.clip(lines / np.where(whole == 0, 1.0, whole), 0.0, 1.0)
    return np.asarray(shares * (1 - _ROUNDED) / np.maximum(np.sum(shares, axis=0), 1.0))


def rate_by_lines(
    actuators: ActuatorLimits, forces: Forces, w: Array, shares: Array, way: Interval, steps: Interval | None = None
) -> Interval:
    """Enclosure of the greatest value of `Forces.rate`, where torques keep within torque-speed curves, too.

    Args:
        actuators: with the curves.
        forces: over boxes.
        w: multipliers, shape (boxes, nv, m).
        shares: of the lines in them, shape (lines, boxes, nv, m).
        way: see `Forces.rate`.
        steps: likewise.
    """
    if not shares.size:
        return forces.rate(w, way, steps)
    rest = Interval.at(np.zeros(w[:, 0].shape))
    for line, share in zip(lines_of(actuators, forces), shares, strict=True):
        part = Interval.at(w) * Interval.at(np.where(line.given[:, None], share, 0.0))
        above = (line.torque - Interval.at(forces.torque.upper)).upper[..., None]
        below = (line.torque - Interval.at(forces.torque.lower)).lower[..., None]
        rest = rest + (part * Interval.at(np.where(w > 0, above, below))).sum(1)
        way = way - part * Interval.at(line.slope[:, None])
    return forces.rate(w, way, steps) + rest
