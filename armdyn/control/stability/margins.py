"""Gain, phase, delay and disk margins of a sampled loop, joint by joint."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from armdyn.arguments import expect
from armdyn.arrays import Array
from armdyn.control.stability.delay import Complex, delay_margin, resolved
from armdyn.control.stability.sampled import SampledLoop
from armdyn.errors import ProblemError

_FREQUENCIES = 4000
"""Evaluated frequencies, evenly spaced in the logarithm, from a millionth of Nyquist's frequency up to it."""
_DECADES = 6
_ABOUT = np.linspace(-1.5, 1.5, 96)
"""Further frequencies about each pole, in its distances from the unit circle: resonances are narrower than a step. None
is the pole's own: an arm without friction has poles on the circle."""
_APART = 1e-9
"""Least distance of a pole from the circle, and least relative one of two frequencies: differences of closer ones are
rounding."""
_HALVINGS = 40
"""Of a step of frequency with a crossing, to the last digits."""
_SINGULAR = 1e13
"""Condition of z I - A from which on z is a pole. Torques and angles in one state have up to 1e8 without one."""


@dataclass(frozen=True)
class Margins:
    """Margins of one joint's loop, opened between the commanded and the applied torque; the other loops are closed.

    Attributes:
        joint: which, from 0.
        gain: factors of the torque (least, greatest) between which the loop is stable. The least is above 0 where
            only feedback keeps the arm up, 0 where the joint's loop may be opened; the greatest may be infinite.
        phase: least angle [rad] by which the torque may lag or lead at all its crossovers; infinite: no crossover.
        delay: least additional delay [s] of the torque that makes the loop unstable, a part of a tick or many ticks;
            infinite: none does.
        disk: α of the disk margin: gain and phase may change together within the disk about 1 with the diameter from
            (2 - α)/(2 + α) to (2 + α)/(2 - α) (Seiler, Packard, Gahinet, An Introduction to Disk Margins, IEEE Control
            Systems Magazine 40(5), 2020).
    """

    joint: int
    gain: tuple[float, float]
    phase: float
    delay: float
    disk: float


def loop_margins(loop: SampledLoop) -> tuple[Margins, ...]:
    """The margins of a stable sampled loop, joint by joint.

    The loop is broken where the arm feels one joint's torque. Crossings are found on 4,000 frequencies and more about
    the loop's poles, and between them by bisection. Delays are exact to 1e-5, see `delay_margin`.

    Args:
        loop: see `sampled_loop`.

    Returns:
        One per joint.

    Raises:
        ProblemError: loop is no SampledLoop, or unstable, and has no margins.
    """
    _expect_stable(loop)
    return tuple(_margins(loop, joint) for joint in range(loop.B.shape[1]))


def multiloop_disk(loop: SampledLoop) -> float:
    """Disk margin for changes of gain and phase in all torques at once, one change per joint.

    1 / max σ(S - I/2) over the frequencies, σ the greatest singular value, S the sensitivity at the torques. The
    largest α takes the structured singular value, which is at most σ: the result is on the safe side. For one
    joint it is that joint's own.

    Args:
        loop: see `sampled_loop`.

    Raises:
        ProblemError: loop is no SampledLoop, or unstable.
    """
    _expect_stable(loop)
    one = np.eye(loop.B.shape[1])
    response = _response(loop, (loop.A, loop.B, loop.C), frequencies(loop, loop.A))
    sensitivity = np.linalg.inv(one - response)
    return float(1 / np.linalg.norm(sensitivity - one / 2, ord=2, axis=(1, 2)).max())


def broken(loop: SampledLoop, joint: int) -> tuple[Array, Array, Array]:
    """A, B, C of the loop broken at the torque that the arm feels at one joint: L(z) = C (z I - A)⁻¹ B, 1 + L = 0.

    Args:
        loop: see `sampled_loop`.
        joint: which, from 0.

    Returns:
        Shapes (n, n), (n, 1), (1, n).
    """
    others = np.arange(loop.B.shape[1]) != joint
    A = loop.A + loop.B[:, others] @ loop.C[others]
    return A, loop.B[:, [joint]], -loop.C[[joint]]


