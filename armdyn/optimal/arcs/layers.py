"""What Coulomb friction asks of meshes and guesses: it changes in the blink in which a joint turns around."""

import numpy as np
from numpy.typing import NDArray

from armdyn.models.friction import JointFriction
from armdyn.optimal.arcs.grid import Density
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_SAMPLES = 4000
"""Of a motion, in which the turns are looked for."""
_REACH = 3.0
"""Widths of the smoothed jump at which the mesh begins to thin out: friction is 0.5 % short of its all there."""
_IN_LAYERS = 0.5
"""Part of the intervals that the turns get, all together."""


def layered(guess: Trajectory, friction: JointFriction) -> Density | None:
    """How densely a mesh should stand.

    Half of the intervals stand evenly in time, half evenly in the change of tanh(v / width), summed over the
    joints: equidistribution of a monitor function (Ascher, Mattheij and Russell, Numerical Solution of
    Boundary Value Problems for Ordinary Differential Equations, section 9.3).

    Args:
        guess: about the motion.
        friction: of its joints.

    Returns:
        None where even will do.
    """
    dry = np.broadcast_to(np.asarray(friction.coulomb) > 0, guess.v.shape[1:])
    if not np.any(dry):
        return None
    t = np.linspace(0, guess.duration, _SAMPLES + 1)
    v = guess(guess.t[0] + t).v[:, dry]
    change = np.sum(np.abs(np.diff(np.tanh(v / (_REACH * friction.width)), axis=0)), axis=1)
    if not np.any(change):
        return None
    return Density(t, (1 - _IN_LAYERS) / _SAMPLES + _IN_LAYERS * change / np.sum(change))
