"""Proof of a lower bound of a leg's duration by multipliers.

For every motion within the cells' boxes and any multipliers w(t), continuous, and λ(t),

    ∫ λᵀ v dt = w(0)ᵀ p(0) − w(T)ᵀ p(T) + ∫ (λ + M ẇ)ᵀ v + wᵀ (τ + e) dt,

since the last terms are the integral of d/dt (wᵀ p). λ is constant between nodes at which positions are known, and
jumps there, so that the left side is

    λ_last ᵀ q(T) − λ_first ᵀ q(0) + Σ_k (λ_before − λ_behind)ᵀ q_k,

each term of which has its least value over the positions of its node. The integrand's supremum over a fixed
cell's boxes is convex in (w, ẇ): with w a polynomial within each cell, its mean at the control points is no less than
its mean over the cell. In every elastic cell w is constant and the integrand at most some ρ. With H the sum of all
fixed cells, S the integral's upper bound there, and c the time in the elastic ones, Λ ≤ S + max ρ c; hence c is bounded
from below. The momentum at a region that is passed counts on both its sides and cancels: no bound of the velocity
there is lost.

The multipliers are those of linear relaxations that every motion within the limits satisfies.

The unknowns are the mean velocities v_k of the cells. With M_k at the middle of a cell's box, momentum changes from one
fixed cell to the next by at most the forces' bounds over half of each cell, and over the whole of an elastic cell of
length d between them, d [τ + e],

    M_k+1 v_k+1 − M_k v_k ∈ ½ Δt_k [τ + e]_k + ½ Δt_k+1 [τ + e]_k+1.

The part of M that is not linear within a box adds a bounded momentum to each cell. Limits of acceleration are rows of
the same kind, with the unit matrix as inertia; so are the lines of torque-speed curves, with a damping. This proves
nothing, since M v is not linear and a solver rounds; the multipliers are the proof's input.

For a leg by itself the duration is given, and the completed share θ of the way is maximised: Σ Δt_k v_k = θ Δq. If θ <
1 the duration is too short. Between boxes of joint positions, Δq is that of their centres, and the offsets within the
boxes satisfy the equations at every end, to first order. Rows are in the order of time, those of the way last: a narrow
band and a border.

For a leg through regions the ways and lengths of elastic cells, and the known positions at nodes, are unknown, too. The
sum of the lengths is minimised.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.bound.cells import Cells, accelerations, at_ends
from armdyn.optimal.bound.enclosure import Indices, Interval, down, rounding, stacked
from armdyn.optimal.bound.leg import BoundLeg, Forces, LegEnd, Line, line_shares, lines_of, rate_by_lines
from armdyn.optimal.bound.linear_program import CONVERGED, LARGEST, LinearProgram


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Dual variables of the proof: any values give a valid bound, those of a linear program a tight one.

    Attributes:
        way: λ in every cell, shape (n, nv) [1/rad or 1/m, with λᵀ Δq about 1, or s times as much].
        momentum: w at the nodes of the fixed cells [1/(N m s), or s times as much], shape (fixed + 1, nv): linear
            within these cells, constant in an elastic one between them.
        speed: multipliers of the acceleration limits, likewise [s/rad or s/m, or s times as much]; zero without limits.
        shares: share of `momentum` for each line of the torque-speed curves, shape (lines, fixed + 1, nv).
        combinations: combinations of the equations at all n + 1 nodes, see `LegEnd.least`; None: the best ones.
    """

    way: Array
    momentum: Array
    speed: Array
    shares: Array
    combinations: Sequence[Array | None]

    def ramp(self, leg: BoundLeg, cells: Cells) -> float:
        """Time after the start, or before the goal, in which torque or acceleration matters [s]: the longer one."""
        torque = leg.torque.actuators.strongest
        most = np.max(accelerations(leg, cells), axis=0)
        worth = np.abs(self.momentum) @ torque + np.abs(self.speed) @ np.nan_to_num(most, posinf=0.0)
        counts = worth > np.sqrt(CONVERGED) * np.max(worth)
        times = np.append(0.0, np.cumsum(cells.side))
        k = cells.middle
        return float(np.max(times, where=counts[: k + 1] | counts[: k - 1 : -1], initial=0.0))


