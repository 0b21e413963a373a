"""The rows of a study in SQLite: one per case, there as soon as it has ended, never two."""

from __future__ import annotations

import fcntl
import json
import os
import sqlite3
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

from armdyn.arguments import path as path_of
from armdyn.errors import ArmdynError, DiskFullError, FileError, ResultError
from armdyn.studies.plants.rows import differences
from armdyn.studies.sweeps.tasks.settings import Value

Sync = Literal["full", "normal"]
"""When a row is on the disk itself: "full", before the next begins; "normal", when the system writes it."""
SYNCS: tuple[Sync, ...] = ("full", "normal")

_ID = 0x61726D73
"""SQLite's application_id of such a file: "arms"."""
_SAID = 4
"""Differences between two studies that are told, at most."""
_PATIENCE = 5.0
"""For the workers of a study that was killed to end, who hold its lock for a moment [s]."""
_TABLES = (
    "CREATE TABLE study (asked TEXT NOT NULL, armdyn TEXT NOT NULL)",
    "CREATE TABLE rows (k INTEGER PRIMARY KEY, status TEXT NOT NULL, good INTEGER NOT NULL, message TEXT NOT NULL, "
    "settings TEXT NOT NULL, facts TEXT NOT NULL, seconds REAL NOT NULL, attempts INTEGER NOT NULL, "
    "worker TEXT NOT NULL, begun_from INTEGER)",
    "CREATE TABLE motions (k INTEGER PRIMARY KEY, motion BLOB NOT NULL)",
)
_INSERT = "INSERT INTO rows VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"


@dataclass(frozen=True, kw_only=True)
class CaseRow:
    """What came of a case.

    Attributes:
        k: its number.
        status: in a word; "worker_died": of whoever worked on it, every time.
        good: it is what was wanted.
        message: in a sentence.
        settings: of the case.
        facts: what was found.
        seconds: that it took [s].
        attempts: at it.
        worker: who did it.
        begun_from: the case whose motion it began with; None: none.
    """

    k: int
    status: str
    good: bool
    message: str
    settings: Mapping[str, Value]
    facts: Mapping[str, Any]
    seconds: float
    attempts: int
    worker: str
    begun_from: int | None = None

    def values(self) -> tuple[object, ...]:
        """As they stand in the table."""
        texts = [json.dumps(dict(one), allow_nan=False) for one in (self.settings, self.facts)]
        return (
            self.k, self.status, int(self.good), self.message, *texts, self.seconds, self.attempts, self.worker,
            self.begun_from,
        )  # fmt: skip


class Database:
    """A study's rows, which only this process writes; others may read them meanwhile."""

    def __init__(self, path: Path, connection: sqlite3.Connection):
        self.path, self._connection = path, connection

    def append(self, rows: Sequence[CaseRow], motions: Mapping[int, bytes]) -> None:
        """Write rows and motions, all of them or, if this is killed, none.

        Raises:
            DiskFullError: there is no room for them.
            ResultError: a case has a row already.
        """
        with _telling(self.path), self._connection:
            self._connection.executemany(_INSERT, [row.values() for row in rows])
            self._connection.executemany("INSERT INTO motions VALUES (?, ?)", motions.items())

    def forget(self, statuses: Sequence[str]) -> int:
        """Take rows out, to have their cases done again; how many these are."""
        marks = ", ".join("?" * len(statuses))
        with _telling(self.path), self._connection:
            return self._connection.execute(
                f"DELETE FROM rows WHERE status IN ({marks})",  # noqa: S608  # question marks
                list(statuses),
            ).rowcount

    def numbers(self) -> set[int]:
        """Cases that have a row."""
        with _telling(self.path):
            return {k for (k,) in self._connection.execute("SELECT k FROM rows")}

    def moved(self) -> set[int]:
        """Cases whose motion is kept."""
        with _telling(self.path):
            return {k for (k,) in self._connection.execute("SELECT k FROM motions")}

    def motion(self, k: int) -> bytes:
        """A case's motion, as `motion_from` reads it; empty: there is none."""
        with _telling(self.path):
            found = self._connection.execute("SELECT motion FROM motions WHERE k = ?", (k,)).fetchone()
        return found[0] if found else b""

    def counts(self) -> dict[str, int]:
        """Rows of each status, the most frequent first."""
        with _telling(self.path):
            query = "SELECT status, COUNT(*) AS n FROM rows GROUP BY status ORDER BY n DESC, status"
            return dict(self._connection.execute(query).fetchall())

    def rows(self) -> Iterator[CaseRow]:
        """All rows, by their numbers, one after the other."""
        with _telling(self.path):
            for k, status, good, message, settings, facts, *others in self._connection.execute(
                "SELECT * FROM rows ORDER BY k"
            ):
                seconds, attempts, worker, begun_from = others
                yield CaseRow(
                    k=k, status=status, good=bool(good), message=message, settings=json.loads(settings),
                    facts=json.loads(facts), seconds=seconds, attempts=attempts, worker=worker, begun_from=begun_from,
                )  # fmt: skip


