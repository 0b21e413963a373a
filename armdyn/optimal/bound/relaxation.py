"""Linear relaxations that every motion within the limits satisfies, and their multipliers.

The unknowns are the mean velocities v_k of the cells. With M_k at the middle of a cell's box, momentum changes from one
fixed cell to the next by at most the forces' bounds over half of each cell, and over the whole of an elastic cell of
length d between them, d [τ + e],

    M_k+1 v_k+1 − M_k v_k ∈ ½ Δt_k [τ + e]_k + ½ Δt_k+1 [τ + e]_k+1.

The part of M that is not linear within a box adds a bounded momentum to each cell. Limits of acceleration are rows of
the same kind, with the unit matrix as inertia; so are the lines of torque-speed curves, with a damping. This proves
nothing, since M v is not linear and a solver rounds; the multipliers are the input of `proof.py`.

For a leg by itself the duration is given, and the completed share θ of the way is maximised: Σ Δt_k v_k = θ Δq. If θ <
1 the duration is too short. Between boxes of joint positions, Δq is that of their centres, and the offsets within the
boxes satisfy the equations at every end, to first order. Rows are in the order of time, those of the way last: a narrow
band and a border.

For a leg through regions the ways and lengths of elastic cells, and the known positions at nodes, are unknown, too. The
sum of the lengths is minimised.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armdyn.arrays import Array
from armdyn.optimal.bound.cells import Cells
from armdyn.optimal.bound.forces import Forces, Line, lines_of, shares_of
from armdyn.optimal.bound.interval import Interval
from armdyn.optimal.bound.leg import BoundLeg, LegEnd
from armdyn.optimal.bound.linear_program import LinearProgram
from armdyn.optimal.bound.proof import Multipliers
from armdyn.optimal.bound.reach import accelerations

Indices = NDArray[np.intp]

_FREE = 1e3
"""Scaled rate of an unlimited quantity in an elastic cell."""


def relaxed(leg: BoundLeg, cells: Cells, forces: Forces, duration: float) -> Multipliers | None:
    """The multipliers of the program of a leg by itself, for a duration [s]; None without convergence."""
    program, kinds, k = LinearProgram(), _kinds(leg, cells, forces), cells.middle
    between = max(duration - np.sum(cells.lengths), 0.0)
    v = program.unknown(cells.v.lower.shape, cells.v.lower / leg.velocity, cells.v.upper / leg.velocity)
    for kind in kinds:
        kind.change[:, k] += between * np.array([kind.rate.lower[k], kind.rate.upper[k]])
    rows = _changes(program, leg, cells, forces, kinds, v[cells.fixed])
    for own, kind in zip(rows, kinds, strict=True):
        program.diagonal(own[k], v[k], between * kind.damping)
    ways = _travel_rows(program, leg, cells, v, duration)
    marginals = program.solved(leg.policy.converged)
    if marginals is None:
        return None
    way = np.broadcast_to(marginals[ways] / (duration * leg.velocity), v.shape)
    return _multipliers(leg, kinds, marginals[rows], way, [None] * (len(v) + 1))


def relaxed_in_phases(
    leg: BoundLeg, cells: Cells, forces: Forces, ends: Sequence[LegEnd | None], scale: float
) -> Multipliers | None:
    """The multipliers of the program of a leg through regions; None without convergence.

    Args:
        leg: leg with its ends.
        cells: cells of the leg.
        forces: forces over the cells.
        ends: known positions at the nodes.
        scale: scale of all times [s].
    """
    program, kinds, speed = LinearProgram(), _kinds(leg, cells, forces), leg.velocity
    fixed, free = cells.fixed, np.flatnonzero(cells.elastic)
    v = program.unknown((len(fixed), speed.size), cells.v.lower[fixed] / speed, cells.v.upper[fixed] / speed)
    x, d = program.unknown((len(free), speed.size)), program.unknown((len(free), 1), 0.0, cost=1.0)
    rows = _changes(program, leg, cells, forces, kinds, v)
    _within_times(program, x, Interval(cells.v.lower / speed, cells.v.upper / speed)[free], d, free)
    for own, kind in zip(rows[:, cells.node[free]], kinds, strict=True):
        pushed = program.unknown(x.shape)
        program.diagonal(own, pushed, -1.0)
        program.diagonal(own, x, np.broadcast_to(scale * kind.damping, x.shape))
        rates = (np.clip(scale * end[free], -_FREE, _FREE) for end in (kind.rate.lower, kind.rate.upper))
        _within_times(program, pushed, Interval(*rates), d, free)
    known = [k for k, end in enumerate(ends) if end is not None]
    segment = np.searchsorted(known, np.arange(len(cells.lengths)), side="right") - 1
    given = [end for end in ends if end is not None]
    sought = np.diff([end.q.centre for end in given], axis=0) / (speed * scale)
    ways = program.rows(sought, np.array(known[1:])[:, None])
    program.diagonal(ways[segment[fixed]], v, cells.lengths[fixed, None] / scale)
    program.diagonal(ways[segment[free]], x, 1.0)
    closing = [_within_end(program, ways, k, end, speed * scale, known[k]) for k, end in enumerate(given)]
    marginals = program.solved(leg.policy.converged)
    if marginals is None:
        return None
    combinations: list[Array | None] = [None] * len(ends)
    for k, node in enumerate(known):
        if (equations := closing[k]) is not None:
            combinations[node] = scale * marginals[equations[0]] / equations[1]
    way = (marginals[ways] / speed)[segment]
    return _multipliers(leg, kinds, scale * marginals[rows], way, combinations)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of one kind, scaled: changes of a quantity from node to node, nodes being the ends of fixed cells.

    Attributes:
        forward: coefficients of the fixed cells' velocities, as shares of the limits, at their first nodes, shape
            (fixed, nv, nv).
        backward: coefficients at their last nodes, likewise.
        damping: decrease of the quantity per second by such velocities, shape (nv,).
        rate: increase per second in every cell, shape (cells, nv).
        change: least and largest change at each node by the adjacent fixed cells, shape (2, nodes, nv).
        given: initial and final values, shape (nodes, nv).
        scale: scale of a row, shape (nv,).
        of_momentum: whether the quantity is momentum, not velocities.
    """

    forward: Array
    backward: Array
    damping: Array
    rate: Interval
    change: Array
    given: Array
    scale: Array
    of_momentum: bool = True


