"""A case's work: the fastest motion of an arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from armdyn.arguments import expect, one_of
from armdyn.optimal import MinimumTimeOptions, MinimumTimeProblem, Solution, Status, solve_minimum_time
from armdyn.optimal.task.policy import Policy
from armdyn.studies.sweeps.tasks.settings import SIGNS, ArmRecipe, Value, arm_of, asked_of, kept
from armdyn.studies.sweeps.tasks.task import INTERRUPTED, CaseOutcome, finite, motion_bytes, motion_from
from armdyn.trajectory import Trajectory

Neighbours = Literal["add", "lead", "off"]
NEIGHBOURS: tuple[Neighbours, ...] = ("add", "lead", "off")


@dataclass(frozen=True, kw_only=True)
class MinimumTime:
    """The fastest motion of an arm.

    Attributes:
        arms: of the study, at least one.
        fixed: settings that do not vary.
        options: of every solve; workers are not looked at.
        neighbours: what a finished neighbour's optimum is: "add", one more guess beside the search's own; "lead",
            one beside few; "off", nothing.
    """

    signs = SIGNS | {"acceleration_limit": "positive"}
    """Its settings."""

    arms: tuple[ArmRecipe, ...]
    fixed: Mapping[str, Value] = field(default_factory=dict)
    options: MinimumTimeOptions = field(default_factory=MinimumTimeOptions)
    neighbours: Neighbours = "add"

    def __post_init__(self) -> None:
        one_of(self.neighbours, NEIGHBOURS, "neighbours")
        expect(self.options, MinimumTimeOptions, "options")

    @property
    def uses_neighbours(self) -> bool:
        """A case may begin with the motion of another."""
        return self.neighbours != "off"

    def problem(self, settings: Mapping[str, Value]) -> MinimumTimeProblem:
        """What is solved in a case.

        Raises:
            ArmdynError: its settings do not fit the arm.
        """
        return problem_of(self.arms, {**self.fixed, **settings})

    def work(self, settings: Mapping[str, Value], guess: bytes) -> CaseOutcome:
        """Solve it."""
        problem = self.problem(settings)
        options = replace(self.options, workers=1)
        if guess:
            options = replace(options, guesses=(*options.guesses, motion_from(guess, problem.robot)))
            if self.neighbours == "lead":
                search = Policy.of(problem).search
                options = replace(options, starts=search.guesses(options, search.neighbour_starts))
        solution = solve_minimum_time(problem, options)
        if solution.status is Status.INTERRUPTED:
            return CaseOutcome(status=INTERRUPTED)
        usable = solution.usable
        return CaseOutcome(
            status="usable" if usable else str(solution.status) if not solution.success else "not_usable",
            good=usable,
            message=solution.message,
            facts=_solution_facts(solution),
            motion=motion_bytes(solution.trajectory) if usable and self.uses_neighbours else b"",
        )

    def description(self) -> dict[str, object]:
        """What it is, as JSON says it."""
        options = {name: getattr(self.options, name) for name in ("search", "starts", "seed", "time_limit")}
        return asked_of("minimum-time", self.arms, self.fixed) | {"search": {**options, "neighbours": self.neighbours}}


def problem_of(arms: Sequence[ArmRecipe], settings: Mapping[str, Value]) -> MinimumTimeProblem:
    """The problem that settings make.

    Raises:
        ArmdynError: they do not fit the arm.
    """
    recipe = arm_of(arms, settings)
    robot = recipe.fitted(settings)
    return MinimumTimeProblem(robot, **recipe.poses(settings, robot.joint_names), **kept(settings))


def _solution_facts(solution: Solution) -> dict[str, float | bool | str | None]:
    """Columns of a fastest motion; what is not known is None."""
    motion, most = solution.trajectory, next(iter(solution.decides), None)
    moves = solution.moves
    return {
        "duration_s": solution.duration if moves else None,
        "certified": solution.certified,
        "gap": finite(solution.gap),
        "lower_bound_s": finite(solution.lower_bound),
        "limited_most_by": most.name if most else None,
        "ms_saved_by_one_per_cent": 10 * most.part * solution.duration if most else None,
        "peak_speed": float(np.abs(motion.v).max()) if moves else None,
        "torque_squared": _torque_squared(motion) if moves else None,
    }


def _torque_squared(motion: Trajectory) -> float:
    """∫ τᵀτ dt [(N m)² s], exact for a torque that is linear between samples (Simpson's rule of its square)."""
    tau, steps = motion.tau, np.diff(motion.t)
    squares = (tau[:-1] ** 2 + tau[:-1] * tau[1:] + tau[1:] ** 2).sum(axis=1) / 3
    return float(squares @ steps)
