"""The whole paper: which cases, solved side by side, kept as they are done, and what is written of them."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from armdyn.control.arrival import ArrivalRule
from armdyn.errors import DiskFullError, ProblemError
from armdyn.files import probe_folder
from armdyn.models.values.spec import PAPER_PAYLOADS
from armdyn.optimal import Status
from armdyn.processes import as_they_end
from armdyn.studies.paper.outcomes.case import READINGS, Case
from armdyn.studies.paper.outcomes.outcome import Outcome
from armdyn.studies.paper.outcomes.run import run_case
from armdyn.studies.paper.outcomes.store import load_outcome, save_outcome
from armdyn.studies.paper.printed.examples import EXAMPLES, PAYLOAD
from armdyn.studies.paper.printed.loop import PAPER_RULE
from armdyn.studies.paper.tables.files import write_findings, write_methods, write_tables
from armdyn.studies.paper.tables.rows import Row, all_rows

EXAMPLES_OF_PART = {
    **{f"example{number}": (number,) for number in range(1, 7)},
    "table3": (),
    "table4": (1, 4),
    "table5": (2, 5),
    "table6": (3, 6),
    "table7": (1, 2, 3, 4, 5, 6),
    **{f"figure{one.figure}": (one.number,) for one in EXAMPLES},
}
"""What `--only` takes, and the examples that each needs."""

_ONLY_FIGURED_PAYLOAD = ("table7", *(f"figure{one.figure}" for one in EXAMPLES))
"""Parts that the paper has for 100.6 g alone."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is to be reproduced.

    Attributes:
        only: names of `EXAMPLES_OF_PART`; empty: everything.
        payloads: M [kg]; empty: those of Table 2.
        arrival_rule: of the PID loops.
        fresh: also what is on disk already.
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
        """Of figures, replays and the examples' folders [kg]: the paper's, or else the first that is asked for."""
        return PAYLOAD if not self.payloads or PAYLOAD in self.payloads else self.payloads[0]

    def wants(self, table: int) -> bool:
        """Whether a table is to be written: all, those named, or if none is named those that the examples fill."""
        named = [part for part in self.only if part.startswith("table")]
        return f"table{table}" in named if named else not self.only or table != 3

    def cases(self) -> list[Case]:
        """The cases that it takes, the slowest first."""
        wanted: dict[Case, None] = {}
        for part in self.only or EXAMPLES_OF_PART:
            payloads = self.payloads or PAPER_PAYLOADS
            if self.only and part in _ONLY_FIGURED_PAYLOAD:
                payloads = (self.shown_payload,)
            for number in EXAMPLES_OF_PART[part]:
                for payload in payloads:
                    wanted |= dict.fromkeys(cases_of(number, payload, self.arrival_rule))
        return sorted(wanted, key=lambda case: (case.kind == "pid", -len(case.arm), -case.payload))


@dataclass(frozen=True)
class Reproduced:
    """What came of a plan.

    Attributes:
        outcomes: of its cases.
        rows: of Tables 3 to 7.
        files: written.
    """

    outcomes: tuple[Outcome, ...]
    rows: tuple[Row, ...]
    files: tuple[Path, ...] = field(repr=False)


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


def reproduce(folder: Path, plan: Plan, done: Callable[[Outcome, int, int], None] | None = None) -> Reproduced:
    """Carry a plan out. What is on disk already is not solved again; what is done when Ctrl-C comes stays there.

    Writes `cases/` (every outcome), a folder for each example with the figures' payload, `tables/`,
    `figures/` and `index.html`.

    Args:
        folder: made if it is not there.
        plan: what.
        done: told each outcome as it comes, how many are there, and of how many.

    Raises:
        KeyboardInterrupt: Ctrl-C; finished cases are on disk, and what was running is not.
        FileError: the folder, or one in it, cannot be written; nothing is solved then.
        DiskFullError: there is no room for a file.
        OSError: a file cannot be written.
    """
    # Not before something is to be drawn, but once for all processes that are forked from this one.
    from armdyn.studies.paper.page.page import write_page

    cases = plan.cases()
    for name in ("cases", "tables", "figures", *{case.paper_example.folder for case in cases}):
        probe_folder(folder / name)
    probe_folder(folder, "index.html").mkdir(parents=True, exist_ok=True)
    found = _outcomes(folder, plan, cases, done)
    outcomes = tuple(found[case] for case in cases)
    rows = tuple(row for row in all_rows(outcomes, plan.payloads or PAPER_PAYLOADS) if plan.wants(row.table))
    folders = [folder / case.paper_example.folder for case in cases if _has_folder(case, plan)]
    files = [file for one in folders for file in sorted(one.iterdir())]
    files += write_tables(folder / "tables", rows)
    files += write_methods(folder / "tables", outcomes)
    if not plan.only:
        files += write_findings(folder / "tables")
    files += write_page(folder, outcomes, rows, plan.shown_payload)
    return Reproduced(outcomes, rows, tuple(files))


def _outcomes(
    folder: Path, plan: Plan, cases: Sequence[Case], done: Callable[[Outcome, int, int], None] | None
) -> dict[Case, Outcome]:
    """The cases' outcomes, solved side by side."""
    jobs = [partial(_work, folder, case, _has_folder(case, plan), plan.fresh) for case in cases]
    found: dict[Case, Outcome] = {}
    with closing(as_they_end(jobs, plan.workers)) as outcomes:
        for outcome in outcomes:
            if isinstance(outcome, DiskFullError):
                raise outcome
            if outcome.status == Status.INTERRUPTED:
                raise KeyboardInterrupt  # it reached the solve
            found[outcome.case] = outcome
            if done:
                done(outcome, len(found), len(cases))
    return found


def _work(folder: Path, case: Case, with_folder: bool, fresh: bool) -> Outcome | DiskFullError:
    """One case, from disk if it is there. A full disk is returned: a job that raises would be done again."""
    kept = None if fresh else load_outcome(folder / "cases", case)
    outcome = kept or run_case(case, workers=1)  # the other cores have cases of their own
    if outcome.status == Status.INTERRUPTED:
        return outcome
    try:
        _keep(folder, outcome, kept is not None, with_folder)
    except DiskFullError as error:
        return error
    return outcome


def _keep(folder: Path, outcome: Outcome, kept: bool, with_folder: bool) -> None:
    """Write an outcome, unless it is kept already, and its example's folder."""
    if not kept:
        save_outcome(folder / "cases", outcome)
    own = folder / outcome.case.paper_example.folder
    if with_folder and outcome.trajectory is not None and not (kept and (own / "result.json").exists()):
        from armdyn.studies.paper.page.example import write_example

        write_example(own, outcome)


def _has_folder(case: Case, plan: Plan) -> bool:
    """The six examples as the paper states them, with the figures' payload."""
    stated = Case(case.example, case.arm, case.paper_example.kind, plan.shown_payload, arrival_rule=case.arrival_rule)
    return case == stated
