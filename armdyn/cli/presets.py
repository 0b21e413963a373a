"""The command `armdyn presets`: lists controller presets, or shows one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

import armdyn as ad
from armdyn.cli.console import Answer, answering, console, escape, facts_table
from armdyn.cli.options.preset import known_presets, preset_named
from armdyn.cli.options.results import Json

if TYPE_CHECKING:
    from rich.table import Table


def presets(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[NAME|FILE.toml]",
            help="Show its limits, sources, and what is not public; none: all presets.",
            autocompletion=known_presets,
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Conditions that robots' controllers put on motions, as far as documents make them public.

    A motion that violates a necessary condition is stopped; recommended ones the controller tolerates, or smooths away.
    A preset makes the limits of a problem, and checks any planner's motion.

    [dim]armdyn presets
    armdyn presets franka-fr3
    armdyn mintime panda --q-start ready --q-goal 1,0.2,0.5,-1.5,0.3,2,-0.5 --preset franka-panda
    armdyn check planned.csv --preset ur5e[/]
    """
    with answering(json) as answer:
        if name is not None:
            _show(preset_named(name), answer)
            return
        listed = [ad.ControllerPreset.named(one) for one in ad.ControllerPreset.names()]
        answer.done("listed", {"presets": [_facts(preset) for preset in listed]})
        console.print(_list(listed))
        console.print("\narmdyn presets NAME shows limits, sources, and what is not public. Your own: docs/presets.md.")


def _facts(preset: ad.ControllerPreset) -> dict[str, object]:
    """A preset for JSON, which has no infinite numbers."""
    facts = preset.to_table()
    facts["limits"] = {
        name: [x if abs(x) < float("inf") else None for x in row] for name, row in facts["limits"].items()
    }
    return facts | {"joints": len(preset.joints), "joint_names": [name for name in preset.joints if name]}


def _list(listed: list[ad.ControllerPreset]) -> Table:
    from rich.table import Table

    table = Table(title="Controller presets", title_justify="left", title_style="bold", box=None)
    for head in ("name", "joints", "Hz", "interfaces", "necessary", "as of"):
        table.add_column(
            head, justify="right" if head in ("joints", "Hz") else "left", style="" if head == "name" else "dim"
        )
    for preset in listed:
        ways = ", ".join(one.name for one in preset.interfaces)
        cells = (
            preset.name,
            str(len(preset.joints)),
            f"{preset.chosen.rate:g}",
            ways,
            _plain(preset.chosen.necessary),
            preset.date,
        )
        table.add_row(*map(escape, cells))
    return table


def _show(preset: ad.ControllerPreset, answer: Answer) -> None:
    """One preset: facts, and a table of its limits."""
    answer.done("listed", {"presets": [_facts(preset)]})
    words = {"robot": preset.robot, "as of": preset.date, "sources": "\n".join(preset.sources)}
    for one in preset.interfaces:
        recommended = f"\nrecommended: {_plain(one.recommended)}" if one.recommended else ""
        words[f"{one.name}, {one.rate:g} Hz"] = f"necessary: {_plain(one.necessary) or 'nothing'}{recommended}"
    words["not public"] = "\n".join(preset.not_public) or "not said"
    console.print(facts_table(preset.name, words))
    console.print(_limits(preset))


def _plain(conditions: tuple[str, ...]) -> str:
    return ", ".join(conditions).replace("_", " ")


def _limits(preset: ad.ControllerPreset) -> Table:
    from rich.table import Table

    from armdyn.models.presets.interface import LIMITS, UNITS

    rows = {name: row for name in LIMITS if (row := getattr(preset.limits, name)) is not None}
    table = Table(title="\nLimits", title_justify="left", title_style="bold", box=None)
    table.add_column("joint")
    for name in rows:
        unit = UNITS["position" if name.startswith("position") else name]
        table.add_column(f"{name.replace('_', ' ')}\n{escape(f'[{unit}]')}", justify="right")
    for i, joint in enumerate(preset.joints):
        table.add_row(escape(joint or str(i + 1)), *(f"{row[i]:g}" for row in rows.values()))
    if preset.limits.taper is not None:
        table.caption = "The velocity limits fall to zero towards the ends of the joints' ranges (docs/presets.md)."
        table.caption_justify = "left"
    return table
