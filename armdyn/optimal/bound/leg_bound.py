"""Lower bound of one leg: boxes, multipliers and proof, iterated until the bound gains little."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from armdyn.optimal.bound.cells import Cells
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.bound.proof import proven
from armdyn.optimal.bound.reach import reached
from armdyn.optimal.bound.relaxation import relaxed
from armdyn.optimal.bound.terms import terms_over

_PASSES, _GRIDS = 8, 16
"""Of nested boxes on one grid, and grids, at most; usually it is four and one."""

_WORTH = 2e-5
"""A pass that raises the bound by a smaller share is the last."""

_REGRID = 1e-3
"""Where ramps meet in the middle and the bound has risen by more than this share, longer cells may raise it more."""

_FULL, _ROOM = 0.9, 1.5
"""Ramps that are longer than this share of a side fill it; shorter ones get sides that are longer by this factor."""

_AHEAD = 0.5
"""Motions that take longer by more than this share than is known to be needed are not spoken of, in one grid; later
twice what the last grid has brought, one hundredth at least: the nearer, the smaller the boxes in the middle."""


def leg_bound(leg: BoundLeg, stop: Callable[[], bool], known: float = 0.0) -> tuple[float, int]:
    """Lower bound on the duration of a leg [s], and the joint that decides it.

    Args:
        leg: to one goal, or to all in a box.
        stop: polled now and then; once it is true, the bound that is proven so far is returned.
        known: a bound that is proven already [s].
    """
    known, joint = max(known, leg.shortest), int(np.argmax(leg.kinematic))
    if known == 0 or not np.all(np.isfinite(leg.velocity)):
        return known, joint
    ahead = _AHEAD
    for _ in range(_GRIDS):
        before = known
        known, joint, full = _on_grid(leg, known, joint, (1 + ahead) * known, stop)
        if stop() or not full or known < before * (1 + _REGRID):
            break
        ahead = min(max(2 * (known / before - 1), 0.01), _AHEAD)
    return known, joint


def _on_grid(
    leg: BoundLeg, known: float, joint: int, longest: float, stop: Callable[[], bool]
) -> tuple[float, int, bool]:
    """The bound by cells for a motion as long as is known to be needed, its joint, and whether ramps fill the cells."""
    cells, full, cut = Cells.of(leg, known / 2, longest), False, False
    for done in range(_PASSES):
        if stop():
            break
        forces = Forces(terms_over(leg.dynamics, cells.q), cells.v, leg.torque, leg.friction)
        if done:  # the first boxes are too wide for a program to say much
            by = relaxed(leg, cells, forces, known)
            if by is None:
                break
            before, bound = known, min(proven(leg, cells, forces, by), longest)
            if bound > known:
                known, joint = bound, int(np.argmax(by.way * leg.away.centre))
            half, ramp = float(np.sum(cells.side)), by.ramp(leg, cells)
            full = not cut and ramp > _FULL * half
            if 0 < ramp * _ROOM < half and not cut:
                cells, cut = cells.cut(leg, ramp * _ROOM), True
                continue
            if known < before * (1 + _WORTH):
                break
        cells = cells.narrowed(leg, reached(leg, cells, forces))
    return known, joint, full or known == longest
