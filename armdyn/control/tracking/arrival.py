"""Arrival of a motion at its goal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from armdyn.arguments import Checked, checked, number, one_of

if TYPE_CHECKING:  # the command line's help names the rules, without numpy
    from armdyn.arrays import Array
    from armdyn.trajectory import Trajectory

ArrivalRule = Literal["last_entry_first_joint", "last_entry_all_joints", "first_crossing"]
"""When the arm is "in the final position":

- "last_entry_all_joints": when the largest |eᵢ| enters the tolerance to stay.
- "last_entry_first_joint": when |e₁| enters the tolerance to stay, wherever the other joints are.
- "first_crossing": when e₁ first is zero, however far joint 1 then overshoots.
"""
ARRIVAL_RULES: tuple[ArrivalRule, ...] = ("last_entry_all_joints", "last_entry_first_joint", "first_crossing")


@dataclass(frozen=True)
class Arrival(Checked):
    """Definition of arrival in the final position.

    Attributes:
        rule: see `ArrivalRule`.
        tolerance: of a joint's error [rad or m].

    Raises:
        ProblemError: unknown rule, or tolerance not positive.
    """

    rule: ArrivalRule = checked(one_of, "last_entry_all_joints", known=ARRIVAL_RULES, name="arrival_rule")
    tolerance: float = checked(number, 0.005, unit="rad or m", sign="positive", name="arrival_tolerance")

    def time(self, motion: Trajectory, goal: Array) -> float | None:
        """Arrival time of a motion [s], exact for the cubics between its samples; None if the motion does not arrive.

        Args:
            motion: the motion, from t = 0.
            goal: [rad or m], shape (nv,).
        """
        return self.first(motion.t, self.outside(goal - motion.q), lambda t: self.outside(goal - motion(t).q)[0])

    def first(self, t: Array, samples: Array, outside: Callable[[float], float]) -> float | None:
        """Time of arrival [s]; None: never.

        Args:
            t: times [s], shape (n,).
            samples: `outside` at these times, shape (n,).
            outside: the same of one time [s].
        """
        import numpy as np
        from scipy.optimize import brentq

        if self.rule == "first_crossing":
            crossed = np.sign(samples) != np.sign(samples[0])
            k = 0 if samples[0] == 0 else int(np.argmax(crossed)) if crossed.any() else samples.size
        else:
            k = int(np.flatnonzero(samples > 0).max(initial=-1)) + 1
        if k in (0, samples.size):
            return None if k else 0.0
        return float(brentq(outside, t[k - 1], t[k], xtol=1e-12))

    def outside(self, error: Array) -> Array:
        """Signed distance of errors, shape (n, nv) or (nv,), from the tolerance of arrival [rad or m], shape (n,).

        It is e₁ for the rule "first_crossing", else the largest |eᵢ| less the tolerance.
        """
        import numpy as np

        error = np.atleast_2d(error)
        if self.rule == "first_crossing":
            return np.asarray(error[:, 0])
        joints = slice(None) if self.rule == "last_entry_all_joints" else slice(0, 1)
        return np.asarray(np.abs(error[:, joints]).max(axis=1) - self.tolerance)