def _kinds(leg: BoundLeg, cells: Cells, forces: Forces) -> list[_Rows]:
    """Rows of the momentum by all forces, by each line of the torque-speed curves, and of limited accelerations."""
    inertia, most = forces.terms.inertia, accelerations(leg, cells)
    units, lines = np.eye(len(leg.velocity)), lines_of(leg.torque.actuators, forces)
    found = [_rows(leg, cells, inertia, forces.rate(units)), *(_line_rows(leg, cells, forces, line) for line in lines)]
    if np.any(np.all(np.isfinite(most), axis=0)):
        own = Interval.at(np.broadcast_to(units, inertia.lower.shape))
        found.append(replace(_rows(leg, cells, own, Interval(-most, most)), of_momentum=False))
    return found


def _rows(leg: BoundLeg, cells: Cells, held: Interval, rate: Interval) -> _Rows:
    """Rows of a momentum M v, with M of each cell, shape (cells, nv, nv), and bounds of its rate."""
    inertia, half = held.centre, cells.lengths[cells.fixed, None] / 2
    scale = np.abs(inertia[0]) @ leg.velocity
    moved = inertia[cells.fixed] * leg.velocity / scale[:, None]
    scaled = Interval(rate.lower / scale, rate.upper / scale)
    change, given = np.zeros((2, len(half) + 1, scale.size)), np.zeros((len(half) + 1, scale.size))
    for bound, force in zip(change, (scaled.lower, scaled.upper), strict=True):
        bound[:-1] += half * force[cells.fixed]
        bound[1:] += half * force[cells.fixed]
    for at, v, sign in ((0, leg.start.v, 1.0), (-1, leg.goal.v, -1.0)):
        if v is None:
            change[:, at] = np.array([-np.inf, np.inf])[:, None]  # any impulse at an end of free velocity
        else:
            given[at] = sign * (inertia[at] @ v) / scale
    return _Rows(moved, -moved, np.zeros(scale.size), scaled, change, given, scale)


def _line_rows(leg: BoundLeg, cells: Cells, forces: Forces, line: Line) -> _Rows:
    """Rows of the momentum M v for one line |τ + s v| ≤ c of the torque-speed curves, whose slope s acts as damping."""
    units = np.eye(len(leg.velocity))
    rows = _rows(leg, cells, forces.terms.inertia, replace(forces, torque=line.torque).rate(units))
    rows.change[..., ~line.given] = np.array([-np.inf, np.inf])[:, None, None]
    damping = line.slope * leg.velocity / rows.scale
    half = cells.lengths[cells.fixed, None, None] / 2 * np.diag(damping)
    return replace(rows, forward=rows.forward + half, backward=rows.backward + half, damping=damping)


