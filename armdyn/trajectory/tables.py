"""Checks of a table of samples: times increase, and columns are derivatives of each other."""

import warnings
from collections.abc import Callable, Sequence

import numpy as np

from armdyn.arrays import Array
from armdyn.errors import ArmdynWarning, TrajectoryError

_COUNTS = {2: "two", 3: "three"}

_BLOCKS = 100
"""Most blocks over which derivatives are summed: differences of neighbouring samples of a log are noise."""
_ROWS = 5
"""Rows from which a factor is known: derivatives at fewer may all be small, or zero, as at stops."""
_ALIKE = 0.95
"""Cosine between changes and summed derivatives, of all joints, from which they differ by a factor alone."""
_NEAR = 0.2
"""Relative distance of a factor from that of a unit: sums over a coarse table are rough."""
_FINE_ROWS, _FINE, _UNLIKE = 12, 0.05, 0.5
"""Rows, and error of a sum as a part of it, as every second row alone shows it, from which a table is fine; error that
is then a mistake, as another joint's velocities."""
_MOVED = 0.1
"""Change of a joint, as a part of the largest one of all joints, below which its derivatives may be noise."""
_SLOW = 0.01
"""Speed [rad/s or m/s] of a table whose times may be milliseconds: minutes for a joint's range."""

_FACTORS = {
    1e3: "is t in ms? (a table's head says so by 't [ms]')",
    1e6: "is t in µs? (a table's head says so by 't [us]')",
    1e9: "is t in ns? (a table's head says so by 't [ns]')",
    180 / np.pi: "are {} degrees? (a table's head says so by '{}1 [deg/s]')",
    30 / np.pi: "are {} revolutions per minute?",
    np.pi / 180: "are {2} degrees? (a table's head says so by '{3}1 [deg]')",
    1e-3: "are {2} mm, or {0} per ms?",
}
"""Likely reason for a derivative that is a multiple of the change, by the multiple."""


def check_times(
    t: Array, rows: Sequence[Array] = (), called: Callable[[int], str] = "t[{}]".format, least: int = 2
) -> None:
    """Refuse times that do not increase.

    Args:
        t: times [s], shape (n,).
        rows: all other arrays of the table, each of shape (n, …): where a time repeats, the message says whether the
            two rows are equal.
        called: name of a sample by its index, from 0 on, as the user counts it.
        least: least number of samples, 2 or 3.

    Raises:
        TrajectoryError: there are fewer samples, or a time is not above the one before; the message names both.
    """
    if t.ndim != 1 or t.size < least:
        raise TrajectoryError(f"t must be at least {_COUNTS[least]} increasing times [s], got shape {t.shape}")
    if not np.any(late := ~(np.diff(t) > 0)):
        return
    k = int(np.argmax(late))
    equal = rows and t[k] == t[k + 1] and all(len(one) == t.size and np.array_equal(one[k], one[k + 1]) for one in rows)
    remedy = "both rows are equal: one of them may be removed" if equal else "times [s] must increase"
    raise TrajectoryError(
        f"{called(k + 1)}: t = {t[k + 1]:.9g} s does not rise above the {t[k]:.9g} s of {called(k)}; {remedy}"
    )


def check_columns(
    t: Array, columns: tuple[Array, Array | None, Array | None], joints: Sequence[str], name: str
) -> None:
    """Refuse a table whose columns contradict each other by a factor, as in other units; warn of other contradictions.

    Changes of each column over blocks of rows are compared with the sums of its derivative (trapezoidal rule). Coarse
    tables of fast motions, and logs with noise, pass.

    Args:
        t: times [s], shape (n,), increasing.
        columns: positions, velocities and accelerations, each of shape (n, nv); None: missing. Of another shape,
            or not finite: not compared.
        joints: names of the joints.
        name: of the table, for messages.

    Raises:
        TrajectoryError: a column is not the derivative of another one, but a multiple of it; the message names the
            joint and the likely unit.

    Warns:
        ArmdynWarning: all velocities (accelerations) are zero along a change, or do not fit it.
    """
    shape = (t.size, len(joints))
    if any(one is not None and (one.shape != shape or not np.all(np.isfinite(one))) for one in columns):
        return  # refused where the motion is made
    q, v, a = columns
    steps, fastest = np.diff(t), np.max(np.abs(np.diff(q, axis=0) / np.diff(t)[:, None]))
    if v is None and 0 < fastest < _SLOW and np.allclose(steps, np.round(steps), rtol=1e-9, atol=0):
        _warn(f"{name}: no joint is faster than {fastest:.2g} rad/s or m/s in {t[-1] - t[0]:g} s: is t in ms?")
    if v is not None:
        change, sums = _compare(t, q, v, name, "positions", "velocities")
        for j in _misfits(t, v, change, sums):
            _warn(f"{name}: the velocities of {joints[j]} do not fit its positions")
    elif a is not None and t.size > 2:
        v = np.gradient(q, t, axis=0)
    if v is not None and a is not None:
        _compare(t, v, a, name, "velocities", "accelerations")


def _compare(t: Array, values: Array, rates: Array, name: str, what: str, called: str) -> tuple[Array, Array]:
    """Changes of values over blocks of rows, and the sums of their rates, each of shape (blocks, nv).

    Raises:
        TrajectoryError: the sums are the changes, in another unit.

    Warns:
        ArmdynWarning: all rates are zero.
    """
    at = np.append(np.arange(0, t.size - 1, max(1, t.size // _BLOCKS)), t.size - 1)
    change = np.diff(values[at], axis=0)
    summed = np.diff(_integrals(rates, t)[at], axis=0)
    if not np.any(rates) and np.any(change) and t.size >= (3 if what == "positions" else _ROWS):
        _warn(
            f"{name}: all {called} are 0 although {what} change, as of a motion that stops at each of {t.size} points; "
            "leave these columns out if they are unknown"
        )
    common, size = float(np.sum(change * summed)), float(np.linalg.norm(change))
    if t.size >= _ROWS and common > _ALIKE * size * np.linalg.norm(summed):
        factor = common / size**2
        for known, hint in _FACTORS.items():
            if abs(factor / known - 1) < _NEAR:
                why = hint.format(called, called[0], what, "q" if what == "positions" else "v")
                raise TrajectoryError(f"{name}: {called} are {factor:.4g} times the derivative of {what}: {why}")
    return change, summed


def _integrals(rates: Array, t: Array) -> Array:
    """Integrals up to each row by the trapezoidal rule; SciPy's function, which would load it for every robot."""
    steps = np.diff(t)[:, None] * (rates[1:] + rates[:-1]) / 2
    return np.vstack([0 * rates[:1], np.cumsum(steps, axis=0)])


def _misfits(t: Array, rates: Array, change: Array, summed: Array) -> list[int]:
    """Indices of joints whose rates, in a fine table, do not sum up to the changes."""
    sums, halved = (_integrals(rates[::k], t[::k]) for k in (1, 2))
    fine = np.ptp(sums[::2] - halved, axis=0) <= _FINE * np.ptp(sums, axis=0)
    moved, sizes = np.ptp(np.cumsum(change, axis=0), axis=0), np.linalg.norm([change, summed], axis=1).max(axis=0)
    apart = np.linalg.norm(change - summed, axis=0) > _UNLIKE * sizes
    wrong = fine & apart & np.any(rates) & (moved > _MOVED * np.max(moved)) & (t.size >= _FINE_ROWS)
    return np.flatnonzero(wrong).tolist()


def _warn(message: str) -> None:
    warnings.warn(message, ArmdynWarning, stacklevel=5)