@contextmanager
def database(
    path: str | os.PathLike[str], description: Mapping[str, object], sync: Sync = "full"
) -> Iterator[Database]:
    """The rows of a study, new or to be gone on with.

    With sync "full" what `append` has returned from survives a SIGKILL of this process and, on a disk that does not lie
    about what it has written, a power cut; with "normal" a SIGKILL, and of a power cut all but the last moments.

    Args:
        path: of the file; its folder is made. Beside it lie SQLite's -wal and -shm, and a .lock.
        description: what the rows answer, as JSON says it.
        sync: see above.

    Raises:
        DiskFullError: there is no room.
        FileError: it cannot be read or written.
        ResultError: it is no such file, answers another study, is damaged, or another process is at it.
    """
    path = Path(path_of(path, "file", error=ResultError))
    if not path.name:
        raise FileError(path, "cannot be written (it is a folder); give the path of a file")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = path.with_name(f"{path.name}.lock").open("ab")
    except OSError as error:
        raise FileError(path, f"cannot be written ({error.strerror}); give the path of a file that can") from None
    with lock:
        _take(lock.fileno(), path)
        with _connected(path) as connection:
            with _telling(path):
                connection.execute("PRAGMA journal_mode = WAL")
                connection.execute(f"PRAGMA synchronous = {'FULL' if sync == 'full' else 'NORMAL'}")
                _begin(connection, path, description)
            yield Database(path, connection)


@contextmanager
def reading(path: str | os.PathLike[str]) -> Iterator[Database]:
    """The rows of a study to read, also while it goes on.

    Raises:
        FileError: there is no such file.
        ResultError: it is none of a study, or damaged.
    """
    path = Path(path_of(path, "file", error=ResultError))
    with _telling(path):
        if not path.is_file():
            raise FileError(path, "no such file")
    with _connected(path) as connection:
        with _telling(path):
            connection.execute("PRAGMA query_only = ON")
            _check_kind(connection, path)
        yield Database(path, connection)


@contextmanager
def _connected(path: Path) -> Iterator[sqlite3.Connection]:
    with _telling(path):
        connection = sqlite3.connect(path, timeout=30.0)
    try:
        yield connection
    finally:
        connection.close()


def _begin(connection: sqlite3.Connection, path: Path, description: Mapping[str, object]) -> None:
    """Make the tables of a new file; of another one see that it answers the same."""
    here = json.loads(json.dumps(description, allow_nan=False))
    empty = connection.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()[0] == 0
    if empty:
        with connection:
            connection.execute("BEGIN IMMEDIATE")
            connection.execute(f"PRAGMA application_id = {_ID}")
            for table in _TABLES:
                connection.execute(table)
            connection.execute("INSERT INTO study VALUES (?, ?)", (json.dumps(here), version("armdyn")))
        return
    _check_kind(connection, path)
    there = json.loads(connection.execute("SELECT asked FROM study").fetchone()[0])
    different = list(differences(there, here))
    if told := [one for one in different if not one.startswith("places ")] or different:  # the places are a checksum
        more = f"; and {len(told) - _SAID} more" if len(told) > _SAID else ""
        raise ResultError(
            f"{path}: its rows answer another study: {'; '.join(told[:_SAID])}{more}. Ask the same, or elsewhere"
        )


def _check_kind(connection: sqlite3.Connection, path: Path) -> None:
    if connection.execute("PRAGMA application_id").fetchone()[0] != _ID:
        raise ResultError(f"{path}: an SQLite file, but not one of a study")


def _take(handle: int, path: Path) -> None:
    """Take the lock, which goes with the process that has it and with its workers, however they end.

    Raises:
        ResultError: someone else keeps it.
    """
    until = time.monotonic() + _PATIENCE
    while True:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except OSError:
            if time.monotonic() > until:
                raise ResultError(f"{path}: another process is at this study") from None
            time.sleep(0.05)


@contextmanager
def _telling(path: Path) -> Iterator[None]:
    """What SQLite complains of, as armdyn says it."""
    try:
        yield
    except ArmdynError:
        raise
    except sqlite3.IntegrityError as error:
        raise ResultError(f"{path}: a case has a row already ({error})") from None
    except sqlite3.OperationalError as error:
        if "full" in str(error):
            raise DiskFullError(path) from None
        raise FileError(path, f"cannot be used ({error})") from None
    except OSError as error:
        raise FileError(path, f"cannot be used ({error.strerror})") from None
    except (sqlite3.DatabaseError, ValueError) as error:
        raise ResultError(f"{path}: no study's file, or damaged ({error})") from None
