"""Proof that a motion keeps its clearances between the samples: bisection by bounds on speed and acceleration.

Two bodies whose relative motion between two times is at most L are apart by (d0 + d1 - L) / 2 at least in between
(Schwarzer, Saha, Latombe, "Adaptive dynamic collision checking", IEEE Transactions on Robotics 21(3), 2005). Where that
is not enough, the plane between them at either end is moved with the velocities of their points: what accelerations add
falls with the square of the time.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arrays import Array, Flags, Index
from armdyn.models.scene.collision import Clearance, CollisionModel
from armdyn.models.scene.separation import MotionBounds, chain_of, reaches
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
    return _Search(model, motion, np.broadcast_to(np.asarray(asked, dtype=float), (len(model.pairs),))).run()


@dataclass(frozen=True, eq=False)
class _Piece:
    """A part of the motion and pairs that are not proven to keep their distances in it.

    Attributes:
        ends: when it begins and ends [s].
        pairs: indices, shape (m,).
        distances: of these at its ends, or lower bounds [m], shape (2, m).
    """

    ends: tuple[float, float]
    pairs: Index
    distances: Array

    def only(self, which: Flags) -> "_Piece":
        """The piece with some of its pairs."""
        return _Piece(self.ends, self.pairs[which], self.distances[:, which])


class _Search:
    """Work space of one proof."""

    def __init__(self, model: CollisionModel, motion: Trajectory, asked: Array):
        self.model, self.motion, self.asked = model, motion, asked
        self.bounds = MotionBounds(model.robot, motion)
        # Bounds on the relative motion of every pair until each sample [m], shape (n, pairs).
        self.moved = self.bounds.travel @ relative_reach(model).T
        self.missed, self.looks = set[float](), 0
        self.nearest = model.nearest(motion.q[0], float(motion.t[0]))

    def run(self) -> ClearanceProof:
        todo, sure = self._pieces(), True
        while todo:
            piece = self._left(todo.pop())
            if piece is None:
                continue
            (a, b), middle = piece.ends, sum(piece.ends) / 2
            if self.looks >= MOST or not a < middle < b:
                sure = False
                continue
            at = self._look(middle, piece.pairs, self.model.distances_of(piece.pairs, self.motion(middle).q))
            self.looks += at.size
            todo += [
                _Piece((a, middle), piece.pairs, np.array([piece.distances[0], at])),
                _Piece((middle, b), piece.pairs, np.array([at, piece.distances[1]])),
            ]
        points = self.model.nearest(self.motion(self.nearest.time).q).points
        nearest = replace(self.nearest, sure=sure and not self.missed, points=points)
        return ClearanceProof(nearest, tuple(sorted(self.missed)))

    def _pieces(self) -> list[_Piece]:
        """Equal parts of the motion, with all pairs."""
        times = np.linspace(self.motion.t[0], self.motion.t[-1], PIECES + 1)
        every, poses = np.arange(self.asked.size), self.motion(times).q
        # A pair that is farther away than it moves in four pieces needs no more than a bound.
        far = 4 / PIECES * float(np.max(self.moved[-1])) + float(np.max(self.asked))
        found = self.model.distances(poses, far)
        at = [self._look(float(t), every, here) for t, here in zip(times, found, strict=True)]
        return [
            _Piece((float(a), float(b)), every, np.array(ends))
            for a, b, *ends in zip(times[:-1], times[1:], at[:-1], at[1:], strict=True)
        ]

    def _left(self, piece: _Piece) -> _Piece | None:
        """The pairs of a piece that are not proven, without those that are known to miss; None: there are none."""
        asked = self.asked[piece.pairs]
        open_ = (np.sum(piece.distances, axis=0) - self._moved(piece) < 2 * asked) & (
            np.min(piece.distances, axis=0) >= asked
        )
        if not np.any(open_):
            return None
        left = piece.only(open_)
        proven = self._separated(left, left.ends[0], 1.0) & self._separated(left, left.ends[1], -1.0)
        return None if np.all(proven) else left.only(~proven)

    def _separated(self, piece: _Piece, end: float, sign: float) -> Flags:
        """Which pairs keep their distances in the half of a piece at one of its ends, shape (m,)."""
        half, at = (piece.ends[1] - piece.ends[0]) / 2, self.motion(end)
        first, last = self._steps(piece)
        most = np.max(self.bounds.acceleration[first : last + 1], axis=0)
        gaps = self.model.gaps(piece.pairs, at.q, at.v, np.array([0.0, sign * half]))
        added = np.sum(most[self.model.joints[piece.pairs]], axis=1) * half**2 / 2
        return np.asarray(np.min(gaps, axis=1) - added >= self.asked[piece.pairs])

    def _look(self, time: float, pairs: Index, distances: Array) -> Array:
        """Take note of distances at a time [m], shape (m,)."""
        k = int(np.argmin(distances))
        if distances[k] < self.nearest.distance:
            self.nearest = Clearance(float(distances[k]), time, *self.model.pairs[pairs[k]])
        if np.any(distances < self.asked[pairs]):
            self.missed.add(time)
        return distances

    def _steps(self, piece: _Piece) -> tuple[int, int]:
        """The first and the last step of the motion that a piece lies in."""
        t = self.motion.t
        first, last = np.searchsorted(t, piece.ends, side="right") - 1
        return int(np.clip(first, 0, t.size - 2)), int(np.clip(last, 0, t.size - 2))

    def _moved(self, piece: _Piece) -> Array:
        """Bounds on the relative motion of its pairs in a piece [m], shape (m,)."""
        t, k = self.motion.t, np.array(self._steps(piece))
        part = ((np.array(piece.ends) - t[k]) / (t[k + 1] - t[k]))[:, None]
        first, second = self.moved[k][:, piece.pairs], self.moved[k + 1][:, piece.pairs]
        start, end = first + part * (second - first)
        return np.asarray(end - start)


def relative_reach(model: CollisionModel) -> Array:
    """Largest relative displacement of points of a pair's bodies per joint travel.

    Returns:
        [m/rad], or 1 for a sliding joint, shape (pairs, nv); 0 for joints that move both bodies or none.
    """
    robot, reach = model.robot, reaches(model.robot)
    out = np.zeros((len(model.pairs), robot.model.nv))
    chains = [set(chain_of(robot, joint)) for joint in range(robot.model.njoints)]
    for k, (first, second) in enumerate(model.joints):
        for joint in chains[first] ^ chains[second]:
            out[k, joint - 1] = reach[first if joint in chains[first] else second, joint - 1]
    return out
