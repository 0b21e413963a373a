"""Transcription scheme: torque parametrisation and collocation tableau."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.polynomial import legendre

from armdyn.arrays import Array


@dataclass(frozen=True)
class Tableau:
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

    def __post_init__(self) -> None:
        for field in ("A", "b", "c"):
            array = np.array(getattr(self, field), dtype=float)
            array.setflags(write=False)
            object.__setattr__(self, field, array)


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


def lagrange(nodes: Array, s: Array | float) -> Array:
    """Lagrange polynomials at s, shape (m,): 1 at one node and 0 at the others; shape (m, nodes)."""
    apart = nodes[:, None] - nodes + np.eye(nodes.size)
    factors = (np.atleast_1d(s)[:, None, None] - nodes) / apart  # (m, j, i)
    factors[:, np.arange(nodes.size), np.arange(nodes.size)] = 1.0
    values: Array = np.prod(factors, axis=2)
    return values


def differentiation(nodes: Array) -> Array:
    """Derivatives at the nodes of the Lagrange polynomials: shape (nodes, nodes)."""
    powers = np.arange(nodes.size)
    derivatives = powers * nodes[:, None] ** np.maximum(powers - 1, 0)
    return np.asarray(derivatives @ np.linalg.inv(nodes[:, None] ** powers))


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
