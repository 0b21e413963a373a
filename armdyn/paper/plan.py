"""Plan of a reproduction: cases, their order, and warm starts between them."""

from collections.abc import Collection
from dataclasses import dataclass, replace

from armdyn.control.tracking.arrival import ArrivalRule
from armdyn.errors import ProblemError
from armdyn.paper.outcomes.case import READINGS, Case
from armdyn.paper.printed.examples import EXAMPLES, PAYLOAD, PAYLOADS, Kind
from armdyn.paper.printed.loop import PAPER_RULE

_KINDS: tuple[Kind, ...] = ("minimum_time", "time_energy", "pid")
FAR: dict[Kind, float] = {"minimum_time": 2.0, "time_energy": 2.5}
"""Ratio of payloads from which they are no neighbours: 500 g and 1 kg have other optima than lighter payloads. Of
time and energy the optimum of 500 g leads to one of 1 kg, where coarse meshes show nothing but artefacts."""

EXAMPLES_OF_PART = {
    **{f"example{number}": (number,) for number in range(1, 7)},
    "table3": (),
    "table4": (1, 4),
    "table5": (2, 5),
    "table6": (3, 6),
    "table7": (1, 2, 3, 4, 5, 6),
    **{f"figure{one.figure}": (one.number,) for one in EXAMPLES},
}
"""Values of `--only`, and the examples that each needs."""

_ONLY_FIGURED_PAYLOAD = ("table7", *(f"figure{one.figure}" for one in EXAMPLES))
"""Parts of the paper for 100.6 g alone."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Plan of a reproduction.

    Attributes:
        only: names of `EXAMPLES_OF_PART`; empty: everything.
        payloads: M [kg]; empty: those of Table 2.
        arrival_rule: of the PID loops.
        fresh: also the cases on disk.
        workers: processes; None: one per core.

    Raises:
        ProblemError: an unknown name, or a payload that is not positive.
    """

    only: tuple[str, ...] = ()
    payloads: tuple[float, ...] = ()
    arrival_rule: ArrivalRule = PAPER_RULE
    fresh: bool = False
    workers: int | None = None

    def __post_init__(self) -> None:
        for name in self.only:
            if name not in EXAMPLES_OF_PART:
                raise ProblemError(f"there is no {name!r} to reproduce; there are {', '.join(EXAMPLES_OF_PART)}")
        for payload in self.payloads:
            if not 0 < payload < float("inf"):
                raise ProblemError(f"a payload is {payload} kg; it must be positive and finite")

    @property
    def shown_payload(self) -> float:
        """Payload of figures, replays and the examples' folders [kg]: the paper's, else the first requested."""
        return PAYLOAD if not self.payloads or PAYLOAD in self.payloads else self.payloads[0]

    def includes(self, table: int) -> bool:
        """Whether a table is to be written: all, those named, or if none is named those that the examples fill."""
        named = [part for part in self.only if part.startswith("table")]
        return f"table{table}" in named if named else not self.only or table != 3

    def cases(self) -> list[Case]:
        """The cases that it takes: those that are shown, the quickest first; then the others, the slowest first."""
        wanted: dict[Case, None] = {}
        for part in self.only or EXAMPLES_OF_PART:
            payloads = self.payloads or PAYLOADS
            if self.only and part in _ONLY_FIGURED_PAYLOAD:
                payloads = (self.shown_payload,)
            for number in EXAMPLES_OF_PART[part]:
                for payload in payloads:
                    wanted |= dict.fromkeys(cases_of(number, payload, self.arrival_rule))
        shown = [case for case in wanted if case.payload == self.shown_payload]
        others = [case for case in wanted if case.payload != self.shown_payload]
        return [
            # One reading after the other: no two workers need the same machine code at the same time.
            *sorted(shown, key=lambda case: (_KINDS.index(case.kind), READINGS.index(case.reading), len(case.arm))),
            *sorted(others, key=lambda case: (case.kind == "pid", -len(case.arm), -case.payload)),
        ]


def cases_of(number: int, payload: float, rule: ArrivalRule = PAPER_RULE) -> list[Case]:
    """An example with a payload [kg] in all the ways that the tables compare.

    Open loop: minimum time and time-energy in both readings, of RRR, which takes longest, with the payload
    at the tip. PID: both readings; of RR also from Example 2's states; of RRR also (7) as printed; with
    the figures' payload also the printed sign of k_D.

    Args:
        number: 1 to 6.
        payload: M [kg].
        rule: of the PID loops.
    """
    arm = EXAMPLES[number - 1].arm
    if EXAMPLES[number - 1].kind != "pid":
        readings = READINGS if arm != "rrr" else READINGS[:1]
        return [
            Case(number, arm, kind, payload, reading)
            for kind in ("minimum_time", "time_energy")
            for reading in readings
        ]
    cases = [Case(number, arm, "pid", payload, reading, arrival_rule=rule) for reading in READINGS]
    if arm == "rr":
        cases += [Case(number, arm, "pid", payload, r, states="example 2", arrival_rule=rule) for r in READINGS]
    if arm == "rrr":
        cases.append(Case(number, arm, "pid", payload, "mM", "printed", arrival_rule=rule))
    if payload == PAYLOAD:
        cases.append(Case(number, arm, "pid", payload, "mM", derivative_sign="printed", arrival_rule=rule))
    return cases


def neighbour(case: Case, cases: Collection[Case], root: float) -> Case | None:
    """Case whose optimum is the initial guess of another: the same one with the next payload towards the root's.

    Args:
        case: to be solved.
        cases: that are solved, too.
        root: payload that the search begins with [kg]; its case has no neighbour.

    Returns:
        None: there is none, or it is `FAR`, or it takes no search: a PID loop, an arm of one joint.
    """
    if case.kind == "pid" or case.arm == "r":
        return None
    alike = [other for other in cases if replace(other, payload=case.payload) == case]
    low, high = sorted((case.payload, root))
    between = [other for other in alike if low <= other.payload <= high and other != case]
    nearest = min(between, key=lambda other: abs(other.payload - case.payload), default=None)
    if nearest is None or not 1 / FAR[case.kind] < nearest.payload / case.payload < FAR[case.kind]:
        return None
    return nearest
