"""The controller of a family that is best on a set of arms, found by differential evolution."""

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import expect, listener, number, one_of, whole
from armdyn.control.loop.law import Controller
from armdyn.control.loop.loop import Loop, expect_loop
from armdyn.control.tracking.setup import Setup
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot, expect_robot, expect_robots
from armdyn.optimal.problem.stop import Stop, stopping
from armdyn.reprs import brief
from armdyn.studies.tuning.families import ControllerFamily, Ramps, Values, by_name, chosen
from armdyn.studies.tuning.index import INDICES, Index, Worth, worth
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_LOOP = Loop()
_NEVER = 1e6
"""Cost of what cannot be run: gains without a law."""
_SPREAD = 0.01
"""The search has converged when the costs of its members are within this part of each other."""

TuningStatus = Literal["converged", "generations", "time_limit", "interrupted"]
"""How a search ended: its members agree; after the most generations; at the time limit; by Ctrl-C."""


@dataclass(frozen=True, kw_only=True)
class TuneOptions:
    """What is made small, and how long it is searched.

    Attributes:
        index: see `Index`.
        overshoot: that costs nothing, as a part of the largest travel of a joint [-].
        duration: how long each arm is watched [s].
        tolerance: of a joint's distance from the goal, to be settled [rad or m].
        seed: of the search; the same gives the same, however many threads there are.
        members: controllers per generation and parameter.
        generations: most of them.
        time_limit: of the search [s]; the generation under way is not ended.
        workers: threads; None: one per core.

    Raises:
        ProblemError: something is out of range or unknown.
    """

    index: Index = "settled"
    overshoot: float = 0.05
    duration: float = 1.5
    tolerance: float = 0.005
    seed: int = 0
    members: int = 8
    generations: int = 60
    time_limit: float = np.inf
    workers: int | None = None

    def __post_init__(self) -> None:
        one_of(self.index, INDICES, "index")
        for name, unit in (("overshoot", ""), ("duration", "s"), ("tolerance", "rad")):
            object.__setattr__(self, name, number(getattr(self, name), name, unit=unit, sign="positive"))
        limit = number(self.time_limit, "time_limit", unit="s", sign="positive", finite=False)
        object.__setattr__(self, "time_limit", limit)
        object.__setattr__(self, "seed", whole(self.seed, "seed", least=0))
        object.__setattr__(self, "members", whole(self.members, "members", least=2))
        object.__setattr__(self, "generations", whole(self.generations, "generations", least=1))
        if self.workers is not None:
            object.__setattr__(self, "workers", whole(self.workers, "workers", least=1))


_OPTIONS = TuneOptions()


@brief
@dataclass(frozen=True, eq=False)
class Tuned:
    """The best controller that a search has found.

    Attributes:
        controller: it.
        reference: along which it was run; of `Ramps` the best.
        values: the parameters by name.
        training: what it is worth on the arms that it was chosen on.
        held_out: what it is worth on others; None: there were none.
        history: cost of the best after each generation.
        evaluations: controllers that were run.
        status: see `TuningStatus`.
        message: the same in a sentence, with its numbers.
    """

    controller: Controller
    reference: Trajectory
    values: dict[str, float]
    training: Worth
    held_out: Worth | None
    history: tuple[float, ...]
    evaluations: int
    status: TuningStatus
    message: str


def tune(
    robot: Robot,
    reference: Trajectory | Ramps,
    family: ControllerFamily,
    plants: Sequence[Robot],
    held_out: Sequence[Robot] = (),
    loop: Loop = _LOOP,
    options: TuneOptions = _OPTIONS,
    progress: Callable[[str], None] | None = None,
) -> Tuned:
    """Choose the controller of a family that is best on the worst of some arms, in the loop as it is built.

    Differential evolution (Storn and Price, Journal of Global Optimization 11, 1997) over the logarithms of the
    parameters, as scipy has it. A controller that overshoots by more than it may is the answer only where the search
    has found no other.

    Args:
        robot: the controller's model of the arm.
        reference: the motion that is asked for; or `Ramps`, whose duration is chosen, too.
        family: what is chosen, such as `ControllerFamily.pid(robot, q_goal)`.
        plants: the arms that it is chosen on, such as `Plants(…).corners(robot)`.
        held_out: others, on which only the answer is run, such as `Plants(…).arms(robot, 100)`.
        loop: how controller and arm are joined.
        options: what is made small, and how long it is searched.
        progress: told in words how far it is.

    Returns:
        The best that was found; after Ctrl-C, or at the time limit, until then.

    Raises:
        ProblemError: something does not fit the robot; no arms; no controller of the family could be run at all.
    """
    expect(family, ControllerFamily, "family", "such as ControllerFamily.pid(robot, q_goal)")
    if not isinstance(reference, Trajectory):
        expect(reference, Ramps, "reference", "a Trajectory or Ramps(q_start, q_goal)")
    expect_loop(loop)
    expect(options, TuneOptions, "options", 'TuneOptions(index="settled")')
    on, off = (expect_robots(arms, name) for arms, name in ((plants, "plants"), (held_out, "held_out")))
    if not on:
        raise ProblemError("plants are none; expected some arms, such as Plants(payload=(0.8, 1.2)).corners(robot)")
    tell = listener(progress)
    search = _Search(expect_robot(robot), reference, family, on, loop, options)
    with stopping(options.time_limit) as stop, ThreadPoolExecutor(options.workers or os.cpu_count() or 1) as pool:
        status = search.go(stop, pool, tell)
        if search.best is None:
            raise ProblemError(f"no controller was run: {search.refused or 'the search was stopped at once'}")
        own, x = search.best
        setup = search.setup(x)
        others = worth(setup, off, options.index) if off else None
    values = by_name(chosen(family, reference), x)
    return Tuned(
        controller=family.controller(values),
        reference=search.motion(values),
        values=values,
        training=own,
        held_out=others,
        history=tuple(search.history),
        evaluations=search.evaluations,
        status=status,
        message=_message(status, own, others, options.overshoot),
    )


