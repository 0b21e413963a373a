"""One thing to solve or simulate, what came of it, and how that is kept on disk."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import Literal

import numpy as np

from armdyn.control import PidRun, simulate_pid
from armdyn.control.arrival import ArrivalRule
from armdyn.control.motion import EquationsOfMotion
from armdyn.control.pid import DerivativeSign
from armdyn.dynamics.printed import PrintedArm
from armdyn.errors import ProblemError
from armdyn.models.robot import Robot
from armdyn.models.spec import ArmSpec, PaperArm, Payload
from armdyn.optimal import (
    IndirectOptions,
    MinimumTimeOptions,
    MinimumTimeProblem,
    Solution,
    compare_with_direct,
    solve_indirect,
    solve_minimum_time,
)
from armdyn.optimal.refine.smooth import trajectory_cost
from armdyn.show.report import minimum_time_summary, pid_summary
from armdyn.studies.paper import EXAMPLES, Example, Kind, example
from armdyn.trajectory import Trajectory

Reading = Literal["tip", "mM"]
"""Where the payload M is: "tip", a point mass at the tip, which is the physics; "mM", the last link's m becomes
m + M while l_c and I stay, which is what the paper's PID times match."""

Variant = Literal["lagrangian", "printed"]
"""Equations of motion: "lagrangian", the arm's; "printed", equation (7) by the letter, RRR only."""

States = Literal["printed", "example 2"]
"""Of Example 5: as printed there, or Example 2's, which the text lets one expect."""

Fact = float | str | bool | None | list[float]

READINGS: tuple[Reading, ...] = ("tip", "mM")
UNBOUNDED_EFFORT = 30.0
"""The torque limit of a problem that has none [N m]: it scales the unknowns. No optimum here passes a fifth of it."""
PID_DURATION = 10.0
"""Of Examples 4 to 6 [s]."""
SOLVE_LIMIT, INDIRECT_LIMIT = 120.0, 20.0
"""Wall time of a direct and of an indirect solve [s]: several times what the slowest case takes."""


