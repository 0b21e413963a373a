"""Linear relaxation that every motion within the limits satisfies, and its multipliers.

Unknown are the mean velocities v_k of the cells and the share θ of the way that is made. With M_k at the middle of a
cell's box, momentum changes from one cell to the next by what the forces' bounds allow over half of each,

    M_k+1 v_k+1 − M_k v_k ∈ ½ Δt_k [τ + e]_k + ½ Δt_k+1 [τ + e]_k+1,     Σ Δt_k v_k = θ Δq,     max θ.

Where θ < 1 the duration is too short. Between boxes of joint positions, Δq is that of their centres, and what is
added within the boxes keeps the equations that hold at every end, to first order. What M leaves open within a box,
beyond what is linear there, is a momentum of the cell's own within bounds. Nothing is proven by it, for M v is not
linear and a solver rounds; its multipliers are what `proof.py` takes. Limits of acceleration are rows of the same
kind, with the unit matrix as inertia; so are the lines of torque-speed curves, with a damping.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import block_diag, bsr_matrix, csr_matrix, eye, hstack, kron, vstack

from armdyn.optimal.bound.cells import Cells
from armdyn.optimal.bound.enclosure.interval import Interval
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.bound.rates import accelerations
from armdyn.optimal.bound.torque_speed import Line, lines_of, shares_of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Dual variables of the proof: any values give a valid bound, those of the linear program a tight one.

    Attributes:
        way: λ of the joints' ways [1/rad or 1/m], λᵀ Δq about 1, shape (nv,).
        momentum: w at the nodes between cells [1/(N m s)], shape (2 k + 1, nv): linear within the cells from the
            start and to the goal, constant in the middle one.
        speed: likewise of the limits of acceleration [s/rad or s/m]; zero where there is none.
        shares: of `momentum` that counts by each line of the torque-speed curves, shape (lines, 2 k + 1, nv).
    """

    way: Array
    momentum: Array
    speed: Array
    shares: Array

    def ramp(self, leg: BoundLeg, cells: Cells) -> float:
        """How long after the start, or before the goal, torque or acceleration still counts [s]: the longer one."""
        torque = leg.torque.actuators.strongest
        most = np.max(accelerations(leg, cells), axis=0)
        worth = np.abs(self.momentum) @ torque + np.abs(self.speed) @ np.where(np.isfinite(most), most, 0.0)
        counts = worth > leg.policy.idle * np.max(worth)
        times = np.append(0.0, np.cumsum(cells.side))
        k = cells.middle
        return float(np.max(times, where=counts[: k + 1] | counts[: k - 1 : -1], initial=0.0))


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of one kind: how something changes from node to node, each scaled.

    Attributes:
        matrix: of the cells' velocities, as shares of the limits.
        shift: of momenta that the cells' inertia leaves open, as many columns as outer cells times joints.
        open: bounds of these, shape (columns, 2).
        change: least and greatest change at each node, shape (nodes nv, 2).
        given: what it begins and ends with, shape (nodes nv,).
        scale: of a row, shape (nv,).
    """

    matrix: csr_matrix
    shift: csr_matrix
    open: Array
    change: Array
    given: Array
    scale: Array


def relaxed(leg: BoundLeg, cells: Cells, forces: Forces, duration: float) -> Multipliers | None:
    """The multipliers of a leg's program for a duration [s]; None if the solver finds none."""
    nv, nodes = len(leg.velocity), 2 * cells.middle + 1
    kinds = [_rows(leg, cells, forces.terms.inertia, forces.rate(np.eye(nv)), duration)]
    kinds += [_line_rows(leg, cells, forces, line, duration) for line in lines_of(leg.torque.actuators, forces)]
    shifts, momenta = [vstack([rows.shift for rows in kinds])], len(kinds)
    most = accelerations(leg, cells)
    accelerated = np.all(np.isfinite(most), axis=0)
    if np.any(accelerated):
        units = Interval.at(np.broadcast_to(np.eye(nv), (nodes, nv, nv)))
        kinds.append(_rows(leg, cells, units, Interval(-most, most), duration))
        shifts.append(kinds[-1].shift)
    times = np.insert(cells.lengths, cells.middle, max(duration - np.sum(cells.lengths), 0.0))
    ways = kron(times / duration, eye(nv))
    away = leg.away.centre / (duration * leg.velocity)
    slacks = len(kinds) * nodes * nv
    closing, free = _within_ends(leg, duration)
    matrix = hstack(
        [
            vstack([ways, *(rows.matrix for rows in kinds)]),
            vstack([csr_matrix((nv, slacks)), -eye(slacks)]),
            vstack([csr_matrix((nv, len(shifts) * (nodes - 1) * nv)), block_diag(shifts)]),
            vstack([csr_matrix(np.column_stack([-free, -away])), csr_matrix((slacks, free.shape[1] + 1))]),
        ]
    )
    before = csr_matrix((closing.shape[0], matrix.shape[1] - 1 - free.shape[1]))
    closed = hstack([before, closing, csr_matrix((closing.shape[0], 1))])
    speeds = np.stack([cells.v.lower / leg.velocity, cells.v.upper / leg.velocity], axis=-1).reshape(-1, 2)
    others = (*(rows.change for rows in kinds), *(rows.open for rows in (kinds[0], *kinds[momenta:])))
    bounds = np.concatenate([speeds, *others, np.tile([-1.0, 1.0], (free.shape[1], 1)), [[-np.inf, np.inf]]])
    cost = np.zeros(len(bounds))
    cost[-1] = -1.0
    given = np.concatenate([np.zeros(nv), *(rows.given for rows in kinds), np.zeros(closing.shape[0])])
    equal, names = csr_matrix(vstack([matrix, closed])), ("primal_feasibility_tolerance", "dual_feasibility_tolerance")
    # A presolve costs a Panda a seventh of the time, a UR5 a quarter.
    options = {**dict.fromkeys(names, leg.policy.feasible), "presolve": False}
    solved = linprog(cost, A_eq=equal, b_eq=given, bounds=bounds, method="highs-ds", options=options)
    if solved.status != 0:
        return None
    marginals = np.asarray(solved.eqlin.marginals)
    parts = np.split(-marginals[nv : nv + slacks], len(kinds))
    found = [part.reshape(nodes, nv) / rows.scale for part, rows in zip(parts, kinds, strict=True)]
    whole = np.sum(found[:momenta], axis=0)
    return Multipliers(
        way=marginals[:nv] / (duration * leg.velocity),
        momentum=_free_at_ends(leg, whole),
        speed=_free_at_ends(leg, np.where(accelerated, found[-1], 0.0)),
        shares=shares_of(np.reshape(found[1:momenta], (momenta - 1, nodes, nv)), whole),
    )