def _changes(
    program: LinearProgram, leg: BoundLeg, cells: Cells, forces: Forces, kinds: Sequence[_Rows], v: Indices
) -> Indices:
    """Add the rows of all kinds for the velocities of the fixed cells; their indices, shape (kinds, nodes, nv)."""
    places = np.append(cells.fixed, len(cells.lengths))[:, None, None]
    rows = np.moveaxis(program.rows(np.stack([kind.given for kind in kinds], axis=1), places), 1, 0)
    left_open = np.einsum("bij,bj->bi", forces.terms.inertia.radius, cells.v.magnitude)[cells.fixed]
    radius = leg.policy.linear_weight * left_open / kinds[0].scale
    open_ = program.unknown(v.shape, -radius, radius)
    for own, kind in zip(rows, kinds, strict=True):
        program.blocks(own[:-1], v, kind.forward)
        program.blocks(own[1:], v, kind.backward)
        program.diagonal(own, program.unknown(own.shape, *kind.change), -1.0)
        if kind.of_momentum:
            program.diagonal(own[:-1], open_, 1.0)
            program.diagonal(own[1:], open_, -1.0)
    return rows


def _within_times(program: LinearProgram, inner: Indices, rates: Interval, times: Indices, place: Indices) -> None:
    """Add rows that bound a quantity in elastic cells by their times, shape (free, 1), multiplied by rates."""
    for sign, most in ((-1.0, -rates.lower), (1.0, rates.upper)):
        rows = program.rows(np.zeros(inner.shape), place[:, None])
        program.diagonal(rows, inner, sign)
        program.diagonal(rows, np.broadcast_to(times, inner.shape), -most)
        program.diagonal(rows, program.unknown(inner.shape, 0.0), 1.0)


def _multipliers(
    leg: BoundLeg, kinds: Sequence[_Rows], marginals: Array, way: Array, combinations: Sequence[Array | None]
) -> Multipliers:
    """The multipliers from the marginals of all rows, shape (kinds, nodes, nv); zero at an end of free velocity."""
    found = -marginals / np.array([kind.scale for kind in kinds])[:, None]
    found[:, [k for k, end in ((0, leg.start), (-1, leg.goal)) if end.v is None]] = 0.0
    momenta = [own for own, kind in zip(found, kinds, strict=True) if kind.of_momentum]
    momentum, speed = np.sum(momenta, axis=0), np.zeros(found.shape[1:])
    if not kinds[-1].of_momentum:
        limited = np.all(np.isfinite(kinds[-1].rate.upper), axis=0)
        speed = np.where(limited, found[-1], 0.0)
    lines = np.reshape(momenta[1:], (len(momenta) - 1, *momentum.shape))
    return Multipliers(way, momentum, speed, shares_of(lines, momentum), combinations)


def _travel_rows(program: LinearProgram, leg: BoundLeg, cells: Cells, v: Indices, duration: float) -> Indices:
    """Add the rows Σ Δt v = θ Δq, with positions within the ends' boxes as unknowns, and the cost of θ."""
    nv, scale = len(leg.velocity), duration * leg.velocity
    ways, made = program.rows(np.zeros(nv)), program.unknown((1, 1), cost=-1.0)
    times = np.where(cells.elastic, max(duration - np.sum(cells.lengths), 0.0), cells.lengths)
    program.diagonal(np.broadcast_to(ways, v.shape), v, times[:, None] / duration)
    program.diagonal(ways, np.repeat(made, nv), -leg.away.centre / scale)
    for end, sign in ((leg.start, -1.0), (leg.goal, 1.0)):
        if end.equations is not None:
            place, gradient = program.unknown((1, nv), -1.0, 1.0), end.equations.gradient[:, :, 0]
            program.diagonal(ways, place, -sign * end.q.radius / scale)
            program.blocks(program.rows(np.zeros((1, len(gradient)))), place, gradient[None])
    return ways


def _within_end(
    program: LinearProgram, ways: Indices, k: int, end: LegEnd, scale: Array, place: int
) -> tuple[Indices, Array] | None:
    """Position of the k-th known node within its box.

    Returns:
        The rows of its equations, and their scales; None: no equations.
    """
    radius = end.q.radius
    if not np.any(radius):
        return None
    at = program.unknown((1, len(radius)), -1.0, 1.0)
    if k > 0:
        program.diagonal(ways[k - 1 : k], at, -radius / scale)
    if k < len(ways):
        program.diagonal(ways[k : k + 1], at, radius / scale)
    if end.equations is None:
        return None
    centre, gradient, rest = (part[..., 0] for part in end.equations.parts)
    size = np.abs(centre) + np.sum(np.abs(gradient), axis=1) + rest
    left = program.unknown((1, len(rest)), -rest / size, rest / size)
    rows = program.rows(-(centre / size)[None], place)
    program.blocks(rows, at, (gradient / size[:, None])[None])
    program.diagonal(rows, left, 1.0)
    return rows[0], size
