"""Commands about the paper's arms: reproduce, urdf."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from armdyn.arguments import one_of
from armdyn.cli import interrupts
from armdyn.cli.console import DONE, NOT_USABLE, Answer, console, done, escape, interrupted, progress_bar, table
from armdyn.cli.invocation import option_value
from armdyn.cli.options.groups import argument, flag, option
from armdyn.cli.options.results import probed_file, probed_folder
from armdyn.control.tracking.arrival import ARRIVAL_RULES
from armdyn.files import write_whole
from armdyn.parsing.numbers import numbers

if TYPE_CHECKING:
    from armdyn.paper.outcomes.outcome import Outcome
    from armdyn.paper.plan import Plan


def reproduce(
    only: list[str] | None = option(
        "PART", "table3 to table7, figure2 to figure7, example1 to example6; several: comma or again."
    ),
    payload: list[str] | None = option("KG", "Payload \\[kg]; several: comma or again. By default the paper's ten."),
    out: Path = option("DIR", "Folder for the results.", default=Path("results/paper")),
    fresh: bool = flag("Solve again the cases that DIR has already."),
    arrival_rule: str | None = option(
        "RULE",
        "When a PID loop has arrived: " + ", ".join(ARRIVAL_RULES) + ".",
        show_default="last_entry_first_joint, the paper's",
    ),
) -> Answer:
    """The whole paper: every example, table and figure, with the published numbers next to ours.

    Open DIR/index.html in a browser: it is there as soon as the examples with 100.6 g are, which come first.
    DIR/tables has Tables 3 to 7 as CSV, Markdown and LaTeX, DIR/figures Figures 2 to 7, DIR/cases every single
    result; the six examples with 100.6 g have a folder each.
    After Ctrl-C the same command continues: solved cases stay in DIR.
    A PID loop that does not settle is a finding, not a failure: the paper's loop is unstable for RRR. Exit code 3:
    some minimum-time motion is not usable.

    [dim]armdyn reproduce --payload 0.1006
    armdyn reproduce --only table4,figure2[/]
    """
    from armdyn.paper.reproduce import reproduce as carry_out

    plan, count = _plan(only or (), payload or (), arrival_rule, fresh), 0
    probed_folder(out, out, "index.html")
    interrupts.saved(f"results that were written are in {out}: run the same command again")
    try:
        with progress_bar("reproduce", len(plan.cases())) as bar:

            def ended(outcome: "Outcome", number: int, of: int) -> None:
                nonlocal count
                count = number
                bar.update(number, outcome.case.name, of)

            def shown(outcomes: "Sequence[Outcome]") -> None:
                with bar.aside():
                    _print_examples(outcomes, plan, out)

            result = carry_out(out, plan, ended, shown)
    except KeyboardInterrupt:
        message = f"interrupted; {count} of {len(plan.cases())} results are in {out}: run the same command again"
        return interrupted(message, out=str(out))
    places = f"all of them are in {escape(str(out / 'index.html'))}; tables in {escape(str(out / 'tables'))}"
    facts = result.summary()
    return Answer(facts=facts, shown=[result.message(), places], code=DONE if facts["success"] else NOT_USABLE)


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


def _print_examples(outcomes: "Sequence[Outcome]", plan: "Plan", out: Path) -> None:
    """Print the examples with the figures' payload, and the place of their figures."""
    from armdyn.paper.tables.examples import HEADER, example_lines

    title = f"The paper's examples with {1000 * plan.shown_payload:g} g at the tip"
    heads = [f">{head}" if head in ("#", "paper", "ours") else head for head in HEADER]
    console.print(table(title, heads, example_lines(outcomes)))
    console.print(f"figures and replays: open {escape(str(out / 'index.html'))} in a browser")


def urdf(
    arm: str = argument("ARM", "r, rr or rrr."),
    payload: float = option("KG", "Point mass at the tip \\[kg].", default=0.0),
    out: Path | None = option("FILE|DIR", "Write a file instead of printing, of that name or in that folder."),
) -> Answer:
    """The URDF of one of the paper's arms, with its payload as a link at the tip.

    [dim]armdyn urdf rr --payload 0.1006 > rr.urdf[/]
    """
    from armdyn.models import ArmSpec, Payload
    from armdyn.models.values.urdf import urdf_file_name, urdf_from_spec

    spec = ArmSpec.paper(arm)  # type: ignore[arg-type]  # paper refuses unknown arms
    load = Payload(mass=payload)
    text = urdf_from_spec(spec, load)
    if out is not None:
        target = probed_file(out, Path(), urdf_file_name(spec, load))
        target.parent.mkdir(parents=True, exist_ok=True)
        path = write_whole(target, text.encode())
        return done("written", {}, escape(str(path)), files=[path])
    if not option_value("json"):
        sys.stdout.write(text)
    return done("written", {"urdf": text})
