"""Lower bounds of one leg: boxes, multipliers and proof, iterated until the bound converges."""

from collections.abc import Sequence

import numpy as np

from armdyn.arguments import StopCondition
from armdyn.optimal.bound.cells import Cells, Phase
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.bound.proof import proven
from armdyn.optimal.bound.reach import reached
from armdyn.optimal.bound.relaxation import relaxed, relaxed_in_phases


def leg_bound(leg: BoundLeg, stop: StopCondition, known: float = 0.0) -> tuple[float, int]:
    """Lower bound on the duration of a leg [s], and the joint that decides it.

    Args:
        leg: leg to one goal, or to all in a box.
        stop: stopping condition, polled regularly; once true, the bound so far is returned.
        known: bound that is already proven [s].
    """
    alone = leg.alone(leg.away)
    known, joint = max(known, float(np.max(alone))), int(np.argmax(alone))
    if known == 0 or not np.all(np.isfinite(leg.velocity)):
        return known, joint
    numbers, horizon = leg.policy, leg.policy.horizon
    for _ in range(numbers.grids):
        before = known
        known, joint, full = _on_grid(leg, known, joint, (1 + horizon) * known, stop)
        if stop() or not full or known < before * (1 + numbers.regrid):
            break
        horizon = min(max(2 * (known / before - 1), numbers.least_horizon), numbers.horizon)
    return known, joint


def _on_grid(leg: BoundLeg, known: float, joint: int, longest: float, stop: StopCondition) -> tuple[float, int, bool]:
    """Bound by cells for a motion of the known duration, its joint, and whether ramps fill the cells."""
    cells, full, cut, numbers = Cells.of(leg, known / 2, longest), False, False, leg.policy
    for done in range(numbers.passes):
        if cells is None:
            return longest, joint, True
        if stop():
            break
        forces = cells.forces(leg)
        if done:  # the first boxes are too wide for a useful program
            by = relaxed(leg, cells, forces, known)
            if by is None:
                break
            before, bound = known, min(proven(leg, cells, forces, cells.ends(leg), by), longest)
            if bound > known:
                known, joint = bound, int(np.argmax(by.way[0] * leg.away.centre))
            half, ramp = float(np.sum(cells.side)), by.ramp(leg, cells)
            full = not cut and ramp > numbers.full * half
            if 0 < ramp * numbers.cut_side < half and not cut:
                cells, cut = cells.cut(leg, ramp * numbers.cut_side), True
                continue
            if known < before * (1 + numbers.least_gain):
                break
        if done + 1 < numbers.passes:
            cells = cells.narrowed(leg, reached(leg, cells, forces))
    return known, joint, full or known == longest


def phased_bound(leg: BoundLeg, phases: Sequence[Phase], known: float, longest: float, stop: StopCondition) -> float:
    """Lower bound on the duration of a leg in phases [s].

    Args:
        leg: leg between joint positions, or boxes of them.
        phases: phases of the leg.
        known: bound that is already proven [s].
        longest: duration up to which motions are covered [s], an upper limit of the bound.
        stop: stopping condition, polled regularly; once true, the bound so far is returned.
    """
    cells = Cells.in_phases(leg, phases, longest)
    if cells is not None and np.all(cells.elastic):
        return known  # momentum gives no bound if motions may take no time
    cells = None if cells is None else cells.narrowed(leg, reached(leg, cells, cells.forces(leg)))
    if cells is None:
        return longest
    forces, ends = cells.forces(leg), cells.ends(leg)
    by = None if stop() else relaxed_in_phases(leg, cells, forces, ends, known)
    return known if by is None else max(known, min(proven(leg, cells, forces, ends, by), longest))
