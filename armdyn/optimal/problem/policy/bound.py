"""Tuned numbers of the lower bound: they decide its tightness and its run time, not its validity."""

from dataclasses import dataclass, replace
from typing import ClassVar

from armdyn.optimal.problem.policy.tuned import tuned

PAIRS = "Panda and UR5, ten random pairs each (seed 1)"
POSES = "positions and full poses of UR5 and Panda"
LINES = "25/300/25 mm of a UR5, straight corners"


@dataclass(frozen=True, kw_only=True)
class BoundPolicy:
    """Tuned numbers of the lower bound: cells in time, narrowing of boxes, enclosures of goal sets."""

    cases: ClassVar = PAIRS

    shortest: float = tuned(4e-5, "of a side", "first cell: a ramp of some thousandths has cells of its own")
    growth: float = tuned(1.35, "-", "from cell to cell, also of a phase behind a region that is passed")
    longest: float = tuned(1 / 20, "of a side", "last cells: torques that reverse anywhere in them cost little")
    passes: int = tuned(8, "passes", "of nested boxes on one grid, at most; twice as many grids; usually four on one")
    least_gain: float = tuned(2e-5, "of the bound", "a pass that gains less is the last")
    cut_side: float = tuned(1.5, "times a ramp", "length to which a side is cut")
    horizon: float = tuned(0.5, "of the bound so far", "slower motions are left out on the first grid: smaller boxes")
    region_horizon: float = tuned(0.03, "of the bound so far", "the same through regions: 0.06 % more than 0.1", LINES)
    linear_weight: float = tuned(
        2.5, "times the inertia's width", "for terms linear in q; of 1 to 8 it raises bounds of long ramps most"
    )
    momentum_joints: int = tuned(
        32, "joints", "of arms whose momentum is bounded, at most: work grows as their fifth power", "talos: 26 CPU s"
    )
    sizes: tuple[float, ...] = tuned(
        (0.05, 0.01, 0.002), "m or rad", "of boxes checked by velocity limits in turn: 1e-3 of a way at last", POSES
    )
    cover: tuple[float, ...] = tuned(
        (1.0, 0.3, 0.2), "m or rad", "of boxes of a chain's stops and of regions that are passed, in turn", POSES
    )
    at_once: int = tuned(8, "bounds", "between boxes of consecutive stops, improved together, on as many cores", POSES)
    few: int = tuned(500, "boxes", "evaluated at once, some 10 MB; of as many, only near ones are bisected", POSES)
    early: float = tuned(0.3, "of the time from the bound to a known goal", "counts as soon", POSES)
    cut: float = tuned(0.1, "of the widest joint's", "width of a box's joints that may be bisected [rad or m]", POSES)
    most_momentum: float = tuned(1.2, "times the velocity limits' bound", "largest bound by momentum tried", POSES)
    tiny: float = tuned(
        1e-6, "rad or m, or relative", "half width of a box that is a point; damping of equations", POSES
    )
    most_boxes: int = tuned(60_000, "boxes", "of one enclosure: positions need 12,000, full poses mostly 25,000", POSES)
    narrowings: int = tuned(2, "rounds", "over all equations: each benefits from the others", POSES)
    phase_cells: int = tuned(32, "cells", "of a phase between regions", POSES)

    @property
    def between_wide(self) -> "BoundPolicy":
        """Numbers for legs between boxes that do not count as points: coarse, 0.7 % less in a third of the time."""
        return replace(self, passes=self.passes // 4, shortest=self.longest / 5, longest=2 * self.longest)

    @property
    def regrid(self) -> float:
        """Gain of a grid that is worth another one, of several passes: where ramps meet, longer cells may gain more."""
        return 50 * self.least_gain

    @property
    def grids(self) -> int:
        """Largest number of grids: another one of cells that are coarser than its gain is not worth its time."""
        return 2 * self.passes if self.shortest < self.regrid else 1

    @property
    def near_enough(self) -> float:
        """Part of a bound between bound and disproven time that is not worth a bisection: what a new grid gains."""
        return 2 * self.regrid

    @property
    def least_horizon(self) -> float:
        """Least `horizon` of later grids, and the gain of a phase's grid that is worth another one: of a few grids."""
        return 10 * self.regrid

    @property
    def phase_horizon(self) -> float:
        """`horizon` of a phase by itself, shorter and in smaller boxes."""
        return self.horizon / 5

    @property
    def most_pairs(self) -> int:
        """Largest number of pairs of boxes of two stops: a check by velocity limits is far cheaper than a box."""
        return 100 * self.most_boxes
