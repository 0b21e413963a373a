"""Commands about the paper's arms: reproduce, urdf."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armdyn.arguments import one_of
from armdyn.cli.console import INTERRUPTED, NOT_USABLE, answering, console, escape, progress_bar
from armdyn.cli.options.results import Json
from armdyn.control.tracking.arrival import ARRIVAL_RULES
from armdyn.files import probe_folder, write_whole
from armdyn.parsing.numbers import numbers

if TYPE_CHECKING:
    from armdyn.paper.outcomes.outcome import Outcome
    from armdyn.paper.plan import Plan
    from armdyn.paper.reproduce import Reproduced


ArrivalRuleName = Annotated[
    str | None,
    typer.Option(
        metavar="RULE",
        help="When a PID loop has arrived: " + ", ".join(ARRIVAL_RULES) + ".",
        show_default="last_entry_first_joint, the paper's",
    ),
]


def reproduce(
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PART", help="table3 to table7, figure2 to figure7, example1 to example6; several: comma or again."
        ),
    ] = None,
    payload: Annotated[
        list[str] | None,
        typer.Option(metavar="KG", help="Payload \\[kg]; several: comma or again. By default the paper's ten."),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results.")] = Path("results/paper"),
    fresh: Annotated[bool, typer.Option("--fresh", help="Solve again the cases that DIR has already.")] = False,
    arrival_rule: ArrivalRuleName = None,
    json: Json = False,
) -> None:
    """The whole paper: every example, table and figure, the published numbers beside ours.

    Open DIR/index.html in a browser: it is there as soon as the examples with 100.6 g are, which come first.
    DIR/tables has Tables 3 to 7 as CSV, Markdown and LaTeX, DIR/figures Figures 2 to 7, DIR/cases every single
    result; the six examples with 100.6 g have a folder each.
    After Ctrl-C the same command goes on: solved cases stay in DIR.
    A PID loop that does not settle is a finding, not a failure: the paper's loop is unstable for RRR. Exit code 3:
    some minimum-time motion is not usable.

    [dim]armdyn reproduce --payload 0.1006
    armdyn reproduce --only table4,figure2[/]
    """
    with answering(json) as answer:
        from armdyn.paper.reproduce import reproduce as carry_out

        plan, count = _plan(only or (), payload or (), arrival_rule, fresh), 0
        try:
            with progress_bar("reproduce", len(plan.cases())) as bar:

                def done(outcome: "Outcome", number: int, of: int) -> None:
                    nonlocal count
                    count = number
                    bar.update(number, outcome.case.name, of)

                def shown(outcomes: "Sequence[Outcome]") -> None:
                    with bar.aside():
                        _print_examples(outcomes, plan, out)

                result = carry_out(out, plan, done, None if json else shown)
        except KeyboardInterrupt:
            message = f"interrupted; {count} of {len(plan.cases())} results are in {out}: run the same command to go on"
            answer.facts |= {"success": False, "status": "interrupted", "message": message, "out": str(out)}
            answer.code = INTERRUPTED
        else:
            answer.facts |= _facts(result)
            answer.code = 0 if answer.facts["success"] else NOT_USABLE
            _print(result, out)


def _plan(only: Sequence[str], payloads: Sequence[str], rule: str | None, fresh: bool) -> "Plan":
    """The plan of the options."""
    from armdyn.paper.plan import Plan
    from armdyn.paper.printed.loop import PAPER_RULE

    rule = rule or PAPER_RULE
    one_of(rule, ARRIVAL_RULES, "--arrival-rule")
    return Plan(
        only=tuple(part.strip().lower() for text in only for part in text.split(",")),
        payloads=tuple(mass for text in payloads for mass in numbers(text, "--payload")),
        arrival_rule=rule,  # type: ignore[arg-type]  # checked above
        fresh=fresh,
    )


def _facts(result: "Reproduced") -> dict[str, object]:
    """For the JSON object."""
    # A time-energy optimum without torque limit that resists is a finding of its own, and the tables say so.
    failed = [o.case.name for o in result.outcomes if o.case.kind == "minimum_time" and not o.success]
    verdicts = [row.verdict for row in result.rows]
    return {
        "success": not failed,
        "status": "done" if not failed else "not_converged",
        "failed": failed,
        "cases": {o.case.name: {"time": o.time, "status": o.status, "message": o.message} for o in result.outcomes},
        "verdicts": {verdict: verdicts.count(verdict) for verdict in ("reproduced", "close", "not reproduced")},
        "files": [str(file) for file in result.files],
    }


def _print_examples(outcomes: "Sequence[Outcome]", plan: "Plan", out: Path) -> None:
    """For people: the examples with the figures' payload, and where they are shown."""
    from rich.table import Table

    from armdyn.paper.printed.published import printed_time
    from armdyn.paper.tables.rows import setup

    grams = f"{1000 * plan.shown_payload:g} g"
    table = Table(title=f"The paper's examples with {grams} at the tip", title_justify="left")
    for column in ("#", "arm", "problem", "paper", "ours", "result"):
        table.add_column(column, justify="right" if column in ("#", "paper", "ours") else "left")
    for outcome in sorted(outcomes, key=lambda o: (o.case.example, o.case.kind)):
        case = outcome.case
        paper = printed_time(case.example, case.payload)
        if case.reading != "tip" or setup(case):
            continue
        table.add_row(
            str(case.example),
            case.arm.upper(),
            {"minimum_time": "minimum time", "time_energy": "time–energy", "pid": "PID"}[case.kind],
            "-" if paper is None else f"{paper.value:.3f} s",
            "-" if outcome.time is None else f"{outcome.time:.4f} s",
            escape(_happened(outcome)),
        )
    console.print(table)
    console.print(f"figures and replays: open {escape(str(out / 'index.html'))} in a browser")


