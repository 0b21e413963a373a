"""Proof that a motion keeps its clearances between the samples: bisection by bounds on speed and acceleration.

Two bodies whose relative motion between two times is at most L are apart by (d0 + d1 - L) / 2 at least in between
(Schwarzer, Saha, Latombe, "Adaptive dynamic collision checking", IEEE Transactions on Robotics 21(3), 2005). Where that
is not enough, the plane between them at either end is moved with the velocities of their points: what accelerations add
falls with the square of the time.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arrays import Array
from armdyn.locks import built_once
from armdyn.models.scene.collision import Clearance, CollisionModel
from armdyn.models.scene.motion_bounds import MotionBounds, chain_of, reaches
from armdyn.trajectory import Trajectory

PIECES = 64
"""Equal parts of a motion that are looked at first: most need no second look at an arm's usual speeds."""
MOST = 20_000
"""Pairs looked at again before the proof is given up: among shelves it takes a few hundred."""


@dataclass(frozen=True, eq=False)
class ClearanceProof:
    """Proven smallest distances of a scene's pairs along a motion.

    Attributes:
        nearest: where the nearest pair is nearest; `sure` if every pair keeps what is asked at all times.
        missed: times at which a pair is nearer than asked [s], increasing.
    """

    nearest: Clearance
    missed: tuple[float, ...]


def prove_clearance(model: CollisionModel, motion: Trajectory, asked: ArrayLike) -> ClearanceProof:
    """Prove that every pair keeps its distance along a motion, or find times at which it does not.

    Args:
        model: of the scene.
        motion: between its samples joints follow cubics, as `Trajectory` interpolates them.
        asked: distances to be kept [m], shape (pairs,) or one for all.
    """
    if not model.pairs:
        nowhere = Clearance(np.inf, float(motion.t[0]), "nothing", "nothing", True)
        return ClearanceProof(nowhere, ())
    bounds, reach = MotionBounds(model.robot, motion), relative_reach(model)
    distances = np.broadcast_to(np.asarray(asked, dtype=float), (len(model.pairs),))
    return ClearanceProof(*model.prove(motion, (bounds.travel, bounds.acceleration, reach), distances, (PIECES, MOST)))


@built_once(maxsize=16)
def relative_reach(model: CollisionModel) -> Array:
    """Largest relative displacement of points of a pair's bodies per joint travel.

    Returns:
        [m/rad], or 1 for a sliding joint, shape (pairs, nv); 0 for joints that move both bodies or none.
    """
    robot, reach = model.robot, reaches(model.robot)
    joints, of_pair = np.unique(model.joints, axis=0, return_inverse=True)
    out = np.zeros((len(joints), robot.nv))
    chains = [set(chain_of(robot, joint)) for joint in range(robot.model.njoints)]
    for k, (first, second) in enumerate(joints):
        for joint in chains[first] ^ chains[second]:
            out[k, joint - 1] = reach[first if joint in chains[first] else second, joint - 1]
    return out[of_pair.reshape(-1)]
