"""Gains with which a PID loop is stable at its goal: of one joint in closed form, over a plane, by a factor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import Checked, checked, expect, interval, number, numbers, one_of
from armdyn.arrays import Array, Flags
from armdyn.control.laws.pid import DEFAULT_GAINS, FORMS, Form, Pid, PidGains
from armdyn.control.loop.loop import Loop, expect_loop
from armdyn.control.stability.linear import Rest, closed_loop_matrix, eigenvalues, plant_at_goal
from armdyn.control.stability.rate import least_stable
from armdyn.control.stability.sampled import SampledLoop
from armdyn.errors import ProblemError
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.reprs import brief

_PER_DECADE = 60
"""Tested factors; all above the result are stable."""
_EXACT = 1e-12
"""Relative precision of the factor."""


@brief
@dataclass(frozen=True)
class GainRegion(Checked):
    """One joint under PID control at its goal: m s³ + (kd + c) s² + (kp + k) s + ki = 0.

    By Routh's table it is stable if and only if kd + c > 0, kp + k > 0, ki ≥ 0 and (kd + c) (kp + k) > m ki. Without ki
    the integral is left out, as in `closed_loop_matrix`, and m s² + (kd + c) s + (kp + k) = 0.

    Attributes:
        inertia: m. Form "torque": D [kg m²]. Else 1 [-].
        stiffness: k. "torque": G' = ∂g/∂q [N m/rad]. "acceleration": G'/D [1/s²], D being constant for one joint.
            "computed_torque": 0. It is negative where the arm stands upright, and falls.
        damping: c, the slope of the joint's friction at rest. "torque": ∂tau_f/∂v [N m s/rad]. "acceleration": that
            over D [1/s]. "computed_torque": 0.

    Raises:
        ProblemError: something is not finite, or the inertia not positive.
    """

    inertia: float = checked(number, unit="kg m²", sign="positive")
    stiffness: float = checked(number, unit="N m/rad")
    damping: float = checked(number, 0.0, unit="N m s/rad")

    @classmethod
    def of(cls, robot: Robot, q_goal: ArrayLike, form: Form = "acceleration") -> Self:
        """Region of an arm with one joint.

        Args:
            robot: the arm.
            q_goal: [rad], shape (1,).
            form: of the controller's output, see `Form`.

        Raises:
            ProblemError: more than one joint, a goal that does not fit it, or an unknown form.
        """
        if expect_robot(robot).nv != 1:
            raise ProblemError(f"{robot.name} has {robot.nv} joints; a gain region in closed form is for one joint")
        one_of(form, FORMS, "form")
        A, B = plant_at_goal(robot, pose_given(robot, q_goal, "q_goal"), form)
        stiffness, damping = -A[1] / B[1]
        return cls(1 / B[1, 0], stiffness, damping)

    def polynomial(self, kp: float, ki: float, kd: float) -> tuple[float, ...]:
        """Characteristic polynomial of the loop, highest power first; of degree 2 without ki."""
        p, i, d = (number(gain, name) for gain, name in ((kp, "kp"), (ki, "ki"), (kd, "kd")))
        cubic = (self.inertia, d + self.damping, p + self.stiffness, i)
        return cubic if i else cubic[:3]

    def stable(self, kp: ArrayLike, ki: ArrayLike, kd: ArrayLike) -> Flags:
        """Whether the loop is stable with given gains, of one shape or shapes that broadcast."""
        p, i, d = (numbers(gain, name) for gain, name in ((kp, "kp"), (ki, "ki"), (kd, "kd")))
        damping, stiffness = d + self.damping, p + self.stiffness
        return np.asarray((i >= 0) & (damping > 0) & (stiffness > 0) & (damping * stiffness > self.inertia * i))

    def least_kd(self, kp: ArrayLike, ki: ArrayLike) -> Array:
        """The kd above which the loop is stable; 0 where friction alone is enough, infinite where no kd is."""
        p, i = np.broadcast_arrays(numbers(kp, "kp"), numbers(ki, "ki"))
        stiffness = p + self.stiffness
        enough = (stiffness > 0) & (i >= 0)
        least = np.maximum(self.inertia * i / np.where(enough, stiffness, 1.0) - self.damping, 0.0)
        return np.asarray(np.where(enough, least, np.inf))


def least_stable_factor(
    robot: Robot,
    q_goal: ArrayLike,
    gains: PidGains = DEFAULT_GAINS,
    form: Form = "acceleration",
    *,
    factors: tuple[float, float] = (1e-3, 1e3),
) -> float | None:
    """Least common factor of kp, ki and kd with which the continuous loop is stable at its goal.

    Stability need not be monotone in the factor. The result is the one from which on all factors of a scan are stable,
    60 per decade up to the greatest; eigenvalues decide.

    Args:
        robot: an arm.
        q_goal: [rad or m], shape (nv,).
        gains: that are multiplied.
        form: of the controller's output, see `Form`.
        factors: the least and the greatest of the scan.

    Returns:
        The factor, exact to 1e-12 of it: above 1 the gains are too small. The least of the scan if all are stable; None
        if the greatest is not.

    Raises:
        ProblemError: the goal or the gains do not fit the robot; unknown form; factors not positive, or out of order.
    """
    goal = pose_given(expect_robot(robot), q_goal, "q_goal")
    low, high = interval(factors, "factors", sign="positive")
    one_of(form, FORMS, "form")
    kp, ki, kd = expect(gains, PidGains, "gains", "PidGains(kp=…, ki=…, kd=…)").per_joint(robot.nv)
    plant = plant_at_goal(robot, goal, form)

    def stable(factor: float) -> bool:
        return bool(eigenvalues(closed_loop_matrix(plant, factor * kp, factor * ki, factor * kd))[0].real < 0)

    return least_stable(stable, low, high, _PER_DECADE, _EXACT)


@brief
@dataclass(frozen=True, eq=False)
class GainPlane:
    """A PID loop at a goal, with one kp, ki and kd for all joints, over a grid of kp and kd.

    Attributes:
        kp: shape (n,); units as in `PidGains`, and increasing; likewise the others.
        kd: shape (m,).
        ki: of all points.
        growth: largest real part [1/s] of the continuous loop's eigenvalues, shape (m, n).
        radius: spectral radius [-] of the sampled loop, shape (m, n).
    """

    kp: Array
    kd: Array
    ki: float
    growth: Array
    radius: Array


def gain_plane(
    robot: Robot,
    q_goal: ArrayLike,
    *,
    kp: ArrayLike,
    kd: ArrayLike,
    ki: float,
    form: Form = "torque",
    loop: Loop | None = None,
) -> GainPlane:
    """Growth and spectral radius over a grid; a point takes about half a millisecond.

    Args:
        robot: the arm, and the controller's model.
        q_goal: [rad or m], shape (nv,).
        kp: shape (n,), increasing.
        kd: shape (m,), increasing.
        ki: one number.
        form: of the controller's output, see `Form`.
        loop: how it is sampled; None: `Loop()`.

    Raises:
        ProblemError: the goal does not fit the robot; gains that are negative or do not increase; a continuous loop.
    """
    goal = pose_given(expect_robot(robot), q_goal, "q_goal")
    p, d = _increasing(kp, "kp"), _increasing(kd, "kd")
    i, how = number(ki, "ki", sign="not negative"), expect_loop(loop, Loop())
    growth, radius = np.empty((d.size, p.size)), np.empty((d.size, p.size))
    one, two = (Rest.of(robot, goal, Pid(PidGains(x, i, x), form, feedforward=False), how) for x in (1.0, 2.0))
    plant = plant_at_goal(robot, goal, form)
    for place in np.ndindex(growth.shape):
        kp_here, kd_here = float(p[place[1]]), float(d[place[0]])
        gains = PidGains(kp_here, i, kd_here).per_joint(robot.nv)
        growth[place] = eigenvalues(closed_loop_matrix(plant, *gains))[0].real
        radius[place] = SampledLoop.of(_between(one, two, kp_here, kd_here), how).radius
    return GainPlane(p, d, i, growth, radius)


def _between(one: Rest, two: Rest, kp: float, kd: float) -> Rest:
    """Interpolate the loop's linearisation: in every form the torque is affine in kp and kd."""
    low, high = one.law, two.law
    law = replace(low, q=low.q + (kp - 1) * (high.q - low.q), v=low.v + (kd - 1) * (high.v - low.v))
    return replace(one, law=law)


def _increasing(value: ArrayLike, name: str) -> Array:
    gains = numbers(value, name, "increasing numbers")
    if gains.ndim != 1 or gains.size < 2 or not np.all(np.diff(gains) > 0) or not 0 <= gains[0] < np.inf:
        raise ProblemError(
            f"{name} has shape {gains.shape}; expected two or more increasing gains that are not negative"
        )
    return gains
