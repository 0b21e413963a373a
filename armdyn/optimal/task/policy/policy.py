"""The one place that knows what depends on the kind of problem, and every tuned number."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Self

from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.policy.curves import CurvePolicy
from armdyn.optimal.task.policy.landing import ConditionsPolicy, LandingPolicy
from armdyn.optimal.task.policy.refinement import (
    ArcsPolicy,
    IndirectPolicy,
    RefinementPolicy,
    SmoothPolicy,
)
from armdyn.optimal.task.policy.search import ProgramPolicy, SamePolicy, SearchPolicy
from armdyn.optimal.task.policy.tuned import rows
from armdyn.optimal.task.scheme import Scheme

_SMALL = 3
"""Joints up to which time determines every torque as a rule, so that arcs can be resolved; beyond, some are idle."""


@dataclass(frozen=True, kw_only=True)
class Policy:
    """How a kind of problem is gone about; every number says its unit, its reason and what it was chosen on.

    Attributes:
        program: how motion becomes a nonlinear program.
        search: guesses, and which of their optima go on.
        same: when two durations are one optimum's.
        refinement: how far an optimum of a mesh is refined.
        arcs: how arcs are read, laid and solved.
        landing: how a mesh's torques are brought to land.
        smooth: optima of time and energy.
        conditions: what is asked along the way.
        indirect: the second approach.
        curves: motions as curves.
    """

    program: ProgramPolicy
    search: SearchPolicy
    same: SamePolicy = field(default_factory=SamePolicy)
    refinement: RefinementPolicy
    arcs: ArcsPolicy = field(default_factory=ArcsPolicy)
    landing: LandingPolicy
    smooth: SmoothPolicy
    conditions: ConditionsPolicy = field(default_factory=ConditionsPolicy)
    indirect: IndirectPolicy
    curves: CurvePolicy

    @classmethod
    def of(cls, problem: MinimumTimeProblem) -> Self:
        """The policy for a problem, by its joints, its limits and its conditions along the way."""
        joints, asked = problem.robot.nv, bool(problem.along_the_way)
        small, crowded = joints <= _SMALL, bool(problem.obstacles) or problem.self_collision
        easy = small or problem.effort_weight > 0
        return cls(
            program=ProgramPolicy(
                dynamics="forward" if small else "inverse",
                linear=problem.continuous_torque,
                condensed=small and not asked,
                graded=not small,
                tie=0.0 if easy else 1e-2,
                flat=(1e-4 if _has_rows(problem) else None if small else 1e-5),
                patience=None if small else 250,
                kept=None if small else 1e-6,
            ),
            search=SearchPolicy(
                starts=_by_joints(joints, (1, 12, 16), 6) if crowded else _by_joints(joints, (1, 16, 40), 4),
                neighbour_starts=_by_joints(joints, (1, 8, 12), 1),
                every_mesh=small,
                side_by_side=joints > 1,
                straight_on_fine=not (small or crowded),
                straight_is_mark=not small,
                without_dry_friction=not small,
                again=1 < joints <= _SMALL and not crowded,
                refined=4 if small else 2,
            ),
            refinement=RefinementPolicy(
                arcs_first=small,
                idle_end_it=not small,
                landing_is_enough=not small,
                extremal_is_enough=joints > 2,
                lists_slower=joints > 2,
                one_mesh=not small,
            ),
            landing=LandingPolicy(leads_home=not small),
            smooth=SmoothPolicy(starts=_by_joints(joints, (2, 16, 24), 4), refined=10 if joints == 2 else 6),
            indirect=IndirectPolicy(starts=_by_joints(joints, (1, 6), 16)),
            curves=CurvePolicy(
                shortest=_shortest(problem),
                starts=6 if crowded else 1 if problem.speed_limited else 4,
            ),
        )

    def scheme(self, options: MinimumTimeOptions) -> Scheme:
        """How motion becomes unknowns: as the options say, where they leave it open as it suits the problem."""
        form = self.program.dynamics if options.dynamics == "auto" else options.dynamics
        control = "linear" if self.program.linear else options.control
        return Scheme(options.method, control, form, options.compile)

    def rows(self) -> Iterator[tuple[str, object, str, str, str]]:
        """Name, value, unit, reason and cases of every number."""
        return rows(self)

    def changed(self, group: str, **numbers: object) -> Self:
        """The same with other numbers in one group, to try them."""
        return replace(self, **{group: replace(getattr(self, group), **numbers)})


def _shortest(problem: MinimumTimeProblem) -> float:
    """The first interval of a curve: torques that may not jump ramp more slowly than velocity limits are reached."""
    if not problem.speed_limited:
        return 1.0
    return 2e-3 if problem.continuous_torque else 3e-4


def _has_rows(problem: MinimumTimeProblem) -> bool:
    """Whether the program has rows besides the equations of motion."""
    return bool(set(problem.along_the_way) - {"via points"})


def _by_joints(joints: int, few: tuple[int, ...], many: int) -> int:
    return few[joints - 1] if joints <= len(few) else many
