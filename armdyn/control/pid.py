"""The gains of a PID controller, and what its output may mean."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.errors import ProblemError

Array = NDArray[np.float64]

Form = Literal["acceleration", "torque", "computed_torque"]
"""What the output u of eq. (27) is:

- "acceleration", eqs (22), (24): tau = D(q) u; Coriolis, gravity and friction torques are not compensated.
- "torque": tau = u, what a motor controller does.
- "computed_torque": tau = D(q) u + C(q, v) v + g(q), and the joints' friction; every joint becomes a triple
  integrator of its own.
"""
FORMS: tuple[Form, ...] = ("acceleration", "torque", "computed_torque")

DerivativeSign = Literal["corrected", "printed"]
"""Sign of k_D θ̇: "corrected" is -k_D θ̇, which (27) says as ė = -θ̇; "printed" is +k_D θ̇ of (28)-(30)."""
DERIVATIVE_SIGNS: tuple[DerivativeSign, ...] = ("corrected", "printed")


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
        for name, value in vars(self).items():
            if isinstance(value, tuple) and len(value) != nv:
                raise ProblemError(f"{name} has {len(value)} numbers; expected one, or {nv}, one per joint")
        kp, ki, kd = (np.broadcast_to(np.array(g, dtype=float), (nv,)) for g in (self.kp, self.ki, self.kd))
        return kp, ki, kd


def _gain(name: str, value: ArrayLike) -> float | tuple[float, ...]:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ProblemError(f"{name} is {value!r}; expected a number, or one per joint") from None
    if array.ndim > 1 or array.size == 0:
        raise ProblemError(f"{name} has shape {array.shape}; expected a number, or one per joint")
    if not np.all(np.isfinite(array) & (array >= 0)):
        raise ProblemError(f"{name} is {value!r}; gains must be finite and not negative")
    return float(array) if array.ndim == 0 else tuple(map(float, array))


PAPER_GAINS = PidGains(kp=30.0, ki=50.0, kd=10.0)
"""Eqs (32)-(34): the same for every joint of R, RR and RRR."""
