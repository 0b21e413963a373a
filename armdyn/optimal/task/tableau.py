"""Transcription scheme: collocation tableau, torque parametrisation, form of the dynamics."""

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
        name: name in options.
        A: coefficients of the stages, shape (s, s).
        b: weights of the step, shape (s,).
        c: nodes of the stages in the interval, shape (s,), increasing.
        order: order of convergence of the states at the knots.
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

    @cached_property
    def starts_at_knot(self) -> bool:
        """Whether the first stage is the knot at the interval's start."""
        return bool(self.c[0] == 0 and not np.any(self.A[0]))

    @cached_property
    def ends_at_knot(self) -> bool:
        """Whether the last stage is the knot at the interval's end: stiffly accurate."""
        return bool(self.c[-1] == 1 and np.array_equal(self.A[-1], self.b))

    @cached_property
    def inner(self) -> range:
        """Indices of the stages that are not knots."""
        return range(int(self.starts_at_knot), self.c.size - int(self.ends_at_knot))


def _collocation(name: str, c: Array, order: int) -> Tableau:
    """Collocation method at the nodes c: integrates the polynomial through the rates there."""
    powers = np.arange(c.size)
    integrals = np.linalg.inv(c[:, None] ** powers)
    A = (c[:, None] ** (powers + 1) / (powers + 1)) @ integrals
    A[c == 0] = 0.0  # exact zeros of the node at the interval's start
    b = A[-1] if c[-1] == 1 else (1 / (powers + 1)) @ integrals
    return Tableau(name=name, A=A, b=b, c=c, order=order)


def _radau(stages: int) -> Tableau:
    """Radau IIA: stiffly accurate, L-stable, of order 2 stages - 1 (Hairer, Wanner, Solving ODEs II, IV.5)."""
    # (P_{s-1} - P_s) / (1 - x) as a series of Legendre polynomials, by Christoffel and Darboux: its roots and x = 1.
    series = 2.0 * np.arange(stages) + 1
    roots = np.sort(legendre.legroots(series).real)
    for _ in range(2):  # Newton's method, from 1e-15 to the last bit
        roots = roots - legendre.legval(roots, series) / legendre.legval(roots, legendre.legder(series))
    return _collocation(f"radau{stages}", np.append((1 + roots) / 2, 1.0), 2 * stages - 1)


def _gauss(stages: int) -> Tableau:
    """Gauss: no stage is a knot; 2 stages is the highest possible order (the same, IV.5)."""
    return _collocation(f"gauss{stages}", (1 + legendre.leggauss(stages)[0]) / 2, 2 * stages)


LOBATTO_3 = _collocation("lobatto3", np.array([0.0, 0.5, 1.0]), 4)
"""Three-stage Lobatto IIIA: Hermite-Simpson."""
RADAU_2, RADAU_3 = _radau(2), _radau(3)
RADAU_5 = _radau(5)
"""Gauss tableau for the smooth arcs of a known structure, where a high order pays."""
GAUSS_2, GAUSS_3 = _gauss(2), _gauss(3)

TABLEAUS = {tableau.name: tableau for tableau in (LOBATTO_3, RADAU_2, RADAU_3, RADAU_5, GAUSS_2, GAUSS_3)}


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
DynamicsForm = Literal["forward", "inverse"]


@dataclass(frozen=True)
class Scheme:
    """Transcription scheme: collocation method, torque parametrisation, form of the dynamics.

    Attributes:
        method: name of the tableau.
        control: torque between knots. Linear and constant torques keep their bounds everywhere; "stage", one value per
            stage, does so only where it is fixed, as on the arcs of a known structure.
        dynamics: "forward", accelerations by the articulated-body algorithm; or "inverse", torques by
            recursive Newton-Euler with the accelerations as unknowns.
        compile: whether derivatives become machine code: always, never, or (None) if cheap (see `compiled`).
    """

    method: str = "lobatto3"
    control: Control = "linear"
    dynamics: DynamicsForm = "forward"
    compile: bool | None = None

    @property
    def tableau(self) -> Tableau:
        """Coefficients of the collocation method."""
        return TABLEAUS[self.method]
