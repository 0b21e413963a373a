"""What Coulomb friction asks of meshes and guesses: it changes in the blink in which a joint turns around."""

import warnings
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armdyn.errors import ArmdynWarning
from armdyn.models.friction import JointFriction
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_SAMPLES = 4000
"""Of a motion, in which the turns are looked for."""
_REACH = 3.0
"""Widths of the smoothed jump at which the mesh begins to thin out: friction is 0.5 % short of its all there."""
_IN_LAYERS = 0.5
"""Part of the intervals that the turns get, all together."""


def without_dry_friction(problem: MinimumTimeProblem) -> MinimumTimeProblem:
    """The same without Coulomb friction, to begin with; itself if it has none."""
    if not np.any(problem.robot.friction.coulomb):
        return problem
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ArmdynWarning)  # of the goal's holding torque: said already
        return replace(problem, robot=problem.robot.with_friction(friction=0.0), goal_pose=None, wrap=False)


def mesh_measure(guess: Trajectory, friction: JointFriction) -> tuple[Array, Array] | None:
    """How densely a mesh should stand: a part of all intervals against a part of the duration.

    Half of the intervals stand evenly in time, half evenly in the change of tanh(v / width), summed over the
    joints: equidistribution of a monitor function (Ascher, Mattheij and Russell, Numerical Solution of
    Boundary Value Problems for Ordinary Differential Equations, section 9.3).

    Args:
        guess: about the motion.
        friction: of its joints.

    Returns:
        Increasing parts of the duration and of the intervals, both from 0 to 1; None where even will do.
    """
    dry = np.broadcast_to(np.asarray(friction.coulomb) > 0, guess.v.shape[1:])
    if not np.any(dry):
        return None
    s = np.linspace(0, 1, _SAMPLES + 1)
    v = guess(guess.t[0] + s * guess.duration).v[:, dry]
    change = np.sum(np.abs(np.diff(np.tanh(v / (_REACH * friction.width)), axis=0)), axis=1)
    if not np.any(change):
        return None
    turns = np.append(0.0, np.cumsum(change) / np.sum(change))
    return s, (1 - _IN_LAYERS) * s + _IN_LAYERS * turns


def fractions_within(edges: Array, counts: NDArray[np.int_], measure: tuple[Array, Array] | None) -> Array:
    """Lengths of intervals as parts of the arcs that they divide, shape (sum of counts,).

    Args:
        edges: ends of the arcs as parts of the duration, shape (arcs + 1,).
        counts: intervals of every arc, shape (arcs,).
        measure: see `mesh_measure`; None: all of an arc's intervals are of one length.
    """
    if measure is None:
        return np.repeat(1 / counts, counts)
    parts = []
    levels = np.interp(edges, *measure)
    for count, (a, b), (low, high) in zip(counts, pairwise(edges), pairwise(levels), strict=True):
        knots = np.interp(np.linspace(low, high, count + 1), measure[1], measure[0])
        knots[0], knots[-1] = a, b
        parts.append(np.diff(knots) / (b - a))
    return np.concatenate(parts)