def _within_ends(leg: BoundLeg, duration: float) -> tuple[csr_matrix, Array]:
    """Equations of the places within the ends' boxes, and what these add to Δq, with ε of all such boxes as columns."""
    closing, free = [np.zeros((0, 0))], [np.zeros((len(leg.velocity), 0))]
    for end, sign in ((leg.start, -1.0), (leg.goal, 1.0)):
        if end.equations is not None:
            closing.append(end.equations.slopes[:, :, 0])
            free.append(sign * np.diag(end.q.radius / (duration * leg.velocity)))
    return csr_matrix(block_diag(closing)), np.hstack(free)


def _rows(leg: BoundLeg, cells: Cells, held: Interval, rate: Interval, duration: float) -> _Rows:
    """Rows of a momentum M v, with M as each cell holds it, shape (cells, nv, nv), and bounds of the rate."""
    k, nv, inertia = cells.middle, len(leg.velocity), held.centre
    half = np.repeat(cells.lengths[:, None] / 2, nv, axis=1)
    scale = np.abs(inertia[0]) @ leg.velocity
    change = np.zeros((2, 2 * k + 1, nv))
    for bound, end in zip(change, (rate.lower, rate.upper), strict=True):
        bound[:-1] += half * end[cells.outer]
        bound[1:] += half * end[cells.outer]
        bound[k] += max(duration - np.sum(cells.lengths), 0.0) * end[k]
    given = np.zeros((2 * k + 1, nv))
    for node, v, sign in ((0, leg.start.v, 1.0), (2 * k, leg.goal.v, -1.0)):
        if v is None:
            change[:, node] = np.array([-np.inf, np.inf])[:, None]
        else:
            given[node] = sign * inertia[node] @ v
    moved = inertia[cells.outer] * leg.velocity / scale[:, None]
    blocks = bsr_matrix((moved, np.arange(len(moved)), np.arange(len(moved) + 1))).tocsr()
    blocks.eliminate_zeros()
    from_node, shift = _between_nodes(blocks, nv), _between_nodes(eye(blocks.shape[0]), nv)
    cruise = csr_matrix((from_node.shape[0], nv))
    beside = leg.policy.caution * (np.einsum("bij,bj->bi", held.radius, cells.v.magnitude) / scale)[cells.outer].ravel()
    return _Rows(
        matrix=csr_matrix(hstack([from_node[:, : k * nv], cruise, from_node[:, k * nv :]])),
        shift=shift,
        open=np.stack([-beside, beside], axis=-1),
        change=np.moveaxis(change / scale, 0, -1).reshape(-1, 2),
        given=(given / scale).ravel(),
        scale=scale,
    )


def _line_rows(leg: BoundLeg, cells: Cells, forces: Forces, line: Line, duration: float) -> _Rows:
    """Rows of the momentum M v by one line of the torque-speed curves, whose damping takes s v of it in a second."""
    k, nv = cells.middle, len(leg.velocity)
    rows = _rows(leg, cells, forces.terms.inertia, replace(forces, torque=line.torque).rate(np.eye(nv)), duration)
    rows.change[~np.tile(line.given, 2 * k + 1)] = -np.inf, np.inf
    times, first = np.zeros((2 * k + 1, 2 * k + 1)), np.arange(2 * k)  # [s] of every cell that count at a node
    times[first, cells.outer] = times[first + 1, cells.outer] = cells.lengths / 2
    times[k, k] = max(duration - np.sum(cells.lengths), 0.0)
    damped = kron(times, np.diag(line.slope * leg.velocity / rows.scale))
    return replace(rows, matrix=csr_matrix(rows.matrix + damped))


def _between_nodes(blocks: csr_matrix, nv: int) -> csr_matrix:
    """Flow balance at the nodes: cells add at their first node and subtract at their last."""
    none = csr_matrix((nv, blocks.shape[1]))
    return csr_matrix(vstack([blocks, none]) - vstack([none, blocks]))


def _free_at_ends(leg: BoundLeg, nodes: Array) -> Array:
    """Multipliers, zero at an end where no velocity is given."""
    for node, v in ((0, leg.start.v), (-1, leg.goal.v)):
        if v is None:
            nodes[node] = 0.0
    return nodes
