"""Costs of a controller's conditions: the time saved without each of them."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arguments import expect, listener
from armdyn.errors import ProblemError
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.minimum_time import solve_minimum_time
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status

REACHED = 0.95
"""Share of a limit from which a condition may cost time; one that stays below it is not solved without."""

NOTHING = 1e-6
"""Part of the duration that is no cost, but rounding."""

LONGEST = 4.0
"""Time limit of a solve without a condition, as a multiple of the time that the solve with all of them took."""
LEAST = 10.0
"""Shortest such time limit [s]."""


@dataclass(frozen=True)
class ConditionCost:
    """Time that one necessary condition costs, all others kept.

    Attributes:
        condition: name of the condition, such as "jerk".
        share: the largest part of its limit that the motion uses [-].
        without: duration of the motion without the condition [s]; None: it was not solved for, or no motion was found.
        cost: time that the condition costs at least [s]: a motion without it may be faster than the one found; None: no
            motion was found.
        reason: why the condition cannot cost time; empty: the problem was solved without it.
    """

    condition: str
    share: float
    without: float | None = None
    cost: float | None = 0.0
    reason: str = ""

    def __str__(self) -> str:
        return f"{self.condition.replace('_', ' ')}: {self.said}"

    @property
    def said(self) -> str:
        """The cost in words."""
        if self.reason:
            return f"nothing, {self.reason}"
        if self.cost is None or self.without is None:
            return "unknown, no motion was found without it"
        if self.cost < NOTHING * self.without:
            return "nothing, without it no faster motion was found"
        part = 100 * self.cost / (self.without + self.cost)
        return f"at least {1e3 * self.cost:.3g} ms, {part:.2g} % of the time: {self.without:.4f} s without it"


def condition_costs(
    solution: Solution,
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[ConditionCost, ...]:
    """Costs of the necessary conditions of a problem's preset, by solving the problem without each of them.

    Args:
        solution: a usable solution of a problem with a preset.
        options: options of the solves; by default a quick search.
        progress: called with a line of text before each solve.

    Returns:
        The costs; after Ctrl-C those so far.

    Raises:
        ProblemError: the problem has no preset, or the solution is not usable.
    """
    expect(solution, Solution, "solution")
    problem, report = solution.problem, listener(progress)
    if problem.preset is None or not solution.usable:
        raise ProblemError("costs are of a usable solution of a problem with a preset")
    limit = max(LEAST, LONGEST * solution.solve_time)
    chosen = replace(options or MinimumTimeOptions(search="quick"), time_limit=limit)
    costs = []
    with suppress(KeyboardInterrupt):
        for condition, share in _shares(solution).items():
            try:
                relaxed = problem.variant(preset=problem.preset.without(condition))
            except ProblemError:  # a kinematic problem without limits of its accelerations
                costs.append(ConditionCost(condition, share, cost=None))
                continue
            reason = "the motion stays below its limit" if share < REACHED else _as_strict(problem, relaxed)
            if reason:
                costs.append(ConditionCost(condition, share, reason=reason))
                continue
            report(f"without the {condition.replace('_', ' ')} limit")
            found = solve_minimum_time(relaxed, chosen)
            if found.status is Status.INTERRUPTED:
                break
            gained = max(0.0, solution.duration - found.duration) if found.usable else None
            costs.append(ConditionCost(condition, share, found.duration if found.usable else None, gained))
    return tuple(costs)


def _as_strict(problem: MinimumTimeProblem, relaxed: MinimumTimeProblem) -> str:
    """Reason why a problem without a condition is the same one; empty if it differs."""
    same = all(np.array_equal(own, relaxed.limits.rows[name]) for name, own in problem.limits.rows.items())
    for name in ("acceleration_limit", "jerk_limit"):
        same &= np.array_equal(getattr(problem, name), getattr(relaxed, name))
    same &= problem.path_constraint_names == relaxed.path_constraint_names
    return "the robot's own limit is as strict" if same else ""


def _shares(solution: Solution) -> dict[str, float]:
    """The largest used part of each necessary condition's limit: of the motion, and of its commands."""
    preset = solution.problem.preset
    assert preset is not None  # noqa: S101  # `condition_costs` checked it
    shares = dict.fromkeys(preset.chosen.necessary, 0.0)
    for row in preset.check(solution.trajectory).rows:
        if row.necessary:
            shares[row.condition] = max(shares[row.condition], row.share)
    for report in solution.constraint_reports:  # a jerk of less than three ticks is more than its third difference
        condition = report.name.removesuffix(" limits").replace("-", "_")
        if condition in shares and report.share is not None:
            shares[condition] = max(shares[condition], report.share)
    return shares
