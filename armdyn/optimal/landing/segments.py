"""Every segment of a motion, from sample to sample, integrated again by Gauss collocation of order six.

The integrator is implicit, of another family than the explicit Runge-Kutta pair of `rollout` and `flat.follow`, and
shares no code with it. All segments are independent of each other, so that all of them are solved at once: Newton's
method on the accelerations at three Gauss points, with Pinocchio's derivatives of the forward dynamics at the middle
of the segment. The same linear equations yield how a segment's end state depends on its start state and on a constant
torque (variational equations; Hairer, Nørsett, Wanner, Solving ODEs I, II.17 and IV.8).
"""

from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import forward_dynamics, forward_dynamics_derivatives
from armdyn.models.robots.robot import Robot
from armdyn.optimal.landing.rollout import dense
from armdyn.optimal.task.tableau import GAUSS_3
from armdyn.trajectory import Trajectory

_AGREES = 1e-9
"""Defect [rad or m, and per second], relative to 1 and the state, below which one step suffices: the step's own error
is part of it, and at most a thousandth of what a goal error may be."""
_STAGES_TOLERANCE = 1e-14
"""Error of the stage velocities, relative to 1 and the velocity, by the last two Newton steps: rounding."""
_STALLED = 1e-9
"""The same where Newton steps no longer halve: rounding of light links' accelerations; beyond, it has not converged."""
_MOST_NEWTON = 12
"""Newton steps: smooth motions take two or three; Coulomb friction within a segment takes some more."""
_AT_ONCE = 4000
"""Segments solved at once: some 50 MB for seven joints."""
_MOST_PARTS = 256
"""Steps of order six in a segment where fewer, or one and the motion's own end, disagree."""


@dataclass(frozen=True, eq=False)
class Segments:
    """A motion's segments, integrated one by one, each from the motion's own state at its first sample.

    Over a jump of the torque no time passes, and the state remains.

    Attributes:
        defect: integrated end state minus the motion's own [rad or m, and per second], shape (K, 2 nv).
        state_transition: derivative of the end state by the start state, shape (K, 2 nv, 2 nv).
        forced: derivative of the end state by a torque constant over the segment, shape (K, 2 nv, nv).
    """

    defect: Array
    state_transition: Array
    forced: Array

    @classmethod
    def of(cls, robot: Robot, motion: Trajectory, most: int = _MOST_PARTS) -> "Segments":
        """Integrate every segment of a motion.

        Args:
            robot: the arm.
            motion: states and torques; a segment is the interval between two samples.
            most: steps in a segment; 1 suffices for the growth.
        """
        x, h, n = np.concatenate([motion.q, motion.v], axis=1), np.diff(motion.t), robot.nv
        tau, step = np.stack([motion.tau[:-1], motion.tau_end], axis=1), _GaussStep(robot)
        defect, forced = -np.diff(x, axis=0), np.zeros((h.size, 2 * n, n))
        state_transition = np.tile(np.eye(2 * n), (h.size, 1, 1))
        scale = _AGREES * (1 + np.max(np.abs(x[:-1]), axis=1))
        rough, parts = np.flatnonzero(~motion.jumps), 1
        while rough.size and parts <= most:
            end, state_transition[rough], forced[rough] = _composed(step, h[rough], x[rough], tau[rough], parts)
            found = end - x[rough + 1]
            change, defect[rough] = np.max(np.abs(found - defect[rough]), axis=1), found
            settled = change <= scale[rough] if parts > 1 else np.max(np.abs(found), axis=1) <= scale[rough]
            rough, parts = rough[~settled], 2 * parts
        return cls(defect, state_transition, forced)

    @property
    def growth(self) -> float:
        """Largest singular value of the derivative of the motion's end state by its start state."""
        total = np.eye(self.defect.shape[1])
        with np.errstate(over="ignore", invalid="ignore"):  # minutes of an unstable motion leave what numbers can hold
            for state_transition in self.state_transition:
                total = state_transition @ total
        return float(np.linalg.norm(total, 2)) if np.all(np.isfinite(total)) else float("inf")

    @property
    def largest(self) -> float:
        """Largest defect [rad or m, and per second]; infinite where a segment could not be integrated."""
        largest = float(np.max(np.abs(self.defect)))
        return largest if np.isfinite(largest) else float("inf")

    def end(self) -> Array:
        """Open-loop end state minus the motion's own, to first order in the defects, shape (2 nv,)."""
        beside = np.zeros(self.defect.shape[1])
        for state_transition, defect in zip(self.state_transition, self.defect, strict=True):
            beside = state_transition @ beside + defect
        return beside


def ticked(robot: Robot, motion: Trajectory, longest: float) -> Trajectory:
    """The motion with samples at most some time apart.

    Args:
        robot: the arm.
        motion: states and torques.
        longest: time between samples [s].

    Returns:
        States at new samples are integrated from the sample before: the defect of a segment is that of its last part.
    """
    finer = dense(motion, int(np.ceil(motion.duration / longest)))
    if finer.t.size == motion.t.size:
        return motion
    kept = np.searchsorted(finer.t, motion.t)
    x, step = np.concatenate([finer.q, finer.v], axis=1), _GaussStep(robot)
    for part in range(1, int(np.max(np.diff(kept)))):
        at = kept[:-1][np.diff(kept) > part] + part
        x[at] = step(
            finer.t[at] - finer.t[at - 1], x[at - 1], np.stack([finer.tau[at - 1], finer.tau_end[at - 1]], axis=1)
        )[0]
    return replace(finer, q=x[:, : robot.nv], v=x[:, robot.nv :])


