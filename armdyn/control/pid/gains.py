"""A PID controller: its gains, what its output means, whether it saturates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.arguments import MOST_MEMBERS, expect, flag, number, one_of, whole
from armdyn.errors import ProblemError
from armdyn.models.values.per_joint import per_joint

Array = NDArray[np.float64]

Form = Literal["acceleration", "torque", "computed_torque"]
"""What the output u of eq. (27) is:

- "acceleration", eqs (22), (24): tau = D(q) u; Coriolis, gravity and friction torques are not compensated.
- "torque": tau = u, what a motor controller does.
- "computed_torque": tau = D(q) u + C(q, v) v + g(q), and the joints' friction; every joint becomes a triple
  integrator of its own.
"""
FORMS: tuple[Form, ...] = ("acceleration", "torque", "computed_torque")


@dataclass(frozen=True)
class PidGains:
    """Gains of u = kp e + ki ∫e dt + kd ė, eq. (27), with e = goal - position, eq. (26).

    Each is one number, or one per joint. Units below are of forms whose output is an acceleration of a
    revolute joint; with form "torque" read N m for 1/s².

    Attributes:
        kp: proportional [1/s²].
        ki: integral [1/s³].
        kd: derivative [1/s].
    """

    kp: float | tuple[float, ...]
    ki: float | tuple[float, ...]
    kd: float | tuple[float, ...]

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            object.__setattr__(self, name, _gain(name, value))
        counts = {len(value) for value in vars(self).values() if isinstance(value, tuple)}
        if len(counts) > 1:
            raise ProblemError(f"gains are for {' and '.join(map(str, sorted(counts)))} joints at once")

    def per_joint(self, nv: int) -> tuple[Array, Array, Array]:
        """kp, ki and kd, each of shape (nv,).

        Raises:
            ProblemError: the gains are for another number of joints.
        """
        nv = whole(nv, "nv", least=1, most=MOST_MEMBERS)
        for name, value in vars(self).items():
            if isinstance(value, tuple) and len(value) != nv:
                raise ProblemError(f"{name} has {len(value)} numbers; expected one, or {nv}, one per joint")
        kp, ki, kd = (np.broadcast_to(np.array(g, dtype=float), (nv,)) for g in (self.kp, self.ki, self.kd))
        return kp, ki, kd


def _gain(name: str, value: ArrayLike) -> float | tuple[float, ...]:
    array = per_joint(value, None, name, error=ProblemError, sign="not negative")
    return float(array) if array.ndim == 0 else tuple(map(float, array))


DEFAULT_GAINS = PidGains(kp=30.0, ki=50.0, kd=10.0)
"""Where none are given. With form "computed_torque" they put each joint's poles at -6.6 and -1.7 ± 2.2i 1/s, whatever
the arm. With the other forms it depends on the arm whether they suit, and `PidRun.max_real_eigenvalue` tells. The
paper has the same numbers for its arms, (32) to (34)."""


@dataclass(frozen=True)
class ContinuousPid:
    """u = kp e + ki ∫e dt + kd ė, eq. (27), and what becomes of u.

    Attributes:
        gains: see `PidGains`.
        form: see `Form`.
        saturate: clip tau at the robot's effort limits, and halt a joint's integral while its torque is
            clipped and its error asks for more (anti-windup by conditional integration, faded over one
            percent of the limit so that the equations stay continuous). None: for "torque" only.
        error_rate: what the controller takes for ė, as a multiple of the joint's velocity. It is -1 of
            e = goal - position, eq. (26), with a goal at rest; another number is another law.

    Raises:
        ProblemError: no gains, unknown form, saturate neither True nor False nor None, or error_rate not finite.
    """

    gains: PidGains = DEFAULT_GAINS
    form: Form = "acceleration"
    saturate: bool | None = None
    error_rate: float = -1.0

    def __post_init__(self) -> None:
        expect(self.gains, PidGains, "gains", "PidGains(kp=…, ki=…, kd=…)")
        one_of(self.form, FORMS, "form")
        if self.saturate is not None:
            flag(self.saturate, "saturate")
        number(self.error_rate, "error_rate")

    @property
    def saturates(self) -> bool:
        """Whether the torque is clipped at the effort limits."""
        return self.form == "torque" if self.saturate is None else self.saturate

    def coefficients(self, nv: int) -> tuple[Array, Array, Array]:
        """a, b and c of u = a e + b ∫e dt - c v, each of shape (nv,).

        Raises:
            ProblemError: the gains are for another number of joints.
        """
        kp, ki, kd = self.gains.per_joint(nv)
        return kp, ki, -self.error_rate * kd
