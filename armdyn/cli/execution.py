"""Execution of a command: its answer, errors and warnings become output and an exit code."""

from __future__ import annotations

import os
import shlex
import warnings
from collections.abc import Callable
from functools import partial
from typing import NoReturn

import typer

from armdyn.cli import interrupts
from armdyn.cli.console import (
    DONE,
    INTERNAL,
    NOT_AS_REQUIRED,
    NOT_USABLE,
    Answer,
    as_interrupted,
    console,
    errors,
    escape,
    failed,
    interrupted,
    write_json,
)
from armdyn.cli.invocation import in_options, option_value
from armdyn.cli.streams import BAD_INPUT, DISK_FULL
from armdyn.errors import ArmdynError, ArmdynWarning, DiskFullError
from armdyn.files import is_full


class Followed(typer.Exit):
    """End of a command that is followed by another one, of these words."""

    def __init__(self, words: list[str]):
        super().__init__(0)
        self.words = words


def carry_out(command: Callable[[], Answer]) -> NoReturn:
    """Run a command, and turn its answer, errors and warnings into output and an exit code, without tracebacks.

    Args:
        command: the running one, whose options --json, --quiet and --then decide the output.

    Raises:
        typer.Exit: always, with the code; `Followed` where another command follows.
    """
    as_json = bool(option_value("json")) or "--json" in shlex.split(option_value("then") or "")
    messages: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", ArmdynWarning)
        warnings.showwarning = partial(_warn, messages)  # at once: a solve may take minutes
        console.quiet = as_json or bool(option_value("quiet"))
        try:
            with interrupts.Raised():
                answer = command()
                for each in answer.shown:
                    console.print(each)
        except (Exception, KeyboardInterrupt) as error:
            if os.environ.get("ARMDYN_DEBUG") and _is_bug(error):
                raise
            answer = _failure(error)
        finally:
            console.quiet = False
    if interrupts.pressed() and answer.code in (DONE, NOT_USABLE, NOT_AS_REQUIRED):
        answer = as_interrupted(answer)
    interrupts.mark_reported()
    if answer.then:
        raise Followed([*answer.then, *(["--json"] if as_json and "--json" not in answer.then else [])])
    if as_json:
        write_json({**answer.facts, "warnings": messages})
    for line in () if as_json else answer.remarks:
        errors.print(line)
    raise typer.Exit(answer.code)


def _warn(messages: list[str], warning: Warning | str, category: type[Warning], *_where: object) -> None:
    """Print a warning, unless the same was printed before, and add it to the messages."""
    message = in_options(str(warning))
    if issubclass(category, ArmdynWarning) and message not in messages:
        messages.append(message)
        errors.print(f"[yellow]warning:[/] {escape(message)}")


def _is_bug(error: BaseException) -> bool:
    """Whether an exception is neither the user's nor the disk's fault, nor a consequence of Ctrl-C."""
    return not (isinstance(error, (ArmdynError, OSError, KeyboardInterrupt)) or interrupts.pressed())


def _failure(error: BaseException) -> Answer:
    """The answer of a command that raised an exception."""
    if isinstance(error, DiskFullError):
        return failed("disk_full", str(error), DISK_FULL)
    if isinstance(error, ArmdynError) and not interrupts.pressed():
        return failed("bad_input", in_options(str(error)), BAD_INPUT)
    if isinstance(error, OSError) and not interrupts.pressed():
        if is_full(error):
            return failed("disk_full", str(DiskFullError(error.filename or "standard output")), DISK_FULL)
        reason = error.strerror or str(error) or type(error).__name__
        return failed("bad_input", reason if error.filename is None else f"{reason}: {error.filename}", BAD_INPUT)
    if _is_bug(error):
        hint = "this is a bug in armdyn; ARMDYN_DEBUG=1 shows where"
        return failed("internal_error", f"internal error ({type(error).__name__}: {error}); {hint}", INTERNAL)
    return interrupted()
