"""The costates once more, without the program that they were read from: the adjoint equations along the replay.

ρ̇ = −∂H/∂x = −(∂f/∂x)ᵀρ, with ∂f/∂x from Pinocchio's derivatives of forward dynamics, integrated from the goal back
to the start. Of the program only the multipliers of held limits enter: where a joint is on a limit of its velocity or
position, the limit pulls on the costate (Bryson and Ho, Applied Optimal Control, section 3.9).

Backwards a difference grows as the motion itself would diverge, ten thousandfold on a heavily laden arm. Therefore the
costates are held against that solution of the equations which is nearest to all of them: shadowing.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.integrate import DOP853

from armdyn.dynamics.numeric import forward_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.optimal.arcs.arc import POSITION, VELOCITY
from armdyn.optimal.arcs.phases import TABLEAU, Phases
from armdyn.optimal.landing.rollout import dense, replay_torques
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_RTOL = 1e-7
"""Of the integrator: a thousandth of the costates' tolerance; absolute a tenth of that, as H feels it."""
_SAMPLES = 400
"""Of the replay, about: quintics between them are then right to 1e-9 of what the paper's arms do."""
_POWERS = np.arange(6.0)
"""Of a quintic."""
_MOST_STEPS = 5_000
"""Of the integrator: ten times what the paper's arms take, some seconds."""
_STILL = 1e-9
"""A joint that moves less than this part of the fastest counts as if it moved that much."""


def adjoint_error(robot: Robot, replay: Trajectory, phases: Phases) -> float:
    """How far the costates are from a solution of the adjoint equations, as H feels it, against the 1 that time costs.

    A difference in ρ_q counts by the joint's largest velocity, one in ρ_v by its largest acceleration.

    Args:
        robot: that moves.
        replay: its motion.
        phases: the arcs, with costates.

    Returns:
        The largest difference at any knot, of any joint; infinite if the replay or the integration broke off.
    """
    duration = phases.duration
    if abs(replay.duration - duration) > 1e-12 * duration:
        return float("inf")
    finer = dense(replay, _SAMPLES)
    if finer.t.size > replay.t.size:  # else the replay's own states are all there are
        finer = replay_torques(robot, finer)
        if finer.t[-1] != replay.t[-1]:
            return float("inf")
    along = _Along.of(robot, finer)
    found = _backwards(along, phases)
    if found is None:
        return float("inf")
    apart = (found[:, :, 0] - phases.costate) * along.size
    freedom = found[:, :, 1:] * along.size[:, None]
    shift = np.linalg.lstsq(freedom.reshape(apart.size, -1), apart.ravel(), rcond=None)[0]
    return float(np.max(np.abs(apart - freedom @ shift)))


@dataclass(frozen=True, eq=False)
class _Along:
    """A motion between whose samples positions are quintics: through q, v and a at both.

    Attributes:
        robot: that moves.
        motion: samples of its states and torques.
        quintics: between two samples, coefficients of sᵏ with s from 0 to 1 [rad or m], shape (m - 1, 6, nv).
        size: largest velocity and acceleration of every joint, shape (2 nv,).
    """

    robot: Robot
    motion: Trajectory
    quintics: Array
    size: Array

    @classmethod
    def of(cls, robot: Robot, motion: Trajectory) -> "_Along":
        """With what forward dynamics say of the samples."""
        acceleration = forward_dynamics(robot)
        q, v, h = motion.q, motion.v, np.diff(motion.t)[:, None]
        a = np.array([acceleration(*sample) for sample in zip(q, v, motion.tau, strict=True)])
        start, mean, bend = h * v[:-1], h**2 / 2 * a[:-1], h**2 / 2 * np.diff(a, axis=0)
        rise, speed = np.diff(q, axis=0) - start - mean, h * np.diff(v, axis=0) - 2 * mean
        # Of s³, s⁴ and s⁵, so that value, slope and curvature at s = 1 are rise, speed and 2 bend.
        more = (10 * rise - 4 * speed + bend, -15 * rise + 7 * speed - 2 * bend, 6 * rise - 3 * speed + bend)
        peaks = [np.max(np.abs(each), axis=0) for each in (v, a)]
        size = np.concatenate([np.maximum(each, _STILL * np.max(each)) for each in peaks])
        return cls(robot, motion, np.stack([q[:-1], start, mean, *more], axis=1), size)

    def within(self, start: float, end: float) -> "_Stretch":
        """The part between two times that are samples: what a jump of the torque at its ends says is of this side."""
        t, tiny = self.motion.t, 1e-14 * self.motion.t[-1]
        first, last = np.searchsorted(t, [start - tiny, end - tiny])
        return _Stretch(self, int(first), int(last))


