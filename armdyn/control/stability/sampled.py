"""The sampled loop at rest at a goal, as one matrix from tick to tick."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import expect
from armdyn.arrays import Array
from armdyn.control.laws.linear import LinearPlant, zero_order_hold
from armdyn.control.loop.loop import Controller, Loop, expect_loop
from armdyn.control.stability.linear import BeyondNumbersError, Rest
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot
from armdyn.reprs import brief


@brief
@dataclass(frozen=True, eq=False)
class SampledLoop:
    """Small deviations from tick to tick: x(k+1) = A x(k) + B f(k), f(k) = C x(k).

    x holds, joint by joint in each block, at the tick and before its reading:

    - q [rad or m] and v [rad/s or m/s], the deviations from rest at the goal;
    - with velocity "filtered" the filter's memory pole v̂(k-1) - (1 - pole) rate q(k-1) [rad/s];
      with "observer" the predicted q̂⁻ [rad] and v̂⁻ [rad/s]; with "exact" nothing;
    - the integrals that the law uses [rad s];
    - the torques that are computed and not yet applied, the next first [N m or N].

    f is the torque applied to the arm over the tick. Nothing is clipped, rounded or noisy.

    Attributes:
        A: transition without the applied torque, shape (n, n).
        B: effect of the applied torque within one tick, shape (n, nv).
        C: selects the applied torque from the state, shape (nv, n).
        period: one tick [s].
        arm: between ticks.
    """

    A: Array
    B: Array
    C: Array
    period: float
    arm: LinearPlant

    @classmethod
    def of(cls, rest: Rest, loop: Loop) -> Self:
        """The matrices of a loop, in the order of one tick.

        Reading, estimate of the velocity, law with the integral as it stands, torque of `delay` ticks before on the
        arm, and then the integral: z + period (q_goal - q_read).

        Args:
            rest: arm, model and law at the goal.
            loop: with hold "zoh".

        Raises:
            ProblemError: a continuous loop.
            BeyondNumbersError: gains or period are too large.
        """
        expect(rest, Rest, "rest", "Rest.of(robot, q_goal, controller, loop)")
        if expect_loop(loop).hold != "zoh":
            raise ProblemError('a loop with hold="continuous" has no ticks; its matrix is `continuous_matrix`')
        law, h, nv = rest.law, loop.period, rest.plant.B.shape[1]
        memory = {"exact": 0, "filtered": nv, "observer": 2 * nv}[loop.velocity]
        ends = np.cumsum([nv, nv, memory, law.used.size, loop.delay * nv])
        n = int(ends[-1])
        q, v, m, z, p = (rows for rows in np.split(np.eye(n), ends[:-1]))  # each picks its part of x
        with np.errstate(over="ignore", invalid="ignore"):
            q_read, v_read = _readings(loop, q, v, m)
            command = law.q @ q_read + law.v @ v_read + law.integral @ z + law.pending @ p
            C = p[:nv] if loop.delay else command
            moved, driven = zero_order_hold(*rest.plant, h)
            A = np.vstack(
                [
                    moved @ np.vstack([q, v]),
                    _remembered(loop, rest, q, q_read, v_read, C),
                    z - h * q_read[law.used],
                    *([p[nv:], command] if loop.delay else []),
                ]
            )
            closed = cls(A, np.vstack([driven, np.zeros((n - 2 * nv, nv))]), C, h, rest.plant)
            if not np.all(np.isfinite(closed.matrix)):
                raise BeyondNumbersError(
                    "the sampled loop exceeds the range of floating-point numbers: its gains or period are too large"
                )
        return closed

    @property
    def matrix(self) -> Array:
        """Matrix of the closed loop, shape (n, n)."""
        return np.asarray(self.A + self.B @ self.C)

    @property
    def radius(self) -> float:
        """Spectral radius: factor of a deviation from tick to tick in the long run; stable below 1."""
        return float(np.abs(np.linalg.eigvals(self.matrix)).max())


def sampled_loop(
    robot: Robot, q_goal: ArrayLike, controller: Controller, loop: Loop, plant: Robot | None = None
) -> SampledLoop:
    """The sampled loop at rest at a goal.

    Encoder steps, noise and limits of torque are left out; Coulomb friction counts with its slope at rest. A plant that
    is not the controller's model rests where its holding torque keeps it; the offset of an observer is left out.

    Args:
        robot: the controller's model of the arm.
        q_goal: [rad or m], shape (nv,).
        controller: whose law it is.
        loop: connection to the arm, with hold "zoh".
        plant: the arm; None: the model is right.

    Raises:
        ProblemError: something does not fit the robot, or the loop is continuous.
    """
    return SampledLoop.of(Rest.of(robot, q_goal, controller, loop, plant), loop)


def _readings(loop: Loop, q: Array, v: Array, memory: Array) -> tuple[Array, Array]:
    """Position and velocity as the law reads them, each of shape (nv, n), as rows on the state."""
    if loop.velocity == "exact":
        return q, v
    if loop.velocity == "filtered":
        return q, memory + (1 - loop.pole) * loop.rate * q
    of_position, of_velocity = loop.observer_gains
    predicted, rate = memory[: len(q)], memory[len(q) :]
    return predicted + of_position * (q - predicted), rate + of_velocity * (q - predicted)


def _remembered(loop: Loop, rest: Rest, q: Array, q_read: Array, v_read: Array, C: Array) -> Array:
    """The filter's or the observer's memory one tick later, shape (0, nv or 2 nv; n)."""
    if loop.velocity == "exact":
        return q[:0]
    if loop.velocity == "filtered":
        return np.asarray(loop.pole * v_read - (1 - loop.pole) * loop.rate * q)
    h, model = loop.period, rest.model
    a = (model.A @ np.vstack([q_read, v_read]) + model.B @ C)[len(q) :]
    return np.vstack([q_read + h * v_read + h**2 / 2 * a, v_read + h * a])
