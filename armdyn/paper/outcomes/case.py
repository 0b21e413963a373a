"""A case of the paper: one problem to solve or one loop to simulate."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from armdyn.arguments import one_of
from armdyn.control.tracking.arrival import ArrivalRule
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot
from armdyn.models.values.spec import ArmSpec, Payload, PlanarArmName
from armdyn.optimal import MinimumTimeProblem
from armdyn.paper.continuous_pid import ContinuousLoop
from armdyn.paper.printed.equations import PrintedArm
from armdyn.paper.printed.examples import EXAMPLES, Example, Kind, example
from armdyn.paper.printed.loop import ERROR_RATES, GAINS, PAPER_RULE, DerivativeSign

Reading = Literal["tip", "mM"]
"""Where the payload M is: "tip", a point mass at the tip, which is the physics; "mM", the last link's m becomes
m + M while l_c and I stay, as the paper's PID times say."""

Variant = Literal["lagrangian", "printed"]
"""Equations of motion: "lagrangian", the arm's; "printed", equation (7) as printed, RRR only."""

States = Literal["printed", "example 2"]
"""Of Example 5: as printed there, or Example 2's, which the text lets one expect."""

READINGS: tuple[Reading, ...] = ("tip", "mM")
UNBOUNDED_EFFORT = 30.0
"""The torque limit of a problem that has none [N m]: it scales the unknowns. No optimum here passes a fifth of it."""


@lru_cache(maxsize=64)
def _robot(spec: ArmSpec, payload: float, reading: Reading) -> Robot:
    if not payload:
        return Robot.from_spec(spec)
    return Robot.from_spec(spec, Payload(mass=payload) if reading == "tip" else Payload.at_last_com(spec, payload))


@dataclass(frozen=True)
class Case:
    """One problem to solve or one loop to simulate.

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
    arm: PlanarArmName
    kind: Kind
    payload: float
    reading: Reading = "tip"
    variant: Variant = "lagrangian"
    states: States = "printed"
    derivative_sign: DerivativeSign = "corrected"
    arrival_rule: ArrivalRule = PAPER_RULE

    def __post_init__(self) -> None:
        of_paper = self.paper_example
        closed_loop = self.kind == "pid"
        one_of(self.derivative_sign, tuple(ERROR_RATES), "derivative_sign")
        if (of_paper.arm, of_paper.kind == "pid") != (self.arm, closed_loop):
            raise ProblemError(f"Example {self.example} is {of_paper.arm} {of_paper.kind}, not {self.arm} {self.kind}")
        if self.variant == "printed" and (not closed_loop or self.arm != "rrr" or self.reading != "mM"):
            raise ProblemError(f"{self.name}: equation (7) as printed is there for RRR's PID loop with m + M only")
        if self.states != "printed" and self.example != 5:
            raise ProblemError(f"{self.name}: only Example 5 is printed with other states than its arm's first example")
        if not closed_loop and (self.derivative_sign, self.arrival_rule) != ("corrected", PAPER_RULE):
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
        extras += [self.arrival_rule] if self.arrival_rule != PAPER_RULE else []
        return "_".join([f"example{self.example}", self.arm, self.kind, f"{1000 * self.payload:g}g", *extras])

    @property
    def q_start(self) -> tuple[float, ...]:
        """Joint positions at the start [rad]."""
        return self._example_of_states.q_start

    @property
    def q_goal(self) -> tuple[float, ...]:
        """Joint positions at the end [rad]."""
        return self._example_of_states.q_goal

    @property
    def _example_of_states(self) -> Example:
        return example(self.arm, "minimum_time") if self.states == "example 2" else self.paper_example

    def robot(self) -> Robot:
        """The arm with its payload; the same for equal ones."""
        return _robot(ArmSpec.paper(self.arm), self.payload, self.reading)

    def loop(self) -> ContinuousLoop:
        """The paper's PID loop, with the case's sign of k_D and equations of motion."""
        printed = PrintedArm.from_spec(ArmSpec.paper(self.arm), self.payload) if self.variant == "printed" else None
        return ContinuousLoop(self.robot(), self.q_goal, GAINS, ERROR_RATES[self.derivative_sign], printed)

    def problem(self) -> MinimumTimeProblem:
        """Problem of an open-loop case: torques within ±3 N m for minimum time, unbounded for time-energy (w = 1).

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
