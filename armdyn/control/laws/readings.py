"""Inputs of a law: readings of the loop, the reference in the loop's own measurements, rows of a table."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from scipy.linalg import solve_banded

from armdyn.arguments import expect
from armdyn.arrays import Array
from armdyn.control.loop.loop import Loop, expect_loop
from armdyn.control.loop.references import Ticks
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot

_LEFT = 1e-6
"""Part of a filtered velocity that is left when the rows end."""
_MOST_MORE = 20_000
"""Rows that a slow filter may add."""


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

    Raises:
        ProblemError: columns of different lengths.
    """
    lengths = {name: len(column) for name, column in columns.items() if column.ndim == 2}
    count = max(lengths.values())
    if min(lengths.values()) < count:
        raise ProblemError(f"columns of a law have different numbers of rows: {lengths}")
    return np.hstack([np.broadcast_to(column, (count, column.shape[-1])) for column in columns.values()])


def reference_of(robot: Robot, ticks: Ticks, loop: Loop) -> Ticks:
    """Reference as a law reads it, in the loop's own measurements: the rows of a law, the last for good.

    A filtered velocity lags by some ticks. An arm that follows exactly is to have no velocity error, so the
    reference's velocity is led through the same filter, and rows are added until it has come to rest.

    Args:
        robot: that is to make the motion.
        ticks: the motion.
        loop: whose velocity filter and delay apply.

    Returns:
        q at the tick of reading; v as the loop measures it on an arm that follows exactly; a and tau as means over the
        tick on which the torque is felt.

    Raises:
        ProblemError: another number of joints; another rate than the loop's.
    """
    expect_loop(loop)
    expect(ticks, Ticks, "ticks", "Ticks.of(robot, reference, loop.rate)")
    if ticks.q.shape[1] != robot.nv:
        raise ProblemError(f"the reference has {ticks.q.shape[1]} joints; {robot.name} has {robot.nv}")
    if ticks.rate != loop.rate:
        raise ProblemError(f"the reference has {ticks.rate:g} ticks a second; the loop has {loop.rate:g}")
    more = _ticks_to_rest(loop) if loop.velocity == "filtered" else 0
    q, v, a, tau = (extended(rows, more) for rows in (ticks.q, ticks.v, ticks.a, ticks.tau))
    seen = _filtered(q, v[0], loop) if loop.velocity == "filtered" else v
    return replace(ticks, q=q, v=seen, a=_acting(a, loop), tau=_acting(tau, loop))


def extended(rows: Array, more: int) -> Array:
    """Append repetitions of the last row."""
    return np.vstack([rows, np.repeat(rows[-1:], more, axis=0)])


def _ticks_to_rest(loop: Loop) -> int:
    """Number of ticks until the velocity filter's output has decayed to a millionth."""
    if loop.pole <= 0:
        return 0
    return int(min(np.ceil(np.log(_LEFT) / np.log(min(loop.pole, 1 - 1e-9))), _MOST_MORE))


def _filtered(q: Array, start: Array, loop: Loop) -> Array:
    """Low-pass difference quotient of positions, initialised with the velocity at the start.

    yₖ - p yₖ₋₁ = (1 - p) dₖ: a system of two bands. (scipy.signal, which has filters, takes half a second to import.)
    """
    rate, pole = loop.rate, loop.pole
    right = (1 - pole) * np.diff(q, axis=0, prepend=(q[0] - start / rate)[None]) * rate
    right[0] += pole * start
    bands = np.repeat([[1.0], [-pole]], len(q), axis=1)
    return np.asarray(solve_banded((1, 0), bands, right))


def _acting(means: Array, loop: Loop) -> Array:
    """Shift means over each tick to the tick on which the torque decided at a row acts.

    A continuous loop takes rows between ticks on a line: a row is then the mean about the time of the row.
    """
    if loop.hold == "continuous":
        return np.vstack([means[:1], (means[1:] + means[:-1]) / 2])
    return np.asarray(means[np.minimum(np.arange(len(means)) + loop.delay, len(means) - 1)])
