"""Routh's table of a real polynomial, in exact arithmetic: number of roots in the right half-plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from itertools import dropwhile, pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import numbers, shown
from armdyn.errors import ProblemError
from armdyn.reprs import brief

Remedy = Literal["", "leading zero", "zero row"]
"""Treatment of a row on which Routh's scheme breaks down:

- "leading zero": the row begins with p zeros. To it is added (-1)^p times itself moved p places to the left. This
  takes the place of the small number epsilon of textbooks, whose limit can mislead where there are roots on the
  imaginary axis (Benidir and Picinbono, Extended table for eliminating the singularities in Routh's array, IEEE
  Transactions on Automatic Control 35(2), 1990).
- "zero row": the row is zero, so the polynomial of the row above divides the given one and its roots lie
  symmetrically about the origin. Its derivative takes the row's place (Gantmacher, The Theory of Matrices, vol. 2,
  chapter XV, section 4).
"""

_MOST, _MOST_WORK = 100, 800_000
"""Coefficients, and these times all their binary digits: the table takes some seconds, which grow with the square."""

_MOST_PRODUCTS = 1e11
"""Fifth power of a matrix's rows times its binary digits: the recursion takes some seconds."""


@brief
@dataclass(frozen=True)
class RouthTable:
    """Routh's table of a polynomial a₀ sⁿ + … + aₙ.

    Attributes:
        rows: n + 1 rows, of sⁿ, sⁿ⁻¹, …, s⁰, as exact fractions.
        remedies: of each row, see `Remedy`.
    """

    rows: tuple[tuple[Fraction, ...], ...]
    remedies: tuple[Remedy, ...]

    @property
    def first_column(self) -> tuple[Fraction, ...]:
        """First column of the table, whose changes of sign are counted; none is zero."""
        return tuple(row[0] for row in self.rows)

    @property
    def right_half_plane(self) -> int:
        """Number of roots with a positive real part, with multiplicity."""
        return _changes(self.first_column)

    @property
    def on_axis(self) -> int:
        """Number of roots on the imaginary axis, with multiplicity."""
        if "zero row" not in self.remedies:
            return 0
        first = self.remedies.index("zero row")
        degree = len(self.rows) - first  # of the row above: its roots lie symmetrically about the origin
        return degree - 2 * _changes(self.first_column[first - 1 :])

    @property
    def is_stable(self) -> bool:
        """Whether all roots have a negative real part."""
        return self.right_half_plane == 0 and self.on_axis == 0

    def markdown(self) -> str:
        """The table in Markdown, numbers to six digits."""
        width = len(self.rows[0])
        lines = ["| power | " + " | ".join([f"column {k + 1}" for k in range(width)] + ["remedy"]) + " |"]
        lines.append("|---|" + "---:|" * width + "---|")
        for power, (row, remedy) in enumerate(zip(self.rows, self.remedies, strict=True)):
            cells = [f"{_printable(x):.6g}" for x in row] + [""] * (width - len(row))
            lines.append(f"| s^{len(self.rows) - 1 - power} | {' | '.join(cells)} | {remedy} |")
        return "\n".join(lines)


def routh_table(polynomial: ArrayLike | Sequence[Fraction]) -> RouthTable:
    """Routh's table of a real polynomial.

    A float is a fraction, and sums, products and quotients of fractions have no rounding: the count is that of the
    given polynomial, however near to a boundary it is.

    Args:
        polynomial: coefficients, highest power first, as floats, integers or fractions; zeros that lead are left out.

    Raises:
        ProblemError: it is no list of finite numbers, all of them are zero, or they are too many for fractions of so
            many digits.
    """
    exact = list(dropwhile(lambda x: x == 0, _exact(polynomial)))
    if not exact:
        raise ProblemError(f"polynomial is {shown(polynomial)}; one coefficient at least must not be zero")
    degree, bits = len(exact) - 1, sum(x.numerator.bit_length() + x.denominator.bit_length() for x in exact)
    if degree >= _MOST or len(exact) * bits > _MOST_WORK:
        raise ProblemError(
            f"polynomial has {len(exact)} coefficients with {bits} binary digits in all, and its table in fractions "
            f"would take too long; expected at most {_MOST} coefficients, and fewer with so many digits"
        )
    rows: list[tuple[Fraction, ...]] = []
    remedies: list[Remedy] = []
    for k in range(degree + 1):
        row = exact[k::2] if k < 2 else _next(rows[-2], rows[-1])
        length = (degree - k) // 2 + 1
        row = [*row, *[Fraction(0)] * (length - len(row))]
        remedy: Remedy = ""
        if not any(row):
            remedy, power = "zero row", degree - k + 1
            row = [x * (power - 2 * j) for j, x in enumerate(rows[-1])][:length]
        if row[0] == 0:
            remedy = remedy or "leading zero"
            row = _without_leading_zeros(row)
        rows.append(tuple(row))
        remedies.append(remedy)
    return RouthTable(tuple(rows), tuple(remedies))


