"""Transcription scheme: torque parametrisation and collocation tableau."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.polynomial import legendre

from armdyn.arrays import Array


class Tableau(NamedTuple):
    """Butcher tableau of a collocation method.

    The s stages of an interval are x_i = x_k + h Σ_j A_ij f_j, and x_{k+1} = x_k + h Σ_j b_j f_j.

    Attributes:
        A: coefficients of the stages, shape (s, s).
        b: weights of the step, shape (s,).
        c: nodes of the stages in the interval, shape (s,), increasing.
    """

    A: Array
    b: Array
    c: Array


def _collocation(c: Array) -> Tableau:
    """Collocation method at the nodes c: integrates the polynomial through the rates there."""
    powers = np.arange(c.size)
    integrals = np.linalg.inv(c[:, None] ** powers)
    A = (c[:, None] ** (powers + 1) / (powers + 1)) @ integrals
    A[c == 0] = 0.0  # exact zeros of the node at the interval's start
    b = A[-1] if c[-1] == 1 else (1 / (powers + 1)) @ integrals
    return Tableau(A, b, c)


LOBATTO_3 = _collocation(np.array([0.0, 0.5, 1.0]))
"""Three-stage Lobatto IIIA of order 4: Hermite-Simpson, for meshes."""
GAUSS_3 = _collocation((1 + legendre.leggauss(3)[0]) / 2)
"""Three-stage Gauss of order 6, for replays: no stage is a knot."""


Control = Literal["linear", "constant"]


@dataclass(frozen=True)
class Scheme:
    """Transcription scheme: collocation by forward dynamics.

    Attributes:
        control: torque between knots, which keeps its bounds everywhere.
        compile: whether derivatives become machine code: always, never, or (None) if cheap (see `compiled`).
    """

    control: Control = "linear"
    compile: bool | None = None
