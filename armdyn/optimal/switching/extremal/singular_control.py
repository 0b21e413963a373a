"""The singular control of a free torque: a polynomial over its segment plus terms of other joints' limits.

Where time leaves a torque free, S̈ = 0 says what it is: a function of the state, the costate and the other torques,
smooth but where one of these jumps.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.polynomial import legendre

from armdyn.arrays import Array


@dataclass(frozen=True)
class SingularControl:
    """A torque over a segment, in parts of `ShootingProblem.torque_unit`.

    Attributes:
        smooth: coefficients of Legendre's polynomials over the segment.
        leaps: likewise, of what is added while another joint is on its upper limit and taken away while it is on its
            lower one: its number, and the coefficients.
    """

    smooth: tuple[float, ...]
    leaps: tuple[tuple[int, tuple[float, ...]], ...] = ()

    @property
    def size(self) -> int:
        """Number of all coefficients."""
        return len(self.values)

    @property
    def values(self) -> Array:
        """All coefficients in a row."""
        return np.concatenate([self.smooth, *(own for _, own in self.leaps)])

    def with_values(self, values: Array) -> Self:
        """With other coefficients, as many."""
        ends = np.cumsum([len(self.smooth), *(len(own) for _, own in self.leaps)])
        smooth, *parts = (tuple(part.tolist()) for part in np.split(values, ends[:-1]))
        leaps = tuple((joint, part) for (joint, _), part in zip(self.leaps, parts, strict=True))
        return type(self)(smooth, leaps)

    def longer(self, by: int, leaping: frozenset[int]) -> Self:
        """With more freedom.

        Args:
            by: so many more coefficients of each polynomial.
            leaping: joints that change within the segment: those that add nothing yet do so from now on.
        """
        more = (0.0,) * by
        own = {joint: (*values, *more) for joint, values in self.leaps}
        leaps = own | dict.fromkeys(leaping.difference(own), more)
        return type(self)((*self.smooth, *more), tuple(sorted(leaps.items())))

    def terms(self, s: Array, signs: Array) -> Array:
        """Basis functions of the coefficients, shape (samples, size).

        Args:
            s: from 0 at the segment's begin to 1 at its end, shape (samples,).
            signs: 1 where a joint is on its upper limit, -1 on its lower one, else 0; shape (samples, nv).
        """
        parts = [legendre.legvander(2 * s - 1, len(self.smooth) - 1)]
        parts += [signs[:, [joint]] * legendre.legvander(2 * s - 1, len(own) - 1) for joint, own in self.leaps]
        return np.hstack(parts)

    def derivative(self, s: Array, signs: Array) -> Array:
        """By s, between the jumps, shape (samples,); arguments as those of `terms`."""
        out = legendre.legval(2 * s - 1, legendre.legder(self.smooth))
        for joint, own in self.leaps:
            out = out + signs[:, joint] * legendre.legval(2 * s - 1, legendre.legder(own))
        return np.asarray(2 * out)
