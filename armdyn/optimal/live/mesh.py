"""Mesh of live motions: one B-spline, places with torque limits, samples for the checks."""

from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.locks import cached_property
from armdyn.optimal.flat.basis import Basis

_PER_INTERVAL = 2
"""Number of places of an interval at which torques are limited: its start and its middle."""


@dataclass(frozen=True, eq=False)
class Places:
    """Places of a curve and its B-splines there.

    Attributes:
        basis: spline basis of the curve.
        checks: samples per interval, without its end; a multiple of 4.
    """

    basis: Basis
    checks: int

    @cached_property
    def places(self) -> Array:
        """Breaks and their middles, at which torques are limited, as parts of the duration, shape (places,)."""
        breaks = self.basis.breaks
        inner = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(_PER_INTERVAL) / _PER_INTERVAL
        return np.append(inner.ravel(), 1.0)

    @cached_property
    def weights(self) -> Array:
        """Parts of the duration nearest to each of the places, shape (places,)."""
        lengths = np.gradient(self.places)
        return np.asarray(lengths / np.sum(lengths))

    @cached_property
    def fine(self) -> Array:
        """Samples of each interval, shape (intervals, checks + 1): a break is in two intervals."""
        breaks = self.basis.breaks
        return breaks[:-1, None] + np.diff(breaks)[:, None] * np.linspace(0, 1, self.checks + 1)

    @cached_property
    def samples(self) -> Array:
        """Samples, each once, shape (samples,)."""
        return np.append(self.fine[:, :-1].ravel(), 1.0)

    @cached_property
    def of_samples(self) -> Array:
        """B-splines at the samples with two derivatives, shape (3, samples, basis.size)."""
        return np.array([self.basis.values(self.samples, order) for order in range(3)])

    @cached_property
    def around(self) -> Index:
        """Samples around each place, up to halfway to the next places, shape (places, checks / 2 + 1)."""
        half = self.checks // (2 * _PER_INTERVAL)
        middle = np.arange(self.places.size)[:, None] * (self.checks // _PER_INTERVAL)
        return np.asarray(np.clip(middle + np.arange(-half, half + 1), 0, self.samples.size - 1))

    def per_interval(self, values: Array) -> Array:
        """Values at the samples, shape (samples, nv), interval by interval, shape (intervals, checks + 1, nv)."""
        index = np.arange(self.basis.intervals)[:, None] * self.checks + np.arange(self.checks + 1)
        return np.asarray(values[index])

    def once(self, values: Array) -> Array:
        """Reverse `per_interval`; for a break the larger of its two values."""
        out = np.concatenate([values[:, :-1].reshape(-1, values.shape[-1]), values[-1:, -1]])
        out[self.checks : -1 : self.checks] = np.maximum(out[self.checks : -1 : self.checks], values[:-1, -1])
        return out