@dataclass(frozen=True)
class Case:
    """One thing to solve or simulate.

    Attributes:
        example: 1 to 6; a time-energy optimum belongs to Example 1, 2 or 3.
        arm: of the example.
        kind: see `Kind`.
        payload: M [kg].
        reading: see `Reading`.
        variant: see `Variant`.
        states: see `States`.
        derivative_sign: of the PID loops: "printed" is + k_D θ̇ of (28) to (30).
        arrival_rule: of the PID loops.

    Raises:
        ProblemError: arm and kind are not the example's, or the options do not fit it.
    """

    example: int
    arm: PaperArm
    kind: Kind
    payload: float
    reading: Reading = "tip"
    variant: Variant = "lagrangian"
    states: States = "printed"
    derivative_sign: DerivativeSign = "corrected"
    arrival_rule: ArrivalRule = "last_entry_first_joint"

    def __post_init__(self) -> None:
        of_paper = self.paper_example
        closed_loop = self.kind == "pid"
        if (of_paper.arm, of_paper.kind == "pid") != (self.arm, closed_loop):
            raise ProblemError(f"Example {self.example} is {of_paper.arm} {of_paper.kind}, not {self.arm} {self.kind}")
        if self.variant == "printed" and (not closed_loop or self.arm != "rrr" or self.reading != "mM"):
            raise ProblemError(f"{self.name}: equation (7) as printed is there for RRR's PID loop with m + M only")
        if self.states != "printed" and self.example != 5:
            raise ProblemError(f"{self.name}: only Example 5 is printed with other states than its arm's first example")
        if not closed_loop and (self.derivative_sign, self.arrival_rule) != ("corrected", "last_entry_first_joint"):
            raise ProblemError(f"{self.name}: a derivative's sign and an arrival rule are for PID loops")

    @property
    def paper_example(self) -> Example:
        """The example in the paper."""
        if self.example not in range(1, 7):
            raise ProblemError(f"the paper has Examples 1 to 6, not {self.example}")
        return EXAMPLES[self.example - 1]

    @property
    def name(self) -> str:
        """Unique, and fit for a file's name."""
        extras: list[str] = [self.reading, self.variant]
        extras += ["example2states"] if self.states != "printed" else []
        extras += ["printedsign"] if self.derivative_sign == "printed" else []
        extras += [self.arrival_rule] if self.arrival_rule != "last_entry_first_joint" else []
        return "_".join([f"example{self.example}", self.arm, self.kind, f"{1000 * self.payload:g}g", *extras])

    @property
    def q_start(self) -> tuple[float, ...]:
        """Joint positions at the start [rad]."""
        return self._posed.q_start

    @property
    def q_goal(self) -> tuple[float, ...]:
        """Joint positions at the end [rad]."""
        return self._posed.q_goal

    @property
    def _posed(self) -> Example:
        return example(self.arm, "minimum_time") if self.states == "example 2" else self.paper_example

    def robot(self) -> Robot:
        """The arm with its payload."""
        spec = ArmSpec.paper(self.arm)
        if not self.payload:
            return Robot.from_spec(spec)
        at_tip = self.reading == "tip"
        load = Payload(mass=self.payload) if at_tip else Payload.at_last_com(spec, self.payload)
        return Robot.from_spec(spec, load)

    def equations(self) -> EquationsOfMotion | None:
        """The printed ones; None: the robot's own."""
        return PrintedArm.from_spec(ArmSpec.paper(self.arm), self.payload) if self.variant == "printed" else None

    def problem(self) -> MinimumTimeProblem:
        """Of an open-loop case: torques within ±3 N m for minimum time, unbounded for time-energy (w = 1).

        Raises:
            ProblemError: the case is a PID loop.
        """
        if self.kind == "pid":
            raise ProblemError(f"{self.name} is a PID loop, not an optimal-control problem")
        unbounded = self.kind == "time_energy"
        return MinimumTimeProblem(
            self.robot(),
            q_start=self.q_start,
            q_goal=self.q_goal,
            effort_limit=UNBOUNDED_EFFORT if unbounded else None,
            effort_weight=1.0 if unbounded else 0.0,
        )


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of a case.

    Attributes:
        case: what was asked.
        time: t_f, or the time of arrival [s]; None if there is none.
        trajectory: the motion; None if there is none.
        success: certified or landed (open loop), arrived (closed loop).
        status: one word.
        message: the same for people.
        facts: numbers beside: see `run_case`.
        summary: as `show.report` tells it.
    """

    case: Case
    time: float | None
    trajectory: Trajectory | None
    success: bool
    status: str
    message: str
    facts: dict[str, Fact] = field(default_factory=dict)
    summary: dict[str, object] = field(default_factory=dict)


def run_case(case: Case, progress: Callable[[str], None] | None = None, workers: int | None = None) -> Outcome:
    """Solve or simulate a case.

    Args:
        case: what.
        progress: told in words what is being tried.
        workers: processes of the search for minimum time; None: one per core.

    Returns:
        An outcome. Its facts are, for every open-loop case, `certified`, `goal_error` [rad], `objective` J,
        `solve_time` [s]; for minimum time also `switch_times_jN` [s] of joint N, `local_optima` [s],
        `hamiltonian_spread`, `switching_violation`, `limit_violation`, `why_not_certified`; with the indirect
        method beside, for R and RR, `indirect_time_s`, None if it failed, `indirect_hamiltonian_spread`,
        `indirect_message`, and `indirect_X_difference` for the X of `optimal.Comparison`; for a PID loop
        `settled`, `max_real_eigenvalue` [1/s], `overshoot` [rad], `arrival_rule`, `goal_error` at the end
        [rad].
    """
    if case.kind == "pid":
        return _closed_loop(case)
    problem = case.problem()
    options = MinimumTimeOptions(time_limit=SOLVE_LIMIT, workers=workers)
    return _open_loop(case, solve_minimum_time(problem, options, progress))


def _open_loop(case: Case, solution: Solution) -> Outcome:
    certificate, motion = solution.certificate, replace(solution.trajectory, name=case.kind.replace("_", " "))
    facts: dict[str, Fact] = {
        "certified": certificate.ok,
        "why_not_certified": "; ".join(certificate.reasons),
        "goal_error": _finite(certificate.goal_error),
        "goal_velocity_error": _finite(certificate.goal_velocity_error),
        "limit_violation": _finite(certificate.limit_violation),
        "hamiltonian_spread": _finite(certificate.hamiltonian_spread),
        "switching_violation": _finite(certificate.switching_violation),
        "objective": trajectory_cost(motion, solution.problem.effort_weight),
        "local_optima": list(solution.local_optima),
        "solve_time": solution.solve_time,
    }
    if solution.success and case.arm != "rrr":  # position limits, which RRR touches, are not the method's
        facts |= _indirect(case, solution)
    if case.kind == "minimum_time":
        facts |= {f"switch_times_j{i + 1}": list(times) for i, times in enumerate(motion.switch_times)}
    return Outcome(
        case=case,
        time=solution.duration if solution.success else None,
        trajectory=motion,
        success=solution.success,
        status=str(solution.status),
        message=solution.message,
        facts=facts,
        summary=minimum_time_summary(solution),
    )


def _indirect(case: Case, solution: Solution) -> dict[str, Fact]:
    """The same optimum by the paper's second approach, put right: Pontryagin's conditions as equations."""
    options = IndirectOptions(bounded=case.kind == "minimum_time", time_limit=INDIRECT_LIMIT)
    found = solve_indirect(solution.problem, solution, options)
    facts: dict[str, Fact] = {
        "indirect_time_s": found.duration if found.success else None,
        "indirect_hamiltonian_spread": _finite(found.hamiltonian_spread),
        "indirect_message": found.message,
    }
    if found.success and solution.phases is not None:
        differences = asdict(compare_with_direct(found, solution.phases))
        facts |= {f"indirect_{name}_difference": value for name, value in differences.items()}
    return facts


def _closed_loop(case: Case) -> Outcome:
    run: PidRun = simulate_pid(
        case.robot(),
        q_start=case.q_start,
        q_goal=case.q_goal,
        duration=PID_DURATION,
        derivative_sign=case.derivative_sign,
        arrival_rule=case.arrival_rule,
        dynamics=case.equations(),
    )
    return Outcome(
        case=case,
        time=run.arrival_time,
        trajectory=run.trajectory,
        success=run.arrival_time is not None,
        status=run.status,
        message=run.message,
        facts={
            "settled": run.settled,
            "max_real_eigenvalue": run.max_real_eigenvalue,
            "overshoot": [float(x) for x in run.overshoot],
            "arrival_rule": run.arrival_rule,
            "goal_error": float(np.max(np.abs(run.trajectory.q[-1] - np.array(case.q_goal)))),
        },
        summary=pid_summary(run),
    )


def _finite(number: float) -> float | None:
    return number if np.isfinite(number) else None
