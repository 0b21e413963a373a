"""Output of commands: text on a terminal, or one JSON object."""

from __future__ import annotations

import json
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import typer

from armdyn.cli import interrupts
from armdyn.cli.interrupts import INTERRUPTED as INTERRUPTED
from armdyn.cli.invocation import command_name, in_options, option_value
from armdyn.cli.streams import BAD_INPUT as BAD_INPUT
from armdyn.cli.streams import DISK_FULL as DISK_FULL
from armdyn.errors import ArmdynError, ArmdynWarning, DiskFullError
from armdyn.files import is_full
from armdyn.locks import cached_property

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console
    from rich.progress import Progress
    from rich.table import Table

DONE, INTERNAL, NOT_USABLE, NOT_AS_REQUIRED = 0, 1, 3, 4
"""Exit codes, besides BAD_INPUT, DISK_FULL and INTERRUPTED."""

EXIT_CODES = (
    "0 done, and the motion is usable: it reaches the goal within its limits; 2 bad usage or input; 3 not usable; "
    "4 usable, but --require is not met; 5 disk full; 130 interrupted."
)
"""Meaning of the exit codes, as in help and README."""

SCHEMA = interrupts.SCHEMA
"""Version of the JSON objects, see docs/json.md: raised when a key is removed or changes its meaning."""


class Terminal:
    """Standard output or error by rich, which is imported at the first print."""

    def __init__(self, *, stderr: bool = False):
        self._stderr = stderr
        self.quiet = False

    @cached_property
    def rich(self) -> Console:
        """Rich's console."""
        from rich.console import Console

        return Console(stderr=self._stderr, highlight=False, emoji=False)

    @property
    def is_terminal(self) -> bool:
        """Whether it is a terminal."""
        return self.rich.is_terminal

    def shows(self, text: str) -> bool:
        """Whether its encoding has all characters of a text."""
        try:
            text.encode(self.rich.encoding)
        except (LookupError, UnicodeEncodeError):
            return False
        return True

    def print(self, what: str | Table) -> None:
        """Print rich's markup, unless `quiet` is set."""
        if not self.quiet:
            self.rich.print(what, crop=False)  # the terminal folds long lines


console, errors = Terminal(), Terminal(stderr=True)


def escape(text: str) -> str:
    """Text with rich's markup escaped."""
    from rich.markup import escape as escaped

    return escaped(text)


@dataclass
class Answer:
    """Answer of a command, filled in while it runs.

    Attributes:
        facts: for the JSON object.
        code: the exit code.
    """

    facts: dict[str, object] = field(default_factory=dict)
    code: int = DONE

    def done(self, status: str, facts: Mapping[str, object], files: Iterable[Path] = ()) -> None:
        """Record success."""
        self.facts |= {"success": True, "status": status, **facts, "files": [str(file) for file in files]}

    def judge(self, usable: bool, *, interrupted: bool = False, as_required: bool = True) -> None:
        """Set the exit code of a result.

        Args:
            usable: whether the result is usable, such as a usable motion.
            interrupted: whether Ctrl-C has cut the command short.
            as_required: whether the result meets `--require` or `--at-least`.
        """
        code = DONE if as_required else NOT_AS_REQUIRED
        self.code = INTERRUPTED if interrupted else code if usable else NOT_USABLE

    def interrupted(self) -> None:
        """Record an interrupt."""
        self.failed("interrupted", "interrupted", INTERRUPTED)

    def failed(self, status: str, message: str, code: int) -> None:
        """Record a failure."""
        self.facts |= {"success": False, "status": status, "message": message}
        self.code = code


