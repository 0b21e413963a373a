"""Gains of a controller, found by differential evolution on a set of arms."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from typing import Any, Literal

import numpy as np

from armdyn.arguments import Checked, checked, expect, listener, number, one_of, path_of, whole
from armdyn.arrays import Array
from armdyn.control.loop.loop import Controller, Loop, expect_loop
from armdyn.control.tracking.track import Setup, expect_own_payload
from armdyn.errors import ProblemError, ResultError
from armdyn.models.robots.robot import Robot, expect_robot, expect_robots
from armdyn.optimal.problem.status import Stop, stopping
from armdyn.reprs import brief
from armdyn.studies.executor import Executor, in_process
from armdyn.studies.plant_study import digest, identity, named
from armdyn.studies.rows import RowStore, StudyRow, Value, row_store
from armdyn.studies.run import CaseRun
from armdyn.studies.study import OwnTask
from armdyn.studies.tasks.task import CaseResult
from armdyn.studies.tuning.families import ControllerFamily, Ramps, Values, by_name, chosen
from armdyn.studies.tuning.index import INDICES, Index, Performance, performance_of
from armdyn.trajectory import Trajectory

FORMAT = "armdyn-tune-2"
_WITHOUT_EFFECT = ("time_limit", "workers", "file")
"""Options without an effect on the controllers that are tried."""
_NEVER = 1e6
"""Cost of a controller that cannot be run."""
_SPREAD = 0.01
"""The search has converged when the costs of its members are within this part of each other."""

TuningStatus = Literal["converged", "generations", "time_limit", "interrupted"]
"""End of a search: its members agree; after the largest number of generations; at the time limit; by Ctrl-C."""


@dataclass(frozen=True, kw_only=True)
class TuneOptions(Checked):
    """Index to minimise, and extent of the search.

    Attributes:
        index: see `Index`.
        overshoot: largest one without a cost, as a part of the largest travel of a joint [-].
        duration: time for which each arm is watched [s].
        tolerance: of a joint's distance from the goal, to be settled [rad or m].
        seed: of the search; the same gives the same, however many threads there are.
        members: controllers per generation and parameter.
        generations: largest number of them.
        time_limit: of the search [s]; the generation under way is not ended.
        workers: threads; None: one per core.
        file: SQLite, with a row for each controller that was run; rows of another search are replaced. None: no file.

    Raises:
        ProblemError: something is out of range or unknown.
    """

    index: Index = checked(one_of, "settled", known=INDICES)
    overshoot: float = checked(number, 0.05, sign="positive")
    duration: float = checked(number, 1.5, unit="s", sign="positive")
    tolerance: float = checked(number, 0.005, unit="rad or m", sign="positive")
    seed: int = checked(whole, 0, least=0)
    members: int = checked(whole, 8, least=2)
    generations: int = checked(whole, 60, least=1)
    time_limit: float = checked(number, np.inf, unit="s", sign="positive", finite=False)
    workers: int | None = checked(whole, None, least=1)
    file: str | os.PathLike[str] | None = checked(path_of, None)


@brief
@dataclass(frozen=True, eq=False)
class Tuned:
    """Result of a search for gains.

    Attributes:
        controller: the best one.
        reference: motion that it followed; of `Ramps` the best.
        values: the parameters by name.
        training: its performance on the arms that the choice was made on.
        held_out: its performance on others; None: there were none.
        history: cost of the best after each generation.
        evaluations: number of controllers that were run.
        status: see `TuningStatus`.
        message: one sentence.
    """

    controller: Controller
    reference: Trajectory
    values: dict[str, float]
    training: Performance
    held_out: Performance | None
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
    loop: Loop = Loop(),
    options: TuneOptions = TuneOptions(),
    progress: Callable[[str], None] | None = None,
) -> Tuned:
    """Choose a family's parameters that are best for the worst of some arms, in the actual loop.

    Differential evolution (Storn and Price, Journal of Global Optimization 11, 1997) over the logarithms of the
    parameters, as scipy has it. A controller with which an arm exceeds its velocity or position limits, or that
    overshoots by more than allowed, is returned only where the search has found no other. With `options.file` the same
    search continues where it was stopped or killed.

    Args:
        robot: the controller's model of the arm.
        reference: motion to follow; or `Ramps`, whose duration is chosen, too.
        family: controllers to choose from, such as `ControllerFamily.pid(robot, q_goal)`.
        plants: arms that the choice is made on, such as `Plants(…).corners(robot)`.
        held_out: others, on which only the result is run, such as `Plants(…).arms(robot, 100)`.
        loop: connection of controller and arm.
        options: the index to minimise, and the extent of the search.
        progress: called with the progress in words.

    Returns:
        The best controller; after Ctrl-C, or at the time limit, of those that were run.

    Raises:
        ProblemError: an argument does not fit the robot; no arms; no controller of the family could be run at all.
        FileError: the file cannot be read or written.
    """
    expect(family, ControllerFamily, "family", "such as ControllerFamily.pid(robot, q_goal)")
    if isinstance(reference, Trajectory):
        expect_own_payload(robot, reference)
    else:
        expect(reference, Ramps, "reference", "a Trajectory or Ramps(q_start, q_goal)")
    expect_loop(loop)
    expect(options, TuneOptions, "options", 'TuneOptions(index="settled")')
    on, off = (expect_robots(arms, name) for arms, name in ((plants, "plants"), (held_out, "held_out")))
    if not on:
        raise ProblemError("plants are none; expected some arms, such as Plants(payload=(0.8, 1.2)).corners(robot)")
    progress = listener(progress)
    search = GainSearch(expect_robot(robot), reference, family, on, loop, options)
    kept = row_store(options.file, search.description, "normal", replace=True)
    with stopping(options.time_limit) as stop, kept as rows:
        with in_process(search, options.workers) as executor:
            status = search.go(rows, executor, stop, progress)
        if search.best is None:
            raise ProblemError(f"no controller was run: {search.refused or 'the search was stopped at once'}")
        own, values = search.best
        others = performance_of(search.setup(values), off, options.index) if off else None
        status = "interrupted" if stop.interrupted else status
    return Tuned(
        controller=family.controller(values), reference=search.motion(values), values=values, training=own,
        held_out=others, history=tuple(search.history), evaluations=search.evaluations, status=status,
        message=_message(status, own, others, options.overshoot),
    )  # fmt: skip


@dataclass(eq=False)
class GainSearch(OwnTask):
    """Search for gains as a study: each case is a controller, each generation of the search a batch of cases."""

    robot: Robot
    reference: Trajectory | Ramps
    family: ControllerFamily
    plants: tuple[Robot, ...]
    loop: Loop
    options: TuneOptions
    tried: list[dict[str, float]] = field(default_factory=list)
    best: tuple[Performance, dict[str, float]] | None = None
    evaluations: int = 0
    history: list[float] = field(default_factory=list)
    refused: str = ""
    """Reason why the last controller that could not be run could not."""

    def __len__(self) -> int:
        return len(self.tried)

    def parameters(self, k: int) -> dict[str, Value]:
        """Parameters of controller k."""
        return dict(self.tried[k])

    def work(self, settings: Mapping[str, Value], guess: bytes = b"", revisit: bool = False) -> CaseResult:
        """Run one controller on all arms."""
        try:
            found = performance_of(self.setup(settings), self.plants, self.options.index)
        except ProblemError as error:  # no law for such numbers
            return CaseResult(status="refused", message=str(error))
        return CaseResult(status="run", good=found.settled == found.count, message=str(found), facts=asdict(found))

    def description(self) -> dict[str, object]:
        """All that the rows depend on, as JSON."""
        options = {name: value for name, value in asdict(self.options).items() if name not in _WITHOUT_EFFECT}
        given, parameters = self.reference, chosen(self.family, self.reference)
        middle = {one.name: float(np.sqrt(one.low * one.high)) for one in parameters}
        return {
            "format": FORMAT,
            "armdyn": version("armdyn"),
            "robot": identity(self.robot),
            "reference": digest(given) if isinstance(given, Trajectory) else named(given),
            "family": self.family.name,
            "parameters": [asdict(one) for one in parameters],
            "example": named(self.family.controller(middle)),
            "plants": [{**identity(arm), "friction": repr(arm.friction)} for arm in self.plants],
            "loop": asdict(self.loop),
            **options,
        }

    def go(self, rows: RowStore, executor: Executor, stop: Stop, progress: Callable[[str], None]) -> TuningStatus:
        """Search, and return the way in which the search ended."""
        from scipy.optimize import differential_evolution

        options, parameters = self.options, chosen(self.family, self.reference)
        bounds = [(np.log(one.low), np.log(one.high)) for one in parameters]

        def generation(_: object, points: Iterable[Array]) -> list[float]:
            """Costs of points, in their order: the `map` that scipy calls."""
            first = len(self.tried)
            self.tried += [by_name(parameters, np.array(x)) for x in points]
            CaseRun(self, rows, executor, stop).go()
            costs = [_NEVER] * (len(self.tried) - first)
            for row in rows.rows(first):
                if row.k < len(self.tried):
                    if row.settings != self.tried[row.k]:
                        what = f"row {row.k} is of another controller; begin with another `file`"
                        raise ResultError(f"{rows.path}: {what}")
                    costs[row.k - first] = self._cost(row)
            return costs

        def report_generation(x: Array, convergence: float) -> bool:
            if self.best is not None:
                self.history.append(self.best[0].cost(options.overshoot))
                progress(f"generation {len(self.history)} of {options.generations}: {self.best[0]}")
            return bool(stop)

        found = differential_evolution(
            lambda x: _NEVER, bounds, maxiter=options.generations, popsize=options.members, tol=_SPREAD, polish=False,
            seed=np.random.default_rng(options.seed), init="sobol", updating="deferred", workers=generation,
            callback=report_generation,
        )  # fmt: skip
        if stop:
            return "interrupted" if stop.interrupted else "time_limit"
        return "converged" if found.success else "generations"

    def _cost(self, row: StudyRow) -> float:
        """Cost of a simulated controller; updates the best one so far."""
        if row.status != "run":
            self.refused = row.message
            return _NEVER
        numbers: dict[str, Any] = {name: np.inf if value is None else value for name, value in row.facts.items()}
        found, most = Performance(**numbers), self.options.overshoot
        self.evaluations += 1
        if self.best is None or _rank(found, most) < _rank(self.best[0], most):
            self.best = found, self.tried[row.k]
        return found.cost(most)

    def motion(self, values: Values) -> Trajectory:
        """The reference of some parameters."""
        given = self.reference
        return given.reference(self.robot, values) if isinstance(given, Ramps) else given

    def setup(self, values: Values) -> Setup:
        """The controller of some parameters, ready for its reference."""
        return Setup.of(
            self.robot, self.motion(values), self.family.controller(values), self.loop,
            duration=self.options.duration, tolerance=self.options.tolerance,
        )  # fmt: skip


def _rank(found: Performance, most: float) -> tuple[bool, bool, float]:
    """The less, the better: controllers within the arms' limits first, then those within the overshoot."""
    return found.beyond_limits > 0, found.overshoot > most, found.cost(most)


_ENDS: dict[TuningStatus, str] = {
    "converged": "the search has converged",
    "generations": "the search went through all its generations",
    "time_limit": "time limit reached",
    "interrupted": "interrupted",
}


def _message(status: TuningStatus, own: Performance, others: Performance | None, most: float) -> str:
    """The end of a search in words."""
    held = "" if others is None else f"; held out: {others}"
    over = f"; none keeps to {100 * most:g} %" if own.overshoot > most else ""
    return f"{_ENDS[status]}: {own}{over}{held}"
