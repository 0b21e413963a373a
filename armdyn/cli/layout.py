"""Layout of the help: a panel for each kind of option, wide descriptions."""

from __future__ import annotations

import shlex
from collections import defaultdict
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from typer import Exit
from typer.core import TyperCommand, TyperGroup

from armdyn.cli.options.groups import LIMITS, OUTPUT, ROBOT, SCENE, SOLVER, TASK

if TYPE_CHECKING:
    from rich.console import RenderableType

_NAMES = 26
"""Letters that an option's name and its value's may take for the description to begin on their line."""

_NARROW = 52
"""Columns of a terminal below which all descriptions are below the options' names: on their line words are cut."""

_COMMANDS = 11
"""Letters that commands have."""

THEN = "--then"
"""Option whose value is the rest of the line: another command, see `identify`."""

_BARE = str.maketrans("", "", "{}")
"""Typer writes {ROBOT} of an argument."""

_FIRST, _LAST = (TASK, ROBOT, LIMITS, SCENE), (SOLVER, OUTPUT)
"""Panels before those of a single command, and after them."""

_IN_OUTPUT = {"out", "json", "quiet", "no_figure", "no_report", "help"}


class Followed(Exit):
    """End of a command that is followed by another one, of these words."""

    def __init__(self, words: list[str]):
        super().__init__(0)
        self.words = words


class Command(TyperCommand):
    """A command whose help has no narrow columns: the description of an option with a long name is below the name."""

    def format_help(self, ctx: Any, formatter: Any) -> None:  # click's
        """Print help."""
        from armdyn.cli.console import console

        console.rich.print(*_page(self, ctx), sep="\n")

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Words of the usage line, which help and errors begin with."""
        return [piece.translate(_BARE) for piece in super().collect_usage_pieces(ctx)]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command's own words: all that follows --then is another command's, one value."""
        at = args.index(THEN) + 1 if THEN in args else len(args)
        own = [*args[:at], shlex.join(args[at:])] if at + 1 < len(args) else args
        left = super().parse_args(ctx, own)
        if ctx.params.get("then") is not None:
            _parse_then(ctx)
        return left

    def invoke(self, ctx: Any) -> Any:
        """Run the command, and the one that it is to be followed by."""
        try:
            return super().invoke(ctx)
        except Followed as end:
            ctx.find_root().command.main(end.words, prog_name="armdyn")


def _parse_then(ctx: Any) -> None:
    """Parse the command after --then now, not when the first one is done, with a word for the arm that is to come."""
    try:
        words = shlex.split(ctx.params["then"])
    except ValueError as error:
        ctx.fail(f"{THEN}: {error}")
    group = ctx.find_root().command
    name, command, rest = group.resolve_command(ctx, words or [""])
    command.make_context(name, ["ROBOT", *rest], parent=ctx.find_root())


class CommandGroup(TyperGroup):
    """The application, whose help has examples, options, and commands by purpose."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print help."""
        from rich.padding import Padding
        from rich.text import Text

        from armdyn.cli.console import console

        commands: defaultdict[str, list[RenderableType]] = defaultdict(list)
        for name in self.list_commands(ctx):
            command: Any = self.get_command(ctx, name)
            about = (command.help or "").partition("\n\n")[0]
            commands[command.rich_help_panel or "Commands"].append(_row(name, Text.from_markup(about), _COMMANDS))
        page = _head(self, ctx, self.help or "")
        page += [_panel(name, rows) for name, rows in commands.items()]
        page += [_panel("Options", [_option_row(param) for param in self.get_params(ctx)])]
        page += [Padding(Text.from_markup(self.epilog or ""), (1, 1))]
        console.rich.print(*page, sep="\n")


def _head(command: Any, ctx: Any, about: str) -> list[RenderableType]:
    """Usage and description of a command."""
    from rich.padding import Padding
    from rich.text import Text

    used = _escaped(command.get_usage(ctx).removeprefix("Usage: "))
    texts = (Text.from_markup(text) for text in (f"[bold]Usage:[/] {used}", about.strip()))
    return ["", *(part for text in texts for part in (Padding(text, (0, 1)), ""))]


def _page(command: Command, ctx: Any) -> list[RenderableType]:
    """The page of a command's help."""
    from rich.text import Text

    about, _, examples = (command.help or "").partition("[dim]")
    page = _head(command, ctx, about)
    if examples:
        page += [_panel("Examples", [Text.from_markup(examples.replace("[/]", "").strip())])]
    for name, params in _panels(command.get_params(ctx)):
        page.append(_panel(name, [_option_row(param) for param in params]))
    return page


def _panels(params: Iterable[Any]) -> list[tuple[str, list[Any]]]:
    """The parameters by panel: arguments, then the panels in their order, then the rest."""
    found: defaultdict[str, list[Any]] = defaultdict(list)
    for param in params:
        if getattr(param, "hidden", False):
            continue
        usual = (
            "Arguments" if param.param_type_name == "argument" else OUTPUT if param.name in _IN_OUTPUT else "Options"
        )
        found[getattr(param, "rich_help_panel", None) or usual].append(param)

    def order(name: str) -> tuple[int, int]:
        return -1 if name == "Arguments" else place(name), name == "Options"

    return [(name, found[name]) for name in sorted(found, key=order)]


def place(panel: str) -> int:
    """Sort key of a panel: the task first, the output last, the panels of a single command between."""
    if panel in _FIRST:
        return _FIRST.index(panel)
    return len(_FIRST) + 1 + _LAST.index(panel) if panel in _LAST else len(_FIRST)


def _option_row(param: Any) -> RenderableType:
    """An option's entry in the help: name, value, description."""
    from rich.console import Group as Rows
    from rich.padding import Padding
    from rich.text import Text

    from armdyn.cli.console import console

    name = Text(_called(param), style="bold cyan")
    about = Text.from_markup(f"{param.help or ''}{_usual(param)}")
    narrow = console.rich.width < _NARROW
    if narrow or name.cell_len > _NAMES:
        return Rows(name, Padding(about, (0, 0, 0, 4 if narrow else _NAMES + 2)))
    return _row(_called(param), about, _NAMES)


def _row(name: str, about: RenderableType, width: int) -> RenderableType:
    """A name and its description side by side."""
    from rich.table import Table
    from rich.text import Text

    row = Table.grid(padding=(0, 2, 0, 0))
    row.add_column(width=width, no_wrap=True)
    row.add_column()
    row.add_row(Text(name, style="bold cyan"), about)
    return row


def _called(param: Any) -> str:
    """An option's names and its value's; an argument's own."""
    if param.param_type_name == "argument":
        return str(param.metavar or param.name.upper())
    names = "/".join([*param.opts, *param.secondary_opts])
    if param.is_flag or param.name == "help":
        return names
    return f"{names} {param.metavar}" if param.metavar else names


def _usual(param: Any) -> str:
    """Default of an option, if one is to be shown."""
    shown = param.show_default if isinstance(param.show_default, str) else ""
    value = param.default
    silent = param.show_default is False or value is None or value is False or value in ((), [], "") or callable(value)
    if param.required:
        return " [dim](required)[/]"
    if shown:
        return f" [dim](default: {_escaped(shown)})[/]"
    flag = getattr(param, "is_flag", False)
    return "" if silent or flag else f" [dim](default: {_escaped(str(value))})[/]"


def _panel(name: str, rows: list[RenderableType]) -> RenderableType:
    from rich.console import Group as Rows
    from rich.panel import Panel

    return Panel(Rows(*rows), title=name, title_align="left", border_style="dim")


def _escaped(text: str) -> str:
    from rich.markup import escape

    return escape(text)
