"""A linear program that every motion within the limits solves, and its multipliers.

Unknown are the mean velocities v_k of the cells, at the inertia M_k of their middle, and the share θ of the way that
is made. Momentum changes from one cell to the next by what the forces' bounds allow over half of each,

    M_k+1 v_k+1 − M_k v_k ∈ ½ Δt_k [τ + e]_k + ½ Δt_k+1 [τ + e]_k+1,     Σ Δt_k v_k = θ Δq,     max θ.

Where θ < 1 the duration is too short. The program is only rounded and its boxes' inertia is not one number, so that
nothing is proven by it; its multipliers are what `proof.py` takes. Acceleration limits are rows of the same kind, with
the unit matrix as inertia.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import block_diag, csr_matrix, eye, hstack, vstack

from armdyn.optimal.bound.cells import Cells
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.interval import Interval
from armdyn.optimal.bound.leg import Leg
from armdyn.optimal.bound.reach import End

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Multipliers:
    """What a proof is made of: any numbers give a bound, those of the program a good one.

    Attributes:
        way: λ of the joints' ways [1/rad or 1/m], λᵀ Δq about 1, shape (nv,).
        momentum: w at the nodes between cells [1/(N m s)], shape (2 k + 1, nv); linear within cells from the start
            and to the goal, constant in the middle one.
        speed: likewise of the limits of acceleration [s/rad or s/m]; None without such.
    """

    way: Array
    momentum: Array
    speed: Array | None


def relaxed(leg: Leg, cells: Cells, forces: Forces, duration: float) -> Multipliers | None:
    """The multipliers of a leg's program for a duration [s]; None if the solver finds none."""
    k, nv = cells.middle, len(leg.velocity)
    momenta = [_momentum(leg, cells, forces, duration)]
    if np.all(np.isfinite(leg.acceleration)):
        momenta.append(_speed(leg, cells, duration))
    rows = (2 * k + 1) * nv
    time = np.insert(cells.lengths, k, max(duration - np.sum(cells.lengths), 0.0))
    ways = hstack([csr_matrix(np.diag(length * leg.velocity / (duration * leg.velocity))) for length in time])
    way = (leg.q_goal - leg.q_start) / (duration * leg.velocity)
    slack = len(momenta) * rows
    left = vstack([ways, *(momentum.matrix for momentum in momenta)])
    middle = vstack([csr_matrix((nv, slack)), -eye(slack)])
    right = vstack([csr_matrix(-way[:, None]), csr_matrix((slack, 1))])
    bounds = np.concatenate(
        [
            np.column_stack([(cells.v.lower / leg.velocity).ravel(), (cells.v.upper / leg.velocity).ravel()]),
            *(np.column_stack([momentum.lower.ravel(), momentum.upper.ravel()]) for momentum in momenta),
            [[-np.inf, np.inf]],
        ]
    )
    cost = np.zeros(len(bounds))
    cost[-1] = -1.0
    solved = linprog(
        cost,
        A_eq=csr_matrix(hstack([left, middle, right])),
        b_eq=np.concatenate([np.zeros(nv), *(momentum.given.ravel() for momentum in momenta)]),
        bounds=bounds,
        method="highs",
        options={"primal_feasibility_tolerance": 1e-9, "dual_feasibility_tolerance": 1e-9},
    )
    if solved.status != 0:
        return None
    found = np.asarray(solved.eqlin.marginals)
    nodes = [
        -part.reshape(2 * k + 1, nv) / momentum.scale
        for part, momentum in zip(np.split(found[nv:], len(momenta)), momenta, strict=True)
    ]
    return Multipliers(found[:nv] / (duration * leg.velocity), nodes[0], nodes[1] if len(nodes) > 1 else None)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of one kind: how something changes from node to node, each scaled.

    Attributes:
        matrix: of the cells' velocities, as shares of the limits.
        lower: least change at each node, shape (nodes, nv).
        upper: greatest change.
        given: what it begins and ends with.
        scale: of a row [its unit], shape (nv,).
    """

    matrix: csr_matrix
    lower: Array
    upper: Array
    given: Array
    scale: Array


def _momentum(leg: Leg, cells: Cells, forces: Forces, duration: float) -> _Rows:
    """The rows of momentum."""
    inertia = forces.terms.inertia
    centre, radius = (inertia.lower + inertia.upper) / 2, (inertia.upper - inertia.lower) / 2
    nv = len(leg.velocity)
    rate = forces.rate(np.eye(nv), Interval.at(np.zeros((1, nv, nv))))
    unsure = np.einsum("bij,bj->bi", radius, cells.v.magnitude)
    return _rows(leg, cells, (centre, rate, unsure), duration)


def _speed(leg: Leg, cells: Cells, duration: float) -> _Rows:
    """The rows of acceleration's limits."""
    boxes, nv = cells.v.lower.shape
    units = np.broadcast_to(np.eye(nv), (boxes, nv, nv))
    rate = np.broadcast_to(leg.acceleration, (boxes, nv))
    return _rows(leg, cells, (units, Interval(-rate, rate), np.zeros((boxes, nv))), duration)


def _rows(leg: Leg, cells: Cells, what: tuple[Array, Interval, Array], duration: float) -> _Rows:
    """Rows of a momentum: the inertia of each cell, bounds of its rate, and how unsure its inertia makes it."""
    inertia, rate, unsure = what
    k, nv = cells.middle, len(leg.velocity)
    outer, half = cells.outer, cells.lengths[:, None] / 2
    scale = np.abs(inertia[0]) @ leg.velocity
    lower = np.zeros((2 * k + 1, nv))
    upper = np.zeros((2 * k + 1, nv))
    for nodes in (slice(0, 2 * k), slice(1, 2 * k + 1)):
        lower[nodes] += half * rate.lower[outer] - unsure[outer]
        upper[nodes] += half * rate.upper[outer] + unsure[outer]
    between = max(duration - np.sum(cells.lengths), 0.0)
    lower[k] += between * rate.lower[k]
    upper[k] += between * rate.upper[k]
    given = np.zeros((2 * k + 1, nv))
    for node, cell, v, sign in ((0, 0, leg.v_start, 1.0), (2 * k, 2 * k, leg.v_goal, -1.0)):
        if v is None:
            lower[node], upper[node] = -np.inf, np.inf
        else:
            given[node] = sign * inertia[cell] @ v
    blocks = block_diag([block * leg.velocity / scale[:, None] for block in inertia[outer]])
    none = csr_matrix((nv, blocks.shape[1]))
    change = csr_matrix(vstack([blocks, none]) - vstack([none, blocks]))
    parts = change[:, : k * nv], csr_matrix((len(given) * nv, nv)), change[:, k * nv :]
    return _Rows(csr_matrix(hstack(parts)), lower / scale, upper / scale, given / scale, scale)
