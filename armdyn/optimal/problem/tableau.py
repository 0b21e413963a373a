"""Transcription scheme: torque parametrisation and collocation tableau."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.polynomial import legendre

from armdyn.arrays import Array
from armdyn.locks import cached_property


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

    @cached_property
    def starts_at_knot(self) -> bool:
        """Whether the first stage is the knot at the interval's start."""
        return bool(self.c[0] == 0 and not np.any(self.A[0]))

    @property
    def inner(self) -> range:
        """Indices of the stages that are not knots, in a tableau whose last stage is one."""
        return range(int(self.starts_at_knot), self.c.size - 1)


def _collocation(c: Array) -> Tableau:
    """Collocation method at the nodes c: integrates the polynomial through the rates there."""
    powers = np.arange(c.size)
    integrals = np.linalg.inv(c[:, None] ** powers)
    A = (c[:, None] ** (powers + 1) / (powers + 1)) @ integrals
    A[c == 0] = 0.0  # exact zeros of the node at the interval's start
    b = A[-1] if c[-1] == 1 else (1 / (powers + 1)) @ integrals
    return Tableau(A, b, c)


def _radau(stages: int) -> Tableau:
    """Radau IIA: stiffly accurate, L-stable, of order 2 stages - 1 (Hairer, Wanner, Solving ODEs II, IV.5)."""
    # (P_{s-1} - P_s) / (1 - x) as a series of Legendre polynomials, by Christoffel and Darboux: its roots and x = 1.
    series = 2.0 * np.arange(stages) + 1
    roots = np.sort(legendre.legroots(series).real)
    for _ in range(2):  # Newton's method, from 1e-15 to the last bit
        roots = roots - legendre.legval(roots, series) / legendre.legval(roots, legendre.legder(series))
    return _collocation(np.append((1 + roots) / 2, 1.0))


LOBATTO_3 = _collocation(np.array([0.0, 0.5, 1.0]))
"""Three-stage Lobatto IIIA of order 4: Hermite-Simpson, for meshes."""
RADAU_5 = _radau(5)
"""Five-stage Radau IIA of order 9, for smooth arcs, where a high order pays."""
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


Control = Literal["linear", "constant", "stage"]


@dataclass(frozen=True)
class Scheme:
    """Transcription scheme: collocation by forward dynamics.

    Attributes:
        control: torque between knots. Linear and constant torques keep their bounds everywhere; "stage", one value per
            stage, does so only where it is fixed, as on the arcs of a known structure.
        compile: whether derivatives become machine code: always, never, or (None) if cheap (see `compiled`).
    """

    control: Control = "linear"
    compile: bool | None = None

    @property
    def tableau(self) -> Tableau:
        """Coefficients of the collocation method: of high order on arcs, whose torques are smooth."""
        return RADAU_5 if self.control == "stage" else LOBATTO_3