@dataclass(eq=False)
class _Search:
    """What a search is asked, and what it has found so far."""

    robot: Robot
    reference: Trajectory | Ramps
    family: ControllerFamily
    plants: tuple[Robot, ...]
    loop: Loop
    options: TuneOptions
    best: tuple[Worth, Array] | None = None
    evaluations: int = 0
    history: list[float] = field(default_factory=list)
    refused: str = ""
    """Why the last controller that could not be run could not."""

    def go(self, stop: Stop, pool: ThreadPoolExecutor, tell: Callable[[str], None]) -> TuningStatus:
        """Search, and say how it ended."""
        from scipy.optimize import differential_evolution

        options, parameters = self.options, chosen(self.family, self.reference)
        bounds = [(np.log(one.low), np.log(one.high)) for one in parameters]

        def judge(x: Array) -> Worth | None:
            """None: not run, for the search is to stop, or there is no law for such numbers."""
            if stop:
                return None
            try:
                return worth(self.setup(x), self.plants, options.index)
            except ProblemError as error:
                self.refused = str(error)
                return None

        def generation(_: object, points: Iterable[Array]) -> list[float]:
            """Costs of points, in their order, side by side: what scipy takes for a `map` of its function."""
            rows = list(points)
            judged = list(pool.map(judge, rows))
            for found, x in zip(judged, rows, strict=True):
                if found is not None:
                    self.evaluations += 1
                    if self.best is None or self.rank(found) < self.rank(self.best[0]):
                        self.best = found, np.array(x)
            return [_NEVER if found is None else found.cost(options.overshoot) for found in judged]

        def told(x: Array, convergence: float) -> bool:
            if self.best is not None:
                self.history.append(self.best[0].cost(options.overshoot))
                tell(f"generation {len(self.history)} of {options.generations}: {self.best[0]}")
            return bool(stop)

        found = differential_evolution(
            lambda x: _NEVER, bounds, maxiter=options.generations, popsize=options.members, tol=_SPREAD, polish=False,
            seed=np.random.default_rng(options.seed), init="sobol", updating="deferred", workers=generation,
            callback=told,
        )  # fmt: skip
        if stop:
            return "interrupted" if stop.interrupted else "time_limit"
        return "converged" if found.success else "generations"

    def rank(self, found: Worth) -> tuple[bool, float]:
        """The less, the better."""
        most = self.options.overshoot
        return found.overshoot > most, found.cost(most)

    def motion(self, values: Values) -> Trajectory:
        """The reference of some parameters."""
        given = self.reference
        return given.reference(self.robot, values) if isinstance(given, Ramps) else given

    def setup(self, x: Array) -> Setup:
        """The controller of a point, ready for its reference."""
        values = by_name(chosen(self.family, self.reference), x)
        return Setup.of(
            self.robot, self.motion(values), self.family.controller(values), self.loop,
            duration=self.options.duration, tolerance=self.options.tolerance,
        )  # fmt: skip


_ENDS: dict[TuningStatus, str] = {
    "converged": "the search has converged",
    "generations": "the search went through all its generations",
    "time_limit": "time limit reached",
    "interrupted": "interrupted",
}


def _message(status: TuningStatus, own: Worth, others: Worth | None, most: float) -> str:
    """How it ended, in words."""
    held = "" if others is None else f"; held out: {others}"
    over = f"; none keeps to {100 * most:g} %" if own.overshoot > most else ""
    return f"{_ENDS[status]}: {own}{over}{held}"
