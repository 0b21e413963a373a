"""Distances of a curve's poses from obstacles and from the arm itself, linear in its control points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from armdyn.models.scene.collision import CollisionModel
from armdyn.optimal.flat.basis import DEGREE
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.program import CurveLayout
from armdyn.optimal.path_constraints.constraint import AskedDistances
from armdyn.optimal.task.policy.sequential import SequentialPolicy

Array = NDArray[np.float64]
Index = NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class Linearised:
    """Distances near one curve: `distances + jacobian @ step`, each with what is asked of it.

    Attributes:
        spare: distances less those that are asked [m], shape (rows,).
        jacobian: by the unknowns, shape (rows, unknowns).
        samples: of which pose each row is, shape (rows,).
        missing: largest shortfall at every pose [m], shape (poses,); 0 where everything is kept.
    """

    spare: Array
    jacobian: csr_matrix
    samples: Index
    missing: Array


@dataclass(frozen=True, eq=False)
class ClearanceRows:
    """Pairs of a scene that keep distances at some poses of a curve.

    Attributes:
        model: of the scene.
        asked: distances to be kept [m], shape (pairs,).
        places: parts of every leg's duration at which they are asked for, each of shape (poses,).
        within: pairs that are no farther apart than this [m] count,
        most: and so many at every pose at most.
    """

    model: CollisionModel
    asked: Array
    places: tuple[Array, ...]
    within: float
    most: int

    @property
    def poses(self) -> int:
        """Number of poses of all legs."""
        return sum(len(places) for places in self.places)

    def at(self, curve: Curve, shape: CurveLayout, x: Array) -> Linearised:
        """Linearise all distances at the unknowns x, shape (shape.size,)."""
        index, weights = list[Array](), list[Array]()
        for k, (leg, places) in enumerate(zip(curve.legs, self.places, strict=True)):
            weights.append(leg.basis.local(places, derivatives=0)[:, 0])
            windows = leg.basis.interval_of(places)[:, None] + np.arange(DEGREE + 1)
            index.append(shape.points(k)[windows])
        of_pose, basis = np.concatenate(index), np.concatenate(weights)
        near = self.model.near(np.einsum("pi,pin->pn", basis, x[of_pose]), self.within, self.most)
        spare, missing = near.distances - self.asked[near.pairs], np.zeros(self.poses)
        np.maximum.at(missing, near.poses, -spare)
        columns, values = of_pose[near.poses], near.gradients[:, None] * basis[near.poses][..., None]
        rows = np.repeat(np.arange(spare.size), columns[0].size if spare.size else 0)
        jacobian = csr_matrix((values.ravel(), (rows, columns.ravel())), shape=(spare.size, shape.size))
        return Linearised(spare, jacobian, near.poses, missing)


def clearance_rows(asked: AskedDistances, guess: Curve, policy: SequentialPolicy) -> ClearanceRows:
    """Rows for distances at even places of every leg and where they were missed before."""
    fine = guess.legs[0].basis.intervals > policy.coarse
    even = np.linspace(0, 1, (policy.poses if fine else policy.coarse_poses) + 2)[1:-1]
    places = tuple(np.sort(np.append(even, more)) for more in asked.places)
    return ClearanceRows(
        asked.model, np.minimum(asked.clearance + policy.spare, asked.most), places, policy.within, policy.pairs
    )
