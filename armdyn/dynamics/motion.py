"""Motions of an arm under torques that are linear from sample to sample, by the bridge's C++.

Explicit steps by Dormand-Prince 8(5,3), with the coefficients of `scipy.integrate.DOP853`; implicit ones by any
collocation method. Both let go of the interpreter's lock.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import DOP853

from armdyn.arrays import Array
from armdyn.dynamics.numeric import bridge_arm
from armdyn.models.robots.robot import Robot
from armdyn.models.values.actuator_limits import ActuatorLimits
from armdyn.parallel import may_thread
from armdyn.trajectory import Trajectory

STAGES = int(DOP853.n_stages)
"""Accelerations that an explicit step takes."""
_POLLED = 32
"""Samples between two looks at the clock: at most some seconds."""
_WORTH_A_THREAD = 100
"""Implicit steps that take ten times as long as a thread's start."""


class Tableau(NamedTuple):
    """Butcher tableau of a collocation method.

    The s stages of an interval are x_i = x_k + h Σ_j A_ij f_j, and x_{k+1} = x_k + h Σ_j b_j f_j.

    Attributes:
        A: coefficients of the stages, shape (s, s).
        b: weights of the step, shape (s,).
        c: nodes of the stages in the interval, shape (s,), increasing.
    """

    A: Array
    b: Array
    c: Array


def _collocation(c: Array) -> Tableau:
    """Collocation method at the nodes c: integrates the polynomial through the rates there."""
    powers = np.arange(c.size)
    integrals = np.linalg.inv(c[:, None] ** powers)
    A = (c[:, None] ** (powers + 1) / (powers + 1)) @ integrals
    A[c == 0] = 0.0  # exact zeros of the node at the interval's start
    b = A[-1] if c[-1] == 1 else (1 / (powers + 1)) @ integrals
    return Tableau(A, b, c)


LOBATTO_3 = _collocation(np.array([0.0, 0.5, 1.0]))
"""Three-stage Lobatto IIIA of order 4: Hermite-Simpson, for meshes."""
GAUSS_3 = _collocation((1 + legendre.leggauss(3)[0]) / 2)
"""Three-stage Gauss of order 6, for replays: no stage is a knot."""


@cache
def _explicit() -> Any:
    import _armdyn_bridge as bridge

    names = ("A", "B", "C", "E3", "E5")
    A, b, c, error3, error5 = (np.ascontiguousarray(getattr(DOP853, name), dtype=float) for name in names)
    return bridge.ExplicitMethod(A[:STAGES, :STAGES], b, c[:STAGES], error3, error5)


def replayed(robot: Robot, motion: Trajectory, rtol: float, spare: int) -> Array:
    """States under a motion's torques, from its first state on.

    A step leads from sample to sample. One whose error by the method's own estimate exceeds the tolerance is made in
    halves, and these likewise.

    Args:
        robot: the arm.
        motion: only its first state, times and torques are used.
        rtol: relative tolerance of a step; absolute 1e-2 of that.
        spare: number of evaluations of the acceleration that repeated steps may take.

    Returns:
        States at the samples, up to the first that is not finite or cannot be reached, shape (m, 2 nv).
    """
    x = np.concatenate([motion.q[0], motion.v[0]])
    states: Array = bridge_arm(robot).replay(
        _explicit(), motion.t, motion.tau, motion.tau_end, motion.jumps, x, rtol, spare
    )
    return states


@dataclass(frozen=True, eq=False)
class Feedback:
    """Computed torque −M(q) (2 ω (v − v_desired) + ω² (q − q_desired)) that is added to torques at samples.

    Attributes:
        bandwidth: ω [1/s].
        fade: share of it that acts at the end of each interval between samples, shape (K,).
        clips: rounds in which a torque is clipped to its range in the state that it leads to.
    """

    bandwidth: float
    fade: Array
    clips: int


