"""Linear program of a motion that passes regions, and its multipliers.

Unknown are the mean velocities v_k of the fixed cells, the ways x_e and lengths d_e of the elastic ones, and the
positions at the nodes at which something is known of them. As in `relaxation.py` momentum changes from one fixed cell
to the next by half of what the forces' bounds allow over each, and over an elastic cell between them by all of it,
d_e (τ + e). The least Σ d_e is sought.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armdyn.arrays import Array
from armdyn.optimal.bound.cells import Cells
from armdyn.optimal.bound.enclosure.interval import Interval
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.leg import BoundLeg, LegEnd
from armdyn.optimal.bound.linear_program import LinearProgram
from armdyn.optimal.bound.proof import Multipliers
from armdyn.optimal.bound.relaxation import free_at_ends, impulses


def relaxed_course(
    leg: BoundLeg, cells: Cells, forces: Forces, ends: Sequence[LegEnd | None], scale: float
) -> Multipliers | None:
    """The multipliers of a course's program; None if the solver finds none.

    Args:
        leg: its ends.
        cells: that speak of it.
        forces: over the cells.
        ends: what is known of the positions at the nodes.
        scale: a time [s], by which all times are divided.
    """
    elastic, fixed, node = cells.elastic, cells.fixed, cells.node
    free = np.flatnonzero(elastic)
    known = [k for k, end in enumerate(ends) if end is not None]
    segment = np.searchsorted(known, np.arange(len(elastic)), side="right") - 1
    nv, speed = len(leg.velocity), leg.velocity
    inertia, rate = forces.terms.inertia, forces.rate(np.eye(nv))
    unit = np.abs(inertia.centre[0]) @ speed
    program = LinearProgram(nv)
    v = program.unknown((len(fixed), nv), cells.v.lower[fixed] / speed, cells.v.upper[fixed] / speed)
    x, d = program.unknown((len(free), nv)), program.unknown((len(free), 1), 0.0, cost=1.0)
    half = cells.lengths[fixed, None] / 2 / unit
    given, lower, upper = impulses(leg, inertia.centre, half, Interval(rate.lower[fixed], rate.upper[fixed]), unit)
    pushed = program.unknown(given.shape, lower, upper)
    pushed_free = program.unknown((len(free), nv))
    beside = leg.policy.caution * np.einsum("bij,bj->bi", inertia.radius, cells.v.magnitude)[fixed] / unit
    open_ = program.unknown((len(fixed), nv), -beside, beside)
    # Momentum: out of a node less into it, and what forces add there.
    momentum = program.rows(given)
    moved = inertia.centre[fixed] * speed / unit[:, None]
    for own, sign in ((slice(0, -1), 1.0), (slice(1, None), -1.0)):
        program.blocks(momentum[own], v, sign * moved)
        program.diagonal(momentum[own], open_, sign)
    program.diagonal(momentum, pushed, -1.0)
    program.diagonal(momentum[node[free]], pushed_free, -1.0)
    # Ways between nodes of which something is known.
    given_ends = [end for end in ends if end is not None]
    centres = np.array([end.q.centre for end in given_ends])
    ways = program.rows(np.diff(centres, axis=0) / (speed * scale))
    program.diagonal(ways[segment[fixed]], v, cells.lengths[fixed, None] / scale)
    program.diagonal(ways[segment[free]], x, 1.0)
    closing = {
        node: _within_end(program, ways, k, end, speed * scale)
        for k, (node, end) in enumerate(zip(known, given_ends, strict=True))
    }
    # Elastic cells: their ways and impulses lie between their lengths times bounds.
    for inner, ends_ in (
        (x, (cells.v.lower / speed, cells.v.upper / speed)),
        (pushed_free, (rate.lower * scale / unit, rate.upper * scale / unit)),
    ):
        for sign, bound in zip((-1.0, 1.0), ends_, strict=True):
            program.limit(inner, sign, d, -sign * bound[free])
    marginals = program.solved(leg.policy.feasible)
    if marginals is None:
        return None
    return Multipliers(
        way=(marginals[ways] / speed)[segment],
        momentum=free_at_ends(leg, -scale * marginals[momentum] / unit),
        speed=np.zeros(given.shape),
        shares=np.zeros((0, *given.shape)),
        combinations=[
            None if (rows := closing.get(k)) is None else scale * marginals[rows[0]] / rows[1] for k in range(len(ends))
        ],
    )


def _within_end(
    program: LinearProgram, ways: NDArray[np.intp], k: int, end: LegEnd, scale: Array
) -> tuple[NDArray[np.intp], Array] | None:
    """Where the k-th position that something is known of lies within its box.

    Returns:
        The rows of its equations, and the sizes by which these are divided; None: there are no equations.
    """
    radius = end.q.radius
    if not np.any(radius):
        return None
    place = program.unknown((1, len(radius)), -1.0, 1.0)
    if k > 0:
        program.diagonal(ways[k - 1 : k], place, -radius / scale)
    if k < len(ways):
        program.diagonal(ways[k : k + 1], place, radius / scale)
    if end.equations is None:
        return None
    centre, slopes, rest = (part[..., 0] for part in end.equations.parts)
    size = np.abs(centre) + np.sum(np.abs(slopes), axis=1) + rest
    left = program.unknown((1, len(rest)), -rest / size, rest / size)
    rows = program.rows(-(centre / size)[None])
    program.blocks(rows, place, (slopes / size[:, None])[None])
    program.diagonal(rows, left, 1.0)
    return rows[0], size
