"""Monte Carlo over plants: success rate and settled times of one controller on random arms."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armdyn.arguments import listener, number, parts_of
from armdyn.arrays import Array
from armdyn.control.laws.lqr import Lqr
from armdyn.control.loop.loop import Controller, Loop
from armdyn.control.tracking.run import Envelope, Run
from armdyn.errors import ProblemError, ResultError
from armdyn.files import as_json, attributes
from armdyn.models.robots.robot import Robot
from armdyn.optimal.problem.status import stopping
from armdyn.reprs import brief
from armdyn.studies.executor import in_process
from armdyn.studies.plant_study import MonteCarloOptions, PlantRow, PlantStudy
from armdyn.studies.plants import Plants
from armdyn.studies.rows import row_store
from armdyn.studies.run import CaseRun, Progress
from armdyn.trajectory import Trajectory

_CONFIDENCE = 0.95
_SAMPLES = 2000
"""Largest number of times of an envelope."""


@dataclass(frozen=True)
class SuccessRate:
    """Success rate of some arms, with a confidence interval for all others of their kind.

    Attributes:
        settled: number of arms that settled in time.
        count: number of arms.
        rate: settled / count [-].
        low: lower end of Wilson's interval of 95 % [-].
        high: upper end [-].
    """

    settled: int
    count: int
    rate: float
    low: float
    high: float

    def __str__(self) -> str:
        """The rate and its confidence interval in words."""
        return (
            f"{self.settled} of {self.count} ({100 * self.rate:.4g} %; 95 % interval {100 * self.low:.4g} to "
            f"{100 * self.high:.4g} %)"
        )


@brief
@dataclass(frozen=True, eq=False)
class MonteCarlo:
    """Result of one controller on many arms.

    Attributes:
        question: the controller, its reference, and the arms.
        rows: one per arm, by their numbers.
        file: in which they are stored; None: none.
    """

    question: PlantStudy
    rows: tuple[PlantRow, ...]
    file: Path | None = None

    @property
    def interrupted(self) -> bool:
        """Whether arms are missing because Ctrl-C was pressed."""
        return len(self.rows) < self.question.options.count

    @property
    def settled_times(self) -> Array:
        """Settled time of each row [s], shape (n,); inf where the arm did not settle."""
        times = [np.inf if row.settled_time is None else row.settled_time for row in self.rows]
        return np.array(times, dtype=float)

    def success(self, within: float = np.inf) -> SuccessRate:
        """Number of arms that settled within a time.

        Wilson's score interval of 95 % (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927).

        Args:
            within: the time [s]; inf: within the time that they were watched.

        Raises:
            ProblemError: it is negative or NaN; there are no rows.
        """
        from scipy.stats import binomtest

        within = number(within, "within", unit="s", sign="not negative", finite=False)
        count = len(self._expect_rows())
        settled = int(np.sum(np.isfinite(self.settled_times) & (self.settled_times <= within)))
        interval = binomtest(settled, count).proportion_ci(_CONFIDENCE, method="wilson")
        return SuccessRate(settled, count, settled / count, float(interval.low), float(interval.high))

    def quantiles(self, parts: Sequence[float] = (0.5, 0.9, 0.99, 1.0)) -> Array:
        """Quantiles of the settled times [s]; inf where too few arms settled.

        Each is the time of an arm; none is interpolated.

        Args:
            parts: each in 0 to 1.

        Raises:
            ProblemError: one is not; there are no rows.
        """
        self._expect_rows()
        return np.asarray(np.quantile(self.settled_times, parts_of(parts, "parts"), method="inverted_cdf"))

    @property
    def worst(self) -> PlantRow:
        """The arm that settled last; of those that did not settle the one that was farthest from its reference.

        Raises:
            ProblemError: there are no rows.
        """

        def badness(row: PlantRow) -> tuple[float, float]:
            farthest = np.inf if row.peak_error is None else row.peak_error
            return (np.inf, farthest) if row.settled_time is None else (row.settled_time, 0.0)

        return max(self._expect_rows(), key=badness)

    @property
    def beyond_limits(self) -> tuple[PlantRow, ...]:
        """Arms that exceeded velocity or position limits on the way, settled or not; the fastest joint's first."""
        beyond = (row for row in self.rows if row.limits_exceeded)
        return tuple(sorted(beyond, key=lambda row: -np.inf if row.peak_velocity is None else -row.peak_velocity))

    def plant(self, k: int) -> Robot:
        """Arm number k, such as `worst.k`."""
        return self.question.plant(k)

    def run(self, k: int) -> Run:
        """Run arm number k again, with its motion."""
        return self.question.run(k)

    def envelope(self, parts: Sequence[float] = (0.05, 0.5, 0.95)) -> Envelope:
        """Distance from the reference over time, of all arms at once; each is run again.

        Args:
            parts: quantiles besides the least and the greatest.

        Raises:
            ProblemError: a part is not in 0 to 1; there are no rows.
        """
        setup, options = self.question.setup, self.question.options
        numbers = [row.k for row in self._expect_rows()]
        ticks = max(int(np.ceil(setup.duration * setup.loop.rate - 1e-9)), 1)
        kept = np.arange(0, ticks + 1, max(-(-ticks // _SAMPLES), 1))
        reference = setup.ticks.q[np.minimum(kept, len(setup.ticks.q) - 1)]
        errors = np.full((len(numbers), kept.size, self.question.robot.nv), np.inf, dtype=np.float32)

        def put(i: int) -> None:
            q = self.question.run(numbers[i]).trajectory.q
            whole = kept[kept < len(q)].size  # a run that broke off is at no known distance
            errors[i, :whole] = np.abs(q[kept[:whole]] - reference[:whole])

        with ThreadPoolExecutor(options.workers) as pool:
            list(pool.map(put, range(len(numbers))))
        t = kept / setup.loop.rate
        return Envelope.of(t, errors, parts, self.question.robot.joint_names, setup.ticks.duration, options.tolerance)

    def summary(self, within: float = np.inf) -> dict[str, object]:
        """The result as JSON; unknown and infinite numbers are None.

        Args:
            within: see `success`.
        """
        success, worst = self.success(within), self.worst
        return {
            **attributes(success, "count", "settled"),
            "within": as_json(within),
            "success_rate": success.rate,
            "success_rate_low": success.low,
            "success_rate_high": success.high,
            "settled_time": dict(zip(("median", "90 %", "99 %", "worst"), as_json(self.quantiles()), strict=True)),
            "beyond_limits": len(self.beyond_limits),
            "worst": {"k": worst.k, "status": worst.status, "payload": worst.sample.payload},
            "interrupted": self.interrupted,
        }

    def _expect_rows(self) -> tuple[PlantRow, ...]:
        if not self.rows:
            raise ProblemError("there are no rows: the study was interrupted before the first arm ended")
        return self.rows


def monte_carlo(
    robot: Robot,
    reference: Trajectory,
    controller: Controller = Lqr(),
    plants: Plants = Plants(),
    loop: Loop = Loop(),
    options: MonteCarloOptions = MonteCarloOptions(),
    file: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> MonteCarlo:
    """Run a controller along a reference on many arms that differ from its model.

    Arm k of a seed is the same for any number of workers and any order. With a file each row is written as it
    ends; a study that was stopped or killed continues with the missing rows, also with a greater count.

    Args:
        robot: the controller's model of the arm, with the payload that it counts on.
        reference: motion to follow, such as a minimum-time solution's trajectory.
        controller: of the loop; with a file a dataclass of numbers, as armdyn's own are.
        plants: ranges that the arms are drawn from.
        loop: connection of controller and arm.
        options: number of arms, and how each is watched.
        file: SQLite, for the rows; `study_table` reads it; None: no file.
        progress: called with the progress in words.

    Returns:
        The result; after Ctrl-C of the rows so far.

    Raises:
        ProblemError: an argument does not fit the robot.
        ResultError: the file's rows belong to another study, it is damaged, or another process writes to it.
        FileError: the file cannot be read or written.
        DiskFullError: the disk is full.
    """
    progress = listener(progress)
    study = PlantStudy(robot, reference, controller, plants, loop, options)

    def report(now: Progress) -> None:
        left = "" if now.left is None else f", {now.left[1]:.0f} s left"
        progress(f"{now.done} of {now.cases} arms{left}")

    with row_store(file, study.description, "normal") as rows, stopping(np.inf) as stop:
        with in_process(study, options.workers) as executor:
            CaseRun(study, rows, executor, stop, report).go()
        found = list[PlantRow]()
        for row in rows.rows():
            if row.k >= options.count:
                break
            if row.settings != study.parameters(row.k):
                raise ResultError(f"{rows.path}: row {row.k} is not of the arm that this seed draws; it was changed")
            found.append(PlantRow.of(row, study.sample(row.k)))
    return MonteCarlo(study, tuple(found), None if file is None else Path(os.fsdecode(file)))
