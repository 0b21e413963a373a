"""Symbolic inputs of a law and the table of its rows, by named columns."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Readings:
    """The arguments of a law as casadi columns.

    Attributes:
        q: readings of position [rad or m], shape (nv, 1).
        v: readings of velocity [rad/s or m/s], shape (nv, 1).
        integral: of the error [rad s or m s], shape (nv, 1).
        pending: torques decided and not yet applied, the next first [N m or N], shape (delay nv, 1).
        row: columns of a row, by name.
    """

    q: ca.SX
    v: ca.SX
    integral: ca.SX
    pending: ca.SX
    row: Mapping[str, ca.SX]


def law_function(nv: int, delay: int, columns: Mapping[str, Array], torque: Callable[[Readings], ca.SX]) -> ca.Function:
    """A law's Function of (q, v, integral, pending, row).

    Numbers of the rows are not in it, so that others need no new machine code.

    Args:
        nv: number of joints.
        delay: ticks from a reading to its torque.
        columns: see `table`.
        torque: of the readings, the torque before clipping [N m or N], shape (nv, 1).
    """
    names = {"q": nv, "v": nv, "integral": nv, "pending": delay * nv}
    readings = {name: ca.SX.sym(name, size) for name, size in names.items()}
    row = {name: ca.SX.sym(name, np.shape(column)[-1]) for name, column in columns.items()}
    arguments = [*readings.values(), ca.vertcat(*row.values())]
    return ca.Function("law", arguments, [torque(Readings(**readings, row=row))], [*readings, "row"], ["tau"])


def table(columns: Mapping[str, Array]) -> Array:
    """Rows of named columns side by side, shape (n, m).

    Args:
        columns: each of shape (n, width), or (width,) where it is the same in all rows; one at least of the former.
    """
    count = max(len(column) for column in columns.values() if column.ndim == 2)
    return np.hstack([np.broadcast_to(column, (count, column.shape[-1])) for column in columns.values()])
