"""The paper's PID loop (24) as one differential equation, integrated by LSODA.

`simulate_pid` is more accurate, but takes a robot. Here the equations of motion may be the paper's own, misprints
included, and the derivative of the error may have the printed sign.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.integrate import LSODA, OdeSolution
from scipy.optimize import brentq

from armdyn.arrays import Array
from armdyn.control.laws.linear import LinearPlant
from armdyn.control.laws.pid import PidGains
from armdyn.control.stability.linear import closed_loop_matrix, eigenvalues, plant_at_goal
from armdyn.control.tracking.arrival import Arrival
from armdyn.control.tracking.run import Run, Status
from armdyn.dynamics import forward_dynamics
from armdyn.locks import cached_property
from armdyn.models.robots.robot import Robot
from armdyn.paper.printed.loop import DURATION, GAINS
from armdyn.trajectory import Trajectory

_RTOL, _ATOL = 1e-9, 1e-10
"""Of the integrator, per component. Arrival times then move by less than 1e-6 s when both shrink tenfold."""
_MAX_STEPS = 30_000
"""Integrator steps after which a run is given up: a settling 10 s run takes about a thousand."""
_POSITION_BOUND, _VELOCITY_BOUND = 100.0, 1000.0
"""Distance from the goal [rad] and speed [rad/s] beyond which a run counts as diverged."""
_SUBSAMPLES = 4
"""Points per integrator step that are searched for crossings; a step is a small part of any oscillation."""
_STEP = 1e-3
"""Of the five-point stencil [rad]: its truncation, ~h⁴/30, is then as small as its rounding, ~1e-16/h."""


class EquationsOfMotion(Protocol):
    """D(q) a + C(q, v) v + g(q) = tau, in joint coordinates."""

    def inertia(self, q: Array) -> Array:
        """D(q) [kg m²], shape (nv, nv); it need not be symmetric, so that misprints can be tried, too."""

    def coriolis(self, q: Array, v: Array) -> Array:
        """C(q, v) [N m s], shape (nv, nv)."""

    def gravity(self, q: Array) -> Array:
        """g(q) [N m], shape (nv,)."""


@dataclass(frozen=True, eq=False)
class ContinuousLoop:
    """tau = D(q) u with u = kp e + ki ∫e dt + kd ė, eqs (22) to (27), around an arm; x = (∫e, q, v), shape (3 nv,).

    Attributes:
        robot: the arm; its effort limits are not enforced.
        goal: [rad], shape (nv,).
        gains: kp, ki, kd.
        error_rate: ė as a multiple of the joint's velocity: -1 with e = goal - position, eq. (26), and a goal at rest.
        dynamics: other equations of motion than the robot's own.
    """

    robot: Robot
    goal: ArrayLike
    gains: PidGains = GAINS
    error_rate: float = -1.0
    dynamics: EquationsOfMotion | None = None

    @cached_property
    def coefficients(self) -> tuple[Array, Array, Array]:
        """a, b and c of u = a e + b ∫e dt - c v, each of shape (nv,)."""
        kp, ki, kd = self.gains.per_joint(self.robot.nv)
        return kp, ki, -self.error_rate * kd

    def inertia(self, q: Array) -> Array:
        """D(q) [kg m²], shape (nv, nv)."""
        if self.dynamics is not None:
            return np.asarray(self.dynamics.inertia(q), dtype=float)
        return np.array(pin.crba(self.robot.model, self._data, self.robot.configuration(q)))

    @cached_property
    def _data(self) -> pin.Data:
        return self.robot.model.createData()

    def torque(self, x: Array) -> Array:
        """Torque of the controller [N m], shape (nv,)."""
        integral, q, v = x.reshape(3, -1)
        kp, ki, damping = self.coefficients
        return np.asarray(self.inertia(q) @ (kp * (np.asarray(self.goal) - q) + ki * integral - damping * v))

    def acceleration(self) -> Callable[[Array, Array, Array], Array]:
        """a(q, v, tau) [rad/s²]: by the articulated-body algorithm, or D⁻¹ (tau - C v - g)."""
        given = self.dynamics
        if given is None:
            return forward_dynamics(self.robot)
        return lambda q, v, tau: np.asarray(
            np.linalg.solve(self.inertia(q), tau - (given.coriolis(q, v) @ v + given.gravity(q))), dtype=float
        )

    def growth(self) -> float:
        """Largest real part of the eigenvalues at the goal [1/s]; the loop is stable if it is negative.

        Of given equations of motion the derivatives are five-point stencils, good to about 1e-9 of the largest entry.
        """
        goal, nv = np.asarray(self.goal, dtype=float), self.robot.nv
        if self.dynamics is None:
            plant = plant_at_goal(self.robot, goal, "acceleration")
        else:
            acceleration, rest, columns = self.acceleration(), np.zeros(nv), []
            for step in _STEP * np.eye(nv):
                near, far = (
                    acceleration(goal + k * step, rest, rest) - acceleration(goal - k * step, rest, rest)
                    for k in (1, 2)
                )
                columns.append((8 * near - far) / (12 * _STEP))
            plant = LinearPlant(np.eye(2 * nv, k=nv), np.eye(2 * nv, nv, -nv))
            plant.A[nv:, :nv] = np.column_stack(columns)
        return float(eigenvalues(closed_loop_matrix(plant, *self.coefficients))[0].real)


def simulate(
    loop: ContinuousLoop, q_start: ArrayLike, arrival: Arrival, *, duration: float = DURATION, samples: int = 1001
) -> Run:
    """Move an arm from rest to the loop's goal.

    Args:
        loop: arm, goal and gains.
        q_start: [rad], shape (nv,).
        arrival: when the arm is in the final position; times are located on the integrator's continuous solution.
        duration: of the simulation [s].
        samples: of the trajectory, evenly spaced.
    """
    robot, goal, start = loop.robot, np.asarray(loop.goal, dtype=float), np.asarray(q_start, dtype=float)
    growth = loop.growth()
    followed = _integrate(loop, np.concatenate([np.zeros(robot.nv), start, np.zeros(robot.nv)]), duration)
    approach = Approach(followed.solution, goal)
    stays = followed.stopped is None and growth < 0
    settled = approach.time(Arrival(tolerance=arrival.tolerance)) if stays else None
    status, message = followed.stopped or _outcome(settled, arrival.tolerance, approach.final_error)
    if growth >= 0:
        message += f"; the loop is not stable at the goal, max Re λ = {growth:+.4g} 1/s"
    t = np.linspace(0.0, followed.solution.t_max, samples)
    x = followed.solution(t)
    _, q, v = np.split(x, 3)
    return Run(
        trajectory=Trajectory(
            t, q.T, v.T, np.array([loop.torque(column) for column in x.T]), robot.joint_names, "PID (acceleration)",
            robot.model_hash,
        ),
        status=status,
        message=message,
        settled_time=settled,
        error_at_end=approach.final_error,
        peak_error=float(np.abs(goal[:, None] - q).max()),
        peak_velocity=float((np.abs(v.T) / robot.limits.velocity).max()),
        saturated=0.0,
        failed_time=None if followed.stopped is None else followed.solution.t_max,
        overshoot=approach.overshoot(),
        arrival_time=approach.time(arrival) if stays or arrival.rule == "first_crossing" else None,
        arrival_rule=arrival.rule,
        max_real_eigenvalue=growth,
    )  # fmt: skip


def _outcome(settled: float | None, tolerance: float, error: float) -> tuple[Status, str]:
    """Status of a run that is whole, and its message."""
    if settled is not None:
        return "settled", f"all joints within {tolerance:g} rad or m of the goal from t = {settled:.6g} s on"
    return "not_settled", f"not settled: {error:.4g} rad or m from the goal at the end"


class _Followed(NamedTuple):
    """Solution of a loop's differential equation, up to the end or to where it stopped."""

    solution: OdeSolution
    """x over time, shape (3 nv,) at one time."""
    stopped: tuple[Status, str] | None
    """Status and message of a run that broke off; None: it is whole."""