def _expect_stable(loop: object) -> None:
    """Raise unless it is a sampled loop that is stable."""
    radius = expect(loop, SampledLoop, "loop", "sampled_loop(robot, q_goal, controller, loop)").radius
    if radius >= 1:
        raise ProblemError(f"the loop is unstable, with a spectral radius of {radius:.4g}: it has no margins")


def _margins(loop: SampledLoop, joint: int) -> Margins:
    opened = broken(loop, joint)
    omega = frequencies(loop, opened[0])
    response = _response(loop, opened, omega)[:, 0, 0]
    poles = np.linalg.eigvals(opened[0])
    undamped = np.angle(poles[np.abs(1 - np.abs(poles)) < _APART]) / loop.period
    beside, _ = np.histogram(undamped, omega)  # signs change there, too, and nothing is zero

    def where_zero(value: Callable[[Complex], Array]) -> Complex:
        """L where a real function of it changes its sign between two frequencies, shape (crossings,)."""
        above = value(response) > 0
        crossed = np.flatnonzero((above[1:] != above[:-1]) & (beside == 0))
        low, high, sign = omega[crossed], omega[crossed + 1], above[crossed]
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            same = (value(_response(loop, opened, middle)[:, 0, 0]) > 0) == sign
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return np.asarray(_response(loop, opened, (low + high) / 2)[:, 0, 0])

    real = where_zero(np.imag).real
    gains = np.append(-1 / real[real < 0], _at_ends(loop, opened))
    phases = np.angle(-where_zero(lambda one: np.abs(one) - 1))
    return Margins(
        joint=joint,
        gain=(float(max(gains[gains < 1], default=0.0)), float(min(gains[gains > 1], default=np.inf))),
        phase=float(np.abs(phases).min(initial=np.inf)),
        delay=delay_margin(loop, joint, opened, omega),
        disk=float(1 / np.abs(1 / (1 + response) - 0.5).max()),
    )


def frequencies(loop: SampledLoop, A: Array) -> Array:
    """Frequencies from far below the loop's slowest mode to Nyquist's frequency [rad/s], more about the poles.

    Args:
        loop: whose closed loop's poles count.
        A: matrix whose poles count, too, shape (n, n).
    """
    nyquist = np.pi / loop.period
    even = np.geomspace(nyquist * 10.0**-_DECADES, nyquist, _FREQUENCIES)
    poles = np.linalg.eigvals(np.stack([loop.matrix, A]))
    poles = poles[poles.imag >= 0, None]
    near = np.angle(poles) + np.maximum(np.abs(1 - np.abs(poles)), _APART) * _ABOUT
    found = np.sort(np.concatenate([even, near.ravel() / loop.period]))
    apart = np.append(np.diff(found) > _APART * found[1:], True)
    return np.asarray(found[(found >= even[0]) & (found <= nyquist) & apart])


def _response(loop: SampledLoop, system: tuple[Array, Array, Array], omega: Array) -> Complex:
    """C (z I - A)⁻¹ B of a system A, B, C at frequencies omega [rad/s], shape (frequencies, outputs, inputs)."""
    A, B, C = system
    return np.asarray(resolved(A, C, np.exp(1j * omega * loop.period)) @ B)


def _at_ends(loop: SampledLoop, opened: tuple[Array, Array, Array]) -> Array:
    """Factors that bring L to -1 at z = 1 and z = -1, where it is real and crosses nothing, shape (0, 1 or 2)."""
    one, A = np.eye(len(opened[0])), opened[0]
    angles = [angle for angle in (0.0, np.pi) if np.linalg.cond(np.cos(angle) * one - A) < _SINGULAR]  # no pole there
    values = _response(loop, opened, np.array(angles) / loop.period).real.ravel()
    return np.asarray(-1 / values[values < 0])
