"""Layout of a program: indices of its unknowns, equations and parameters by name.

The unknowns are in the order of time, and the final time is copied to every knot:

    w = [knot_0 | inner_0 | knot_1 | inner_1 | … | knot_N]
    knot_k  = q, v, T, and the torque if it is linear between knots
    inner_k = q and v in the middle, and the torque unless it is linear

Slices work for numpy arrays and CasADi's SX, MX and DM. All numbers are scaled.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Self

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.locks import cached_property
from armdyn.optimal.problem.options import Scheme

BODY = 10
"""Number of dynamic parameters of a body: mass, first moments, inertia."""
KEPT = 256
"""Number of cached index arrays, and four times that of programs with IPOPT: a search solves hundreds on few meshes."""


@lru_cache(KEPT)
def _places(first: int, size: int, block: int, blocks: int) -> Index:
    """Indices of a part of every block, shape (blocks, size)."""
    places = block * np.arange(blocks)[:, None] + first + np.arange(size)
    places.setflags(write=False)
    return places


@lru_cache(KEPT)
def _condensed_places(full: "Layout", N: int) -> Index:
    """Index of each unknown of the condensed layout in the full one; see `CondensedLayout.kept`."""
    states = np.sort(np.concatenate([full.states(N).ravel(), full.torques(N).ravel()]))
    places = np.append(states, full.times(N)[0])
    places.setflags(write=False)
    return places


@dataclass(frozen=True)
class KnotFields:
    """Indices of a knot's block.

    Attributes:
        q: positions.
        v: velocities.
        state: positions and velocities.
        time: the final time T.
        torque: torques; empty unless linear between knots.
        size: size of the block.
    """

    q: slice
    v: slice
    state: slice
    time: int
    torque: slice
    size: int


@dataclass(frozen=True)
class Layout:
    """Indices of the program of an arm with `nv` joints."""

    nv: int
    scheme: Scheme

    @property
    def linear(self) -> bool:
        """Whether the torque is linear between knots, and so an unknown at knots."""
        return self.scheme.control == "linear"

    @cached_property
    def knot(self) -> KnotFields:
        """Slices of a knot's unknowns."""
        n = self.nv
        torque = slice(2 * n + 1, 2 * n + 1 + (n if self.linear else 0))
        return KnotFields(slice(0, n), slice(n, 2 * n), slice(0, 2 * n), 2 * n, torque, torque.stop)

    @property
    def rows(self) -> int:
        """Number of equations: defects of (q, v) in the middle and at the end, and the difference of final times."""
        return 4 * self.nv + 1

    @property
    def block(self) -> int:
        """Number of unknowns from one knot to the next."""
        return self.knot.size + 2 * self.nv + (0 if self.linear else self.nv)

    @property
    def width(self) -> int:
        """Number of an interval's unknowns: its two knots' and its own."""
        return self.block + self.knot.size

    def size(self, intervals: int) -> int:
        """Number of unknowns of a program."""
        return self.block * intervals + self.knot.size

    def parts(self, y: Any) -> tuple[Any, Any, Any]:
        """Split an interval's unknowns into its first knot's, its own, and its last knot's."""
        return y[: self.knot.size], y[self.knot.size : self.block], y[self.block : self.width]

    def intervals(self, N: int) -> Index:
        """Indices of each interval's unknowns, a column each, shape (width, N)."""
        return self.block * np.arange(N)[None, :] + np.arange(self.width)[:, None]

    def knots(self, N: int) -> Index:
        """Indices of each knot's unknowns, shape (N + 1, knot)."""
        return _places(0, self.knot.size, self.block, N + 1)

    def inners(self, N: int) -> Index:
        """Indices of each interval's own unknowns: q and v in its middle, and its torque unless linear."""
        return _places(self.knot.size, self.block - self.knot.size, self.block, N)

    def times(self, N: int) -> Index:
        """Indices of the final times, shape (N + 1,)."""
        return self.knots(N)[:, self.knot.time]

    def states(self, N: int) -> Index:
        """Indices of each knot's q and v, shape (N + 1, 2 nv)."""
        return self.knots(N)[:, self.knot.state]

    def middles(self, N: int) -> Index:
        """Indices of q and v in the middle of each interval, shape (N, 2 nv)."""
        return self.inners(N)[:, : 2 * self.nv]

    def torques(self, N: int) -> Index:
        """Indices of the torques, shape (N + 1, nv) at knots if linear, else (N, nv) of intervals."""
        return self.knots(N)[:, self.knot.torque] if self.linear else self.inners(N)[:, 2 * self.nv :]

    def equation(self, row: int) -> tuple[str, int]:
        """Kind and joint of an interval's equation; that of final times counts as a position's."""
        row = row % (2 * self.nv)
        return "position defect" if row < self.nv else "velocity defect", row % self.nv