class _Stretch:
    """The adjoint equations between two samples.

    Attributes:
        along: the motion.
        first: the sample that it begins with.
        last: the sample that it ends with.
    """

    def __init__(self, along: _Along, first: int, last: int):
        self.along, self.first, self.last = along, first, last
        self._model, self._data = along.robot.model, along.robot.model.createData()

    def rate(self, time: float, flat: Array) -> Array:
        """−(∂f/∂x)ᵀ times the columns of a matrix, shape (2 nv, 2 nv + 1), all as one row."""
        n = self.along.robot.nv
        columns = flat.reshape(2 * n, -1)
        by_q, by_v = self._slopes(time)
        down: Array = -np.concatenate([by_q.T @ columns[n:], columns[:n] + by_v.T @ columns[n:]]).ravel()
        return down

    def _slopes(self, time: float) -> tuple[Array, Array]:
        """∂a/∂q and ∂a/∂v, friction included, each of shape (nv, nv)."""
        robot, (q, v, tau) = self.along.robot, self._state(time)
        friction = robot.friction
        if not friction.present:
            pin.computeABADerivatives(self._model, self._data, robot.configuration(q), v, tau)
            return self._data.ddq_dq, self._data.ddq_dv
        pin.computeABADerivatives(self._model, self._data, robot.configuration(q), v, tau - friction.torque(v))
        inverse = np.triu(self._data.Minv) + np.triu(self._data.Minv, 1).T
        return self._data.ddq_dq, self._data.ddq_dv - inverse * friction.slope(v)

    def _state(self, time: float) -> tuple[Array, Array, Array]:
        """Position, velocity and torque."""
        t, tau = self.along.motion.t, self.along.motion.tau
        k = min(max(int(np.searchsorted(t, time, side="right")) - 1, self.first), self.last - 1)
        h = t[k + 1] - t[k]
        s = (time - t[k]) / h
        powers, quintic = s**_POWERS, self.along.quintics[k]
        velocity = (_POWERS[1:] * powers[:-1]) @ quintic[1:] / h
        return powers @ quintic, velocity, tau[k] + s * (tau[k + 1] - tau[k])


def _backwards(along: _Along, phases: Phases) -> Array | None:
    """The adjoint equations at the knots, from the costate at the goal; None if they cannot be followed.

    Returns:
        Their solution, and how it answers to each costate at the goal, shape (K + 1, 2 nv, 1 + 2 nv).
    """
    inner, knots, on_limit = _pulls(phases)
    K, own = phases.arc_of.size, phases.costate.shape[1]
    found = np.empty((K + 1, own, own + 1))
    found[-1] = np.column_stack([phases.costate[-1], np.diag(1 / along.size)])
    steps = 0
    for k in range(K - 1, -1, -1):
        here = found[k + 1].copy()
        if k < K - 1:
            here[:, 0] -= knots[k]
        start, end = phases.t[k], phases.t[k + 1]
        stretch = along.within(start, end)
        stops = start + (end - start) * TABLEAU.c[-2::-1] if on_limit[k] else np.empty(0)
        for j, stop in enumerate([*stops, start]):
            reached, more = _integrated(stretch, end, stop, here)
            steps += more
            if reached is None or steps > _MOST_STEPS:
                return None
            here, end = reached, stop
            if j < stops.size:
                here[:, 0] -= inner[k, -1 - j]
        found[k] = here
    return found if np.all(np.isfinite(found)) else None


def _integrated(stretch: _Stretch, start: float, end: float, matrix: Array) -> tuple[Array | None, int]:
    """A matrix of costates carried from one time back to an earlier one, None if that fails; and the steps it took."""
    if start <= end:
        return matrix, 0
    atol = np.repeat(0.1 * _RTOL / stretch.along.size, matrix.shape[1])
    solver = DOP853(stretch.rate, start, matrix.ravel(), end, rtol=_RTOL, atol=atol, first_step=start - end)
    steps = 0
    while solver.status == "running" and steps <= _MOST_STEPS:
        solver.step()
        steps += 1
    return (solver.y.reshape(matrix.shape).copy() if solver.status == "finished" else None), steps


def _pulls(phases: Phases) -> tuple[Array, Array, NDArray[np.bool_]]:
    """What limits of the state pull on the costates: impulses, none from a limit that no arc names.

    Impulses at the stages are what the collocation's quadrature makes of a limit that is held. A touch has its own
    at the knot, and IPOPT's barrier some of it at the stages beside.

    Returns:
        At the inner stages, shape (K, stages - 1, 2 nv); at the inner knots, shape (K - 1, 2 nv); and whether any
        stage of an interval has some, shape (K,).
    """
    K, n = phases.q.shape[0] - 1, phases.q.shape[1]
    modes = np.array([phases.arcs[a].modes for a in phases.arc_of], dtype=object)
    slow = np.isin(modes, POSITION)
    held = np.stack([slow, slow | np.isin(modes, VELOCITY)], axis=1)  # (K, 2, nv): positions, velocities
    met = held[:-1] | held[1:]
    for a, k in enumerate(np.flatnonzero(np.diff(phases.arc_of))):
        for i, mode in phases.arcs[a].touches:
            rows = slice(None) if mode in POSITION else slice(1, 2)
            met[k, rows, i] = held[k : k + 2, rows, i] = True
    inner = (phases.state_pull * held[:, None]).reshape(K, -1, 2 * n)
    return inner, (phases.knot_pull * met).reshape(K - 1, 2 * n), np.asarray(np.any(held, axis=(1, 2)))