def _integrate(loop: ContinuousLoop, x0: Array, duration: float) -> _Followed:
    goal, acceleration = np.asarray(loop.goal, dtype=float), loop.acceleration()
    nv = goal.size

    def rate(t: float, x: Array) -> Array:
        _, q, v = x.reshape(3, -1)
        return np.concatenate([goal - q, v, acceleration(q, v, loop.torque(x))])

    solver = LSODA(rate, 0.0, x0, duration, rtol=_RTOL, atol=_ATOL)
    times, pieces = [0.0], []
    stopped: tuple[Status, str] | None = None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # LSODA warns of failures that its status reports as well
        while solver.status == "running" and stopped is None:
            reason = solver.step()
            if solver.status == "failed" or not np.all(np.isfinite(solver.y)):
                stopped = ("failed", f"the integrator gave up at t = {times[-1]:.6g} s ({reason})")
                break
            times.append(solver.t)
            pieces.append(solver.dense_output())
            away, speed = (float(np.abs(part).max()) for part in (solver.y[nv : 2 * nv] - goal, solver.y[2 * nv :]))
            if away > _POSITION_BOUND or speed > _VELOCITY_BOUND:
                where = f"a joint is {away:.4g} off its goal, at speed {speed:.4g}"
                stopped = ("diverged", f"diverged at t = {solver.t:.6g} s: {where}")
            elif len(pieces) >= _MAX_STEPS and solver.status == "running":
                stopped = ("failed", f"gave up at t = {solver.t:.6g} s after {_MAX_STEPS} integrator steps")
    return _Followed(OdeSolution(times, pieces), stopped)


