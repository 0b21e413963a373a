"""Tests of the residuals of a fit: do they depend on torque, direction, speed, position or reversals?

Each pattern is a column that the model lacks. Its score test leaves out what the unknowns explain, without the prior,
which is no noise, and counts autocorrelated terms as fewer ones, as the intervals do.

Columns and residuals share the encoders' errors: a mean acceleration over a step is a difference of two velocities, so
that their product is not zero in the mean. A mean over three steps is the difference of the outer velocities, whose
errors do not correlate with that of the acceleration in the middle. Such means are the instruments of the tests, as in
Janot, Vandanjon, Gautier, IEEE T-CST 22(1), 2014, states of a simulation; by their signs motion and load turn back.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.special import ndtr, stdtr

from armdyn.arrays import Array
from armdyn.identification.equations import Equations, means_of, rigid_torques
from armdyn.identification.fitting import Fit, autocorrelation
from armdyn.identification.log import Signals

FALSE_ALARMS = 0.01
"""Level of a test that widens intervals, and of all tests of a log together that name a pattern."""
_SLOW = 0.1, 0.3
"""Speeds below which friction may rise [rad/s or m/s]; others are combinations of these and the model's own."""
_TURNING = 3
"""Averaged torques to either side of a reversal that count as next to it: 60 ms cross a gear's play."""
_CLIPPED = 12.0
"""Largest squared residual, in variances, that counts."""
_SIGNIFICANT = 3e-4
"""Part of a joint's torque limit below which a pattern is not named: a simulated log without noise leaves as much."""
_RANK, _OWN = 1e-10, 1e-6
"""Singular value of the scaled normal equations below which a combination is not determined; the part of a column's
square that they leave below which it is none of its own, and of the largest gradient of the torques below which one is
zero: all are rounding."""
_SHIFT = 1e-5
"""Step of the derivative of torques by the positions [rad or m]."""
_FRICTION, _GRAVITY = "friction is not the model's", "gravity, gears or cables are not the model's"


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern:
    """A dependence that the residuals may show.

    Attributes:
        joint: its index.
        columns: change of the torques with the pattern as large as it is found [N m or N], shape (m, nv, 0 or 1).
        words: what it depends on, how much, and why, in a sentence; empty: too small to be named.
        probability: of a dependence as strong, or stronger, by chance.
        unfit: whether intervals do not hold, however wide the pattern makes them.
    """

    joint: int
    columns: Array
    words: str = ""
    probability: float = 1.0
    unfit: bool = False


def patterns(
    equations: Equations, fit: Fit, columns: Array, torque: Array, means: list[tuple[Signals, int]]
) -> Iterator[Pattern]:
    """Patterns that the residuals show, the most significant first, then, without words, those that no test rules out.

    Args:
        equations: of the fit.
        fit: the fit.
        columns: its columns, shape (m, nv, p).
        torque: measured minus known [N m or N], shape (m, nv).
        means: the logs, and the number of samples that the columns are averaged over.
    """
    tests = _Tests(equations, fit, columns, torque, means)
    found = [own for j in range(equations.robot.nv) for own in tests.of_joint(j)]
    for one in sorted(found, key=lambda one: one.probability):
        if one.probability < FALSE_ALARMS:
            yield one if one.probability * len(found) < FALSE_ALARMS else replace(one, words="", unfit=False)
    yield from tests.hidden()


