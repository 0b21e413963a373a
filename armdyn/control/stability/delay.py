"""Delay margin of a sampled loop, exact for a torque that comes ticks and a part of a tick later."""

import numpy as np
from numpy.typing import NDArray

from armdyn.arrays import Array
from armdyn.control.laws.linear import zero_order_hold
from armdyn.control.stability.sampled import SampledLoop

_PARTS = np.linspace(0.0, 1.0, 33).tolist()
"""Parts of a tick at which bounds of a late torque's response and of its slope are taken."""
_NEAR = 0.01
"""Intervals between two frequencies are examined where the response comes that near to 1, with any part of a tick."""
_FINER, _DIVIDED, _ROUNDS = 16, 8, 20
"""In each round the intervals that limit the steps are divided, each into as many parts, so many of them."""
_SAFE = 0.9
"""Part of a step that is taken: slopes are those at the ends and middles of intervals and at parts of a tick."""
_EXACT = 1e-6
"""Relative size of a step that ends a round, and relative change by a round that ends the search."""
_MOST_STEPS = 10_000
"""Of a round. Steps are short where a mode comes near to instability without getting there."""

Complex = NDArray[np.complex128]


def resolved(A: Array, C: Array, z: Complex) -> Complex:
    """C (z I - A)⁻¹ at points z, shape (…, outputs, n)."""
    rows = np.linalg.solve(z[..., None, None] * np.eye(len(A)) - A.T, C.T)
    return np.asarray(np.swapaxes(rows, -1, -2))


class LateLoop:
    """A loop opened where the arm feels one joint's torque, which comes later than commanded.

    Of a torque late by m + p ticks the arm feels in a tick first the command of m + 1 ticks before, and for the other
    1 - p that of m ticks before. With those commands as states the loop is again one matrix from tick to tick. Its
    eigenvalues are the zeros of 1 + z⁻ᵐ L(z, p), and move continuously with the delay: a stable loop stays stable until
    one of them is on the unit circle.
    """

    def __init__(self, loop: SampledLoop, joint: int, opened: tuple[Array, Array, Array]) -> None:
        """Keep a loop and A, B, C of the loop broken at a joint, see `margins.broken`."""
        self.loop, self.joint, (self.A, _, self.C) = loop, joint, opened

    def at(self, omega: Array) -> tuple[Complex, Complex]:
        """Points z and C (z I - A)⁻¹ for inputs to the arm, shape (…, 2 nv), at frequencies [rad/s], shape (…)."""
        z = np.exp(1j * self.loop.period * omega)
        return z, resolved(self.A, self.C, z)[..., 0, : len(self.loop.arm.A)]

    def response(self, z: Complex, rows: Complex, part: float) -> Complex:
        """L(z, p), with z and the rows of `at`."""
        now = zero_order_hold(*self.loop.arm, (1 - part) * self.loop.period)[1][:, self.joint]
        return np.asarray(rows @ now + rows @ (self.loop.B[: len(now), self.joint] - now) / z)

    def slope(self, z: Complex, rows: Complex) -> Array:
        """Largest |∂L/∂delay| over a tick [1/s]."""
        b, h = self.loop.arm.B[:, self.joint], self.loop.period
        moved = np.array([zero_order_hold(*self.loop.arm, part * h)[0] @ b for part in _PARTS])
        return np.asarray(np.abs(rows @ moved.T).max(axis=-1) * np.abs(1 - 1 / z))


def delay_margin(loop: SampledLoop, joint: int, opened: tuple[Array, Array, Array], omega: Array) -> float:
    """Least additional delay [s] of one joint's torque that makes a stable loop unstable; infinite: none does.

    Args:
        loop: stable.
        joint: which, from 0.
        opened: A, B, C of the loop broken there.
        omega: increasing frequencies up to Nyquist's [rad/s], near enough to each other to show every crossover.
    """
    late = LateLoop(loop, joint, opened)
    points = late.at(omega)
    sizes = np.abs([late.response(*points, part) for part in _PARTS])
    least, most = sizes.min(axis=0), sizes.max(axis=0)
    near = (np.minimum(least[1:], least[:-1]) < 1 + _NEAR) & (np.maximum(most[1:], most[:-1]) > 1 - _NEAR)
    edges, delay = np.stack([omega[:-1], omega[1:]], axis=-1)[near], np.inf
    for _ in range(_ROUNDS):
        before, (delay, steps) = delay, _march(late, edges)
        if delay == np.inf or 0 < delay * (1 - _EXACT) <= before <= delay * (1 + _EXACT):
            break
        order = np.argsort(steps)
        ends = np.linspace(edges[order[:_DIVIDED], 0], edges[order[:_DIVIDED], 1], _FINER + 1)
        edges = np.vstack([edges[order[_DIVIDED:]], np.stack([ends[:-1], ends[1:]], axis=-1).reshape(-1, 2)])
    return delay


def _march(late: LateLoop, edges: Array) -> tuple[float, Array]:
    """Delay [s] that is reached from 0 by steps that skip no instability, and the last step of each interval.

    From a delay at which the loop is stable, none is unstable that is nearer than |1 + z⁻ᵐ L| / max |∂L/∂delay| at
    every z of the unit circle. On an interval of frequencies the distance of 0 from a chord counts, less that of the
    chord from the curve in its middle.

    Args:
        late: loop with a late torque.
        edges: intervals of frequency [rad/s], shape (n, 2).
    """
    z, rows = late.at(edges @ np.array([[1.0, 0.5, 0.0], [0.0, 0.5, 1.0]]))
    sizes = np.abs([late.response(z, rows, part) for part in _PARTS])
    bend = np.abs(sizes[..., 1] - (sizes[..., 0] + sizes[..., 2]) / 2)[..., None]
    crossed = ((sizes - bend).min(axis=(0, 2)) < 1) & ((sizes + bend).max(axis=(0, 2)) > 1)
    fastest, delay, steps = late.slope(z, rows).max(axis=-1), 0.0, np.empty(0)
    for _ in range(_MOST_STEPS):
        ticks, part = divmod(delay / late.loop.period, 1.0)
        left, middle, right = np.moveaxis(1 + z**-ticks * late.response(z, rows, part), -1, 0)
        chord = right - left
        nearest = np.clip(-(left * chord.conj()).real / np.abs(chord) ** 2, 0.0, 1.0)
        gaps = np.abs(left + nearest * chord) - np.abs(middle - (left + right) / 2)
        steps = np.where(crossed, _SAFE * gaps / fastest, np.inf)
        step = float(steps.min(initial=np.inf))
        if step <= _EXACT * delay or delay == np.inf:
            break
        delay += step
    return delay, steps