class Approach:
    """Error of a continuous motion to its goal: arrival and overshoot, located on the continuous solution."""

    def __init__(self, motion: OdeSolution, goal: Array):
        self._motion, self._goal = motion, goal
        fractions = np.arange(_SUBSAMPLES) / _SUBSAMPLES
        inner = motion.ts[:-1, None] + np.diff(motion.ts)[:, None] * fractions
        self._t = np.append(inner.ravel(), motion.t_max)
        _, q, self._v = np.split(motion(self._t), 3)
        self._error = goal[:, None] - q

    @property
    def final_error(self) -> float:
        """Largest |eᵢ| at the end [rad]."""
        return float(np.abs(self._error[:, -1]).max())

    def time(self, arrival: Arrival) -> float | None:
        """Time of arrival [s]; None: never."""

        def outside(t: float) -> float:
            return float(arrival.outside(self._goal - np.split(self._motion(t), 3)[1])[0])

        return arrival.first(self._t, arrival.outside(self._error.T), outside)

    def overshoot(self) -> Array:
        """Farthest past the goal, seen from the start [rad], shape (nv,)."""
        beyond = -np.sign(self._error[:, :1]) * self._error
        past = np.where(self._error[:, :1] == 0, np.abs(self._error), beyond)
        return np.array([self._peak(joint, past[joint]) for joint in range(self._goal.size)])

    def _peak(self, joint: int, past: Array) -> float:
        """Largest of a joint's values past the goal [rad], at rest between the points if it is there."""
        k = int(past.argmax())
        if past[k] <= 0:
            return 0.0
        a, b = max(k - 1, 0), min(k + 1, self._t.size - 1)
        if self._v[joint, a] * self._v[joint, b] >= 0:
            return float(past[k])
        nv = self._goal.size
        rest = brentq(lambda t: self._motion(t)[2 * nv + joint], self._t[a], self._t[b])
        return max(float(past[k]), float(abs(self._motion(rest)[nv + joint] - self._goal[joint])))
