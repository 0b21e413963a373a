"""Rows of studies in SQLite: one per case, on disk as soon as the case has ended, never two."""

import fcntl
import json
import os
import re
import sqlite3
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass, fields
from importlib.metadata import version
from pathlib import Path
from typing import Any, BinaryIO, Literal

from armdyn.arguments import path_of, shown
from armdyn.errors import ArmdynError, DiskFullError, FileError, ProblemError, ResultError
from armdyn.files import is_full, parse_json, probe_folder, refuse_replacing

Value = Any
"""A setting's value, as JSON has it: a number, a text, or a list or table of these."""

Sync = Literal["full", "normal"]
"""Time at which a row reaches the disk: "full", before the next begins; "normal", when the system writes it."""
SYNCS: tuple[Sync, ...] = ("full", "normal")

_ID = 0x61726D73
"""SQLite's application_id of the file: "arms"."""
_SHOWN = 4
"""Differences between two studies that a message shows, at most."""
_LOCK_TIMEOUT = 5.0
"""Time [s] for the workers of a killed study to end: they hold its lock for a moment."""
_TABLES = (
    "CREATE TABLE study (asked TEXT NOT NULL, armdyn TEXT NOT NULL)",
    "CREATE TABLE rows (k INTEGER PRIMARY KEY, status TEXT NOT NULL, good INTEGER NOT NULL, message TEXT NOT NULL, "
    "settings TEXT NOT NULL, facts TEXT NOT NULL, seconds REAL NOT NULL, attempts INTEGER NOT NULL, "
    "worker TEXT NOT NULL, begun_from INTEGER)",
    "CREATE TABLE motions (k INTEGER PRIMARY KEY, motion BLOB NOT NULL)",
)


@dataclass(frozen=True, kw_only=True)
class StudyRow:
    """Result of one case, with the way to it.

    Attributes:
        k: number of the case.
        status: one word; "worker_died": every worker that tried the case died.
        good: whether the case has the result that its task looks for, such as a usable motion.
        message: one sentence.
        settings: of the case.
        facts: results by name.
        seconds: work on the case [s].
        attempts: number of workers that tried.
        worker: name of the last one.
        begun_from: number of the case whose motion was the initial guess; None: no motion was.
    """

    k: int
    status: str
    good: bool
    message: str
    settings: Mapping[str, Value]
    facts: Mapping[str, Any]
    seconds: float = 0.0
    attempts: int = 1
    worker: str = ""
    begun_from: int | None = None


_COLUMNS = tuple(field.name for field in fields(StudyRow))
_KINDS: dict[str, Any] = {
    "good": int, "settings": str, "facts": str, "seconds": float | int, "attempts": int, "begun_from": int | None,
}  # fmt: skip
"""Types of the columns in the file, where SQLite may have another one in a damaged row; of others text."""


class RowStore:
    """Rows and motions of a study; one process writes, others may read meanwhile."""

    def __init__(self, path: Path, connection: sqlite3.Connection):
        self.path, self._connection = path, connection

    def append(self, rows: Sequence[StudyRow], motions: Mapping[int, bytes], *, replace: bool = False) -> None:
        """Write rows and motions: all of them, or none if this process is killed.

        Args:
            rows: of cases without a row.
            motions: by the number of their case.
            replace: the cases may have rows already, which are replaced.

        Raises:
            DiskFullError: the disk is full.
            ResultError: a case has a row already.
        """
        insert = "INSERT OR REPLACE INTO" if replace else "INSERT INTO"
        values = [_dumped(row) for row in rows]
        with _errors(self.path), self._connection:
            self._connection.executemany(f"{insert} rows VALUES ({', '.join('?' * len(_COLUMNS))})", values)
            self._connection.executemany(f"{insert} motions VALUES (?, ?)", motions.items())

    def forget(self, statuses: Sequence[str]) -> None:
        """Delete the rows of some statuses, so that their cases are done again."""
        with _errors(self.path), self._connection:
            self._connection.executemany("DELETE FROM rows WHERE status = ?", [(status,) for status in statuses])

    def numbers(self) -> set[int]:
        """Numbers of the cases that have a row."""
        with _errors(self.path):
            return {k for (k,) in self._connection.execute("SELECT k FROM rows")}

    def moved(self) -> set[int]:
        """Numbers of the cases whose motion is stored."""
        with _errors(self.path):
            return {k for (k,) in self._connection.execute("SELECT k FROM motions")}

    def motion(self, k: int) -> bytes:
        """Motion of a case as `motion_from` reads it; empty if none is stored."""
        with _errors(self.path):
            found = self._connection.execute("SELECT motion FROM motions WHERE k = ?", (k,)).fetchone()
            if found and not isinstance(found[0], bytes):
                raise ValueError(f"motion of case {k} is {shown(found[0])}")
        return found[0] if found else b""

    def counts(self) -> dict[str, int]:
        """Number of rows of each status, the most frequent first."""
        with _errors(self.path):
            query = "SELECT status, COUNT(*) AS n FROM rows GROUP BY status ORDER BY n DESC, status"
            return dict(self._connection.execute(query).fetchall())

    def rows(self, first: int = 0) -> Iterator[StudyRow]:
        """Rows from the number `first` on, by their numbers."""
        with _errors(self.path):
            for values in self._connection.execute("SELECT * FROM rows WHERE k >= ? ORDER BY k", (first,)):
                yield _row(values)


