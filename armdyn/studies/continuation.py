"""Chains of similar problems: each optimum begins the search of the next one, and later optima are tried on earlier."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from armdyn.arguments import expect, listener
from armdyn.errors import ArmdynError, ProblemError
from armdyn.optimal import MinimumTimeOptions, MinimumTimeProblem, Solution
from armdyn.optimal.problem.status import stopping
from armdyn.studies.executor import in_process
from armdyn.studies.rows import StudyRow, Value, row_store
from armdyn.studies.run import CaseRun
from armdyn.studies.study import Axis, Study
from armdyn.studies.tasks.minimum_time import MinimumTimeTask
from armdyn.studies.tasks.task import CaseResult


@dataclass(frozen=True, eq=False)
class ListedProblems:
    """Problems that are there already, by the value of one setting.

    Attributes:
        setting: its name.
        problems: by its values, in an order in which neighbours resemble each other.
    """

    setting: str
    problems: Mapping[float, MinimumTimeProblem]

    def problem(self, settings: Mapping[str, Value]) -> MinimumTimeProblem:
        """Problem of a case."""
        return self.problems[settings[self.setting]]

    def description(self) -> dict[str, object]:
        """Checksums of the problems."""
        return {"problems": {f"{value:g}": _digest(problem) for value, problem in self.problems.items()}}


def chain(
    setting: str,
    problems: Mapping[float, MinimumTimeProblem],
    options: MinimumTimeOptions,
    progress: Callable[[str], None] | None = None,
) -> Study:
    """The study of a chain of problems, to be done in this process.

    Args:
        setting: name of the one that varies.
        problems: by its values.
        options: of every search; `starts` holds for all, if it is given. A time limit is each search's own.
        progress: called with the progress of a search in words.
    """
    task = MinimumTimeTask(
        problems=ListedProblems(setting, problems), options=options, neighbours="chain", progress=progress
    )
    return Study(task=task, axes=(Axis(name=setting, values=tuple(problems)),))


def continuation(
    problems: Sequence[MinimumTimeProblem],
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
    done: Callable[[int, Solution], None] | None = None,
) -> tuple[Solution, ...]:
    """Solve a series of similar problems, such as one motion with growing payload, each from the last optimum.

    The first is searched as `solve_minimum_time` does. Each of the others begins with its neighbour's optimum and few
    guesses of its own; then, backwards, an optimum that a later problem has found is tried on the one before, unless
    that is proven to be nearly optimal. The same model with other payloads, limits or poses is built and
    compiled once.

    Args:
        problems: in an order in which neighbours resemble each other.
        options: of every search; see `chain`.
        progress: called with the progress in words.
        done: called with the number and the solution of a problem, again where the way back finds a faster one.

    Returns:
        A solution for each problem, in their order; after Ctrl-C those so far.

    Raises:
        ProblemError: the problems' robots differ in their joints.
    """
    options = MinimumTimeOptions() if options is None else expect(options, MinimumTimeOptions, "options")
    names = [problem.robot.joint_names for problem in problems]
    for k, own in enumerate(names):
        if own != names[0]:
            raise ProblemError(f"problems[{k}] moves {', '.join(own)}; the first moves {', '.join(names[0])}")
    if not problems:
        return ()
    found, progress = dict[int, Solution](), listener(progress)

    def keep(row: StudyRow, result: CaseResult) -> None:
        found[row.k] = result.value
        if done:
            done(row.k, result.value)

    def count(text: str) -> None:
        progress(f"{min(len(found) + 1, len(problems))} of {len(problems)}: {text}")

    study = chain("problem", {float(k): one for k, one in enumerate(problems)}, options, count)
    with row_store(None, study.description) as rows, stopping(np.inf) as stop, in_process(study.task) as executor:
        CaseRun(study, rows, executor, stop, ended=keep).go()
    return tuple(found[k] for k in sorted(found))


def _digest(problem: MinimumTimeProblem) -> str:
    """Checksum of a problem as TOML, or of its values where no file can describe it."""
    try:
        text = problem.to_toml()
    except ArmdynError:
        own = {field.name: getattr(problem, field.name) for field in fields(problem) if field.name != "robot"}
        text = f"{problem.robot.model_hash} {problem.robot.friction!r} {own!r}"
    return hashlib.sha256(text.encode()).hexdigest()
