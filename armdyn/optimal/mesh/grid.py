"""Multi-phase meshes: short intervals where the motion is curved, or a joint reverses through dry friction."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.models.values.friction import JointFriction
from armdyn.optimal.problem.policy.refinement import ArcsPolicy
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Density:
    """Density of a mesh: relative number of intervals per unit of time.

    Attributes:
        t: times [s], shape (K + 1,).
        mass: masses of the intervals between them, shape (K,).
    """

    t: Array
    mass: Array

    def up_to(self, times: Array) -> Array:
        """Mass before given times [s]."""
        return np.asarray(np.interp(times, self.t, np.concatenate([[0], np.cumsum(self.mass)])))

    def between(self, start: float, end: float, count: int) -> Array:
        """Parts, shape (count,), that divide a stretch of time into equal masses."""
        t = np.unique(np.concatenate([[start, end], self.t[(self.t > start) & (self.t < end)]]))
        total = self.up_to(t)
        times = np.interp(np.linspace(total[0], total[-1], count + 1), total, t)
        parts: Array = np.diff(times) / (end - start)
        return parts

    def with_half_of(self, other: "Density") -> "Density":
        """Density that places half of the intervals by itself and half by the other, over the same time."""
        t = np.union1d(self.t, other.t)
        return Density(t, np.diff(self.up_to(t) / self.mass.sum() + other.up_to(t) / other.mass.sum()))


def distribute(durations: Array, intervals: int, density: Density | None, per_arc: int) -> tuple[Index, Array]:
    """Distribute intervals over arcs: a least number each, the rest in proportion to the density's mass.

    Args:
        durations: durations of the arcs [s].
        intervals: number of intervals.
        density: density of the mesh; None: uniform.
        per_arc: least number per arc.

    Returns:
        The index of each interval's arc, and the interval's part of that arc, both of shape (intervals,).
    """
    ends = np.concatenate([[0.0], np.cumsum(durations)])
    if density is None:
        density = Density(ends, np.diff(ends))
    else:  # the density may be of other durations
        density = Density(density.t * (ends[-1] / density.t[-1]), density.mass)
    mass = np.maximum(np.diff(density.up_to(ends)), 1e-12)
    counts = per_arc + np.floor((intervals - per_arc * mass.size) * mass / mass.sum()).astype(int)
    counts[np.argmax(mass)] += intervals - counts.sum()
    parts = [density.between(a, b, n) for (a, b), n in zip(pairwise(ends), counts, strict=True)]
    return np.repeat(np.arange(mass.size), counts), np.concatenate(parts)


def density_of(t: Array, polynomials: Sequence[tuple[Array, Array]], least_density: float) -> Density:
    """Density of the next mesh from the errors on the last.

    The error of an interval falls with some power p of its length; it is equal everywhere (de Boor's equidistribution)
    at a density of error^(1/p) / length. The highest coefficient of a polynomial of degree p estimates the error.

    Args:
        t: knots [s], shape (K + 1,).
        polynomials: nodes as parts of the interval, shape (p + 1,), and values there, shape (K, p + 1, n).
        least_density: least density, as a part of the mean one: an error estimate may miss some.
    """
    mass = np.zeros(t.size - 1)
    for nodes, values in polynomials:
        apart = nodes[:, None] - nodes + np.eye(nodes.size)
        highest = np.abs(np.einsum("j,kjn->kn", 1 / np.prod(apart, axis=1), values))
        size = np.maximum(np.ptp(values, axis=(0, 1)), 1e-6 * np.max(np.abs(values)) + 1e-300)
        mass = np.maximum(mass, np.max(highest / size, axis=1) ** (1 / (nodes.size - 1)))
    rate = mass / np.diff(t)
    near = np.max([rate, np.append(rate[1:], 0), np.append(0, rate[:-1])], axis=0)
    return Density(t, np.maximum(near, least_density * mass.sum() / t[-1]) * np.diff(t))


def layered(guess: Trajectory, friction: JointFriction, numbers: ArcsPolicy) -> Density | None:
    """Mesh density for the short layers in which Coulomb friction changes sign, as a joint reverses.

    Half of the intervals are equal in time, half equal in the change of tanh(v / width), summed over the
    joints: equidistribution of a monitor function (Ascher, Mattheij and Russell, Numerical Solution of
    Boundary Value Problems for Ordinary Differential Equations, section 9.3).

    Args:
        guess: approximate motion.
        friction: friction of the joints.
        numbers: width of a layer, and its part of the intervals.

    Returns:
        None if a uniform density suffices.
    """
    dry = np.broadcast_to(np.asarray(friction.coulomb) > 0, guess.v.shape[1:])
    if not np.any(dry):
        return None
    samples, reach, part = numbers.layer_samples, numbers.layer_reach, numbers.in_layers
    t = np.linspace(0, guess.duration, samples + 1)
    v = guess(guess.t[0] + t).v[:, dry]
    width = np.broadcast_to(friction.width, dry.shape)[dry]
    change = np.sum(np.abs(np.diff(np.tanh(v / (reach * width)), axis=0)), axis=1)
    if not np.any(change):
        return None
    return Density(t, (1 - part) / samples + part * change / np.sum(change))
