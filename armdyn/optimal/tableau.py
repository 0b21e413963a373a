"""Collocation methods as data."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_R3, _R6, _R15 = np.sqrt(3.0), np.sqrt(6.0), np.sqrt(15.0)


@dataclass(frozen=True)
class Tableau:
    """The Butcher tableau of a collocation method; checks itself when it is made.

    The s stages of an interval are x_i = x_k + h Σ_j A_ij f_j, and x_{k+1} = x_k + h Σ_j b_j f_j.

    Attributes:
        name: what users call it.
        A: shape (s, s).
        b: shape (s,).
        c: where the stages lie in the interval, shape (s,), increasing.
        order: of convergence in the state at the knots.
    """

    name: str
    A: Array
    b: Array
    c: Array
    order: int

    def __post_init__(self) -> None:
        for field in ("A", "b", "c"):
            array = np.array(getattr(self, field), dtype=float)
            array.setflags(write=False)
            object.__setattr__(self, field, array)
        s = self.c.size
        if self.A.shape != (s, s) or self.b.shape != (s,) or not np.all(np.diff(self.c) > 0):
            raise ValueError(f"{self.name}: a tableau of {s} stages has A ({s}, {s}) and increasing c")
        # Hairer, Wanner: Solving ODEs II, section IV.5: C(s), which makes it collocation, and B(order).
        power = np.arange(1, s + 1)
        if not np.allclose(self.A @ self.c[:, None] ** (power - 1), self.c[:, None] ** power / power, atol=1e-14):
            raise ValueError(f"{self.name}: A does not integrate polynomials of degree {s - 1} to its stages")
        power = np.arange(1, self.order + 1)
        if not np.allclose(self.b @ self.c[:, None] ** (power - 1), 1 / power, atol=1e-14):
            raise ValueError(f"{self.name}: b does not integrate polynomials of degree {self.order - 1}")

    @property
    def starts_at_knot(self) -> bool:
        """The first stage is the knot at the interval's start."""
        return bool(self.c[0] == 0 and not np.any(self.A[0]))

    @property
    def ends_at_knot(self) -> bool:
        """The last stage is the knot at the interval's end: stiffly accurate."""
        return bool(self.c[-1] == 1 and np.array_equal(self.A[-1], self.b))

    @property
    def inner(self) -> range:
        """The stages that are no knots."""
        return range(int(self.starts_at_knot), self.c.size - int(self.ends_at_knot))


LOBATTO_3 = Tableau(
    name="lobatto3",
    A=np.array([[0, 0, 0], [5 / 24, 1 / 3, -1 / 24], [1 / 6, 2 / 3, 1 / 6]]),
    b=np.array([1 / 6, 2 / 3, 1 / 6]),
    c=np.array([0, 1 / 2, 1]),
    order=4,
)
"""Three-stage Lobatto IIIA: Hermite-Simpson, the paper's "three-stage Lobatto formula"."""

# Hairer, Wanner: Solving ODEs II, table IV.5.5 and 5.6 (Radau IIA), IV.5.1 and 5.2 (Gauss).
RADAU_2 = Tableau(
    name="radau2",
    A=np.array([[5 / 12, -1 / 12], [3 / 4, 1 / 4]]),
    b=np.array([3 / 4, 1 / 4]),
    c=np.array([1 / 3, 1]),
    order=3,
)
"""Two-stage Radau IIA: stiffly accurate, L-stable."""

RADAU_3 = Tableau(
    name="radau3",
    A=np.array(
        [
            [(88 - 7 * _R6) / 360, (296 - 169 * _R6) / 1800, (-2 + 3 * _R6) / 225],
            [(296 + 169 * _R6) / 1800, (88 + 7 * _R6) / 360, (-2 - 3 * _R6) / 225],
            [(16 - _R6) / 36, (16 + _R6) / 36, 1 / 9],
        ]
    ),
    b=np.array([(16 - _R6) / 36, (16 + _R6) / 36, 1 / 9]),
    c=np.array([(4 - _R6) / 10, (4 + _R6) / 10, 1]),
    order=5,
)
"""Three-stage Radau IIA: stiffly accurate, L-stable."""

GAUSS_2 = Tableau(
    name="gauss2",
    A=np.array([[1 / 4, 1 / 4 - _R3 / 6], [1 / 4 + _R3 / 6, 1 / 4]]),
    b=np.array([1 / 2, 1 / 2]),
    c=np.array([1 / 2 - _R3 / 6, 1 / 2 + _R3 / 6]),
    order=4,
)
"""Two-stage Gauss: no stage is a knot; the highest order that two stages can have."""

GAUSS_3 = Tableau(
    name="gauss3",
    A=np.array(
        [
            [5 / 36, 2 / 9 - _R15 / 15, 5 / 36 - _R15 / 30],
            [5 / 36 + _R15 / 24, 2 / 9, 5 / 36 - _R15 / 24],
            [5 / 36 + _R15 / 30, 2 / 9 + _R15 / 15, 5 / 36],
        ]
    ),
    b=np.array([5 / 18, 4 / 9, 5 / 18]),
    c=np.array([1 / 2 - _R15 / 10, 1 / 2, 1 / 2 + _R15 / 10]),
    order=6,
)
"""Three-stage Gauss: no stage is a knot; the highest order that three stages can have."""

TABLEAUS = {tableau.name: tableau for tableau in (LOBATTO_3, RADAU_2, RADAU_3, GAUSS_2, GAUSS_3)}