def tracked(
    robot: Robot,
    target: Trajectory,
    tau: Array,
    x: Array,
    feedback: Feedback,
    limits: ActuatorLimits,
    late: Callable[[], bool] = lambda: False,
    **steps: float,
) -> tuple[Array, Array]:
    """States and torques of an arm under feedback along a motion.

    Args:
        robot: the arm.
        target: states at samples.
        tau: torques there, to which feedback adds, shape (samples, nv).
        x: state at the first sample, shape (2 nv,).
        feedback: at every sample, from the state at the one before.
        limits: to which torques are clipped.
        late: whether to end before the last sample; polled every few samples.
        steps: rtol and spare, as of `replayed`; spare is for every sample.

    Returns:
        As of `replayed`, and the torques at all samples, shape (samples, nv).
    """
    states = np.concatenate([target.q, target.v], axis=1)
    slopes, rests = limits.lines
    torque_range = [np.ascontiguousarray(each, dtype=float) for each in (limits.lower, limits.upper, slopes, rests)]
    arm, found, torques, last = bridge_arm(robot), [x[None]], tau.copy(), target.t.size - 1
    for k in range(0, last, _POLLED):
        upto, part = min(k + _POLLED, last), slice(k, min(k + _POLLED, last) + 1)
        more, torques[part] = arm.track(
            _explicit(), target.t[part], torques[part], target.jumps[k:upto], states[part], feedback.fade[k:upto],
            feedback.bandwidth, feedback.clips, torque_range, found[-1][-1], **steps,
        )  # fmt: skip
        found.append(more[1:])
        if len(more) <= upto - k or late():
            break
    return np.concatenate(found), torques


class Collocation:
    """Implicit Runge-Kutta steps through many segments, with the sensitivities of their end states.

    Half of the segments may run in a second thread; to be called by one thread at a time.

    Newton's method on the accelerations at the stages, with Pinocchio's derivatives of the forward dynamics at the
    middle of the step. The same linear equations yield how the end state depends on the start state and on a constant
    torque (variational equations; Hairer, Nørsett, Wanner, Solving ODEs I, II.17 and IV.8).
    """

    def __init__(self, robot: Robot, tableau: Tableau, tolerance: float, stalled: float, most: int) -> None:
        """Set up integration steps of a robot's equations of motion.

        Args:
            robot: the arm.
            tableau: coefficients of the method.
            tolerance: error of the stage velocities, relative to 1 and the velocity, by the last two Newton steps.
            stalled: the same where Newton steps no longer halve.
            most: Newton steps.
        """
        import _armdyn_bridge as bridge

        A, b, c = (np.ascontiguousarray(each, dtype=float) for each in tableau)
        self._arms = [bridge_arm(robot) for _ in range(1 + may_thread())]
        self._method = bridge.ImplicitMethod(A, b, c, tolerance, stalled, most)

    def __call__(self, h: Array, x: Array, tau: Array, parts: int = 1) -> tuple[Array, Array, Array]:
        """Integrate each segment by equal steps, and differentiate its end state.

        Args:
            h: their lengths [s], shape (K,).
            x: their start states, shape (K, 2 nv).
            tau: torques at start and end [N m or N], shape (K, 2, nv).
            parts: steps in a segment.

        Returns:
            End states, shape (K, 2 nv), and their derivatives by start state, shape (K, 2 nv, 2 nv), and constant
            torque, shape (K, 2 nv, nv). End states are not numbers where Newton's method does not converge.
        """
        cut = h.size // 2 if len(self._arms) > 1 and h.size * parts >= _WORTH_A_THREAD else 0

        def steps(arm: Any, part: slice) -> tuple[Array, Array, Array]:
            found: tuple[Array, Array, Array] = arm.implicit_steps(self._method, h[part], x[part], tau[part], parts)
            return found

        if not cut:
            return steps(self._arms[0], slice(None))
        with ThreadPoolExecutor(1) as pool:
            later = pool.submit(steps, self._arms[1], slice(cut, None))
            first = steps(self._arms[0], slice(cut))
        end, by_state, by_torque = (np.concatenate(pair) for pair in zip(first, later.result(), strict=True))
        return end, by_state, by_torque