class _Tests:
    """Residuals, and the signals on which they may depend, as means."""

    def __init__(
        self, equations: Equations, fit: Fit, columns: Array, torque: Array, means: list[tuple[Signals, int]]
    ) -> None:
        self.fit, self.none, self.slides = fit, columns[..., :0], equations.robot.slides
        self.columns = columns / np.sqrt(np.maximum(np.diag(fit.normal.matrix), 1e-300))
        self.instruments = _smoothed(fit.weights[..., None] * self.columns)
        self.inverse = np.linalg.pinv(np.einsum("njp,njq->pq", self.instruments, self.columns), rcond=_RANK)
        self.residual = torque - columns @ fit.x
        self.variance = np.mean((fit.weights * self.residual) ** 2, axis=0) / np.mean(fit.weights, axis=0)
        averaged = [[means_of(own, every) for own in _signals(one, equations.width)] for one, every in means]
        self.q, self.v, a, tau, self.both, *self.slow = map(np.concatenate, zip(*averaged, strict=True))
        self.tau, self.least = tau - self.residual, _SIGNIFICANT * equations.torque_limits
        *_, self.coulomb, self.offset = equations.unknowns.numbers(fit.x)
        robot, steps = equations.robot_at(fit.x), _SHIFT * np.eye(equations.robot.nv)
        moved = np.stack([rigid_torques(robot, self.q + step, self.v, a) for step in steps])
        moved -= rigid_torques(robot, self.q, self.v, a)
        self.gradient = np.where(np.abs(moved) > _OWN * np.max(np.abs(moved)), moved / _SHIFT, 0.0)

    def hidden(self) -> Iterator[Pattern]:
        """Friction that differs with the direction by the offset: but in slow reversals the two are one torque.

        It differs by all of itself at most.
        """
        for j, size in enumerate(np.minimum(np.abs(self.offset), self.coulomb)):
            yield Pattern(joint=j, columns=size * self._own(j, self.both)[..., None])

    def of_joint(self, j: int) -> Iterator[Pattern]:
        """All tests of a joint."""
        unit, length = ("N", "mm") if self.slides[j] else ("N m", "mrad")
        parts = (
            (self.tau, "torque", "the torque sensor's scale differs, or another joint's"),
            (self.both, "direction of motion", _FRICTION),
            *((one, "speed", _FRICTION) for one in self.slow),
            *((one, "position", _GRAVITY) for one in (np.sin(self.q), np.cos(self.q))),
        )
        for signal, what, why in parts:
            yield self._mean(j, self._own(j, signal), f"the {what}: {{size:.2g}} {unit}; {why}")
        for signal, what in ((_smoothed(self.v), "motion"), (_smoothed(self.tau), "load")):
            shift = self.gradient[j] * np.sign(signal[:, j, None])
            yield self._mean(j, shift, f"position and direction of the {what}: {{shift:.2g}} {length} of backlash")
            yield self._turning(j, signal[:, j], what, unit)

    def _own(self, j: int, values: Array) -> Array:
        """Values at one joint, shape (m, nv), as a column of its torque alone."""
        return np.where(np.arange(self.least.size) == j, values, 0.0)

    def _mean(self, j: int, column: Array, words: str) -> Pattern:
        """Score test of a column, shape (m, nv)."""
        weights, known = self.fit.weights, self.columns
        rest = column - known @ (self.inverse @ np.einsum("njp,nj->p", self.instruments, column))
        carried = weights * _smoothed(rest)
        information = float(np.sum(carried * rest))
        if information <= _OWN * float(np.sum(weights * column**2)):
            return Pattern(joint=j, columns=self.none)
        amount = float(np.sum(carried * self.residual)) / information
        scores = np.sum(carried * (self.residual - amount * rest), axis=1)
        inflation = float(autocorrelation(scores[:, None], np.full(1, np.inf), 1.0)[0])
        # Where few equations carry the column, their scatter is small by chance; that of the joint is not.
        square = max(float(scores @ scores), float(np.sum(carried**2 / weights * self.variance)))
        size = abs(amount) * float(np.max(np.abs(rest[:, j])))
        said = f"residual depends on {words.format(shift=1e3 * abs(amount), size=size)}" if size > self.least[j] else ""
        chance = 2 * float(ndtr(-abs(amount) * information / np.sqrt(max(square * inflation, 1e-300))))
        return Pattern(joint=j, columns=amount * column[..., None], words=said, probability=chance)

    def _turning(self, j: int, signal: Array, what: str, unit: str) -> Pattern:
        """Test whether residuals are larger next to reversals."""
        turns = np.concatenate([[False], np.signbit(signal[1:]) != np.signbit(signal[:-1])])
        near = np.convolve(turns, np.ones(2 * _TURNING + 1), "same") > 0
        stays = int(near[0]) + int(np.sum(near[1:] > near[:-1]))  # reversals next to one another scatter as one
        if stays < 2 or np.mean(near) > 0.5:  # no reversal, or hardly anything else
            return Pattern(joint=j, columns=self.none)
        square = _smoothed(self.residual[:, j]) ** 2
        square = np.minimum(square, _CLIPPED * np.mean(square[~near]))
        rest, centred = square[~near], near - np.mean(near)
        square = square - np.mean(rest)
        inflation = float(autocorrelation(square[:, None], np.full(1, np.inf), 1.0)[0])
        value = float(centred @ square / np.sqrt(np.var(rest) * np.sum(centred**2) * inflation))
        sizes = [float(np.sqrt(np.mean(self.residual[at, j] ** 2))) for at in (near, ~near)]
        # Friction of another shape errs by less than the friction; play of a gear, which no column describes, by more.
        more = sizes[0] > self.coulomb[j]
        why = "more than friction: backlash" if more else f"backlash, or {_FRICTION}"
        said = f"{sizes[0]:.2g} {unit} against {sizes[1]:.2g} {unit}; {why}"
        words = f"residual is larger where the {what} turns back: {said}"
        chance = float(stdtr(float(stays), -value)) if sizes[0] > self.least[j] else 1.0
        return Pattern(joint=j, columns=self.none, words=words, probability=chance, unfit=more)


def _signals(one: Signals, width: float | Array) -> list[Array]:
    sign = np.tanh(one.v / width)
    own = [np.abs(sign), *(np.exp(-((one.v / speed) ** 2)) * sign for speed in _SLOW)]
    return [one.q, one.v, one.a, one.tau, *map(one.smoothed, own)]


def _smoothed(values: Array) -> Array:
    """Means of three in turn, along the first axis."""
    return np.asarray(uniform_filter1d(values, 3, axis=0))
