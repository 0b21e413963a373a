"""Proof that a motion keeps its clearances between the samples, too: bisection per pair, by bounds on the speed.

Two bodies whose relative motion between two times is at most L are apart by (d0 + d1 - L) / 2 at least in between,
where d0 and d1 are their distances at these times (conservative advancement; Schwarzer, Saha, Latombe, "Adaptive dynamic
collision checking", IEEE Transactions on Robotics 21(3), 2005).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.models.robots.robot import Robot
from armdyn.models.scene.bodies import bodies
from armdyn.models.scene.collision import Clearance, CollisionModel
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]
Index = NDArray[np.int_]

PIECES = 64
"""Equal parts of a motion that are looked at first."""
MOST = 20_000
"""Poses looked at before the proof is given up: a Panda that slides along a wall 0.1 mm farther than asked takes 1,500."""


@dataclass(frozen=True, eq=False)
class ClearanceProof:
    """How near the pairs of a scene come to each other along a motion.

    Attributes:
        nearest: where the nearest pair is nearest; `sure` if every pair keeps what is asked at all times.
        least: least distance found of every pair, or a lower bound where it is far [m], shape (pairs,).
        missed: times at which a pair is nearer than asked [s], increasing.
    """

    nearest: Clearance
    least: Array
    missed: tuple[float, ...]


def prove_clearance(model: CollisionModel, motion: Trajectory, asked: ArrayLike) -> ClearanceProof:
    """Prove that every pair keeps its distance along a motion, or find times at which it does not.

    Args:
        model: of the scene.
        motion: between its samples joints follow cubics, as `Trajectory` interpolates them.
        asked: distances to be kept [m], shape (pairs,) or one for all.
    """
    search = _Search(model, motion, np.broadcast_to(np.asarray(asked, dtype=float), (len(model.pairs),)))
    return search.run()


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


class _Search:
    """Work space of one proof."""

    def __init__(self, model: CollisionModel, motion: Trajectory, asked: Array):
        self.model, self.motion, self.asked = model, motion, asked
        # Bounds on the relative motion of every pair until each sample [m], shape (n, pairs).
        self.moved = _travel(motion) @ relative_reach(model).T
        self.least, self.missed, self.looks = np.full(asked.size, np.inf), set[float](), 0
        self.nearest = model.nearest(motion.q[0], float(motion.t[0]))

    def run(self) -> ClearanceProof:
        if not self.model.pairs:
            return ClearanceProof(replace(self.nearest, sure=True), self.least, ())
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
            todo += [
                _Piece((a, middle), piece.pairs, np.array([piece.distances[0], at])),
                _Piece((middle, b), piece.pairs, np.array([at, piece.distances[1]])),
            ]
        nearest = replace(self.nearest, sure=sure and not self.missed)
        return ClearanceProof(nearest, self.least, tuple(sorted(self.missed)))

    def _pieces(self) -> list[_Piece]:
        """Equal parts of the motion, with all pairs."""
        times = np.linspace(self.motion.t[0], self.motion.t[-1], PIECES + 1)
        every = np.arange(self.asked.size)
        # A pair that is farther away than it moves in four pieces needs no more than a bound.
        far = 4 / PIECES * float(np.max(self.moved[-1])) + float(np.max(self.asked))
        at = [self._look(float(t), every, self.model.distances(q, far)) for t, q in zip(times, self.motion(times).q, strict=True)]
        return [
            _Piece((float(a), float(b)), every, np.array(ends))
            for a, b, *ends in zip(times[:-1], times[1:], at[:-1], at[1:], strict=True)
        ]

    def _left(self, piece: _Piece) -> _Piece | None:
        """The pairs of a piece that are not proven, without those that are known to miss; None: there are none."""
        asked, moved = self.asked[piece.pairs], self._moved(piece)
        open_ = (np.sum(piece.distances, axis=0) - moved < 2 * asked) & (np.min(piece.distances, axis=0) >= asked)
        if not np.any(open_):
            return None
        return _Piece(piece.ends, piece.pairs[open_], piece.distances[:, open_])

    def _look(self, time: float, pairs: Index, distances: Array) -> Array:
        """Take note of distances at a time [m], shape (m,)."""
        self.looks += 1
        self.least[pairs] = np.minimum(self.least[pairs], distances)
        k = int(np.argmin(distances))
        if distances[k] < self.nearest.distance:
            self.nearest = Clearance(float(distances[k]), time, *self.model.pairs[pairs[k]])
        if np.any(distances < self.asked[pairs]):
            self.missed.add(time)
        return distances

    def _moved(self, piece: _Piece) -> Array:
        """Bounds on the relative motion of its pairs in a piece [m], shape (m,)."""
        t = self.motion.t
        at = np.array(piece.ends)
        k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, t.size - 2)
        part = ((at - t[k]) / (t[k + 1] - t[k]))[:, None]
        first, second = self.moved[k][:, piece.pairs], self.moved[k + 1][:, piece.pairs]
        start, end = first + part * (second - first)
        return np.asarray(end - start)


def _travel(motion: Trajectory) -> Array:
    """Bounds on how far each joint has travelled until each sample [rad or m], shape (n, nv).

    The velocity of a cubic is a parabola, which lies within its three Bézier coefficients.
    """
    steps = np.diff(motion.t)[:, None]
    v0, v1 = motion.v[:-1], motion.v[1:]
    middle = 3 * np.diff(motion.q, axis=0) / steps - v0 - v1
    most = np.max(np.abs([v0, middle, v1]), axis=0) * steps
    return np.vstack([np.zeros((1, most.shape[1])), np.cumsum(most, axis=0)])


def relative_reach(model: CollisionModel) -> Array:
    """How far a point of a pair's body moves relative to the other body, per joint travel.

    Returns:
        [m/rad], or 1 for a sliding joint, shape (pairs, nv); 0 for joints that move both bodies or none.
    """
    robot = model.robot
    reach = _reach(robot)
    out = np.zeros((len(model.pairs), robot.model.nv))
    chains = [set(_chain(robot, joint)) for joint in range(robot.model.njoints)]
    for k, (first, second) in enumerate(model.joints):
        for joint in chains[first] ^ chains[second]:
            body = first if joint in chains[first] else second
            out[k, joint - 1] = reach[body, joint - 1]
    return out


def _chain(robot: Robot, joint: int) -> list[int]:
    """A joint and those that carry it, without the world."""
    out = []
    while joint:
        out.append(joint)
        joint = int(robot.model.parents[joint])
    return out


def _reach(robot: Robot) -> Array:
    """Farthest distance of the bodies on a joint from the axis of another that carries them [m], shape (njoints, nv)."""
    model = robot.model
    beyond = np.zeros(model.njoints)
    for body in bodies(robot):
        ends = np.array([body.capsule.a, body.capsule.b])
        beyond[body.joint] = max(beyond[body.joint], float(np.max(np.linalg.norm(ends, axis=1))) + body.capsule.radius)
    out = np.zeros((model.njoints, model.nv))
    for last in range(1, model.njoints):
        far = beyond[last]
        for joint in _chain(robot, last):
            slides = robot.slides[joint - 1]
            out[last, joint - 1] = 1.0 if slides else far
            far += float(np.linalg.norm(model.jointPlacements[joint].translation))
            if slides:
                ends = robot.limits.position_lower[joint - 1], robot.limits.position_upper[joint - 1]
                far += float(np.max(np.abs(ends)))
    return out
