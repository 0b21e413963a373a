"""Trajectories, the one result of solvers and simulations, and their formats."""

from typing import TYPE_CHECKING

from armdyn.lazy import facade

if TYPE_CHECKING:
    from armdyn.trajectory.samples import Samples
    from armdyn.trajectory.value import HOLDS, LEAST_STEP, Hold, Sample, Trajectory
else:
    __getattr__, __dir__ = facade(__name__, {"samples": "Samples", "value": "HOLDS LEAST_STEP Hold Sample Trajectory"})

__all__ = ["HOLDS", "LEAST_STEP", "Hold", "Sample", "Samples", "Trajectory"]
