"""How commands speak: to people on a terminal, to machines as one JSON object."""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import typer

from armdyn.cli import interrupts
from armdyn.cli.interrupts import INTERRUPTED as INTERRUPTED
from armdyn.cli.reports.invocation import is_given
from armdyn.cli.streams import BAD_INPUT as BAD_INPUT
from armdyn.cli.streams import DISK_FULL as DISK_FULL
from armdyn.errors import ArmdynError, ArmdynWarning, DiskFullError
from armdyn.files import is_full

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

DONE, INTERNAL, NOT_USABLE, NOT_AS_REQUIRED = 0, 1, 3, 4
"""Exit codes, besides BAD_INPUT, DISK_FULL and INTERRUPTED."""

EXIT_CODES = (
    "0 done, and the motion is usable: it lands and keeps its limits; 2 bad usage or input; 3 it is not usable; "
    "4 it is, but not what --require asks for; 5 disk full; 130 interrupted."
)
"""What they mean, as help and README say it."""

SCHEMA = interrupts.SCHEMA
"""Version of the JSON objects, see docs/json.md: raised when a key goes, or means something else."""


class Terminal:
    """Standard output or error, spoken to by rich; which is loaded when there is something to say."""

    def __init__(self, *, stderr: bool = False):
        self._stderr = stderr
        self.quiet = False

    @cached_property
    def rich(self) -> Console:
        """Rich's console."""
        from rich.console import Console

        return Console(stderr=self._stderr, highlight=False)

    @property
    def is_terminal(self) -> bool:
        """Someone watches."""
        return self.rich.is_terminal

    def shows(self, text: str) -> bool:
        """It has all characters of a text."""
        try:
            text.encode(self.rich.encoding)
        except (LookupError, UnicodeEncodeError):
            return False
        return True

    def print(self, what: str | Table) -> None:
        """Say something, in rich's markup; nothing where it is to be quiet."""
        if not self.quiet:
            self.rich.print(what)


console, errors = Terminal(), Terminal(stderr=True)

_COMMAND: ContextVar[str] = ContextVar("command", default="")


@contextmanager
def speaking(command: str, *, quiet: bool) -> Iterator[None]:
    """Within it a command speaks.

    Args:
        command: its name, for the JSON object.
        quiet: nothing is said on standard output, and no progress shown.
    """
    token = _COMMAND.set(command)
    console.quiet = quiet
    try:
        yield
    finally:
        _COMMAND.reset(token)
        console.quiet = False


def escape(text: str) -> str:
    """The text as it is, in rich's markup."""
    from rich.markup import escape as escaped

    return escaped(text)


@dataclass
class Answer:
    """What a command found out; filled in as it goes.

    Attributes:
        facts: for the JSON object.
        code: the exit code.
    """

    facts: dict[str, object] = field(default_factory=dict)
    code: int = DONE

    def interrupted(self) -> None:
        """It ends by Ctrl-C."""
        self.facts |= {"success": False, "status": "interrupted", "message": "interrupted"}
        self.code = INTERRUPTED

    def disk_full(self, error: DiskFullError) -> None:
        """It ends for want of room."""
        self.facts |= {"success": False, "status": "disk_full", "message": str(error)}
        self.code = DISK_FULL

    def internal(self, error: Exception) -> None:
        """It ends by what nobody has thought of."""
        hint = "this is a bug in armdyn; ARMDYN_DEBUG=1 shows where"
        message = f"internal error ({type(error).__name__}: {error}); {hint}"
        self.facts |= {"success": False, "status": "internal_error", "message": message}
        self.code = INTERNAL


@contextmanager
def answering(as_json: bool) -> Iterator[Answer]:
    """Turns what happens within into output and an exit code; no traceback leaves it.

    Raises:
        typer.Exit: always, with the code.
    """
    answer = Answer()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", ArmdynWarning)
        try:
            with interrupts.Raised():
                yield answer
        except DiskFullError as error:
            answer.disk_full(error)
        except ArmdynError as error:
            answer.facts |= {"success": False, "status": "bad_input", "message": _by_option(str(error))}
            answer.code = BAD_INPUT
        except OSError as error:
            if is_full(error):
                answer.disk_full(DiskFullError(error.filename or "standard output"))
            else:
                answer.facts |= {"success": False, "status": "bad_input", "message": _os_message(error)}
                answer.code = BAD_INPUT
        except typer.Exit:
            raise
        except Exception as error:
            if interrupts.pressed():
                answer.interrupted()
            elif os.environ.get("ARMDYN_DEBUG"):
                raise
            else:
                answer.internal(error)
        except KeyboardInterrupt:
            answer.interrupted()
    messages = list(dict.fromkeys(str(w.message) for w in caught if issubclass(w.category, ArmdynWarning)))
    for message in messages:
        errors.print(f"[yellow]warning:[/] {escape(message)}")
    if as_json:
        answer.facts["warnings"] = messages
        said = {"schema": SCHEMA, "command": _COMMAND.get(), **answer.facts}
        sys.stdout.write(json.dumps(said, allow_nan=False) + "\n")
    if answer.code in (INTERNAL, BAD_INPUT, DISK_FULL, INTERRUPTED) and "message" in answer.facts and not as_json:
        errors.print(f"[bold red]armdyn:[/] {escape(str(answer.facts['message']))}")
    raise typer.Exit(answer.code)


def _by_option(message: str) -> str:
    """A message that begins with an argument, with the option instead where that was given on the command line."""
    name, said, rest = message.partition(" is ")
    return f"--{name.replace('_', '-')}{said}{rest}" if is_given(name) else message


def _os_message(error: OSError) -> str:
    """What the operating system refuses, and of which file."""
    what = error.strerror or str(error) or type(error).__name__
    return what if error.filename is None else f"{what}: {error.filename}"


@contextmanager
def working(what: str, as_json: bool) -> Iterator[Callable[[str], None]]:
    """A spinner on standard error while something runs; the function it gives updates its words."""
    interrupts.at(what)
    if as_json or console.quiet or not errors.is_terminal:
        yield lambda text: interrupts.at(f"{what}: {text}")
        return
    with errors.rich.status(escape(what)) as status:

        def update(text: str) -> None:
            interrupts.at(f"{what}: {text}")
            status.update(escape(f"{what}: {text}"))

        yield update


def facts_table(title: str, facts: dict[str, str]) -> Table:
    """Two columns, what and how much."""
    from rich.table import Table

    table = Table(title=escape(title), title_justify="left", title_style="bold", show_header=False, box=None)
    table.add_column(style="dim")
    table.add_column()
    for key, value in facts.items():
        table.add_row(escape(key), escape(value))
    return table
