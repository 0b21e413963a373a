"""Lower bound of one leg: boxes, multipliers and proof, iterated until the bound gains little."""

from collections.abc import Callable

import numpy as np

from armdyn.optimal.bound.cells import Cells
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.bound.proof import proven
from armdyn.optimal.bound.rates import torques
from armdyn.optimal.bound.reach import reached
from armdyn.optimal.bound.relaxation import relaxed
from armdyn.optimal.bound.terms import terms_over


def leg_bound(leg: BoundLeg, stop: Callable[[], bool], known: float = 0.0) -> tuple[float, int]:
    """Lower bound on the duration of a leg [s], and the joint that decides it.

    Args:
        leg: to one goal, or to all in a box.
        stop: polled now and then; once it is true, the bound that is proven so far is returned.
        known: a bound that is proven already [s].
    """
    ramped = leg.ramped
    known, joint = max(known, float(np.max(ramped))), int(np.argmax(ramped))
    if known == 0 or not np.all(np.isfinite(leg.velocity)):
        return known, joint
    numbers, ahead = leg.policy, leg.policy.ahead
    for _ in range(numbers.grids):
        before = known
        known, joint, full = _on_grid(leg, known, joint, (1 + ahead) * known, stop)
        if stop() or not full or known < before * (1 + numbers.regrid):
            break
        ahead = min(max(2 * (known / before - 1), numbers.least_ahead), numbers.ahead)
    return known, joint


def _on_grid(
    leg: BoundLeg, known: float, joint: int, longest: float, stop: Callable[[], bool]
) -> tuple[float, int, bool]:
    """The bound by cells for a motion as long as is known to be needed, its joint, and whether ramps fill the cells."""
    cells, full, cut, numbers = Cells.of(leg, known / 2, longest), False, False, leg.policy
    for done in range(numbers.passes):
        if stop():
            break
        forces = Forces(terms_over(leg.dynamics, cells.q), cells.v, torques(leg, cells), leg.friction)
        if done:  # the first boxes are too wide for a program to say much
            by = relaxed(leg, cells, forces, known)
            if by is None:
                break
            before, bound = known, min(proven(leg, cells, forces, by), longest)
            if bound > known:
                known, joint = bound, int(np.argmax(by.way * leg.away.centre))
            half, ramp = float(np.sum(cells.side)), by.ramp(leg, cells)
            full = not cut and ramp > numbers.full * half
            if 0 < ramp * numbers.room < half and not cut:
                cells, cut = cells.cut(leg, ramp * numbers.room), True
                continue
            if known < before * (1 + numbers.worth):
                break
        cells = cells.narrowed(leg, reached(leg, cells, forces))
    return known, joint, full or known == longest