def characteristic_polynomial(matrix: ArrayLike) -> tuple[Fraction, ...]:
    """det(s I - A) of a real matrix, exactly, by Faddeev and LeVerrier's recursion in integers.

    Coefficients that are computed from rounded eigenvalues, as by `numpy.poly`, decide nothing near a boundary. Here
    the matrix is taken exactly: floats times a power of two are integers.

    Args:
        matrix: shape (n, n).

    Returns:
        The n + 1 coefficients, that of sⁿ first, which is 1.

    Raises:
        ProblemError: it is not square, not finite, or too large for integers of so many digits.
    """
    A = numbers(matrix, "matrix", "a square matrix")
    if A.ndim != 2 or A.shape[0] != A.shape[1] or not np.all(np.isfinite(A)):
        raise ProblemError(f"matrix has shape {A.shape}; expected a square matrix of finite numbers")
    n = len(A)
    digits = 53 + int(np.ptp(np.frexp(A[A != 0])[1])) if np.any(A) else 1  # of the floats as integers of one scale
    if n**5 * digits > _MOST_PRODUCTS:
        raise ProblemError(f"matrix has {n} rows of numbers of {digits} binary digits: its polynomial takes too long")
    scale = max([Fraction(x).denominator for x in A.ravel().tolist()], default=1)
    whole = np.array([[int(Fraction(x) * scale) for x in row] for row in A.tolist()], dtype=object).reshape(n, n)
    one = np.eye(n, dtype=object)
    coefficients, M = [1], one
    for k in range(1, n + 1):
        product = whole @ M
        coefficients.append(-np.trace(product) // k)
        M = product + coefficients[-1] * one
    return tuple(Fraction(c, scale**k) for k, c in enumerate(coefficients))


def _exact(polynomial: ArrayLike | Sequence[Fraction]) -> list[Fraction]:
    if isinstance(polynomial, list | tuple) and all(isinstance(x, Fraction) for x in polynomial):
        return list(polynomial)
    array = numbers(polynomial, "polynomial", "its coefficients, highest power first")
    if array.ndim != 1 or not np.all(np.isfinite(array)):
        raise ProblemError(f"polynomial is {shown(polynomial)}; expected finite coefficients, highest power first")
    return [Fraction(x) for x in array.tolist()]


def _next(above: tuple[Fraction, ...], row: tuple[Fraction, ...]) -> list[Fraction]:
    """The row below two, by Routh's cross products."""
    ratio = above[0] / row[0]
    return [above[j] - ratio * (row[j] if j < len(row) else 0) for j in range(1, len(above))]


def _without_leading_zeros(row: list[Fraction]) -> list[Fraction]:
    """The row and, with the sign (-1)^p, itself moved to the left by its p leading zeros."""
    p = next(j for j, x in enumerate(row) if x)
    moved = [*row[p:], *[Fraction(0)] * p]
    return [x + (-1) ** p * y for x, y in zip(row, moved, strict=True)]


def _printable(x: Fraction) -> float | Decimal:
    """The number, also beyond the range of floats."""
    return float(x) if x == 0 or 1e-300 < abs(x) < 1e300 else Decimal(x.numerator) / x.denominator


def _changes(column: Sequence[Fraction]) -> int:
    return sum((a > 0) != (b > 0) for a, b in pairwise(column))