def proven(leg: BoundLeg, cells: Cells, forces: Forces, ends: Sequence[LegEnd | None], by: Multipliers) -> float:
    """Proven lower bound on the duration of the leg's motions within the cells [s]; 0 proves nothing.

    Args:
        leg: leg with its ends.
        cells: cells of the leg.
        forces: forces over the cells.
        ends: known positions at the nodes.
        by: multipliers.
    """
    fixed, free, motors = cells.fixed, np.flatnonzero(cells.elastic), leg.torque.actuators
    lengths, way, at = Interval.at(cells.lengths[fixed]), Interval.at(by.way), cells.node[free]
    w, steps, shares = _controls(leg, cells, forces, by)
    rates = rate_by_lines(
        motors, forces[fixed], w, shares, (way[fixed] + _differences(by.speed) / lengths[:, None])[:, :, None], steps
    )
    speed, most = np.abs(by.speed), np.nan_to_num(accelerations(leg, cells), posinf=0.0)
    accelerated = (Interval.at(speed[:-1]) + Interval.at(speed[1:])) * Interval.at(most[fixed])
    mean = rates.sum(1) / Interval.at(float(w.shape[2])) + accelerated.sum(1) * Interval.at(0.5)
    made = (lengths * mean).sum(0) + at_ends(leg, by.momentum, by.speed)
    inner, own = by.momentum[at][:, :, None], by.shares[:, at][..., None]
    between = rate_by_lines(motors, forces[free], inner, own, way[free][:, :, None])[:, 0]
    between = between + (Interval.at(speed[at]) * Interval.at(most[free])).sum(1)
    left, rate = (_least_ways(ends, by) - made).lower, float(np.max(between.upper))
    if left <= 0:
        return 0.0
    if rate <= 0:
        return np.inf
    return float((lengths.sum(0) + Interval.at(down(left)) / Interval.at(rate)).lower)


def _least_ways(ends: Sequence[LegEnd | None], by: Multipliers) -> Interval:
    """Least ∫ λᵀ v dt over the positions at the nodes."""
    none, total = np.zeros_like(by.way[:1]), Interval.at(0.0)
    jumps = np.concatenate([none, by.way]) - np.concatenate([by.way, none])
    for end, jump, combination in zip(ends, jumps, by.combinations, strict=True):
        if end is not None and np.any(jump):
            error = rounding(2, np.abs(jump) @ end.q.magnitude)
            total = total + Interval.at(end.least(jump, combination) - error)
    return total


def _controls(leg: BoundLeg, cells: Cells, forces: Forces, by: Multipliers) -> tuple[Array, Interval, Array]:
    """Multipliers w at the control points of the fixed cells, their time derivatives, and the lines' shares.

    The control points are those of Bernstein polynomials: w is linear, or quadratic for torque that falls with speed,
    so that M ẇ − s w is of second order in the cell's length, not of first.
    """
    w, shares, lengths = by.momentum, by.shares, cells.lengths[cells.fixed, None]
    ends, steps = (w[:-1], w[1:]), _differences(w) / Interval.at(lengths)
    both = shares[:, :-1], shares[:, 1:]
    if not shares.size:
        return np.stack(ends, axis=2), steps[:, :, None], np.stack(both, axis=3)
    damped = np.einsum("kj,knj,nj->nj", leg.torque.actuators.lines[0], shares, w)
    inertia, change = forces.terms.inertia.centre[cells.fixed], damped[:-1] - damped[1:]
    correction = np.linalg.solve(inertia, change[..., None])[..., 0] * lengths / 4
    middle = (ends[0] + ends[1]) / 2 + correction
    twice, at = Interval.at(2.0), [Interval.at(each) for each in (ends[0], middle, ends[1])]
    first, last = (twice * (after - before) / Interval.at(lengths) for before, after in pairwise(at))
    slopes = stacked([first, steps, last], axis=2)
    return (
        np.stack([ends[0], middle, ends[1]], axis=2),
        slopes,
        np.stack([both[0], (both[0] + both[1]) / 2, both[1]], axis=3),
    )


def _differences(nodes: Array) -> Interval:
    return Interval.at(nodes[1:]) - Interval.at(nodes[:-1])


