"""Rows of a study as one table: CSV, or Parquet with pyarrow."""

from __future__ import annotations

import csv
import json
import os
from itertools import islice
from pathlib import Path
from typing import Any

from armdyn.errors import MissingPackageError
from armdyn.files import writing_whole
from armdyn.studies.rows import RowStore, StudyRow, read_rows

_FIRST = ("k", "status", "good")
_LAST = ("seconds", "attempts", "worker", "begun_from", "message")
_PIECE = 10_000
"""Rows that are in memory at once."""


def flat(row: StudyRow) -> dict[str, Any]:
    """The row with a column for each setting and each fact; a fact of a setting's name is called fact_NAME.

    Lists and tables are texts in JSON.
    """
    facts = {name if name not in row.settings else f"fact_{name}": value for name, value in row.facts.items()}
    first, last = ({name: getattr(row, name) for name in names} for names in (_FIRST, _LAST))
    found = {**first, **row.settings, **facts, **last}
    return {name: json.dumps(value) if isinstance(value, list | dict) else value for name, value in found.items()}


def study_table(file: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """All rows of a study's file as flat dictionaries, ready for `pandas.DataFrame`.

    Raises:
        FileError: there is no such file.
        ResultError: it is no study's.
    """
    with read_rows(file) as rows:
        return [flat(row) for row in rows.rows()]


def write_csv(rows: RowStore, path: str | os.PathLike[str]) -> Path:
    """The rows as CSV, with every column that any of them has; whole or not at all.

    Raises:
        OSError: the folder cannot be written.
    """
    columns = _columns(rows)
    with writing_whole(path) as scratch, scratch.open("w", newline="") as file:
        table = csv.DictWriter(file, list(columns), lineterminator="\n")
        table.writeheader()
        table.writerows(flat(row) for row in rows.rows())
    return Path(path)


def write_parquet(rows: RowStore, path: str | os.PathLike[str]) -> Path:
    """The rows as Parquet, a group of ten thousand after the other; whole or not at all.

    Raises:
        MissingPackageError: pyarrow is not installed.
        OSError: the folder cannot be written.
    """
    try:
        import pyarrow as arrow
        from pyarrow import parquet
    except ImportError:
        raise MissingPackageError("pyarrow", "Parquet", "CSV needs nothing") from None
    schema = arrow.schema([(name, _arrow_type(arrow, kinds)) for name, kinds in _columns(rows).items()])
    with writing_whole(path) as scratch, parquet.ParquetWriter(scratch, schema) as file:
        waiting = rows.rows()
        while piece := [flat(row) for row in islice(waiting, _PIECE)]:
            file.write_table(arrow.Table.from_pylist(piece, schema=schema))
    return Path(path)


def _columns(rows: RowStore) -> dict[str, set[type]]:
    """Columns of all rows, settings first, with the types of their values."""
    settings, kinds = dict[str, None](), dict[str, set[type]]()
    for row in rows.rows():
        settings |= dict.fromkeys(row.settings)
        for name, value in flat(row).items():
            kinds.setdefault(name, set()).update([] if value is None else [type(value)])
    named = [*_FIRST, *settings]
    ordered = [*named, *(name for name in kinds if name not in named and name not in _LAST), *_LAST]
    return {name: kinds.get(name, set()) for name in ordered}


def _arrow_type(arrow: Any, kinds: set[type]) -> Any:
    if kinds == {bool}:
        return arrow.bool_()
    if kinds == {int}:
        return arrow.int64()
    return arrow.float64() if kinds <= {int, float} else arrow.string()  # of no value at all, too
