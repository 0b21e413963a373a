"""Linear relaxation that every motion within the limits satisfies, and its multipliers.

Unknown are the mean velocities v_k of the cells and the share θ of the way that is made. With M_k at the middle of a
cell's box, momentum changes from one cell to the next by what the forces' bounds allow over half of each,

    M_k+1 v_k+1 − M_k v_k ∈ ½ Δt_k [τ + e]_k + ½ Δt_k+1 [τ + e]_k+1,     Σ Δt_k v_k = θ Δq,     max θ.

Where θ < 1 the duration is too short. Between boxes of joint positions, Δq is that of their centres, and what is
added within the boxes keeps the equations that hold at every end, to first order. What M leaves open within a box,
beyond what is linear there, is a momentum of the cell's own within bounds. Nothing is proven by it, for M v is not
linear and a solver rounds; its multipliers are what `proof.py` takes. Limits of acceleration are rows of the same
kind, with the unit matrix as inertia; so are the lines of torque-speed curves, with a damping.

Rows stand in the order of time, those of the way last: they make a narrow band and a border.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.bound.cells import Cells
from armdyn.optimal.bound.enclosure.interval import Interval
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.bound.linear_program import LinearProgram
from armdyn.optimal.bound.proof import Multipliers
from armdyn.optimal.bound.rates import accelerations
from armdyn.optimal.bound.torque_speed import Line, lines_of, shares_of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of one kind: how something changes from node to node, each scaled.

    Attributes:
        onward: of the outer cells' velocities, as shares of the limits, at their first nodes, shape (cells, nv, nv).
        back: likewise at their last nodes.
        cruise: likewise of the middle cell's velocities at its node, shape (nv, nv).
        change: least and greatest change at each node, shape (2, nodes, nv).
        given: what it begins and ends with, shape (nodes, nv).
        scale: of a row, shape (nv,).
    """

    onward: Array
    back: Array
    cruise: Array
    change: Array
    given: Array
    scale: Array


def relaxed(leg: BoundLeg, cells: Cells, forces: Forces, duration: float) -> Multipliers | None:
    """The multipliers of a leg's program for a duration [s]; None if the solver finds none."""
    nv, nodes, inertia = len(leg.velocity), 2 * cells.middle + 1, forces.terms.inertia
    kinds = [_rows(leg, cells, inertia, forces.rate(np.eye(nv)), duration)]
    kinds += [_line_rows(leg, cells, forces, line, duration) for line in lines_of(leg.torque.actuators, forces)]
    momenta, most = len(kinds), accelerations(leg, cells)
    accelerated = np.all(np.isfinite(most), axis=0)
    if np.any(accelerated):
        units = Interval.at(np.broadcast_to(np.eye(nv), (nodes, nv, nv)))
        kinds.append(_rows(leg, cells, units, Interval(-most, most), duration))
    program, fixed = LinearProgram(nv), cells.fixed
    v = program.unknown((nodes, nv), cells.v.lower / leg.velocity, cells.v.upper / leg.velocity)
    rows = program.rows(np.stack([kind.given for kind in kinds], axis=1))
    beside = leg.policy.caution * np.einsum("bij,bj->bi", inertia.radius, cells.v.magnitude)[fixed] / kinds[0].scale
    open_ = program.unknown((2 * cells.middle, nv), -beside, beside)
    for k, kind in enumerate(kinds):
        program.blocks(rows[:-1, k], v[fixed], kind.onward)
        program.blocks(rows[1:, k], v[fixed], kind.back)
        program.blocks(rows[cells.middle, None, k], v[cells.middle, None], kind.cruise[None])
        program.diagonal(rows[:, k], program.unknown((nodes, nv), *kind.change), -1.0)
        if k < momenta:
            program.diagonal(rows[:-1, k], open_, 1.0)
            program.diagonal(rows[1:, k], open_, -1.0)
    ways = _ways(program, leg, cells, v, duration)
    marginals = program.solved_in_boxes(leg.policy.converged)
    if marginals is None:
        return None
    found = [-marginals[rows[:, k]] / kind.scale for k, kind in enumerate(kinds)]
    whole = np.sum(found[:momenta], axis=0)
    return Multipliers(
        way=np.broadcast_to(marginals[ways] / (duration * leg.velocity), cells.v.lower.shape),
        momentum=free_at_ends(leg, whole),
        speed=free_at_ends(leg, np.where(accelerated, found[-1], 0.0)),
        shares=shares_of(np.reshape(found[1:momenta], (momenta - 1, nodes, nv)), whole),
        combinations=[None] * (nodes + 1),
    )


