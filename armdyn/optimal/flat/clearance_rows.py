"""Distances of a curve's poses from obstacles and the arm itself, linear in its control points."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from armdyn.arrays import Array, Index
from armdyn.locks import cached_property
from armdyn.models.scene.collision import CollisionModel
from armdyn.optimal.flat.basis import Basis
from armdyn.optimal.flat.curve import Curve, CurveLeg
from armdyn.optimal.flat.program import CurveLayout
from armdyn.optimal.path_constraints.constraint import RequiredDistances
from armdyn.optimal.task.policy.sequential import SequentialPolicy


@dataclass(frozen=True, eq=False)
class Linearised:
    """Linearised distances of a curve: `spare + jacobian @ step` must not be negative.

    Attributes:
        spare: distances minus the required ones [m], shape (rows,).
        jacobian: derivatives with respect to the unknowns, shape (rows, unknowns).
        samples: index of each row's pose, shape (rows,).
        missing: largest shortfall at every pose [m], shape (poses,); 0 without any.
    """

    spare: Array
    jacobian: csr_matrix
    samples: Index
    missing: Array


@dataclass(frozen=True, eq=False)
class ClearanceRows:
    """Distance rows of a scene's pairs at some poses of a curve.

    Attributes:
        model: collision model of the scene.
        required: required distances [m], shape (pairs,).
        legs: basis of each leg, and its poses as parts of its duration.
        within: largest distance of a pair with a row [m].
        most: largest number of rows per pose.
    """

    model: CollisionModel
    required: Array
    legs: tuple[tuple[Basis, Array], ...]
    within: float
    most: int

    @cached_property
    def _weights(self) -> Array:
        """Weights of the control points on which a pose depends, shape (poses, WINDOW)."""
        return np.concatenate([basis.local(s, 0)[:, 0] for basis, s in self.legs])

    def at(self, shape: CurveLayout, x: Array) -> Linearised:
        """Linearise all distances at the unknowns x, shape (shape.size,)."""
        of_pose = shape.windows(self.legs)
        near = self.model.near(np.einsum("pi,pin->pn", self._weights, x[of_pose]), self.within, self.most)
        spare, missing = near.distances - self.required[near.pairs], np.zeros(len(of_pose))
        np.maximum.at(missing, near.poses, -spare)
        columns, values = of_pose[near.poses], near.gradients[:, None] * self._weights[near.poses][..., None]
        starts = np.arange(spare.size + 1) * of_pose[0].size
        jacobian = csr_matrix((values.ravel(), columns.ravel(), starts), shape=(spare.size, shape.size))
        return Linearised(spare, jacobian, near.poses, missing)


def clearance_rows(required: RequiredDistances, guess: Curve, policy: SequentialPolicy) -> ClearanceRows:
    """Rows at evenly spaced places of every leg, where distances were violated before, and where pairs pass closely."""
    longest = max(leg.basis.intervals for leg in guess.legs)
    fine = longest > policy.coarse
    most = policy.poses if fine else policy.coarse_poses
    least = np.minimum(required.clearance + policy.clearance_added, required.most)
    legs = []
    for leg, more in zip(guess.legs, required.places, strict=True):
        even = np.linspace(0, 1, -(-most * leg.basis.intervals // longest) + 2)
        passing = _passing(required.model, leg, even, least + policy.passing) if fine else even[:0]
        near = np.concatenate([more, passing])
        around = (near[:, None] + even[1] * policy.neighbour_distance * np.array([-1, 0, 1])).ravel()
        # Places nearer than a hundredth of a step are redundant.
        all_ = np.unique(np.round(np.concatenate([even, around]) / (0.01 * even[1]))) * 0.01 * even[1]
        legs.append((leg.basis, all_[(all_ > 0) & (all_ < 1 - 1e-9)]))
    return ClearanceRows(required.model, least, tuple(legs), policy.within, policy.pairs)


_FINER = 8
"""Parts of two steps that are sampled for the time of least distance, twice: 1/32 of a step is accurate enough."""


def _passing(model: CollisionModel, leg: CurveLeg, even: Array, near: Array) -> Array:
    """Parts of a leg's duration at the least distances of pairs that come nearer than `near` [m], shape (pairs,)."""
    distances = model.distances(leg.at(even)[0], float(np.max(near)))
    before, here, after = distances[:-2], distances[1:-1], distances[2:]
    steps, pairs = np.nonzero((here <= before) & (here <= after) & (here < near))
    out = []
    for step, pair in zip(steps + 1, pairs, strict=True):
        first, last = even[step - 1], even[step + 1]
        for _ in range(2):
            times = np.linspace(first, last, _FINER + 1)
            found = model.distances_of(np.array([pair]), leg.at(times)[0])
            k = int(np.clip(np.argmin(found), 1, _FINER - 1))
            first, last = times[k - 1], times[k + 1]
        out.append((first + last) / 2)
    return np.array(out)
