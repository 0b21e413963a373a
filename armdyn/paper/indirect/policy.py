"""Tuned numbers of the indirect method."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.problem.policy.tuned import tuned


@dataclass(frozen=True, kw_only=True)
class IndirectPolicy:
    """Tuned numbers of the indirect method: its seeds, and its way to minimum time."""

    cases: ClassVar = "R, RR, Luus"

    first_weight: float = tuned(0.5, "of 1 for time", "cost of full torques where continuation begins")
    last_weight: float = tuned(2e-3, "of 1 for time", "and where it ends")
    fall: float = tuned(0.25, "-", "from step to step")
    rough: float = tuned(1e-3, "-", "tolerance on the way: good enough to see the arcs")
    rough_nodes: int = tuned(1000, "nodes", "at most, on the way")
    wider: float = tuned(10.0, "of a limit", "limits of a seed without limits", "R, RR")
    shot: float = tuned(1e-10, "scaled", "of the shooting equations: durations then hold to about as much")
    candidates: int = tuned(6, "optima", "tried until one is confirmed: some are artefacts of the mesh", "R, RR, RRR")
