"""Torque that a minimum-time motion should leave to feedback, so that an arm settles soonest."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armdyn.arguments import each, listener, number
from armdyn.control import Loop, Lqr, Run
from armdyn.control.loop.loop import Controller, expect_controller, expect_loop
from armdyn.control.tracking.run import STAYS
from armdyn.control.tracking.track import LONGER, Setup
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot, expect_robot, expect_robots
from armdyn.optimal import MinimumTimeOptions, MinimumTimeProblem, Solution, Status
from armdyn.optimal.problem.problem import expect_problem
from armdyn.reprs import brief
from armdyn.studies.continuation import continuation
from armdyn.studies.plants import with_payload_times

RESERVES = (0.0, 0.05, 0.08, 0.1, 0.12, 0.15, 0.2, 0.3)
"""Reserves that are tried by default."""
FINE_RESERVES = (0.0, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12)
"""Reserves for arms of `Estimate.likely`, which differ by less than `likely_plants`."""

_LOADS = (0.8, 1.0, 1.2)
_DRY, _VISCOUS = 0.02, 0.001
"""Coulomb friction, and viscous friction per rad/s, of the likely arms that rub, as parts of the torque limits."""
_WATCHED = 2.5
"""Simulated time [s], longer than a settling motion takes; a reference may last longer, see `track`."""


@dataclass(frozen=True, eq=False)
class Settling:
    """Settled times of one controller with one reserve, on all plants.

    Attributes:
        reserve: part of the torque limits that the motion leaves.
        controller: of the loop.
        duration: of the motion [s].
        settled: settled time of each plant [s]; None: it has not settled.
        runs: of the plants.
    """

    reserve: float
    controller: Controller
    duration: float
    settled: tuple[float | None, ...]
    runs: tuple[Run, ...]

    @property
    def worst(self) -> float:
        """Settled time of the last plant [s]; inf: one has not settled."""
        return max(np.inf if t is None else t for t in self.settled)

    @property
    def mean(self) -> float:
        """Mean settled time [s]; inf: one plant has not settled."""
        return float(np.mean([np.inf if t is None else t for t in self.settled]))

    @property
    def count(self) -> int:
        """Number of plants that have settled."""
        return sum(t is not None for t in self.settled)

    @property
    def beyond_limits(self) -> int:
        """Number of plants that exceeded velocity or position limits on the way, see `Run.limits_exceeded`."""
        return sum(bool(run.limits_exceeded) for run in self.runs)

    def facts(self) -> dict[str, Any]:
        """The row as JSON; None: not every plant settles."""
        return {
            "controller": type(self.controller).__name__,
            "reserve": self.reserve,
            "duration": self.duration,
            "settled": self.count,
            "arms": len(self.settled),
            "beyond_limits": self.beyond_limits,
            "mean": self.mean if self.count == len(self.settled) else None,
            "worst": self.worst if self.count == len(self.settled) else None,
        }


@brief
@dataclass(frozen=True, eq=False)
class ReserveCurve:
    """Settled time against reserve.

    Attributes:
        rows: one for every controller and every reserve that has a usable motion, in their orders.
        solutions: by reserve.
        plants: arms that moved.
        interrupted: reserves are missing because Ctrl-C was pressed.
    """

    rows: tuple[Settling, ...]
    solutions: dict[float, Solution]
    plants: tuple[Robot, ...]
    interrupted: bool = False

    @property
    def best(self) -> Settling | None:
        """Row with which most plants settle, and then the last of them soonest; None: there is no row."""
        return min(self.rows, key=lambda row: (-row.count, row.worst, row.mean, row.reserve), default=None)

    def of(self, controller: Controller) -> tuple[Settling, ...]:
        """The rows of one controller."""
        return tuple(row for row in self.rows if row.controller is controller)


def likely_plants(robot: Robot) -> tuple[Robot, ...]:
    """Arms that a controller must expect: payload 20 % less, as it is and 20 % more, without and with friction.

    Friction takes 2 % of the torque limits, and 0.1 % for each rad/s, in addition to the friction of the model.

    Args:
        robot: the controller's model.

    Returns:
        Six, or two of a robot without a payload.
    """
    damping, coulomb = expect_robot(robot).friction.per_joint(robot.nv)
    size = np.minimum(np.abs(robot.limits.actuators.lower), np.abs(robot.limits.actuators.upper))
    size = np.where(np.isfinite(size), size, 0.0)
    carries = robot.payload is not None and robot.payload.mass > 0
    loaded = [with_payload_times(robot, factor) for factor in _LOADS] if carries else [robot]
    rubbing = [arm.with_friction(damping + _VISCOUS * size, coulomb + _DRY * size) for arm in loaded]
    return (*loaded, *rubbing)


def reserve_curve(
    problem: MinimumTimeProblem,
    controllers: Sequence[Controller] | None = None,
    plants: Sequence[Robot] | None = None,
    reserves: Sequence[float] = RESERVES,
    *,
    loop: Loop | None = None,
    duration: float = _WATCHED,
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> ReserveCurve:
    """Settled time of minimum-time motions that leave more and more torque to feedback.

    A motion with a larger reserve takes longer, and is followed better: between lies the least settled time.

    Args:
        problem: the motion; its own reserve is ignored.
        controllers: that follow it; None: `Lqr()`.
        plants: arms that move; None: `likely_plants`.
        reserves: values to try, each at least 0 and below 1.
        loop: connection of controllers and arms; None: `Loop()`.
        duration: time for which each arm is watched [s]; if the motion and 0.1 s more take longer, its duration and a
            second.
        options: of the searches.
        progress: called with the progress in words.

    Returns:
        The curve; after Ctrl-C its rows so far.

    Raises:
        ProblemError: no problem; no reserve; something does not fit the robot.
    """
    expect_problem(problem)
    progress, loop = listener(progress), expect_loop(loop, Loop())
    duration = number(duration, "duration", unit="s", sign="positive")
    levels = sorted(set(each(reserves, "reserves", number)))
    if not levels or not 0 <= levels[0] <= levels[-1] < 1:
        raise ProblemError(f"reserves are {tuple(levels)}; expected one or more, each at least 0 and below 1")
    whole = problem.variant(reserve=0.0, velocity_reserve=0.0)
    robot = replace(problem.robot, limits=whole.limits)  # feedback has the problem's whole limits
    arms = likely_plants(robot) if plants is None else expect_robots(plants, "plants")
    laws = each((Lqr(),) if controllers is None else controllers, "controllers", expect_controller)
    found = continuation([problem.variant(reserve=r) for r in levels], options, progress)
    solutions = {r: s for r, s in zip(levels, found, strict=False) if s.usable and s.status is not Status.INTERRUPTED}
    rows = []
    for controller in laws:
        for r, solution in solutions.items():
            progress(f"{type(controller).__name__}, reserve {r:g}")
            watched = duration if duration >= solution.duration + STAYS else solution.duration + LONGER
            setup = Setup.of(robot, solution.trajectory, controller, loop, duration=watched, tolerance=0.005)
            runs = tuple(setup.run(arm) for arm in arms)
            rows.append(Settling(r, controller, solution.duration, tuple(run.settled_time for run in runs), runs))
    interrupted = len(found) < len(levels) or any(one.status is Status.INTERRUPTED for one in found)
    return ReserveCurve(tuple(rows), solutions, arms, interrupted)