@contextmanager
def row_store(
    path: str | os.PathLike[str] | None,
    describe: Callable[[], Mapping[str, object]],
    sync: Sync = "full",
    *,
    replace: bool = False,
) -> Iterator[RowStore]:
    """Open the rows of a study: new ones, or those of an earlier run.

    With sync "full" a row that `append` has written survives a SIGKILL of this process and, on a disk that flushes its
    writes, a power cut; with "normal" it survives a SIGKILL, and a power cut may take the last moments.

    Args:
        path: of the file, whose folder is made; next to it lie SQLite's -wal and -shm, and a .lock. None: in memory.
        describe: description of the study, as JSON; not called for rows in memory.
        sync: see above.
        replace: rows of another study are deleted instead of refused.

    Raises:
        DiskFullError: the disk is full.
        FileError: the file cannot be read or written.
        ResultError: the file is not a study's, belongs to another study, is damaged, or another process writes to it.
    """
    here = Path(":memory:" if path is None else path_of(path, "file", error=ResultError))
    if not here.name:
        raise FileError(here, "cannot be written (it is a folder); give the path of a file")
    with nullcontext() if path is None else _locked(here), _connected(here) as connection:
        with _errors(here):
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute(f"PRAGMA synchronous = {'FULL' if sync == 'full' else 'NORMAL'}")
            _begin(connection, here, {} if path is None else describe(), replace)
        yield RowStore(here, connection)


@contextmanager
def read_rows(path: str | os.PathLike[str]) -> Iterator[RowStore]:
    """Open the rows of a study to read, also while the study runs.

    Raises:
        FileError: there is no such file.
        ResultError: the file is not a study's, or damaged.
    """
    path = Path(path_of(path, "file", error=ResultError))
    with _errors(path):
        if not path.is_file():
            raise FileError(path, "is a folder; give the path of its study.sqlite" if path.is_dir() else "no such file")
    with _connected(path) as connection:
        with _errors(path):
            connection.execute("PRAGMA query_only = ON")
            _check_kind(connection, path)
        yield RowStore(path, connection)


def differences(there: Mapping[str, Any], here: Mapping[str, Any], prefix: str = "") -> Iterable[str]:
    """Differences between the descriptions of two studies, one phrase each.

    Args:
        there: description of the study in the file.
        here: description of the study that is to be run.
        prefix: names of the enclosing keys, each with a dot.
    """
    for name in dict.fromkeys([*there, *here]):
        old, new = there.get(name), here.get(name)
        if isinstance(old, dict) and isinstance(new, dict):
            yield from differences(old, new, f"{prefix}{name}.")
        elif old != new:
            yield f"{prefix}{name} is {_shown(old)} there and {_shown(new)} here"


def _shown(value: object) -> str:
    """A value as JSON, cut off where it is long; of a checksum the first letters."""
    if isinstance(value, str) and re.fullmatch(r"[0-9a-f]{64}", value):
        return f"{value[:8]}…"
    return json.dumps(value)[:80]


def _dumped(row: StudyRow) -> list[object]:
    """Values of the columns."""
    values = {name: getattr(row, name) for name in _COLUMNS}
    return [json.dumps(dict(one), allow_nan=False) if isinstance(one, Mapping) else one for one in values.values()]


def _row(values: Sequence[Any]) -> StudyRow:
    """The row of the columns' values.

    Raises:
        ValueError: a value is none that `_dumped` gives.
    """
    row = dict(zip(_COLUMNS, values, strict=True))
    for name, value in row.items():
        if not isinstance(value, _KINDS.get(name, int if name == "k" else str)):
            raise ValueError(f"{name} of case {shown(row['k'])} is {shown(value)}")
    return StudyRow(**row | {"good": bool(row["good"])} | {name: _table(row[name]) for name in ("settings", "facts")})


