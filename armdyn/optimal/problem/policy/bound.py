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
    growth: float = tuned(1.35, "-", "from cell to cell")
    longest: float = tuned(1 / 20, "of a side", "last cells: torques that reverse anywhere in them cost little")
    passes: int = tuned(8, "passes", "of nested boxes on one grid, at most; usually it is four")
    grids: int = tuned(16, "grids", "at most; usually it is one")
    least_gain: float = tuned(2e-5, "of the bound", "a pass that gains less is the last")
    regrid: float = tuned(1e-3, "of the bound", "gained where ramps meet in the middle: longer cells may gain more")
    full: float = tuned(0.9, "of a side", "longer ramps fill it")
    cut_side: float = tuned(1.5, "times a ramp", "length to which a side is cut")
    horizon: float = tuned(
        0.5,
        "of the bound so far",
        "slower motions are left out on the first grid; the smaller, the smaller the middle boxes",
    )
    least_horizon: float = tuned(
        0.01, "of the bound so far", "the same on later grids, at least; else twice the last gain"
    )
    linear_weight: float = tuned(
        2.5,
        "times the inertia's width",
        "for terms linear in q, absent from the program; of 1 to 8 it raises bounds of long ramps most",
        "first random pair of a Panda: gap 3.4 to 3.3 %; fourth of a UR5: 1.02 to 0.92 %",
    )
    momentum_joints: int = tuned(
        32,
        "joints",
        "of arms whose momentum is bounded, at most: the work grows with the fifth power",
        "talos: 26 CPU s",
    )
    idle: float = tuned(1e-3, "of its best worth", "a torque of less worth is ignored")
    converged: float = tuned(
        1e-6,
        "of the way",
        "gap of a linear program: with 1e-8 bounds are the same to 1e-6, after three more iterations",
    )
    sizes: tuple[float, ...] = tuned(
        (0.05, 0.01, 0.002), "m or rad", "of boxes checked by velocity limits in turn: 1e-3 of a way at last", POSES
    )
    size: float = tuned(0.02, "m or rad", "of boxes checked by momentum, before touching ones are joined", POSES)
    at_once: int = tuned(8, "bounds", "between boxes of consecutive stops, improved together, on as many cores", POSES)
    cover: tuple[float, ...] = tuned((1.0, 0.3, 0.2), "m or rad", "of boxes of a chain's stops, pruned in turn", POSES)
    narrow: float = tuned(0.05, "rad or m", "half width of boxes that are checked by momentum first", POSES)
    wide_passes: int = tuned(2, "passes", "between boxes that are bisected later: more gain little", POSES)
    wide_cells: tuple[float, float] = tuned(
        (0.01, 0.1), "of a side", "first and last cells between such boxes: 0.7 % less in a third of the time", POSES
    )
    passed: float = tuned(
        0.01, "m or rad", "deviations of regions that a chain passes: wider ones take 20,000 boxes or more", POSES
    )
    most_pairs: int = tuned(6_000_000, "pairs", "of boxes of two stops that are checked by velocity limits", POSES)
    few: int = tuned(500, "boxes", "beyond this number only boxes that are reached soon are bisected", POSES)
    early: float = tuned(0.3, "of the time from the bound to a known goal", "counts as soon", POSES)
    times: int = tuned(2, "times", "durations that are tried for a set of goals", POSES)
    regions: int = tuned(4, "bounds", "by momentum per duration: 0.05 to 0.5 s each for six or seven joints", POSES)
    most_momentum: float = tuned(
        1.2, "times the velocity limits' bound", "largest bound by momentum that is tried", POSES
    )
    near_enough: float = tuned(2e-3, "of the bound", "between bound and disproven time: not bisected further", POSES)
    isolated: float = tuned(1e-6, "rad or m", "half width of a box that counts as a point", POSES)
    most_boxes: int = tuned(
        60_000, "boxes", "of one enclosure, 3 to 6 s: positions need up to 12,000, full poses mostly 25,000", POSES
    )
    cut: float = tuned(0.1, "of the widest joint's", "width of a box's joints that may be bisected [rad or m]", POSES)
    narrowings: int = tuned(2, "rounds", "over all equations: each benefits from the others", POSES)
    damping: float = tuned(1e-6, "of the equations' size", "keeps dependent combinations of them solvable", POSES)
    region_rounds: int = tuned(3, "rounds", "that narrow the box of a region that is passed, each pass", POSES)
    region_sizes: tuple[float, ...] = tuned(
        (0.5, 0.3, 0.2), "m or rad", "of boxes that enclose a region that is passed, in turn: some hundreds", POSES
    )
    reach_rounds: int = tuned(8, "rounds", "of bisection for the time before which a region is out of reach", POSES)
    phase_cells: int = tuned(32, "cells", "of a phase between regions", POSES)
    region_grids: int = tuned(4, "grids", "of a motion that passes regions, at most", POSES)
    region_horizon: float = tuned(
        0.03, "of the bound so far", "slower motions are left out: bound 0.06 % higher than with 0.1", LINES
    )
    slice: float = tuned(0.005, "m", "of a line, about, per box of joint positions", POSES)
    line_margin: float = tuned(0.05, "rad or m", "by which such boxes are widened before they are narrowed", POSES)
    most_slices: int = tuned(60, "slices", "of a line behind its end, at most", POSES)
    passing_horizon: float = tuned(0.25, "of the bound so far", "as `horizon`, where lines are enclosed", POSES)
    phase_grids: int = tuned(12, "grids", "of a phase by itself, at most", POSES)
    phase_horizon: float = tuned(
        0.1, "of a phase's bound so far", "as `horizon`, for one phase: a bound 0.4 % higher than with 0.2", LINES
    )
    phase_least_gain: float = tuned(0.01, "of a phase's bound", "a grid that gains less is its last", LINES)
    phase_growth: float = tuned(1.25, "-", "from cell to cell behind a region that is passed", POSES)

    @property
    def between_wide(self) -> "BoundPolicy":
        """Numbers for legs between boxes that do not count as points."""
        shortest, longest = self.wide_cells
        return replace(self, grids=1, passes=self.wide_passes, shortest=shortest, longest=longest)
