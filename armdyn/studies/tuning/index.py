"""Performance of a controller on a set of arms."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from armdyn.control.tracking.run import Run
from armdyn.control.tracking.track import Setup
from armdyn.models.robots.robot import Robot

Index = Literal["settled", "itae", "ise"]
"""Performance index of the worst arm, to be minimised; e is the distance from the goal:

- "settled": the settled time [s]. Of a run that does not settle, the time that it was watched and more the farther it
  is from its goal in the end.
- "itae": ∫ t Σ|e| dt [rad s²].
- "ise": ∫ Σ e² dt [rad² s].
"""
INDICES: tuple[Index, ...] = ("settled", "itae", "ise")

_BEYOND = 9.0
"""Additional cost where all arms exceed a limit, as a multiple of the index: a ramp within the limits takes less than
ten times as long."""
_LAST = 0.1
"""Part of the time at whose end a run that has not settled is judged."""


@dataclass(frozen=True)
class Performance:
    """Performance of a controller on a set of arms.

    Attributes:
        index: of the worst arm, see `Index`.
        settled: number of arms that settle.
        count: of arms.
        settled_time: of the worst arm [s]; inf if one does not settle.
        overshoot: of the worst arm's worst joint, as a part of the largest travel of a joint [-].
        beyond_limits: number of arms that exceed velocity or position limits on the way, see `Run.limits_exceeded`.
    """

    index: float
    settled: int
    count: int
    settled_time: float
    overshoot: float
    beyond_limits: int = 0

    def cost(self, most: float) -> float:
        """Cost that the search minimises: the index, more beyond an overshoot and for arms beyond their limits.

        It is in proportion, so that it means the same to each index, and grows with the overshoot without a jump, so
        that the search finds its way back.

        Args:
            most: overshoot that costs nothing [-].
        """
        beyond = 1 + _BEYOND * self.beyond_limits / self.count
        return self.index * (1 + max(self.overshoot / most - 1, 0.0)) * beyond

    def __str__(self) -> str:
        """The performance in words."""
        time = f"worst settled time {self.settled_time:.4f} s" if self.settled == self.count else "not all settle"
        beyond = f", {self.beyond_limits} exceed velocity or position limits" if self.beyond_limits else ""
        over = f"overshoot {100 * self.overshoot:.2f} % of the travel"
        return f"{self.settled} of {self.count} settle, {time}, {over}{beyond}"


def performance_of(setup: Setup, plants: Sequence[Robot], index: Index) -> Performance:
    """Performance of a controller.

    Args:
        setup: the controller along its reference.
        plants: the arms, one at least.
        index: see `Index`.
    """
    runs = [setup.run(plant) for plant in plants]
    times = [np.inf if run.settled_time is None else run.settled_time for run in runs]
    travel = float(np.abs(setup.ticks.goal - setup.start[: setup.robot.nv]).max())
    over = max(float(run.overshoot.max()) for run in runs)
    return Performance(
        index=max(index_of(run, setup, index) for run in runs),
        settled=sum(run.settled for run in runs),
        count=len(runs),
        settled_time=max(times),
        overshoot=over / travel if travel else (np.inf if over else 0.0),
        beyond_limits=sum(bool(run.limits_exceeded) for run in runs),
    )


def index_of(run: Run, setup: Setup, index: Index) -> float:
    """Index of a run, see `Index`; a run that broke off stays where it was to the end.

    Args:
        run: of the setup.
        setup: see `performance_of`.
        index: see `Index`.
    """
    motion, end = run.trajectory, setup.duration
    away = np.abs(motion.q - setup.ticks.goal)
    if index == "settled":
        if run.settled_time is not None:
            return run.settled_time
        late = away[motion.t >= (1 - _LAST) * motion.t[-1]].max()
        return float(end * (1 + np.log1p(late / setup.tolerance)) + max(end - motion.t[-1], 0.0))
    left = max(end - motion.t[-1], 0.0)
    if index == "itae":
        total = away.sum(axis=1)
        return float(np.trapezoid(motion.t * total, motion.t) + total[-1] * left * (end + motion.t[-1]) / 2)
    total = np.sum(away**2, axis=1)
    return float(np.trapezoid(total, motion.t) + total[-1] * left)