def _print(result: "Reproduced", out: Path) -> None:
    """For people: how the paper's numbers fare, and where the rest is."""
    from collections import Counter

    from armdyn.paper.tables.standing import VERDICTS, standings

    stand = standings(result.rows)
    again, close, missing = (Counter(stand.values())[verdict] for verdict in VERDICTS)
    console.print(
        f"of {len(stand)} numbers in the paper's tables {again} come out again, {close} come near, and {missing} come "
        f"out of no reading of the paper's own data ({len(result.rows)} comparisons)"
    )
    console.print(f"all of them are in {escape(str(out / 'index.html'))}; tables in {escape(str(out / 'tables'))}")


def _happened(outcome: "Outcome") -> str:
    facts = outcome.facts
    if outcome.case.kind == "pid":
        return f"{outcome.status.replace('_', ' ')}, max Re λ = {facts['max_real_eigenvalue']:+.3f} 1/s"
    if not outcome.success:
        return outcome.message
    landed = "certified" if facts["certified"] else f"replay ends {facts['goal_error']:.0e} rad from the goal"
    indirect = facts.get("indirect_time_s")
    if not isinstance(indirect, float) or outcome.time is None:
        return landed
    apart = abs(indirect - outcome.time)
    return f"{landed}; indirect method {f'differs by {apart:.0e} s' if apart > 1e-12 else 'agrees to rounding'}"


def urdf(
    arm: Annotated[str, typer.Argument(metavar="ARM", help="r, rr or rrr.")],
    payload: Annotated[float, typer.Option(metavar="KG", help="Point mass at the tip \\[kg].")] = 0.0,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write a file there instead of printing.", show_default=False)
    ] = None,
    json: Json = False,
) -> None:
    """The URDF of one of the paper's arms, with its payload as a link at the tip.

    [dim]armdyn urdf rr --payload 0.1006 > rr.urdf[/]
    """
    with answering(json) as answer:
        from armdyn.models import ArmSpec, Payload
        from armdyn.models.values.urdf import urdf_file_name, urdf_from_spec

        spec = ArmSpec.paper(arm)  # type: ignore[arg-type]  # paper refuses what it does not know
        load = Payload(mass=payload)
        text = urdf_from_spec(spec, load)
        answer.done("written", {})
        if out is not None:
            probe_folder(out, urdf_file_name(spec, load)).mkdir(parents=True, exist_ok=True)
            path = write_whole(out / urdf_file_name(spec, load), text.encode())
            answer.facts["files"] = [str(path)]
            console.print(escape(str(path)))
        elif json:
            answer.facts["urdf"] = text
        else:
            sys.stdout.write(text)
