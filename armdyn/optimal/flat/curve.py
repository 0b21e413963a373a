"""A motion as a curve: legs of control points, each with its duration."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.models.robot import Robot
from armdyn.optimal.flat.basis import Basis
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Leg:
    """A curve from one given pose to the next.

    Attributes:
        basis: its B-splines.
        points: control points [rad or m], shape (basis.size, nv).
        duration: [s].
    """

    basis: Basis
    points: Array
    duration: float

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations at parts s of the duration, each of shape (s, nv)."""
        curve, T = self.basis.curve(self.points), self.duration
        return curve(s), curve(s, 1) / T, curve(s, 2) / T**2


@dataclass(frozen=True, eq=False)
class Curve:
    """A motion from start to goal.

    Attributes:
        legs: from pose to pose, at least one.
    """

    legs: tuple[Leg, ...]

    @property
    def duration(self) -> float:
        """Of the whole [s]."""
        return float(sum(leg.duration for leg in self.legs))

    @property
    def passing(self) -> Array:
        """When one leg ends and the next begins [s], shape (legs - 1,)."""
        return np.cumsum([leg.duration for leg in self.legs])[:-1]

    def slower(self, factor: float) -> Self:
        """The same path in so many times the duration."""
        return replace(self, legs=tuple(replace(leg, duration=factor * leg.duration) for leg in self.legs))

    def torques(self, robot: Robot, leg: int, s: Array) -> Array:
        """Torques on a leg at parts s of its duration, by `pin.rnea` and friction [N m or N], shape (s, nv)."""
        torque = inverse_dynamics(robot)
        return np.array([torque(*x) for x in zip(*self.legs[leg].at(s), strict=True)])

    def trajectory(self, robot: Robot, samples: int) -> Trajectory:
        """Samples in every interval, and the torques that the curve takes there.

        Args:
            robot: that moves.
            samples: of every interval, besides its end.
        """
        parts, start = [], 0.0
        for k, leg in enumerate(self.legs):
            breaks = leg.basis.breaks
            s = np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(samples) / samples).ravel(), 1.0)
            q, v, _ = leg.at(s)
            t = start + leg.duration * s
            if k < len(self.legs) - 1:  # where legs meet the torque may jump
                t[-1] = np.nextafter(t[-1], 0)
            parts.append((t, q, v, self.torques(robot, k, s)))
            start += leg.duration
        t, q, v, tau = (np.concatenate(part) for part in zip(*parts, strict=True))
        return Trajectory(t, q, v, tau, robot.joint_names, "curve", robot.model_hash)
