"""Piecewise polynomials through a motion's points: the cubics of a `Trajectory`, and those of ros2_control."""

from collections.abc import Iterator, Sequence

import numpy as np

from armdyn.arrays import Array, Index

INTERPOLATIONS = {1: "linear", 2: "cubic", 3: "quintic"}
"""ros2_control's joint_trajectory_controller goes from point to point by the lowest polynomial that has the given
derivatives at both: https://control.ros.org/rolling/doc/ros2_controllers/joint_trajectory_controller/doc/trajectory.html"""

PARTS = 64
"""Parts of a step between rows at which a table is judged: the peak of a velocity that rises from rest and falls to
rest within one step, as a parabola, is met to 2.5e-4 of it."""
_MOST = 400_000
"""Points at which a table is judged, beyond which its steps have fewer parts."""

KEPT = 1e-3
"""Excess over a limit, as a part of it, that is tolerated between rows: planners keep limits at samples."""


def between_rows(t: Array, derivatives: Sequence[Array]) -> tuple[Array, Array, Array]:
    """States along the polynomials that a controller runs between a table's rows: where its limits are judged.

    Args:
        t: times of the rows [s], shape (n,), increasing.
        derivatives: as of `interpolated`.

    Returns:
        Times, shape (m,), positions and velocities, each of shape (m, nv); the rows are among them.
    """
    parts = int(np.clip(_MOST // t.size, 4, PARTS))
    at = np.append((t[:-1, None] + np.diff(t)[:, None] * (np.arange(parts) / parts)).ravel(), t[-1])
    q, v = _orders(t, derivatives, at, 2)
    return at, q, v


def cubic(s: Array, h: Array, q: tuple[Array, Array], v: tuple[Array, Array]) -> tuple[Array, Array]:
    """Positions and velocities of the cubic that matches both ends of an interval.

    Hermite's, https://en.wikipedia.org/wiki/Cubic_Hermite_spline, in Horner form.

    Args:
        s: parts of the interval from 0 to 1, shape (..., 1).
        h: its length [s], likewise.
        q: positions at its begin and end, each of shape (..., nv).
        v: velocities there, likewise.
    """
    (q0, q1), (v0, v1) = q, v
    rise = q1 - q0
    c2, c3 = 3 * rise - h * (2 * v0 + v1), -2 * rise + h * (v0 + v1)
    return q0 + s * (h * v0 + s * (c2 + s * c3)), v0 + s * (2 * c2 + 3 * s * c3) / h


def cubic_accelerations(t: Array, q: Array, v: Array) -> tuple[Array, Array]:
    """Accelerations where each cubic between samples begins and ends, each of shape (n - 1, nv); linear in between.

    Args:
        t: times of the samples [s], shape (n,).
        q: positions, shape (n, nv).
        v: velocities, likewise.
    """
    h = np.diff(t)[:, None]
    rise, before, after = np.diff(q, axis=0) / h, v[:-1], v[1:]
    return (6 * rise - 4 * before - 2 * after) / h, (2 * before + 4 * after - 6 * rise) / h


def interpolated(t: Array, derivatives: Sequence[Array], at: Array) -> tuple[Array, Array, Array]:
    """Piecewise polynomial through points and their derivatives, and its first two derivatives.

    Args:
        t: times of the points [s], shape (n,), increasing.
        derivatives: values and derivatives at the points, each of shape (n, nv), in their order.
        at: times [s], shape (m,), from the first to the last.

    Returns:
        Values, first and second derivatives, each of shape (m, nv).
    """
    q, v, a = _orders(t, derivatives, at, 3)
    return q, v, a


def _orders(t: Array, derivatives: Sequence[Array], at: Array, count: int) -> Iterator[Array]:
    """Values and derivatives as of `interpolated`, `count` in all; an interval's polynomial is determined once."""
    m = len(derivatives)
    k, of = np.unique(np.clip(np.searchsorted(t, at, side="right") - 1, 0, t.size - 2), return_inverse=True)
    h = (t[k + 1] - t[k])[:, None]
    powers = np.arange(2 * m)
    # Coefficients over s = (t - t[k]) / h from the derivatives by s at s = 0 and s = 1.
    at_ends = np.array([_factors(powers, d) * s ** np.maximum(powers - d, 0) for s in (0.0, 1.0) for d in range(m)])
    data = [h**d * np.asarray(derivatives[d])[k + side] for side in (0, 1) for d in range(m)]
    coefficients = np.einsum("ij,jkl->ikl", np.linalg.inv(at_ends), np.array(data))
    s = ((at - t[k[of]]) / h[of, 0])[:, None]
    for d in range(count):
        found = np.zeros((at.size, coefficients.shape[2]))
        factors = _factors(powers, d)
        for p in reversed(powers[d:]):  # Horner's form
            found *= s
            found += (factors[p] * coefficients[p] / h**d)[of]
        yield found


def _factors(powers: Index, order: int) -> Array:
    """Factors p (p - 1) ... of the monomials' derivatives of some order, shape of `powers`."""
    return np.asarray(np.prod([np.ones(powers.size), *(np.maximum(powers - i, 0) for i in range(order))], axis=0))