@dataclass(frozen=True)
class CondensedLayout:
    """Layout with constant torques, without inner stages and with a single final time, see `condensed`.

    w = [x_0 | u_0 | x_1 | u_1 | … | x_N | T].
    """

    full: Layout

    @property
    def width(self) -> int:
        """Number of an interval's unknowns: (x_k, u_k, x_{k+1}, T)."""
        return 5 * self.full.nv + 1

    def parts(self, y: Any) -> tuple[Any, Any, Any, Any]:
        """Split an interval's unknowns into the state at its start, the torque, the state at its end, and T."""
        n = self.full.nv
        return y[: 2 * n], y[2 * n : 3 * n], y[3 * n : 5 * n], y[-1]

    def intervals(self, N: int) -> Index:
        """Indices of each interval's unknowns, a column each, shape (width, N)."""
        own = np.arange(self.width - 1)[:, None] + 3 * self.full.nv * np.arange(N)
        return np.vstack([own, np.full((1, N), self.kept(N).size - 1)])

    def kept(self, N: int) -> Index:
        """Index of each unknown in the full layout, of its first final time for T."""
        return _condensed_places(self.full, N)

    def expanded(self, w: Array, middles: Array) -> Array:
        """Unknowns of the full layout from those of the condensed one.

        Args:
            w: unknowns of this layout.
            middles: states in the middle of the intervals, a column per interval, shape (2 nv, N).
        """
        full, N = self.full, middles.shape[1]
        x = np.empty(full.size(N))
        x[self.kept(N)], x[full.times(N)] = w, w[-1]
        x[full.middles(N).ravel()] = middles.ravel(order="F")
        return x


@dataclass(frozen=True)
class Parameters:
    """Parameters of an interval's equations, as numbers or symbols.

    Attributes:
        fraction: the interval's length over the whole duration.
        time: scale of time [s].
        length: scale of positions [rad or m].
        speed: scale of velocities [rad/s or m/s].
        weights: weights of the squared scaled torques, shape (nv,).
        effort: scales of torques [N m or N], shape (nv,).
        last_body: dynamic parameters of the body on the last joint, shape (10,).
    """

    fraction: Any
    time: Any
    length: Any
    speed: Any
    weights: Any
    effort: Any
    last_body: Any

    @staticmethod
    def size(joints: int, intervals: int = 1) -> int:
        """Number of parameters: all but the fraction are common to all intervals."""
        return intervals + 3 + 2 * joints + BODY

    @classmethod
    def of(cls, p: Any, joints: int) -> Self:
        """Split an interval's parameter vector by name."""
        weights, effort = slice(4, 4 + joints), slice(4 + joints, 4 + 2 * joints)
        return cls(p[0], p[1], p[2], p[3], p[weights], p[effort], p[4 + 2 * joints : 4 + 2 * joints + BODY])

    def packed(self) -> Array:
        """Concatenate the parameters; with the fractions of all intervals, shape (N,), the program's parameters."""
        fractions = np.atleast_1d(self.fraction)
        return np.array([*fractions, self.time, self.length, self.speed, *self.weights, *self.effort, *self.last_body])

    @classmethod
    def by_interval(cls, joints: int, intervals: int) -> Index:
        """Indices of each interval's parameters, a column each, shape (count, intervals)."""
        shared = np.arange(intervals, cls.size(joints, intervals))[:, None].repeat(intervals, axis=1)
        return np.vstack([np.arange(intervals), shared])