def _composed(step: "_GaussStep", h: Array, x: Array, tau: Array, parts: int) -> tuple[Array, Array, Array]:
    """Several equal steps through each segment; arguments and result as of `_GaussStep.__call__`."""
    n = tau.shape[2]
    state_transition, forced = np.broadcast_to(np.eye(2 * n), (h.size, 2 * n, 2 * n)), np.zeros((h.size, 2 * n, n))
    for k in range(parts):
        part = np.array([k, k + 1])[None, :, None] / parts
        x, own, pushed = step(h / parts, x, tau[:, :1] + part * (tau[:, 1:] - tau[:, :1]))
        state_transition, forced = own @ state_transition, own @ forced + pushed
    return x, state_transition, forced


class _GaussStep:
    """One step of Gauss collocation through each of many segments. For one thread, with a work space of Pinocchio."""

    def __init__(self, robot: Robot) -> None:
        self.derivatives = forward_dynamics_derivatives(robot)
        self.acceleration = forward_dynamics(robot)

    def __call__(self, h: Array, x: Array, tau: Array) -> tuple[Array, Array, Array]:
        """Integrate each segment by one Gauss step, and differentiate its end state.

        Args:
            h: their lengths [s], shape (K,).
            x: their start states, shape (K, 2 nv).
            tau: torques at start and end [N m or N], shape (K, 2, nv).

        Returns:
            End states, shape (K, 2 nv), and their derivatives by start state and constant torque, as in `Segments`.
            Where Newton's method does not converge they are not numbers.
        """
        if h.size > _AT_ONCE:
            halves = [self(*each) for each in zip(*(np.array_split(array, 2) for array in (h, x, tau)), strict=True)]
            end, state_transition, forced = (np.concatenate(each) for each in zip(*halves, strict=True))
            return end, state_transition, forced
        A, b, c = GAUSS_3.A, GAUSS_3.b, GAUSS_3.c
        K, s, n = h.size, c.size, tau.shape[2]
        q, v, h = x[:, None, :n], x[:, None, n:], h[:, None, None]
        torque = tau[:, :1] + c[:, None] * (tau[:, 1:] - tau[:, :1])
        drift = q + h * c[:, None] * v
        a = np.repeat(self._accelerations(q, v, tau[:, :1]), s, axis=1)
        middle = (q + h / 2 * v)[:, 0], (v + h / 2 * a[:, :1])[:, 0], tau.mean(axis=1)
        _, by_q, by_v, by_tau = self.derivatives(*middle)
        system = h * np.einsum("ij,kab->kiajb", A, by_v).reshape(K, s * n, s * n)
        system += h**2 * np.einsum("ij,kab->kiajb", A @ A, by_q).reshape(K, s * n, s * n)
        inverse = np.linalg.inv(np.eye(s * n) - system)
        going, error, last = np.arange(K), np.full(K, np.inf), np.full(K, np.nan)
        for _ in range(_MOST_NEWTON):
            now, own = a[going], h[going]
            rates = self._accelerations(
                drift[going] + own**2 * (A @ A @ now), v[going] + own * (A @ now), torque[going]
            )
            change = (inverse[going] @ (rates - now).reshape(-1, s * n, 1)).reshape(-1, s, n)
            a[going] = now + change
            size = np.max(np.abs(own * change), axis=(1, 2)) / (1 + np.max(np.abs(v[going]), axis=(1, 2)))
            error[going] = size * np.fmin(size / last, 1)  # it shrinks at least as fast again; at first it is not known
            done = (error[going] <= _STAGES_TOLERANCE) | ((size > last / 2) & (size <= _STALLED))
            last, going = size[~done], going[~done]
            if not going.size:
                break
        a[~(error <= _STALLED)] = np.nan
        # How the accelerations at the stages depend on the start state and on a constant torque.
        sources = np.concatenate([by_q, by_v, by_tau], axis=2)[:, None].repeat(s, axis=1)
        sources[..., n : 2 * n] += h[..., None] * c[:, None, None] * by_q[:, None]
        moved = (inverse @ sources.reshape(K, s * n, 3 * n)).reshape(K, s, n, 3 * n)
        far, fast = h * np.einsum("i,kiab->kab", b @ A, moved), np.einsum("i,kiab->kab", b, moved)
        change = h * np.concatenate([far, fast], axis=1)
        state_transition = np.eye(2 * n) + change[..., : 2 * n]
        state_transition[:, :n, n:] += h * np.eye(n)
        end = np.concatenate(
            [q[:, 0] + h[:, 0] * (v[:, 0] + h[:, 0] * (b @ A @ a)), v[:, 0] + h[:, 0] * (b @ a)], axis=1
        )
        return end, state_transition, change[..., 2 * n :]

    def _accelerations(self, q: Array, v: Array, tau: Array) -> Array:
        """Forward dynamics, friction included, of many states, each array of shape (..., nv)."""
        states = zip(*(np.broadcast_to(x, tau.shape).reshape(-1, tau.shape[-1]) for x in (q, v, tau)), strict=True)
        return np.array([self.acceleration(*state) for state in states]).reshape(tau.shape)
