"""Result of an identification: the arm, its parameters with confidence, and torque errors."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import MOST_MEMBERS, number, numbers, whole
from armdyn.arrays import Array
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.errors import ProblemError
from armdyn.identification.equations import Equations
from armdyn.identification.fitting import Fit, Normal, minimise
from armdyn.models.robots.robot import Robot
from armdyn.reprs import brief

NORMAL_95 = 1.959964
"""Standard deviations within which 95 % of a normal distribution lie."""
SEEN = 0.9
"""Least reduction of the prior's variance for a parameter to count as measured."""
_BARRIER = 1e-3
"""Weight of the divergence that keeps likely arms physical: of the prior at its own width, which the region has, it
is a thousandth."""


@dataclass(frozen=True)
class Estimated:
    """One parameter of the arm.

    Attributes:
        name: such as "mass of panda_joint4".
        unit: its SI unit.
        prior: of the given robot.
        value: the estimate.
        deviation: its standard deviation; 95 % intervals are 1.96 of it to either side. Of what the log does not
            measure the prior's is 100 % of a number at least.
        seen: reduction of the prior's variance by the log, 0 to 1; that variance is the one of the fit, or of 100 %
            where the fit has a larger one.
    """

    name: str
    unit: str
    prior: float
    value: float
    deviation: float
    seen: float

    @property
    def measured(self) -> bool:
        """Whether the log rather than the prior determines the parameter."""
        return self.seen >= SEEN

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval."""
        return self.value - NORMAL_95 * self.deviation, self.value + NORMAL_95 * self.deviation


@dataclass(frozen=True, kw_only=True, eq=False)
class Judged:
    """Torques on the end of the logs, from a fit of their beginning, as means over `IdentifyOptions.step`.

    Attributes:
        t: times from the start of the held-out data, of several logs one after the other [s], shape (n,).
        torque: as measured [N m or N], shape (n, nv).
        prior: predicted by the given robot, likewise.
        fitted: predicted by the fit, likewise.
    """

    t: Array
    torque: Array = field(repr=False)
    prior: Array = field(repr=False)
    fitted: Array = field(repr=False)

    @property
    def measured(self) -> Array:
        """Root mean square of the measured torques [N m or N], shape (nv,)."""
        return _rms(self.torque)

    @property
    def before(self) -> Array:
        """Root mean square of the torque errors of the robot as given [N m or N], shape (nv,)."""
        return _rms(self.torque - self.prior)

    @property
    def after(self) -> Array:
        """Root mean square of the fit's torque errors [N m or N], shape (nv,)."""
        return _rms(self.torque - self.fitted)


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


@brief
@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """Result of `identify`.

    Attributes:
        robot: the arm with the identified inertias, payload or friction.
        offset: of the measured torques, which no robot has [N m or N], shape (nv,).
        parameters: the parameters and their confidence.
        judged: torque errors on held-out data; None: no data was held out.
        noise: standard deviation of the torque residuals [N m or N], shape (nv,).
        weight: of the divergence from the prior, chosen by cross-validation.
        combinations: number of combinations of the unknowns that are identifiable by motions of this arm.
        measured_combinations: number of those that this log measures better than the prior.
        condition: condition number of the regressor on those combinations, unknowns relative to the prior.
        unmoved: joints that hardly move in the logs.
        unfit: why the estimate should not be used, in a sentence; empty: it may be.
        warnings: sentences on joints whose residuals depend on torque, direction, speed, position or reversals, and
            where inertias that are taken from the robot contradict the logs.
        covariance: of the unknowns, prior's own width and patterns included, shape (p, p): that of all deviations.
        equations: the fitted equations, with their unknowns.
        fit: their fit.
    """

    robot: Robot
    offset: Array
    parameters: tuple[Estimated, ...]
    judged: Judged | None = None
    noise: Array
    weight: float
    combinations: int
    measured_combinations: int
    condition: float
    unmoved: tuple[str, ...] = ()
    unfit: str = ""
    warnings: tuple[str, ...] = ()
    covariance: Array = field(repr=False)
    equations: Equations = field(repr=False)
    fit: Fit = field(repr=False)

    def _repr_parts(self) -> list[str]:
        measured = f"{self.measured_combinations} of {self.combinations} combinations measured"
        return [self.robot.name, *(["unfit"] if self.unfit else []), measured, f"condition {self.condition:.3g}"]

    def torques(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Predicted torques at the joints, friction and offset included [N m or N], shape (nv,) or (n, nv).

        Args:
            q: positions [rad or m], shape (nv,) or (n, nv).
            v: velocities [rad/s or m/s], likewise.
            a: accelerations [rad/s² or m/s²], likewise.

        Raises:
            ProblemError: shapes do not fit.
        """
        states, shape = self._states(q, v, a)
        return np.asarray((inverse_dynamics(self.robot)(*states) + self.offset).reshape(shape))

    def torque_deviation(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Standard deviation of the predicted torques without the sensors' noise; else see `torques`."""
        states, shape = self._states(q, v, a)
        columns, _ = self.equations.at(*states, every=1)
        variance = np.einsum("njp,pq,njq->nj", columns, self.covariance, columns)
        return np.asarray(np.sqrt(variance).reshape(shape))

    def likely(self, count: int = 20, confidence: float = 0.95, seed: int = 0) -> tuple[Robot, ...]:
        """Arms that fit the logs: physical ones on the surface of the confidence region of all unknowns.

        Within the region arms differ less from `robot`. `track`, `reserve_curve` and `Plants` take them.

        Args:
            count: number of arms, in random directions of the region.
            confidence: probability that the region holds the arm that moved, above 0 and below 1.
            seed: of the directions.

        Raises:
            ProblemError: an argument is out of range.
        """
        count, seed = whole(count, "count", 1, MOST_MEMBERS), whole(seed, "seed", 0)
        if not 0 < number(confidence, "confidence") < 1:
            raise ProblemError(f"confidence is {confidence}; it is a probability above 0 and below 1, such as 0.95")
        from scipy.stats import chi2  # half a second; only likely arms need it

        unknowns, fit = self.equations.unknowns, self.fit
        away = np.random.default_rng(seed).normal(size=(count, unknowns.size))
        away *= np.sqrt(chi2.ppf(confidence, unknowns.size)) / np.linalg.norm(away, axis=1, keepdims=True)
        precision = np.asarray(np.linalg.inv(self.covariance), dtype=float)
        gradient = unknowns.divergence_near(fit.x).gradient
        arms = []
        for x in fit.x + away @ np.linalg.cholesky(self.covariance).T:
            # The physical arm nearest to x in the metric of the region; the gradient keeps the estimate where it is.
            near = Normal(precision, precision @ x + _BARRIER * gradient, 0.0)
            arms.append(self.equations.robot_at(minimise(unknowns, near, _BARRIER, fit.x)))
        return tuple(arms)

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
