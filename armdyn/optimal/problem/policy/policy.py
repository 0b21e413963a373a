"""The policy of a problem: strategies and tuned numbers by its class."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from typing import ClassVar, Self

import numpy as np

from armdyn.dynamics.numeric import joint_inertia
from armdyn.errors import ProblemError
from armdyn.optimal.problem.choices import MethodName
from armdyn.optimal.problem.policy.bound import BoundPolicy
from armdyn.optimal.problem.policy.curves import TRAINED, CurvePolicy, LivePolicy, SequentialPolicy
from armdyn.optimal.problem.policy.refinement import (
    ArcsPolicy,
    MotionMeshPolicy,
    PathConstraintPolicy,
    PolishPolicy,
    ShootingPolicy,
)
from armdyn.optimal.problem.policy.search import GoalPolicy, ProgramPolicy, SamePolicy, SearchPolicy
from armdyn.optimal.problem.policy.tuned import by_kind
from armdyn.optimal.problem.problem import MinimumTimeProblem


@dataclass(frozen=True, kw_only=True)
class StrategyPolicy:
    """Refinement methods, in the order in which they are tried."""

    cases: ClassVar = TRAINED

    methods: tuple[MethodName, ...] = by_kind(
        "methods",
        "tried in turn until an optimum is certified: curves alone beyond three joints, as idle ones leave arcs open, "
        "and first where velocity limits shape the motion, often proven; profiles first where rates are limited most",
    )
    fallback: tuple[MethodName, ...] = by_kind(
        "methods", "from landed motions if no optimum is usable; a curve needs a motor at every joint", "by definition"
    )
    bounded: bool = by_kind("-", "velocity limits shape the motion: their lower bound is computed concurrently")

    @property
    def curves_alone(self) -> bool:
        """Whether curves are the last method, so that no mesh follows."""
        return self.methods[-1] == "curves"


def is_speed_limited(problem: MinimumTimeProblem) -> bool:
    """Whether velocity limits shape the fastest motion, by an estimate.

    They do if the joint with the largest lower bound by its velocity limit reaches that limit: moving alone, from and
    to rest, with the inertia at the start of its leg and half its torque range.

    Args:
        problem: the problem.
    """
    ways, limits = np.abs(np.diff(problem.poses, axis=0)), problem.limits
    times = ways / limits.velocity
    leg, j = np.unravel_index(int(np.argmax(times)), times.shape)
    if times[leg, j] == 0:
        return False
    inertia = joint_inertia(problem.robot)(problem.poses[leg])[j, j]
    return bool(limits.velocity[j] ** 2 * inertia <= ways[leg, j] * limits.actuators.half_range[j])


@dataclass(frozen=True, kw_only=True)
class Policy:
    """Settings for one class of problems; each number has its unit, its reason and the cases of its tuning.

    Attributes:
        strategy: refinement methods, in the order in which they are tried.
        program: nonlinear program and its solver.
        search: guesses, and the choice of optima to refine.
        goals: choice among many goals, and the descent of an end along a pose.
        same: tolerances within which two durations belong to one optimum.
        motion_mesh: mesh refinement until the motion is resolved.
        arcs: detection of arcs.
        polish: exact switching times of a mesh's bang arcs.
        shooting: multiple shooting, its correction, and costates along its motion.
        path_constraints: tightening of path constraints.
        curves: motions as curves.
        sequential: sequential convexification: curves among obstacles.
        live: replanning while the arm moves.
        bound: tightness of the lower bound.
        overrides: groups and numbers set by `changed`, in order.
    """

    strategy: StrategyPolicy
    program: ProgramPolicy
    search: SearchPolicy
    goals: GoalPolicy = field(default_factory=GoalPolicy)
    same: SamePolicy = field(default_factory=SamePolicy)
    motion_mesh: MotionMeshPolicy = field(default_factory=MotionMeshPolicy)
    arcs: ArcsPolicy = field(default_factory=ArcsPolicy)
    polish: PolishPolicy = field(default_factory=PolishPolicy)
    shooting: ShootingPolicy = field(default_factory=ShootingPolicy)
    path_constraints: PathConstraintPolicy = field(default_factory=PathConstraintPolicy)
    curves: CurvePolicy
    sequential: SequentialPolicy = field(default_factory=SequentialPolicy)
    live: LivePolicy = field(default_factory=LivePolicy)
    bound: BoundPolicy = field(default_factory=BoundPolicy)
    overrides: tuple[tuple[str, dict[str, object]], ...] = ()

    @classmethod
    def of(cls, problem: MinimumTimeProblem) -> Self:
        """The policy for a problem, from its joints, limits and path constraints."""
        motors = not np.any(problem.limits.passive)
        speed_limited = is_speed_limited(problem)
        joints, has_constraints = problem.robot.nv, bool(problem.path_constraint_names)
        rated = problem.continuous_torque or problem.acceleration_limit is not None
        many = motors and not has_constraints and joints == 3  # hundreds of optima
        some = motors and not has_constraints and joints == 2
        far = not problem.pays_effort  # torques that cost nothing fold an arm far off the straight way
        wide = np.any(problem.limits.position_upper - problem.limits.position_lower > 4 * np.pi)  # more than two turns
        starts = _by_joints(joints, 1, 32 if some else 16 if motors else 40, 140 if many else 100)
        if problem.pays_effort:
            starts = _by_joints(joints, 2, 200 if some else 64, 140 if many else 24)
        return cls(
            strategy=_strategy(problem, motors, speed_limited),
            program=ProgramPolicy(
                linear=rated or problem.effort_weight > 0 or not problem.limits.actuators.constant,
                condensed=not has_constraints,
                coarse_barriers=(1e-2, 1e-1) if many and far else (1e-3, 1e-2),
                guess_iterations=250 if many or (some and not far) else None,
                flat=1e-4 if set(problem.path_constraint_names) - {"via points"} else None,
            ),
            search=SearchPolicy(
                starts=starts,
                ends_early=not (many or (some and far)),
                scattered=0.4 if (many or some) and far else 0.0,
                meshes=(60,) if problem.effort_weight > 0 else (15, 25) if motors else (25, 35),
                fine_mesh=80 if problem.effort_weight > 0 else 40,
                neighbour_starts=_by_joints(joints, *((1, 4, 6, 1) if problem.pays_effort else (1, 8, 12, 1))),
                spread=0.0 if many and far else 1.5 if joints == 3 else 1.0,
                uniform_spread=0.0 if not far else 8.0 if many and wide else 4.0 if many or some else 0.0,
                guess_duration=0.4 if many else 0.6 if some else 1.0,
                mutated=0.4 if many else 0.0,
                side_by_side=joints > 2 or (joints > 1 and (has_constraints or problem.pays_effort)),
            ),
            curves=CurvePolicy(
                cruises=speed_limited,
                # Continuous torques ramp more slowly than speeds saturate.
                shortest=(2e-3 if problem.continuous_torque else 3e-4) if speed_limited else 1.0,
                starts=1 if speed_limited else 4,
                mesh_starts=_by_joints(joints, 1, 4, 12) if rated and motors and not problem.via else 0,
            ),
        )

    def rows(self) -> Iterator[tuple[str, object, str, str, str]]:
        """Name, value, unit, reason and cases of every number."""
        groups = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "overrides"}
        for name, group in groups.items():
            for one in fields(group):
                about = one.metadata
                cases = about["cases"] or group.cases
                yield f"{name}.{one.name}", getattr(group, one.name), about["unit"], about["why"], cases

    def changed(self, group: str, **numbers: object) -> Self:
        """The policy with other numbers in one group, for experiments; `for_problem` applies them to other problems."""
        own = {group: replace(getattr(self, group), **numbers), "overrides": (*self.overrides, (group, numbers))}
        return replace(self, **own)

    def by(self, method: MethodName) -> Self:
        """The policy with one method alone."""
        return self.changed("strategy", methods=(method,), fallback=())

    def for_problem(self, problem: MinimumTimeProblem) -> Self:
        """The policy for another problem, with the same overrides."""
        policy = self.of(problem)
        for group, numbers in self.overrides:
            policy = policy.changed(group, **numbers)
        return policy


def _strategy(problem: MinimumTimeProblem, motors: bool, speed_limited: bool) -> StrategyPolicy:
    """Refinement methods for a class of problems."""
    alone = motors and (problem.robot.nv > 3 or problem.relative_effort_weight > 0 or problem.has_regions)
    constrained = bool(set(problem.path_constraint_names) - {"obstacles", "self-collision"})
    free = motors and not (constrained or problem.pays_effort)
    first: tuple[MethodName, ...] = ("curves",) if alone or (speed_limited and free) else ()
    profiled: tuple[MethodName, ...] = ("profiles",) if motors and _has_profiles(problem) else ()
    return StrategyPolicy(
        methods=(*profiled, *(first if alone else (*first, "mesh"))),
        fallback=("curves",) if motors and not alone else (),
        bounded=bool(speed_limited or profiled) and not problem.pays_effort,
    )


def policy_for(problem: MinimumTimeProblem, method: MethodName | None) -> Policy:
    """The policy for a problem, with the method that the user names alone.

    Raises:
        ProblemError: the method cannot solve the problem; the message says why.
    """
    if method is None:
        return Policy.of(problem)
    motors = dict(zip(problem.robot.joint_names, ~problem.limits.passive, strict=True))
    idle = next((joint for joint, motor in motors.items() if not motor), None)
    inverse = f"joint {idle!r} has no motor, and torques by inverse dynamics need one at every joint"
    faults: dict[MethodName, dict[str, bool]] = {
        "mesh": {
            "it does not avoid obstacles, nor the arm itself": problem.has_clearance,
            "frames do not pass regions on it": problem.has_regions,
            "it has no `relative_effort_weight`": problem.relative_effort_weight > 0,
        },
        "curves": {inverse: idle is not None},
        "profiles": {
            inverse: idle is not None,
            "every joint needs `acceleration_limit` or `jerk_limit`, and the motion goes from rest to rest, without "
            "via points, regions or a weight on effort": not _has_profiles(problem),
        },
    }
    if found := [why for why, holds in faults[method].items() if holds]:
        raise ProblemError(f"`method` {method} cannot solve this: {found[0]}; without `method` another is chosen")
    return Policy.of(problem).by(method)


def _has_profiles(problem: MinimumTimeProblem) -> bool:
    """Whether every joint has a fastest profile of its own: its rates are limited, from rest to rest."""
    limit = problem.acceleration_limit if problem.jerk_limit is None else problem.jerk_limit
    limited = limit is not None and bool(np.all(np.isfinite(limit)))
    return limited and problem.from_rest_to_rest and not (problem.via or problem.has_regions or problem.pays_effort)


def _by_joints(joints: int, *numbers: int) -> int:
    """Number for a count of joints; the last is for all larger counts."""
    return numbers[min(joints, len(numbers)) - 1]
