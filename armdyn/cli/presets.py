"""The command `armdyn presets`: lists controller presets, or shows one."""

from __future__ import annotations

import armdyn as ad
from armdyn.cli.console import Answer, Shown, done, facts_table, table
from armdyn.cli.options.groups import argument
from armdyn.cli.options.path_constraints import known_presets, preset_named
from armdyn.files import as_json


def presets(
    name: str | None = argument(
        "NAME|FILE.toml",
        "Show its limits, sources, and unpublished conditions; none: all presets.",
        default=None,
        autocompletion=known_presets,
    ),
) -> Answer:
    """Conditions that robots' controllers put on motions, as far as documents make them public.

    A motion that violates a necessary condition is stopped; recommended ones the controller tolerates, or smooths away.
    A preset makes the limits of a problem, and checks any planner's motion.

    [dim]armdyn presets
    armdyn presets franka-fr3
    armdyn mintime panda --q-start ready --q-goal 1,0.2,0.5,-1.5,0.3,2,-0.5 --preset franka-panda
    armdyn check planned.csv --preset ur5e[/]
    """
    if name is not None:
        return _shown(preset_named(name))
    listed = [ad.ControllerPreset.named(one) for one in ad.ControllerPreset.names()]
    more = "\narmdyn presets NAME shows limits, sources, unpublished conditions. Your own: docs/presets.md."
    return done("listed", {"presets": [_facts(preset) for preset in listed]}, _list(listed), more)


def _facts(preset: ad.ControllerPreset) -> dict[str, object]:
    """A preset for JSON, which has no infinite numbers."""
    facts: dict[str, object] = as_json(preset.to_table())
    return facts | {"joints": len(preset.joints) or None, "joint_names": [name for name in preset.joints if name]}


def _list(listed: list[ad.ControllerPreset]) -> Shown:
    rows = [
        (
            preset.name,
            str(len(preset.joints) or "any"),
            f"{preset.chosen.rate:g}",
            ", ".join(one.name for one in preset.interfaces),
            _plain(preset.chosen.necessary),
            preset.date,
        )
        for preset in listed
    ]
    return table("Controller presets", ("name", ">joints", ">Hz", "interfaces", "necessary", "as of"), rows)


def _shown(preset: ad.ControllerPreset) -> Answer:
    """One preset: facts, and a table of its limits."""
    words = {"robot": preset.robot, "as of": preset.date, "sources": "\n".join(preset.sources)}
    for one in preset.interfaces:
        recommended = f"\nrecommended: {_plain(one.recommended)}" if one.recommended else ""
        words[f"{one.name}, {one.rate:g} Hz"] = f"necessary: {_plain(one.necessary) or 'nothing'}{recommended}"
    words["not public"] = "\n".join(preset.not_public) or "not said"
    return done("listed", {"presets": [_facts(preset)]}, facts_table(preset.name, words), _limits(preset))


def _plain(conditions: tuple[str, ...]) -> str:
    return ", ".join(conditions).replace("_", " ")


def _limits(preset: ad.ControllerPreset) -> Shown:
    from armdyn.models.presets.interface import LIMITS, UNITS

    columns = {name: row for name in LIMITS if (row := getattr(preset.limits, name)) is not None}
    units = [UNITS["position" if name.startswith("position") else name] for name in columns]
    heads = [">" + "\n".join([*name.split("_"), f"[{unit}]"]) for name, unit in zip(columns, units, strict=True)]
    rows = [
        (joint or str(i + 1), *(f"{row[i]:g}" for row in columns.values()))
        for i, joint in enumerate(preset.joints or ("any",))
    ]
    taper = "The velocity limits fall to zero towards the ends of the joints' ranges (docs/presets.md)."
    return table("\nLimits", ("joint", *heads), rows, caption="" if preset.limits.taper is None else taper)
