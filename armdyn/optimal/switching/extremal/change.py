"""Events of a switching structure: a mode changes, or a limit is touched.

A free torque starts with its singular control: S̈ = 0 determines a singular torque as a function of the state, the
costate and the other torques: smooth except where one of these jumps.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.polynomial import legendre

from armdyn.arrays import Array
from armdyn.optimal.arcs.arc import Mode


@dataclass(frozen=True)
class SingularControl:
    """Torque over a segment, in parts of `ShootingProblem.torque_unit`.

    Attributes:
        smooth: coefficients of Legendre polynomials over the segment.
        jumps: of a second polynomial, added while another joint is on its upper limit, subtracted while it is on its
            lower one: index of that joint, and the coefficients.
    """

    smooth: tuple[float, ...]
    jumps: tuple[tuple[int, tuple[float, ...]], ...] = ()

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.values)

    @property
    def values(self) -> Array:
        """All coefficients, concatenated."""
        return np.concatenate([self.smooth, *(own for _, own in self.jumps)])

    def with_values(self, values: Array) -> Self:
        """The control with new coefficients of the same number."""
        ends = np.cumsum([len(self.smooth), *(len(own) for _, own in self.jumps)])
        smooth, *parts = (tuple(part.tolist()) for part in np.split(values, ends[:-1]))
        jumps = tuple((joint, part) for (joint, _), part in zip(self.jumps, parts, strict=True))
        return type(self)(smooth, jumps)

    def longer(self, by: int, jumping: frozenset[int]) -> Self:
        """The control with further coefficients.

        Args:
            by: number of further coefficients of each polynomial.
            jumping: joints that jump within the segment: missing ones get a term.
        """
        more = (0.0,) * by
        own = {joint: (*values, *more) for joint, values in self.jumps}
        jumps = own | dict.fromkeys(jumping.difference(own), more)
        return type(self)((*self.smooth, *more), tuple(sorted(jumps.items())))

    def terms(self, s: Array, signs: Array) -> tuple[Array, Array]:
        """Basis functions of the coefficients, and their derivatives in s between jumps, each (samples, size).

        Args:
            s: from 0 at the segment's start to 1 at its end, shape (samples,).
            signs: 1 for a joint on its upper limit, -1 on its lower one, else 0; shape (samples, nv).
        """
        x, size = 2 * s - 1, max([len(self.smooth), *(len(own) for _, own in self.jumps)])
        values = legendre.legvander(x, size - 1)
        derivatives = legendre.legval(x, legendre.legder(np.eye(size), scl=2)).T
        parts = [(values[:, : len(self.smooth)], derivatives[:, : len(self.smooth)])]
        for joint, own in self.jumps:
            sign, size = signs[:, [joint]], len(own)
            parts.append((sign * values[:, :size], sign * derivatives[:, :size]))
        return np.hstack([own for own, _ in parts]), np.hstack([own for _, own in parts])


@dataclass(frozen=True)
class Change:
    """Change of one joint's mode at one time.

    Attributes:
        joint: index of the joint.
        mode: mode from then on; for a touch, the touched limit.
        touch: whether the change is a touch: the joint keeps its mode.
        control: singular control of a free torque; else None.
    """

    joint: int
    mode: Mode
    touch: bool = False
    control: SingularControl | None = None

    def is_of(self, joint: int) -> bool:
        """Whether this is a change of a joint's mode."""
        return self.joint == joint and not self.touch


@dataclass(frozen=True)
class Segment:
    """Time of a joint in one mode.

    Attributes:
        begin: index of the change at its beginning; -1: the start.
        end: index of the change at its end; the number of changes: the goal.
    """

    begin: int
    end: int
