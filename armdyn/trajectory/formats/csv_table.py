"""Tables of comma-separated values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from armdyn.errors import MissingPackageError
from armdyn.files import csv_text

if TYPE_CHECKING:
    import numpy as np
    from pandas import DataFrame

    from armdyn.trajectory.samples import Samples

PIECE_COLUMNS = ("piece", "event", "load [kg]")
"""Columns of motions of several pieces: names and events are text, and a load may be empty."""

UNITS = {"q": "rad or m", "v": "rad/s or m/s", "a": "rad/s^2 or m/s^2", "tau": "N m or N"}
"""Units of the columns, by quantity."""


@dataclass(frozen=True)
class CsvTable:
    """RFC 4180, but for the ends of lines, which are Unix's; numbers read back to the last bit."""

    name: ClassVar[str] = "csv"
    suffix: ClassVar[str] = ".csv"
    summary: ClassVar[str] = "a table"

    def text(self, samples: Samples) -> str:
        """A head with names and units, a row per stamp."""
        rows = zip(_rows(samples).tolist(), _piece_rows(samples), strict=True)
        return csv_text([columns(samples), *([*row, *more] for row, more in rows)])


def columns(samples: Samples) -> list[str]:
    """Head of the table: quantity, joint and unit."""
    joints = samples.joint_names or [f"joint{i + 1}" for i in range(samples.q.shape[1])]
    numbers = ["t [s]", *(f"{what}_{joint} [{unit}]" for what, unit in UNITS.items() for joint in joints)]
    return [*numbers, *PIECE_COLUMNS] if samples.pieces else numbers


def dataframe(samples: Samples) -> DataFrame:
    """The table as a pandas DataFrame."""
    try:
        import pandas
    except ImportError:
        raise MissingPackageError("pandas", "to_dataframe", "to_csv does without") from None
    head = columns(samples)
    table = pandas.DataFrame(_rows(samples), columns=head[: len(head) - len(PIECE_COLUMNS)] if samples.pieces else head)
    for name, column in zip(PIECE_COLUMNS, zip(*_piece_rows(samples), strict=True), strict=False):
        table[name] = column
    return table


def _rows(samples: Samples) -> np.ndarray[Any, np.dtype[np.float64]]:
    import numpy as np

    return np.column_stack([samples.t, *(getattr(samples, what) for what in UNITS)])


def _piece_rows(samples: Samples) -> list[tuple[str | float | None, ...]]:
    """`PIECE_COLUMNS` of each row; of a motion without pieces nothing."""
    rows: list[tuple[str | float | None, ...]] = [()] * samples.t.size
    ends = [*samples.piece_rows[1:], len(rows)]
    for piece, first, end in zip(samples.pieces, samples.piece_rows, ends, strict=bool(samples.pieces)):
        mass = None if piece.load is None else piece.load.mass
        rows[first:end] = [(piece.name, piece.event if k == first else "", mass) for k in range(first, end)]
    return rows
