"""Tables of comma-separated values."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from armdyn.errors import MissingPackageError

if TYPE_CHECKING:
    import numpy as np
    from pandas import DataFrame

    from armdyn.trajectory.samples import Samples

_UNITS = {"q": "rad or m", "v": "rad/s or m/s", "a": "rad/s^2 or m/s^2", "tau": "N m or N"}


@dataclass(frozen=True)
class CsvTable:
    """RFC 4180, but for the ends of lines, which are Unix's; numbers read back to the last bit."""

    name: ClassVar[str] = "csv"
    suffix: ClassVar[str] = ".csv"
    summary: ClassVar[str] = "a table"

    def text(self, samples: Samples) -> str:
        """A head with names and units, a row per stamp."""
        content = io.StringIO(newline="")
        writer = csv.writer(content, lineterminator="\n")
        writer.writerow(columns(samples))
        writer.writerows(_rows(samples).tolist())  # Python's floats are written with as many digits as they need
        return content.getvalue()


def columns(samples: Samples) -> list[str]:
    """Head of the table: quantity, joint and unit."""
    joints = samples.joint_names or [f"joint{i + 1}" for i in range(samples.q.shape[1])]
    return ["t [s]", *(f"{what}_{joint} [{unit}]" for what, unit in _UNITS.items() for joint in joints)]


def dataframe(samples: Samples) -> DataFrame:
    """The table as a pandas DataFrame."""
    try:
        import pandas
    except ImportError:
        raise MissingPackageError("pandas", "to_dataframe", "to_csv does without") from None
    return pandas.DataFrame(_rows(samples), columns=columns(samples))


def _rows(samples: Samples) -> np.ndarray[Any, np.dtype[np.float64]]:
    import numpy as np

    return np.column_stack([samples.t, *(getattr(samples, what) for what in _UNITS)])
