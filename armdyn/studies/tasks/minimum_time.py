"""Study task "minimum-time": the fastest motion of every case."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np

from armdyn.arguments import Checked, checked, expect, one_of
from armdyn.cycle.solution import CycleSolution
from armdyn.optimal import MinimumTimeOptions, Solution, Status, solve_minimum_time
from armdyn.optimal.answer.words import standing
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.policy.search import SamePolicy
from armdyn.optimal.verify.certificate import GAP_TOLERANCE
from armdyn.optimal.verify.optimum import torque_squared
from armdyn.parsing.toml import Table
from armdyn.studies.problems import ProblemSource
from armdyn.studies.rows import StudyRow, Value
from armdyn.studies.settings import SIGNS
from armdyn.studies.tasks.task import INTERRUPTED, CaseResult, Neighbours, motion_bytes, motion_from

NEIGHBOURS: tuple[Neighbours, ...] = ("add", "lead", "off", "chain")


@dataclass(frozen=True, kw_only=True)
class MinimumTimeTask(Checked):
    """Search of the fastest motion.

    Attributes:
        problems: problem of each case.
        options: of every search; with neighbours "chain" its workers count, else each search has one.
        neighbours: see `Neighbours`.
        progress: called with the progress of a search in this process, in words.
        same: numbers that tell whether two motions are one optimum.
    """

    name: ClassVar = "minimum-time"
    signs: ClassVar = SIGNS | {"acceleration_limit": "positive"}
    outcomes: ClassVar = ("duration_s", "torque_squared")

    problems: ProblemSource
    options: MinimumTimeOptions = checked(expect, MinimumTimeOptions(), kind=MinimumTimeOptions)
    neighbours: Neighbours = checked(one_of, "add", known=NEIGHBOURS)
    progress: Callable[[str], None] | None = None
    same: SamePolicy = field(default_factory=SamePolicy)

    @classmethod
    def read(cls, table: Table, problems: ProblemSource, names: Mapping[str, Table]) -> Self:
        """The task that a table [search] describes."""
        table.only(("search", "starts", "seed", "time_limit", "neighbours"))
        given: dict[str, Any] = {name: value for name, value in table.values.items() if name != "neighbours"}
        with table.locating_errors():
            options = MinimumTimeOptions(**given)
        neighbours: Any = table.text("neighbours", "add", NEIGHBOURS)
        return cls(problems=problems, options=options, neighbours=neighbours)

    def work(self, settings: Mapping[str, Value], guess: bytes, revisit: bool = False) -> CaseResult:
        """Solve the problem of a case."""
        problem = self.problems.problem(settings)
        options = self.options if self.neighbours == "chain" else replace(self.options, workers=1)
        if guess:
            options = replace(options, guesses=(*options.guesses, motion_from(guess, problem.robot)))
            if self.neighbours != "add":
                search = Policy.of(problem).search
                options = replace(options, starts=1 if revisit else search.guesses(options, search.neighbour_starts))
        solution = solve_minimum_time(problem, options, self.progress)
        facts = _facts(solution)
        if self.neighbours == "chain":
            facts |= _chain_facts(solution)
        kept = solution.success if self.neighbours == "chain" else solution.usable and self.neighbours != "off"
        return replace(result_with(solution, facts), motion=motion_bytes(solution.trajectory) if kept else b"")

    def description(self) -> dict[str, object]:
        """The task as JSON."""
        options = {name: getattr(self.options, name) for name in ("search", "starts", "seed", "time_limit")}
        search = {**options, "neighbours": self.neighbours}
        return {"task": self.name, **self.problems.description(), "search": search}

    def promising(self, row: StudyRow, later: StudyRow) -> bool:
        """Whether the later optimum is of another branch, and the row is not proven to be about as fast as can be."""
        own = row.facts
        proven = own["gap_proven"] and own["gap"] is not None and own["gap"] <= GAP_TOLERANCE
        alike = own["arcs"] and own["arcs"] == later.facts["arcs"]
        return bool(later.facts["landed"] and not proven and not alike)

    def better(self, row: StudyRow, other: StudyRow) -> bool:
        """Whether a row is better than another one: only it reaches the goal, or it costs less."""
        own, its = row.facts, other.facts
        if own["landed"] != its["landed"]:
            return bool(own["landed"])
        return bool(own["cost"] < its["cost"] * (1 - self.same.resolved))


def result_with(solution: Solution | CycleSolution, facts: Mapping[str, Any]) -> CaseResult:
    """Result of a case that was solved, usable or not."""
    status = "usable" if solution.usable else "not_usable" if solution.success else str(solution.status)
    status = INTERRUPTED if solution.status is Status.INTERRUPTED else status
    return CaseResult(status=status, good=solution.usable, message=solution.message, facts=facts, value=solution)


def _facts(solution: Solution) -> dict[str, Any]:
    """Columns of a fastest motion; None: not known."""
    motion, most = solution.trajectory, next(iter(solution.decides), None)
    moves = solution.moves
    return {
        "duration_s": solution.duration if moves else None,
        "certified": solution.certified,
        "gap": solution.gap,
        "lower_bound_s": solution.lower_bound,
        "limited_most_by": most.name if most else None,
        "ms_saved_by_one_per_cent": 10 * most.part * solution.duration if most else None,
        "peak_speed": float(np.abs(motion.v).max()) if moves else None,
        "torque_squared": torque_squared(motion) if moves else None,
    }


def _chain_facts(solution: Solution) -> dict[str, Any]:
    """Facts that compare the optima of a chain, and that `--require` checks."""
    by, weight = solution.sensitivities(), solution.problem.effort_weight
    # Where effort is paid for torques are on no limit, and their arcs say nothing.
    arcs = () if solution.problem.pays_effort else solution.arcs
    return standing(solution) | {
        "ms_per_gram": by.payload_mass if by else None,
        "landed": solution.success,
        "arcs": "; ".join(", ".join(mode.value for mode in arc.modes) for arc in arcs),
        "cost": solution.duration + torque_squared(solution.trajectory, weight) / 2,
    }