def relaxed(
    leg: BoundLeg, cells: Cells, forces: Forces, ends: Sequence[LegEnd | None], duration: float
) -> Multipliers | None:
    """The multipliers of the linear program of a leg; None without convergence.

    Args:
        leg: leg with its ends.
        cells: cells of the leg.
        forces: forces over the cells.
        ends: known positions at the nodes.
        duration: duration that is tried [s]; also the scale of all times.
    """
    program, kinds, speed = LinearProgram(), _kinds(leg, cells, forces), leg.velocity
    fixed, free, scale = cells.fixed, np.flatnonzero(cells.elastic), duration * leg.velocity
    v = program.unknown((len(fixed), speed.size), cells.v.lower[fixed] / speed, cells.v.upper[fixed] / speed)
    known = [k for k, end in enumerate(ends) if end is not None]
    alone, at, left = len(known) == 2, cells.node[free], max(duration - float(np.sum(cells.lengths)), 0.0)
    if alone:
        x, part = program.unknown((1, speed.size), cells.v.lower[free] / speed, cells.v.upper[free] / speed), left
        for kind in kinds:
            kind.change[:, at] += left * np.stack([kind.rate.lower[free], kind.rate.upper[free]])
        rows = _changes(program, leg, cells, forces, kinds, v)
    else:
        x, part, d = program.unknown((len(free), speed.size)), duration, program.unknown((len(free), 1), 0.0, cost=1.0)
        rows = _changes(program, leg, cells, forces, kinds, v)
        _within_times(program, x, Interval(cells.v.lower / speed, cells.v.upper / speed)[free], d, free)
        for own, kind in zip(rows[:, at], kinds, strict=True):
            pushed = program.unknown(x.shape)
            program.diagonal(own, pushed, -1.0)
            fast = 10 * LARGEST  # of the little time between two regions
            rates = (np.clip(duration * end[free], -fast, fast) for end in (kind.rate.lower, kind.rate.upper))
            _within_times(program, pushed, Interval(*rates), d, free)
    for own, kind in zip(rows[:, at], kinds, strict=True):
        program.diagonal(own, x, np.broadcast_to(part * kind.damping, x.shape))
    segment = np.searchsorted(known, np.arange(len(cells.lengths)), side="right") - 1
    given = [end for end in ends if end is not None]
    sought = np.diff([end.q.centre for end in given], axis=0) / scale
    ways = program.rows((1.0 - alone) * sought, np.array(known[1:])[:, None])
    if alone:
        program.diagonal(ways, np.repeat(program.unknown((1, 1), cost=-1.0), speed.size), -sought)
    program.diagonal(ways[segment[fixed]], v, cells.lengths[fixed, None] / duration)
    program.diagonal(ways[segment[free]], x, part / duration)
    closing = {place: _within_end(program, ways, k, given[k], scale, place) for k, place in enumerate(known)}
    marginals = program.solved()
    if marginals is None:
        return None
    combinations: list[Array | None] = [None] * len(ends)
    for place, found in closing.items():
        if found is not None and not alone:
            combinations[place] = marginals[found[0]] / found[1]
    return _multipliers(leg, kinds, marginals[rows], (marginals[ways] / scale)[segment], combinations)


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
    return Multipliers(way, momentum, speed, line_shares(lines, momentum), combinations)


def _within_end(
    program: LinearProgram, ways: Indices, k: int, end: LegEnd, scale: Array, place: int
) -> tuple[Indices, Array] | None:
    """Position of the k-th known node within its box.

    Returns:
        The rows of its equations, to first order alone if it is the end of a single way, and their scales; None: no
        equations.
    """
    alone = len(ways) == 1
    if end.equations is None and (alone or not np.any(end.q.radius)):
        return None
    at = program.unknown((1, len(scale)), -1.0, 1.0)
    for way, sign in ((k - 1, -1.0), (k, 1.0)):
        if 0 <= way < len(ways):
            program.diagonal(ways[way : way + 1], at, sign * end.q.radius / scale)
    if end.equations is None:
        return None
    centre, gradient, rest = (part[..., 0] for part in end.equations.parts)
    size = np.abs(centre) + np.sum(np.abs(gradient), axis=1) + rest
    rows = program.rows((alone - 1.0) * (centre / size)[None], place)
    program.blocks(rows, at, (gradient / size[:, None])[None])
    if not alone:
        program.diagonal(rows, program.unknown((1, len(rest)), -rest / size, rest / size), 1.0)
    return rows[0], size