def cut_short(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Facts of a summary; changed if Ctrl-C came after the motion was found, during costs or reserves.

    Args:
        summary: of the result; its "status" says whether the solve itself was interrupted.
    """
    if not interrupts.pressed() or summary["status"] == "interrupted":
        return dict(summary)
    message = "interrupted after the motion was found; the other requested results are incomplete"
    return {**summary, "success": False, "status": "interrupted", "message": message}


@contextmanager
def answering(as_json: bool, *, last: bool = True) -> Iterator[Answer]:
    """Turn results, errors and warnings of the block into output and an exit code, without tracebacks.

    Args:
        as_json: the answer is one JSON object, and `console` says nothing.
        last: no other command follows whose JSON object is the answer, unless this one fails.

    Raises:
        typer.Exit: always, with the code.
    """
    answer = Answer()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", ArmdynWarning)
        try:
            console.quiet = as_json or bool(option_value("quiet"))
            with interrupts.Raised():
                yield answer
        except typer.Exit:
            raise
        except DiskFullError as error:
            answer.failed("disk_full", str(error), DISK_FULL)
        except ArmdynError as error:
            answer.failed("bad_input", in_options(str(error)), BAD_INPUT)
        except OSError as error:
            if is_full(error):
                answer.failed("disk_full", str(DiskFullError(error.filename or "standard output")), DISK_FULL)
            else:
                answer.failed("bad_input", _os_message(error), BAD_INPUT)
        except (Exception, KeyboardInterrupt) as error:
            if interrupts.pressed() or isinstance(error, KeyboardInterrupt):
                answer.interrupted()
            elif os.environ.get("ARMDYN_DEBUG"):
                raise
            else:
                hint = "this is a bug in armdyn; ARMDYN_DEBUG=1 shows where"
                answer.failed("internal_error", f"internal error ({type(error).__name__}: {error}); {hint}", INTERNAL)
        finally:
            console.quiet = False
    interrupts.answer()
    messages = list(dict.fromkeys(in_options(str(w.message)) for w in caught if issubclass(w.category, ArmdynWarning)))
    for message in messages:
        errors.print(f"[yellow]warning:[/] {escape(message)}")
    if as_json and (last or answer.code):
        answer.facts["warnings"] = messages
        write_json(answer.facts)
    if answer.code in (INTERNAL, BAD_INPUT, DISK_FULL, INTERRUPTED) and "message" in answer.facts and not as_json:
        errors.print(f"[bold red]armdyn:[/] {escape(str(answer.facts['message']))}")
    raise typer.Exit(answer.code)


def write_json(facts: Mapping[str, object]) -> None:
    """Write facts of the command that is running as the JSON object of its answer."""
    printed = {"schema": SCHEMA, "command": command_name(), **facts}
    sys.stdout.write(json.dumps(printed, allow_nan=False) + "\n")


def _os_message(error: OSError) -> str:
    """The operating system's message, with the file."""
    what = error.strerror or str(error) or type(error).__name__
    return what if error.filename is None else f"{what}: {error.filename}"


@contextmanager
def working(what: str) -> Iterator[Callable[[str], None]]:
    """Show a spinner on standard error; yields the function that updates its text."""
    interrupts.at(what)
    if console.quiet or not errors.is_terminal:
        yield lambda text: interrupts.at(f"{what}: {text}")
        return
    with errors.rich.status(escape(what)) as status:

        def update(text: str) -> None:
            interrupts.at(f"{what}: {text}")
            status.update(escape(f"{what}: {text}"))

        yield update


_REDRAWN = 0.1
"""Least time between two redraws of a bar [s]: some studies do thousands of cases a second."""


class Bar:
    """Progress bar on standard error, or none."""

    def __init__(self, bar: Progress | None, total: int):
        self._bar, self._task = bar, bar.add_task("", total=total) if bar else None
        self._drawn = 0.0

    def update(self, done: int, text: str, total: int | None = None) -> None:
        """Set the count of finished cases, and the text next to the bar."""
        if self._bar and self._task is not None:
            now = time.monotonic()
            due = now - self._drawn >= _REDRAWN
            self._drawn = now if due else self._drawn
            self._bar.update(self._task, completed=done, total=total, description=escape(text), refresh=due)

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Hide the bar while other text is printed."""
        if self._bar:
            self._bar.stop()
        yield
        if self._bar:
            self._bar.start()


@contextmanager
def progress_bar(name: str, total: int) -> Iterator[Bar]:
    """Show a progress bar with a name and a count, if standard error is a terminal."""
    if console.quiet or not errors.is_terminal:
        yield Bar(None, total)
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn(escape(name)), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    # It refreshes itself in a thread otherwise, and processes are to be forked.
    text = TextColumn("{task.description}")
    with Progress(*columns, text, console=errors.rich, transient=True, auto_refresh=False) as bar:
        own = Bar(bar, total)
        bar.refresh()
        yield own


_LONGEST_WORD = 14
"""Longer words of a table are folded, such as paths [letters]."""


def table(
    title: str,
    heads: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    styles: Sequence[str | None] = (),
    caption: str = "",
) -> Table:
    """Table of text, none of which is markup.

    Args:
        title: above it.
        heads: of the columns; one that begins with ">" is of numbers, which stand at the right and are never folded.
            Other columns are folded between words.
        rows: their cells; those that a row has not are empty.
        styles: of the rows, as rich names them; none: all are plain.
        caption: below it.
    """
    from rich.cells import cell_len
    from rich.table import Table

    made = Table(
        title=escape(title), caption=escape(caption), title_justify="left", caption_justify="left",
        title_style="bold", header_style="bold", box=None, pad_edge=False,
    )  # fmt: skip
    rows = list(rows)
    for k, head in enumerate(heads):
        numbers, head = head.startswith(">"), head.removeprefix(">")
        texts = "\n".join([head, *(cells[k] for cells in rows if k < len(cells))])
        whole = texts.split("\n") if numbers else texts.split()
        least = min(max(map(cell_len, whole), default=0), _LONGEST_WORD)
        justify: Literal["left", "right"] = "right" if numbers else "left"
        made.add_column(escape(head), justify=justify, no_wrap=numbers, overflow="fold", min_width=least)
    for i, cells in enumerate(rows):
        made.add_row(*map(escape, cells), style=styles[i] if styles else None)
    return made


def facts_table(title: str, facts: dict[str, str]) -> Table:
    """Table of two columns: names and values."""
    from rich.table import Table

    table = Table(title=escape(title), title_justify="left", title_style="bold", show_header=False, box=None)
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    for key, value in facts.items():
        table.add_row(escape(key), escape(value))
    return table
