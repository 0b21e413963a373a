"""Output of commands: text on a terminal, or one JSON object."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from armdyn.cli import interrupts
from armdyn.cli.interrupts import INTERRUPTED as INTERRUPTED
from armdyn.cli.invocation import command_name
from armdyn.locks import cached_property

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console
    from rich.progress import Progress
    from rich.table import Table

Shown: TypeAlias = "str | Table"
"""Output of a command on the terminal: text in rich's markup, or a table."""

DONE, INTERNAL, NOT_USABLE, NOT_AS_REQUIRED = 0, 1, 3, 4
"""Exit codes, besides INTERRUPTED, and BAD_INPUT and DISK_FULL of `streams`."""

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

    def shows(self, text: str) -> bool:
        """Whether its encoding has all characters of a text."""
        try:
            text.encode(self.rich.encoding)
        except (LookupError, UnicodeEncodeError):
            return False
        return True

    def print(self, what: Shown) -> None:
        """Print rich's markup, unless `quiet` is set."""
        if not self.quiet:
            command = isinstance(what, str) and what.startswith("armdyn ")  # stays one line, to be copied
            self.rich.print(what, crop=False, soft_wrap=command)  # the terminal folds long lines


console, errors = Terminal(), Terminal(stderr=True)


def escape(text: str) -> str:
    """Text with rich's markup escaped."""
    from rich.markup import escape as escaped

    return escaped(text)


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Answer of a command.

    Attributes:
        facts: for the JSON object.
        shown: for the terminal.
        code: the exit code.
        remarks: lines for standard error, unless the answer is the JSON object.
        then: words of the command that follows; empty: none.
    """

    facts: Mapping[str, object] = field(default_factory=dict)
    shown: Sequence[Shown] = ()
    code: int = DONE
    remarks: Sequence[str] = ()
    then: Sequence[str] = ()


def judged(
    facts: Mapping[str, object],
    *shown: Shown,
    usable: bool,
    as_required: bool = True,
    remarks: Sequence[str] = (),
    files: Iterable[Path] = (),
) -> Answer:
    """The answer of a command with a result, or with a part of it after Ctrl-C: then its status is "interrupted".

    Args:
        facts: of the result, its status among them.
        shown: for the terminal.
        usable: whether the result is usable, such as a usable motion.
        as_required: whether the result meets `--require` or `--at-least`.
        remarks: for standard error.
        files: that were written.
    """
    code = NOT_USABLE if not usable else DONE if as_required else NOT_AS_REQUIRED
    known = {**facts, "files": [str(file) for file in files]}
    answer = Answer(facts=known, shown=shown, code=code, remarks=remarks)
    return as_interrupted(answer) if facts["status"] == "interrupted" else answer


def as_interrupted(answer: Answer) -> Answer:
    """The answer of a command that Ctrl-C ended with a part of its result, or with all of it: it says what is saved."""
    given = answer.facts.get("message")
    message = f"{given if answer.facts.get('status') == 'interrupted' else 'interrupted'}; {interrupts.kept()}"
    facts = {**answer.facts, "success": False, "status": "interrupted", "message": message}
    return replace(answer, facts=facts, code=INTERRUPTED, remarks=[*answer.remarks, _complaint(message)])


def done(status: str, facts: Mapping[str, object], *shown: Shown, files: Iterable[Path] = ()) -> Answer:
    """The answer of a command that succeeded."""
    known = {"success": True, "status": status, **facts, "files": [str(file) for file in files]}
    return Answer(facts=known, shown=shown)


def failed(status: str, message: str, code: int, **facts: object) -> Answer:
    """The answer of a command that failed."""
    known = {**facts, "success": False, "status": status, "message": message}
    said, *lines = message.split("\n")
    return Answer(facts=known, code=code, remarks=[_complaint(said), *map(escape, lines)])


def interrupted(message: str = "", **facts: object) -> Answer:
    """The answer of a command that Ctrl-C ended; by default it says which results are saved."""
    return failed("interrupted", message or interrupts.message(), INTERRUPTED, **facts)


def _complaint(message: object) -> str:
    return f"[bold red]armdyn:[/] {escape(str(message))}"


def cut_short(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Facts of a summary, marked as interrupted if Ctrl-C came after the solve, during costs or reserves.

    Args:
        summary: of the result; its "status" says whether the solve itself was interrupted.
    """
    if not interrupts.pressed() or summary["status"] == "interrupted":
        return dict(summary)
    message = "interrupted after the motion was found; the other requested results are incomplete"
    return {**summary, "success": False, "status": "interrupted", "message": message}


def write_json(facts: Mapping[str, object]) -> None:
    """Write facts of the command that is running as the JSON object of its answer."""
    printed = {"schema": SCHEMA, "command": command_name(), **facts}
    sys.stdout.write(json.dumps(printed, allow_nan=False) + "\n")


@contextmanager
def working(what: str) -> Iterator[Callable[[str], None]]:
    """Show a spinner on standard error; yields the function that updates its text."""
    interrupts.set_step(what)
    if console.quiet or not errors.rich.is_terminal:
        yield lambda text: interrupts.set_step(f"{what}: {text}")
        return
    with errors.rich.status(escape(what)) as status:

        def update(text: str) -> None:
            interrupts.set_step(f"{what}: {text}")
            status.update(escape(f"{what}: {text}"))

        yield update


_REDRAWN = 0.1
"""Least time between two redraws of a bar [s]: some studies do thousands of cases a second."""


class Bar:
    """Progress bar on standard error; without one of rich's it is hidden."""

    def __init__(self, bar: Progress | None, total: int):
        self._bar = bar
        if bar is not None:
            self._task = bar.add_task("", total=total)
        self._drawn = 0.0

    def update(self, done: int, text: str, total: int | None = None) -> None:
        """Set the count of finished cases, and the text next to the bar."""
        if self._bar is None:
            return
        now = time.monotonic()
        due = now - self._drawn >= _REDRAWN
        self._drawn = now if due else self._drawn
        self._bar.update(self._task, completed=done, total=total, description=escape(text), refresh=due)

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Hide the bar while other text is printed."""
        if self._bar is None:
            yield
            return
        self._bar.stop()
        yield
        self._bar.start()


@contextmanager
def progress_bar(name: str, total: int) -> Iterator[Bar]:
    """Show a progress bar with a name and a count, if standard error is a terminal."""
    if console.quiet or not errors.rich.is_terminal:
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
) -> Shown:
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


def facts_table(title: str, facts: dict[str, str]) -> Shown:
    """Table of two columns: names and values."""
    from rich.table import Table

    table = Table(title=escape(title), title_justify="left", title_style="bold", show_header=False, box=None)
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    for key, value in facts.items():
        table.add_row(escape(key), escape(value))
    return table