def _table(text: Any) -> dict[str, Any]:
    """A JSON object.

    Raises:
        ValueError: the text is none.
    """
    found = parse_json(text) if isinstance(text, str) else None
    if not isinstance(found, dict):
        raise ValueError(f"{shown(text)} is no JSON object")
    return found


def _connected(path: Path) -> AbstractContextManager[sqlite3.Connection]:
    with _errors(path):
        return closing(sqlite3.connect(path, timeout=30.0))


def _begin(connection: sqlite3.Connection, path: Path, description: Mapping[str, object], replace: bool) -> None:
    """Make the tables of a new file, or check that an old one belongs to the same study."""
    try:
        here = json.loads(json.dumps(description, allow_nan=False))
    except (TypeError, ValueError) as error:
        raise ProblemError(f"the study's description is no JSON: {error}") from None
    if connection.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()[0]:
        _check_kind(connection, path)
        there = _table(next(iter(connection.execute("SELECT asked FROM study").fetchone() or ()), None))
        different = list(differences(there, here))
        if not different:
            return
        if not replace:
            listed = [one for one in different if not one.startswith("places ")] or different  # places are a checksum
            more = f"; and {len(listed) - _SHOWN} more" if len(listed) > _SHOWN else ""
            older = any(there.get(name) != here.get(name) for name in ("format", "armdyn"))
            remedy = "Choose" if older else "Repeat that one, or choose"
            raise ResultError(
                f"{path} has the rows of another study: {'; '.join(listed[:_SHOWN])}{more}. {remedy} another `file`"
            )
    with connection:
        connection.execute("BEGIN IMMEDIATE")
        for name in ("study", "rows", "motions"):
            connection.execute(f"DROP TABLE IF EXISTS {name}")
        connection.execute(f"PRAGMA application_id = {_ID}")
        for table in _TABLES:
            connection.execute(table)
        connection.execute("INSERT INTO study VALUES (?, ?)", (json.dumps(here), version("armdyn")))


def _check_kind(connection: sqlite3.Connection, path: Path) -> None:
    """Refuse a file with other tables than a study's: a view or a trigger is a program, which need not end."""
    found = {text for (text,) in connection.execute("SELECT sql FROM sqlite_master")}
    if connection.execute("PRAGMA application_id").fetchone()[0] != _ID or found != set(_TABLES):
        raise ResultError(f"{path}: an SQLite file, but not one of a study")


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold the lock of a file, which ends with this process and its workers, however they end; removed without errors.

    Raises:
        DiskFullError: the disk is full.
        FileError: the folder cannot be written, or there is a device, pipe, folder or link in the place of a file.
        ResultError: another process holds it.
    """
    file, until = path.with_name(f"{path.name}.lock"), time.monotonic() + _LOCK_TIMEOUT
    with _errors(path):
        for end in ("", ".lock", "-wal", "-shm", "-journal"):
            refuse_replacing(path.with_name(path.name + end))
    while (lock := _lock(path, file)) is None:
        if time.monotonic() > until:
            raise ResultError(f"{path}: another process is at this study")
        time.sleep(0.05)
    with lock:
        yield
        with suppress(OSError):
            file.unlink()  # while it is held: see `_lock`


def _lock(path: Path, file: Path) -> BinaryIO | None:
    """Open and lock a file; None if another process holds it, or has removed it since it was opened.

    Raises:
        DiskFullError: the disk is full.
        FileError: the folder cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = file.open("ab")
    except OSError as error:
        if is_full(error):
            raise DiskFullError(path) from None
        raise FileError(path, f"cannot be written ({error.strerror}); give the path of a file that can") from None
    with suppress(OSError):
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.path.samestat(os.fstat(lock.fileno()), file.stat()):
            return lock
    lock.close()
    return None


@contextmanager
def _errors(path: Path) -> Iterator[None]:
    """Raise SQLite's errors as armdyn's."""
    try:
        yield
    except ArmdynError:
        raise
    except sqlite3.IntegrityError as error:
        raise ResultError(f"{path}: a case has a row already ({error})") from None
    except sqlite3.OperationalError as error:
        if "full" in str(error):
            raise DiskFullError(path) from None
        with suppress(FileError):
            probe_folder(path.parent)  # a full disk is a "disk I/O error", too, where the -shm has no room
        raise FileError(path, f"cannot be used ({error})") from None
    except OSError as error:
        raise FileError(path, f"cannot be used ({error.strerror})") from None
    except (sqlite3.DatabaseError, ValueError, RecursionError) as error:
        raise ResultError(f"{path}: no study's file, or damaged ({error})") from None
