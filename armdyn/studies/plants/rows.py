"""Rows of many runs: one line of JSON each, written as it ends, so that a killed study goes on where it was."""

import fcntl
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import IO, Any, NoReturn, Self

import numpy as np

from armdyn.arguments import shown
from armdyn.control.tracking.run import Run
from armdyn.errors import DiskFullError, FileError, ResultError
from armdyn.files import is_full, read_bounded
from armdyn.studies.plants.plants import Draw

MAX_BYTES = 2**28
"""A file that is larger is none of ours [bytes]; a row has some six hundred."""

_MOST = float(np.finfo(float).max)
"""Stands for infinity, which JSON does not have."""
_RUN = ("settled_time", "error_at_end", "peak_error", "peak_velocity", "saturated", "went_wrong")


@dataclass(frozen=True)
class RunRow:
    """What came of one arm; the numbers are those of `Run`, None where there is none.

    Attributes:
        k: its number.
        draw: how the arm differs from the model.
        status: see `Run`.
        settled_time: [s].
        error_at_end: [rad or m].
        peak_error: [rad or m].
        peak_velocity: [-].
        saturated: [-].
        went_wrong: [s].
        overshoot: [rad or m], shape (nv,).
    """

    k: int
    draw: Draw
    status: str
    settled_time: float | None
    error_at_end: float | None
    peak_error: float | None
    peak_velocity: float | None
    saturated: float | None
    went_wrong: float | None
    overshoot: tuple[float, ...]

    @classmethod
    def of(cls, k: int, draw: Draw, run: Run) -> Self:
        """A run's."""
        facts: dict[str, Any] = run.summary()
        numbers = {name: facts[name] for name in _RUN}
        overshoot = np.nan_to_num(run.overshoot, nan=_MOST, posinf=_MOST).tolist()
        return cls(k=k, draw=draw, status=facts["status"], overshoot=tuple(overshoot), **numbers)

    def line(self) -> bytes:
        """As JSON, with its end."""
        return (json.dumps(asdict(self), allow_nan=False) + "\n").encode()

    @classmethod
    def read(cls, line: bytes) -> Self:
        """What `line` wrote.

        Raises:
            ValueError: it is something else.
        """
        content = json.loads(line, parse_constant=_refuse)
        names = [field.name for field in fields(cls)]
        if not isinstance(content, dict) or list(content) != names or not isinstance(content["draw"], dict):
            raise ValueError(f"expected {', '.join(names)}")
        draw: dict[str, Any] = {name: tuple(x) if isinstance(x, list) else x for name, x in content["draw"].items()}
        numbers = [content[name] for name in ("k", *_RUN)]
        if not all(x is None or (isinstance(x, int | float) and not isinstance(x, bool)) for x in numbers):
            raise ValueError("a number is none")
        try:
            return cls(**{**content, "draw": Draw(**draw), "overshoot": tuple(content["overshoot"])})
        except TypeError as error:
            raise ValueError(str(error)) from None


class RowFile:
    """A file of rows that only this process appends to; its first line says what was asked."""

    def __init__(self, path: Path, file: IO[bytes], rows: tuple[RunRow, ...]):
        self.path, self._file, self.rows = path, file, rows

    def append(self, row: RunRow) -> None:
        """Write a row, whole, so that it is there though this process were killed.

        Raises:
            DiskFullError: there is no room for it.
            OSError: it cannot be written.
        """
        self.write(row.line())

    def write(self, line: bytes) -> None:
        """Likewise a line."""
        try:
            self._file.write(line)
            self._file.flush()
        except OSError as error:
            if is_full(error):
                raise DiskFullError(self.path) from None
            raise


