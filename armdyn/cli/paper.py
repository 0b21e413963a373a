"""Commands about the paper's arms: reproduce, urdf."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from armdyn.cli.arguments import Json
from armdyn.cli.console import NOT_CERTIFIED, answering, console, working
from armdyn.models import ArmSpec, Payload
from armdyn.models.urdf import urdf_file_name, urdf_from_spec
from armdyn.show.files import write_whole
from armdyn.studies.paper import PAYLOAD


def reproduce(
    payload: Annotated[float, typer.Option(metavar="KG", help="Point mass at the tip \\[kg].")] = PAYLOAD,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the results.")] = Path("results/paper"),
    json: Json = False,
) -> None:
    """The paper's six examples: minimum time and PID for the R, RR and RRR arms.

    Every example gets a folder with its figure, its replay page, its trajectory and a summary.
    A PID loop that does not settle is a finding, not a failure: the paper's loop is unstable for RRR.
    """
    with answering(json) as answer:
        from armdyn.studies.paper import reproduce as run_examples

        table = Table(title=f"The paper's examples with {1000 * payload:g} g", title_justify="left")
        for column, justify in (("#", "right"), ("arm", "left"), ("problem", "left"), ("time", "right"),
                                ("replay error", "right"), ("what happened", "left")):  # fmt: skip
            table.add_column(column, justify=justify)  # type: ignore[arg-type]
        results: dict[str, object] = {}
        with working("reproduce", json) as progress:
            for one, summary in run_examples(out, payload, progress=progress):
                results[one.name] = summary
                key = "duration" if one.kind == "mintime" else "arrival_time"
                time, error = summary[key], summary.get("replay_error")
                table.add_row(
                    str(one.number),
                    one.arm.upper(),
                    "minimum time" if one.kind == "mintime" else "PID",
                    "-" if time is None else f"{time:.4f} s",
                    "" if error is None else f"{error:.0e} rad",
                    escape(str(summary["message" if one.kind == "pid" else "status"])),
                )
                if one.kind == "mintime" and not summary["success"]:
                    answer.code = NOT_CERTIFIED
        solved = answer.code == 0
        answer.facts |= {
            "success": solved,
            "status": "done" if solved else "not_converged",
            "examples": results,
            "files": [file for summary in results.values() for file in summary["files"]],  # type: ignore[index]
        }
        if not json:
            console.print(table)
            console.print(f"results in {escape(str(out))}: open {escape(str(out))}/*/replay.html in a browser")


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
        spec = ArmSpec.paper(arm)  # type: ignore[arg-type]  # paper refuses what it does not know
        load = Payload(mass=payload)
        text = urdf_from_spec(spec, load)
        answer.facts |= {"success": True, "status": "written", "files": []}
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            path = write_whole(out / urdf_file_name(spec, load), text.encode())
            answer.facts["files"] = [str(path)]
            if not json:
                console.print(escape(str(path)))
        elif json:
            answer.facts["urdf"] = text
        else:
            sys.stdout.write(text)
