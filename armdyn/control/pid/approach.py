"""A closed-loop motion seen from its goal: when it arrives there, and how far it overshoots."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import OdeSolution
from scipy.optimize import brentq

from armdyn.control.pid.arrival import Arrival

Array = NDArray[np.float64]

_SUBSAMPLES = 4
"""Points per integrator step that are searched for crossings; a step is a small part of any oscillation."""


class Approach:
    """A motion seen from its goal: when it enters the tolerance, how far it overshoots."""

    def __init__(self, motion: OdeSolution, goal: Array):
        self._motion, self._goal = motion, goal
        fractions = np.arange(_SUBSAMPLES) / _SUBSAMPLES
        inner = motion.ts[:-1, None] + np.diff(motion.ts)[:, None] * fractions
        self._t = np.append(inner.ravel(), motion.t_max)
        _, q, self._v = np.split(motion(self._t), 3)
        self._error = goal[:, None] - q

    @property
    def final_error(self) -> float:
        """Largest |eᵢ| at the end [rad or m]."""
        return float(np.abs(self._error[:, -1]).max())

    def time(self, arrival: Arrival) -> float | None:
        """When it arrives [s], on the continuous solution; None if it does not."""
        rule, tolerance = arrival.rule, arrival.tolerance
        if rule == "first_crossing":
            before = np.sign(self._error[0]) == np.sign(self._error[0, 0])
            if before.all():
                return 0.0 if self._error[0, 0] == 0 else None
            return self._root(int(np.argmin(before)), lambda error: float(error[0]))
        joints = slice(None) if rule == "last_entry_all_joints" else slice(0, 1)
        outside = np.abs(self._error[joints]).max(axis=0) > tolerance
        if outside[-1]:
            return None
        if not outside.any():
            return 0.0
        inside = int(np.flatnonzero(outside)[-1]) + 1
        return self._root(inside, lambda error: float(np.abs(error[joints]).max()) - tolerance)

    def _root(self, k: int, of_error: Callable[[Array], float]) -> float:
        """Where a function of the error, shape (nv,), changes sign between points k - 1 and k [s]."""

        def value(t: float) -> float:
            return of_error(self._goal - np.split(self._motion(t), 3)[1])

        return float(brentq(value, self._t[k - 1], self._t[k], xtol=1e-12))

    def overshoot(self) -> Array:
        """Farthest past the goal, seen from the start [rad or m], shape (nv,)."""
        beyond = -np.sign(self._error[:, :1]) * self._error
        past = np.where(self._error[:, :1] == 0, np.abs(self._error), beyond)
        return np.array([self._peak(joint, past[joint]) for joint in range(self._goal.size)])

    def _peak(self, joint: int, past: Array) -> float:
        """Largest of a joint's values past the goal [rad or m], at rest between the points if it is there."""
        k = int(past.argmax())
        if past[k] <= 0:
            return 0.0
        a, b = max(k - 1, 0), min(k + 1, self._t.size - 1)
        if self._v[joint, a] * self._v[joint, b] >= 0:
            return float(past[k])
        nv = self._goal.size
        rest = brentq(lambda t: self._motion(t)[2 * nv + joint], self._t[a], self._t[b])
        return max(float(past[k]), float(abs(self._motion(rest)[nv + joint] - self._goal[joint])))