@contextmanager
def row_file(path: str | os.PathLike[str], description: Mapping[str, object]) -> Iterator[RowFile]:
    """A file of rows, new or to be gone on with. A last line that was torn by a kill is cut off.

    Args:
        path: of the file; its folder is made.
        description: what the rows answer, as JSON says it.

    Raises:
        DiskFullError: there is no room for it.
        FileError: it cannot be read or written.
        ResultError: it is no such file, answers another question, is damaged, or another process is at it.
    """
    path = Path(path)
    header = (json.dumps(description, allow_nan=False) + "\n").encode()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("a+b")
    except OSError as error:
        raise FileError(path, f"cannot be written ({error.strerror}); give the path of a file that can") from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # it goes with the process, however that ends
        except OSError:
            raise ResultError(f"{path}: another process is writing rows to it") from None
        content = read_bounded(path, MAX_BYTES)
        whole = content.rfind(b"\n") + 1
        rows = RowFile(path, file, _rows(path, content[:whole], description) if not header.startswith(content) else ())
        if header.startswith(content) and whole != len(header):
            file.truncate(0)  # empty, or torn within its first line
            rows.write(header)
        else:
            file.truncate(whole)
        yield rows


def read_rows(path: str | os.PathLike[str], description: Mapping[str, object]) -> tuple[RunRow, ...]:
    """The rows of a file, by their numbers; see `row_file`.

    Raises:
        FileError: it cannot be read.
        ResultError: see `row_file`.
    """
    return _rows(Path(path), read_bounded(path, MAX_BYTES), description)


def _rows(path: Path, content: bytes, description: Mapping[str, object]) -> tuple[RunRow, ...]:
    lines = content.split(b"\n")[:-1]
    if not lines:
        raise ResultError(f"{path}: no file of rows: it has no line that says what was asked")
    try:
        there = json.loads(lines[0], parse_constant=_refuse)
    except ValueError as error:
        raise ResultError(f"{path}: no file of rows: line 1 is not JSON ({error})") from None
    if not isinstance(there, dict) or there.get("format") != description["format"]:
        raise ResultError(f"{path}: no file of rows of format {description['format']}")
    if different := list(differences(there, json.loads(json.dumps(description)))):
        raise ResultError(
            f"{path}: its rows answer another question: {'; '.join(different)}. Ask the same, or give another file"
        )
    known: dict[int, RunRow] = {}
    for i, line in enumerate(lines[1:], start=2):
        try:
            row = RunRow.read(line)
        except ValueError as error:
            raise ResultError(f"{path}: line {i} is no row ({error})") from None
        if row.k in known:
            raise ResultError(f"{path}: line {i} has row {row.k} a second time")
        known[row.k] = row
    return tuple(known[k] for k in sorted(known))


def differences(there: Mapping[str, Any], here: Mapping[str, Any], within: str = "") -> Iterable[str]:
    """What two questions, as JSON says them, differ in, in words."""
    for name in dict.fromkeys([*there, *here]):
        old, new = there.get(name), here.get(name)
        if isinstance(old, dict) and isinstance(new, dict):
            yield from differences(old, new, f"{within}{name}.")
        elif old != new:
            yield f"{within}{name} is {json.dumps(old)[:80]} there and {json.dumps(new)[:80]} here"


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is not finite")


def named(value: object) -> dict[str, object]:
    """A frozen value as a header says it: its class and its fields.

    Args:
        value: a dataclass.

    Raises:
        ResultError: it is none, and cannot be told from another of its class.
    """
    if not hasattr(value, "__dataclass_fields__"):
        raise ResultError(
            f"rows on disk say which {type(value).__name__} they are of: make it a dataclass, or give no file"
        )
    own = {field: getattr(value, field) for field in value.__dataclass_fields__}
    plain = json.loads(json.dumps(own, default=_plain))
    return {"class": type(value).__name__, **plain}


def _plain(value: object) -> object:
    if hasattr(value, "__dataclass_fields__"):
        return named(value)
    array = np.asarray(value)
    if array.dtype == object:
        raise ResultError(f"rows on disk say what they are of in numbers; {shown(value)} is none: give no file")
    return array.tolist()
