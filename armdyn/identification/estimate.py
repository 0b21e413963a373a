"""The identified arm, and what the log says of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.arguments import numbers
from armdyn.errors import ProblemError
from armdyn.identification.equations import Equations
from armdyn.identification.fitting import Fit
from armdyn.identification.model import rigid_torques
from armdyn.models.robots.robot import Robot
from armdyn.reprs import brief

Array = NDArray[np.float64]

NORMAL_95 = 1.959964
"""95 % of a normal distribution lie within so many standard deviations."""
SEEN = 0.9
"""Part of the prior's variance that the log has to take away for a number to count as measured."""


@dataclass(frozen=True, kw_only=True)
class Estimated:
    """One number of the arm.

    Attributes:
        name: such as "mass of panda_joint4".
        unit: its SI unit.
        prior: before the log.
        value: the estimate.
        deviation: its standard deviation; 95 % intervals are 1.96 of it to either side.
        seen: part of the prior's variance that the log takes away, 0 to 1.
    """

    name: str
    unit: str
    prior: float
    value: float
    deviation: float
    seen: float

    @property
    def measured(self) -> bool:
        """Whether the log decides the number, not the prior."""
        return self.seen >= SEEN

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval."""
        return self.value - NORMAL_95 * self.deviation, self.value + NORMAL_95 * self.deviation


@dataclass(frozen=True, kw_only=True)
class Judged:
    """Errors of the torques, as means over `IdentifyOptions.step`, on the end of the logs, by a fit of their beginning.

    Attributes:
        measured: root mean square of the measured torques [N m or N], shape (nv,).
        before: of the given robot's torque errors, shape (nv,).
        after: of the fit's, shape (nv,).
    """

    measured: Array
    before: Array
    after: Array


@brief
@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """Result of `identify`.

    Attributes:
        robot: the arm with the identified inertias, payload or friction.
        offset: of the measured torques, which no robot has [N m or N], shape (nv,).
        parameters: the numbers and their confidence.
        judged: torque errors on data that were held out; None: none were.
        noise: standard deviation of the torque residuals [N m or N], shape (nv,).
        weight: of the divergence from the prior, chosen by cross-validation.
        combinations: number of combinations of the unknowns that any motion of this arm can tell.
        measured_combinations: number of those that this log tells better than the prior.
        condition: condition number of the regressor on those combinations, unknowns relative to the prior.
        unmoved: joints that hardly move in the logs.
    """

    robot: Robot
    offset: Array
    parameters: tuple[Estimated, ...]
    judged: Judged | None
    noise: Array
    weight: float
    combinations: int
    measured_combinations: int
    condition: float
    unmoved: tuple[str, ...]
    equations: Equations = field(repr=False)
    fit: Fit = field(repr=False)

    def _words(self) -> list[str]:
        told = f"{self.measured_combinations} of {self.combinations} combinations measured"
        return [self.robot.name, told, f"condition {self.condition:.3g}"]

    def torques(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Torques as they would be measured, friction and offset included [N m or N], shape (nv,) or (n, nv).

        Args:
            q: positions [rad or m], shape (nv,) or (n, nv).
            v: velocities [rad/s or m/s], likewise.
            a: accelerations [rad/s² or m/s²], likewise.

        Raises:
            ProblemError: shapes do not fit.
        """
        states, shape = self._states(q, v, a)
        found = rigid_torques(self.robot, *states) + self.robot.friction.torque(states[1]) + self.offset
        return np.asarray(found.reshape(shape))

    def torque_deviation(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Standard deviation of the predicted torques without the sensors' noise; else see `torques`."""
        states, shape = self._states(q, v, a)
        columns, _ = self.equations.at(*states, every=1)
        variance = np.einsum("njp,pq,njq->nj", columns, self.fit.covariance, columns)
        return np.asarray(np.sqrt(variance).reshape(shape))

    def _states(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> tuple[tuple[Array, Array, Array], tuple[int, ...]]:
        given = [numbers(one, name) for one, name in ((q, "q"), (v, "v"), (a, "a"))]
        shape = given[0].shape
        if any(one.shape != shape for one in given) or shape[-1:] != (self.robot.nv,) or len(shape) > 2:
            raise ProblemError(
                f"q, v and a have shapes {', '.join(str(one.shape) for one in given)}; they are ({self.robot.nv},) or "
                f"(n, {self.robot.nv})"
            )
        rows = [one.reshape(-1, self.robot.nv) for one in given]
        return (rows[0], rows[1], rows[2]), shape
