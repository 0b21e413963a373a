"""Stability of a sampled loop at its goal, and the sampling rate that it needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import interval, whole
from armdyn.control.loop.loop import LEAST_RATE, MOST_RATE, Controller, Loop, expect_loop
from armdyn.control.stability.linear import BeyondNumbersError, Rest, continuous_matrix
from armdyn.control.stability.sampled import SampledLoop
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot, expect_robot

Rests = Callable[[Loop], list[Rest]]
"""Loops at rest at a goal, of a controller in a loop with an arm as it sticks and as it slides."""

RATES = (10.0, 2e5)
"""Scanned rates [Hz]."""
_PER_DECADE = 12
_EXACT = 1e-4
"""Relative precision of the rate."""


@dataclass(frozen=True)
class SampledStability:
    """Stability of a loop at rest at a goal, for small deviations.

    Coulomb friction acts on a joint near rest like strong damping, and not at all on one that moves faster than the
    friction's width. A loop that needs it to be stable swings on once it is pushed. So an arm with
    Coulomb friction is examined with the friction's slope at rest and without friction, and the worse of both counts.

    Attributes:
        radius: spectral radius, the factor of a deviation from tick to tick in the long run; infinite: it overflows.
        stable: whether that is below 1.
        continuous_growth: largest real part [1/s] of the eigenvalues of the same law without sampling, delay or filter;
            None: the controller has no law for a loop without them.
        slowest_stable_rate: rate from which on the loop is stable [Hz]; None if it is stable at its own rate, unstable
            as a continuous loop, too, or unstable at every rate of the scan.
        message: the verdict in a sentence.
    """

    radius: float
    stable: bool
    continuous_growth: float | None
    slowest_stable_rate: float | None
    message: str


def sampled_stability(
    robot: Robot, q_goal: ArrayLike, controller: Controller, loop: Loop, plant: Robot | None = None
) -> SampledStability:
    """Stability of a loop at rest at a goal, and whether its sampling is the cause of instability.

    Other rates are scanned only where it is unstable as sampled, and stable as a continuous loop.

    Args:
        robot: the controller's model of the arm.
        q_goal: [rad or m], shape (nv,).
        controller: of the loop.
        loop: connection to the arm.
        plant: the arm; None: the model is right.

    Raises:
        ProblemError: something does not fit the robot, or the controller the loop.
    """
    rests = _rests(robot, q_goal, controller, plant)
    try:
        return _stability(rests, expect_loop(loop))
    except BeyondNumbersError as error:
        return SampledStability(float("inf"), False, None, None, f"unstable: {error}")


def _stability(rests: Rests, loop: Loop) -> SampledStability:
    if loop.hold == "continuous":
        growth = _continuous_growth(rests, loop)
        with np.errstate(over="ignore"):
            radius = float(np.exp(growth * loop.period))
        verdict = f"{'stable' if growth < 0 else 'unstable'} as a continuous loop ({_growth(growth)})"
        return SampledStability(radius, growth < 0, growth, None, verdict)
    radius = _radius(rests, loop)
    ticks = f"{loop.delay or 'no'} tick{'s' * (loop.delay > 1)}"
    how = f"spectral radius {radius:.4g} at {loop.rate:g} Hz with {ticks} of delay"
    try:
        continuous: float | None = _continuous_growth(rests, replace(Loop.ideal(), rate=loop.rate))
    except ProblemError:  # a law that was made for samples alone
        continuous = None
    rate = None
    if radius < 1 or continuous is None:
        message = f"{'stable' if radius < 1 else 'unstable'} as sampled: {how}"
    elif continuous >= 0:
        message = f"unstable even as a continuous loop ({_growth(continuous)}); {how}"
    else:
        rate = _slowest(rests, loop, *RATES)
        found = (
            f"stable from {rate:.0f} Hz on" if rate else f"not stable up to {RATES[1]:g} Hz with this delay and filter"
        )
        message = f"unstable for its sampling: stable as a continuous loop ({_growth(continuous)}), {how}; {found}"
    return SampledStability(radius, radius < 1, continuous, rate, message)


def slowest_stable_rate(
    robot: Robot,
    q_goal: ArrayLike,
    controller: Controller,
    delay: int = 1,
    plant: Robot | None = None,
    *,
    loop: Loop | None = None,
    rates: tuple[float, float] = RATES,
) -> float | None:
    """Sampling rate above which a loop is stable at rest at a goal [Hz].

    Stability need not be monotone in the rate. The result is the rate above which all of a scan are stable, twelve
    per decade; below it there may be others at which the loop is stable. The delay stays the same number of ticks, the
    cutoff of the velocity's filter or observer the same frequency, and a controller whose law depends on the rate is
    made anew for each; a rate at which it has none counts as unstable.

    Args:
        robot: the controller's model of the arm.
        q_goal: [rad or m], shape (nv,).
        controller: of the loop.
        delay: ticks from a reading to its torque.
        plant: the arm; None: the model is right.
        loop: connection to the arm, but for rate and delay; None: `Loop()`.
        rates: least and greatest of the scan [Hz].

    Returns:
        The rate, exact to 1e-4 of it; the least of the scan if all are stable; None if the greatest is not.

    Raises:
        ProblemError: something does not fit the robot; a continuous loop; rates out of order.
    """
    base = replace(expect_loop(loop, Loop()), delay=whole(delay, "delay", least=0))
    low, high = interval(rates, "rates", unit="Hz", sign="positive")
    if low < LEAST_RATE or high > MOST_RATE:
        raise ProblemError(f"rates are {low:g} to {high:g} Hz; expected some of {LEAST_RATE:g} to {MOST_RATE:g} Hz")
    return _slowest(_rests(robot, q_goal, controller, plant), base, low, high)


def _slowest(rests: Rests, loop: Loop, low: float, high: float) -> float | None:
    """See `slowest_stable_rate`; rates in the range [Hz]."""

    def stable(rate: float) -> bool:
        try:
            return _radius(rests, replace(loop, rate=rate)) < 1
        except ProblemError:  # no law at this rate, where there is one at the loop's own
            return False

    _radius(rests, loop)  # refuses arguments that fit at no rate
    return least_stable(stable, low, high, _PER_DECADE, _EXACT)


def least_stable(
    stable: Callable[[float], bool], low: float, high: float, per_decade: int, exact: float
) -> float | None:
    """Least number above which all of a scan are stable, found by bisection of its logarithm.

    Args:
        stable: whether a number is stable.
        low: the least of the scan; the result if all are stable.
        high: the greatest of the scan.
        per_decade: numbers of the scan per decade.
        exact: relative precision.

    Returns:
        The number, on the stable side; None if the greatest is not stable.
    """
    scan = np.geomspace(high, low, int(np.ceil(per_decade * np.log10(high / low))) + 1).tolist()
    first = next((k for k, one in enumerate(scan) if not stable(one)), None)  # that is not stable, from above
    if not first:
        return low if first is None else None
    above, below = map(float, scan[first - 1 : first + 1])
    while above > below * (1 + exact):
        middle = float(np.sqrt(below * above))
        below, above = (below, middle) if stable(middle) else (middle, above)
    return above


def _rests(robot: Robot, q_goal: ArrayLike, controller: Controller, plant: Robot | None) -> Rests:
    """A controller's loops at rest: with the arm and, if it has Coulomb friction, with the arm without."""
    arm = expect_robot(robot) if plant is None else expect_robot(plant, "plant")
    arms = [arm, arm.with_friction(friction=0.0)] if np.any(arm.friction.coulomb) else [arm]
    return lambda loop: [Rest.of(robot, q_goal, controller, loop, one) for one in arms]


def _radius(rests: Rests, loop: Loop) -> float:
    return max(SampledLoop.of(rest, loop).radius for rest in rests(loop))


def _continuous_growth(rests: Rests, loop: Loop) -> float:
    return max(float(np.linalg.eigvals(continuous_matrix(rest)).real.max()) for rest in rests(loop))


def _growth(growth: float) -> str:
    return f"max Re λ = {growth:+.4g} 1/s"
