"""Standard output and error that may be closed, without Unicode, or lose their reader."""

import errno
import io
import os
import sys
from typing import ClassVar, TextIO

BAD_INPUT, DISK_FULL = 2, 5
"""Exit codes."""


def make_robust() -> None:
    """Make standard output and error robust: no encoding, no closed pipe and no full disk raises an error.

    A character that the terminal's encoding lacks is written as its escape. Output without a
    reader, or without room, is dropped, and the command continues: its files are still wanted.

    Raises:
        SystemExit: standard output is closed.
    """
    for number in (0, 1, 2):
        _open_on_null_device(number)
    sys.stderr = _robust(sys.stderr) or open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115  # for good
    out = _robust(sys.stdout)
    if out is None:
        sys.stderr.write("armdyn: standard output is closed; to discard it, send it to /dev/null\n")
        sys.exit(BAD_INPUT)
    sys.stdout = out


def flushed(code: str | int | None) -> str | int | None:
    """Flush standard output: the exit code, or another one if that failed.

    Args:
        code: that the command ends with.
    """
    sys.stdout.flush()
    if error := _UntilNobodyReads.failures.get(sys.stdout.fileno()):
        from armdyn.errors import DiskFullError
        from armdyn.files import is_full

        full = is_full(error)
        why = str(DiskFullError("standard output")) if full else f"standard output: {error.strerror}"
        if code != DISK_FULL:  # else the command has reported it
            sys.stderr.write(f"armdyn: {why}\n")
        code = code or (DISK_FULL if full else BAD_INPUT)
    sys.stderr.flush()
    return code


def _open_on_null_device(number: int) -> None:
    """Point a closed descriptor to the null device: else the next opened file would get its number."""
    try:
        os.fstat(number)
    except OSError:
        os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free


def _robust(stream: TextIO | None) -> TextIO | None:
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    file: io.RawIOBase = _UntilNobodyReads(stream.fileno(), "wb", closefd=False)
    return io.TextIOWrapper(
        io.BufferedWriter(file),
        encoding=stream.encoding,
        errors="backslashreplace",
        line_buffering=stream.line_buffering,
    )


class _UntilNobodyReads(io.FileIO):
    """A file that accepts data after the reader of the pipe has closed it, or the disk is full."""

    failures: ClassVar[dict[int, OSError]] = {}
    """Errors of files, by their descriptors, except closed pipes."""

    def write(self, data: "bytes | memoryview") -> int:  # type: ignore[override]  # a buffer, as BufferedWriter gives it
        try:
            return super().write(data)
        except OSError as error:
            if error.errno != errno.EPIPE:
                self.failures[self.fileno()] = error
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            return len(data)
