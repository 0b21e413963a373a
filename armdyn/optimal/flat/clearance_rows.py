"""Distances of a curve's poses from obstacles and from the arm itself, linear in its control points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from armdyn.models.scene.collision import CollisionModel, NearPairs
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
        spare, rows, cols, values, samples = list[float](), list[Index](), list[Index](), list[Array](), list[int]()
        missing, first = np.zeros(self.poses), 0
        for k, (leg, places) in enumerate(zip(curve.legs, self.places, strict=True)):
            points = shape.points(k)
            basis, windows = leg.basis.local(places, derivatives=0)[:, 0], leg.basis.interval_of(places)
            for m, (weights, window) in enumerate(zip(basis, windows, strict=True), start=first):
                index = points[window : window + DEGREE + 1]
                near = self.model.near(weights @ x[index], self.within, self.most)
                left = near.distances - self.asked[near.pairs]
                missing[m] = max(0.0, float(-np.min(left, initial=0.0)))
                self._add(near, weights, index, len(spare), (rows, cols, values))
                spare.extend(left.tolist())
                samples.extend([m] * left.size)
            first += len(places)
        size = (len(spare), shape.size)
        entries = tuple(np.concatenate(part) if part else np.empty(0) for part in (values, rows, cols))
        jacobian = csr_matrix((entries[0], (entries[1].astype(int), entries[2].astype(int))), shape=size)
        return Linearised(np.array(spare), jacobian, np.array(samples, dtype=int), missing)

    @staticmethod
    def _add(
        near: NearPairs, weights: Array, index: Index, first: int, entries: tuple[list[Index], list[Index], list[Array]]
    ) -> None:
        """Entries of the Jacobian at one pose: B-splines times gradients."""
        count = near.pairs.size
        if not count:
            return
        rows, cols, values = entries
        values.append((near.gradients[:, None, :] * weights[None, :, None]).ravel())
        cols.append(np.tile(index.ravel(), count))
        rows.append(np.repeat(first + np.arange(count), index.size))


def clearance_rows(asked: AskedDistances, guess: Curve, policy: SequentialPolicy) -> ClearanceRows:
    """Rows for distances at even places of every leg and where they were missed before."""
    fine = guess.legs[0].basis.intervals > policy.coarse
    even = np.linspace(0, 1, (policy.poses if fine else policy.coarse_poses) + 2)[1:-1]
    places = tuple(np.sort(np.append(even, more)) for more in asked.places)
    return ClearanceRows(
        asked.model, np.minimum(asked.clearance + policy.spare, asked.most), places, policy.within, policy.pairs
    )