def _ways(
    program: LinearProgram, leg: BoundLeg, cells: Cells, v: NDArray[np.intp], duration: float
) -> NDArray[np.intp]:
    """Add the rows Σ Δt v = θ Δq, with the places within the ends' boxes as further unknowns, and the cost of θ."""
    nv, scale = len(leg.velocity), duration * leg.velocity
    ways, made = program.rows(np.zeros(nv)), program.unknown((1, 1), cost=-1.0)
    times = np.where(cells.elastic, max(duration - np.sum(cells.lengths), 0.0), cells.lengths)
    program.diagonal(np.broadcast_to(ways, v.shape), v, times[:, None] / duration)
    program.diagonal(ways, np.repeat(made, nv), -leg.away.centre / scale)
    for end, sign in ((leg.start, -1.0), (leg.goal, 1.0)):
        if end.equations is not None:
            place, slopes = program.unknown((1, nv), -1.0, 1.0), end.equations.slopes[:, :, 0]
            program.diagonal(ways, place, -sign * end.q.radius / scale)
            program.blocks(program.rows(np.zeros((1, len(slopes)))), place, slopes[None])
    return ways


def _rows(leg: BoundLeg, cells: Cells, held: Interval, rate: Interval, duration: float) -> _Rows:
    """Rows of a momentum M v, with M as each cell holds it, shape (cells, nv, nv), and bounds of the rate."""
    k, nv, inertia = cells.middle, len(leg.velocity), held.centre
    scale = np.abs(inertia[0]) @ leg.velocity
    half = cells.lengths[cells.fixed, None] / 2 / scale
    given, *ends = impulses(leg, inertia, half, rate[cells.fixed], scale)
    change = np.array(ends)
    change[:, k] += max(duration - np.sum(cells.lengths), 0.0) * np.array([rate.lower[k], rate.upper[k]]) / scale
    moved = inertia[cells.fixed] * leg.velocity / scale[:, None]
    return _Rows(moved, -moved, np.zeros((nv, nv)), change, given, scale)


def impulses(leg: BoundLeg, inertia: Array, half: Array, rate: Interval, unit: Array) -> tuple[Array, Array, Array]:
    """Given momentum at the nodes, and least and largest impulse there, all as parts of `unit`, shape (nodes, nv).

    Args:
        leg: its ends; an end of free velocity may take any impulse.
        inertia: joint-space inertia in the cells, shape (cells, nv, nv).
        half: half the durations of the cells of fixed length, over `unit`, shape (nodes - 1, nv).
        rate: of the momentum in those cells [N m or N], shape (nodes - 1, nv).
        unit: of momentum, shape (nv,).
    """
    given, lower, upper = np.zeros((3, len(half) + 1, unit.size))
    for bound, force in ((lower, rate.lower), (upper, rate.upper)):
        bound[:-1] += half * force
        bound[1:] += half * force
    for at, own, sign in ((0, leg.start.v, 1.0), (-1, leg.goal.v, -1.0)):
        if own is None:
            lower[at], upper[at] = -np.inf, np.inf
        else:
            given[at] = sign * (inertia[at] @ own) / unit
    return given, lower, upper


def _line_rows(leg: BoundLeg, cells: Cells, forces: Forces, line: Line, duration: float) -> _Rows:
    """Rows of the momentum M v by one line of the torque-speed curves, whose damping takes s v of it in a second."""
    nv = len(leg.velocity)
    rows = _rows(leg, cells, forces.terms.inertia, replace(forces, torque=line.torque).rate(np.eye(nv)), duration)
    rows.change[..., ~line.given] = np.array([-np.inf, np.inf])[:, None, None]
    damped = np.diag(line.slope * leg.velocity / rows.scale)
    half, cruise = (
        cells.lengths[cells.fixed, None, None] / 2 * damped,
        max(duration - np.sum(cells.lengths), 0.0) * damped,
    )
    return replace(rows, onward=rows.onward + half, back=rows.back + half, cruise=cruise)


def free_at_ends(leg: BoundLeg, nodes: Array) -> Array:
    """Multipliers, zero at an end where no velocity is given."""
    for node, v in ((0, leg.start.v), (-1, leg.goal.v)):
        if v is None:
            nodes[node] = 0.0
    return nodes
