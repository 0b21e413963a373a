"""Poses of an arm that take the most torque to be held."""

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array
from armdyn.models.reading.urdf_arm import configurations

_POSES, _SWEEPS = 1000, 2
"""Random poses, and sweeps over the joints that improve the best of them."""
_MANY = 40
"""Number of joints from which it is not improved: the time grows with its cube."""
_SIMPLER = 0.98
"""Part of the largest holding torque that suffices in a pose that leaves more joints at zero."""


def hardest_poses(model: pin.Model, lower: Array, upper: Array) -> list[tuple[Array, float]]:
    """For each joint a pose within limits that takes nearly the most torque to be held, and the torque [N m or N].

    The zero pose and the best of random ones are improved joint by joint.

    Args:
        model: of the arm.
        lower: position limits [rad or m], shape (nv,); beyond half a turn none counts.
        upper: likewise.
    """
    data, at, joints = model.createData(), configurations(model), np.arange(model.nv)
    lower, upper = (np.clip(each, -np.pi, np.pi) for each in (lower, upper))
    rest, found = np.clip(np.zeros(model.nv), lower, upper), []
    poses = np.vstack([rest, np.random.default_rng(0).uniform(lower, upper, (_POSES, model.nv))])

    def torque(q: Array) -> Array:
        return np.array(pin.computeGeneralizedGravity(model, data, at(q)))

    def climbed(q: Array, j: int) -> Array:
        """A pose that takes more: the torque is A + B cos q + C sin q in an angle, linear in a displacement."""
        for i in _SWEEPS * list(joints) if model.nv < _MANY else ():

            def moved(x: float, i: int = i, q: Array = q) -> Array:
                return np.where(joints == i, x, q)

            zero, quarter, half = (torque(moved(x))[j] for x in (0.0, np.pi / 2, np.pi))
            peak = np.arctan2(quarter - (zero + half) / 2, (zero - half) / 2)
            marks = np.clip([*(peak + np.pi * np.arange(1, -2, -1)), np.inf, -np.inf], lower[i], upper[i])
            q = max((q, *map(moved, marks)), key=lambda one: float(f"{abs(torque(one)[j]):.9e}"))
        return q

    best = np.argmax(np.abs([torque(q) for q in poses]), axis=0)
    for j in joints:
        every = [climbed(poses[k], j) for k in (0, best[j])]
        most = max(abs(torque(q)[j]) for q in every)
        q = next(one for one in every if abs(torque(one)[j]) >= _SIMPLER * most)
        for i in joints:  # joints that hardly matter stay at zero
            simpler = np.where(joints == i, rest, q)
            q = simpler if abs(torque(simpler)[j]) >= _SIMPLER * most else q
        found.append((q, float(torque(q)[j])))
    return found
