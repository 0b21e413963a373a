"""Layout of the help: a panel for each kind of option, wide descriptions."""

from collections import defaultdict
from collections.abc import Iterable
from typing import Any

from rich.console import Group as Rows
from rich.console import RenderableType
from rich.padding import Padding
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from armdyn.cli.console import console, escape
from armdyn.cli.options.groups import LIMITS, OUTPUT, ROBOT, SCENE, SOLVER, TASK

_NAMES = 26
"""Letters that an option's name and its value's may take for the description to begin on their line."""

_NARROW = 52
"""Columns of a terminal below which all descriptions are below the options' names: on their line words are cut."""

_COMMANDS = 11
"""Letters that commands have."""

_OWN = "of a single command"
_PANELS = ("Arguments", TASK, ROBOT, LIMITS, SCENE, _OWN, "Options", SOLVER, OUTPUT)
"""Panels in their order; those of a single command stand in the place of `_OWN`."""

_IN_OUTPUT = {"out", "json", "quiet", "no_figure", "no_report", "help"}


def print_command_help(command: Any, ctx: Any) -> None:
    """Print the page of a command's help: usage, examples, its parameters by panel."""
    about, _, examples = (command.help or "").partition("[dim]")
    page = _head(command, ctx, about)
    if examples:
        page.append(_panel("Examples", [Text.from_markup(examples.replace("[/]", "").strip())]))
    page += [_panel(name, list(map(_option_row, params))) for name, params in _panels(command.get_params(ctx))]
    console.rich.print(*page, sep="\n")


def print_application_help(group: Any, ctx: Any) -> None:
    """Print the page of the application's help: usage, examples, commands by purpose, options."""
    commands: defaultdict[str, list[RenderableType]] = defaultdict(list)
    for name in group.list_commands(ctx):
        command = group.get_command(ctx, name)
        about = (command.help or "").partition("\n\n")[0]
        commands[command.rich_help_panel or "Commands"].append(_row(name, Text.from_markup(about), _COMMANDS))
    page = _head(group, ctx, group.help or "")
    page += [_panel(name, rows) for name, rows in commands.items()]
    page += [_panel("Options", list(map(_option_row, group.get_params(ctx))))]
    page += [Padding(Text.from_markup(group.epilog or ""), (1, 1))]
    console.rich.print(*page, sep="\n")


def _head(command: Any, ctx: Any, about: str) -> list[RenderableType]:
    """Usage and description of a command."""
    used = escape(command.get_usage(ctx).removeprefix("Usage: "))
    texts = (Text.from_markup(text) for text in (f"[bold]Usage:[/] {used}", about.strip()))
    return ["", *(part for text in texts for part in (Padding(text, (0, 1)), ""))]


def _panels(params: Iterable[Any]) -> list[tuple[str, list[Any]]]:
    """The parameters by panel, in the panels' order."""
    found: defaultdict[str, list[Any]] = defaultdict(list)
    for param in params:
        usual = (
            "Arguments" if param.param_type_name == "argument" else OUTPUT if param.name in _IN_OUTPUT else "Options"
        )
        found[getattr(param, "rich_help_panel", None) or usual].append(param)
    return [(name, found[name]) for name in sorted(found, key=place)]


def place(panel: str) -> int:
    """Sort key of a panel: arguments and task first, the output last, the panels of a single command between."""
    return _PANELS.index(panel if panel in _PANELS else _OWN)


def _option_row(param: Any) -> RenderableType:
    """An option's entry in the help: name, value, description."""
    name = Text(_called(param), style="bold cyan")
    about = Text.from_markup(f"{param.help or ''}{_shown_default(param)}")
    narrow = console.rich.width < _NARROW
    if narrow or name.cell_len > _NAMES:
        return Rows(name, Padding(about, (0, 0, 0, 4 if narrow else _NAMES + 2)))
    return _row(_called(param), about, _NAMES)


def _row(name: str, about: RenderableType, width: int) -> RenderableType:
    """A name and its description side by side."""
    row = Table.grid(padding=(0, 2, 0, 0))
    row.add_column(width=width, no_wrap=True)
    row.add_column()
    row.add_row(Text(name, style="bold cyan"), about)
    return row


def _called(param: Any) -> str:
    """Names of an option, with the name of its value; of an argument its name."""
    if param.param_type_name == "argument":
        return str(param.metavar or param.name.upper())
    names = "/".join([*param.opts, *param.secondary_opts])
    if param.is_flag or param.name == "help":
        return names
    return f"{names} {param.metavar}" if param.metavar else names


def _shown_default(param: Any) -> str:
    """Default of an option, if one is to be shown."""
    if param.required:
        return " [dim](required)[/]"
    shown, value = param.show_default, param.default
    if not isinstance(shown, str):
        silent = shown is False or value is None or value is False or value in ((), [], "") or callable(value)
        shown = "" if silent or getattr(param, "is_flag", False) else str(value)
    return f" [dim](default: {escape(shown)})[/]" if shown else ""


def _panel(name: str, rows: list[RenderableType]) -> RenderableType:
    return Panel(Rows(*rows), title=name, title_align="left", border_style="dim")
