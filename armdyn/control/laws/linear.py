"""An arm about its reference as linear difference equations, and the gains that are best for them."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, expm, solve_discrete_are

from armdyn.arrays import Array
from armdyn.control.loop.references import Ticks
from armdyn.dynamics.numeric import forward_dynamics_derivatives
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot
from armdyn.parallel import one_blas_thread


class Steps(NamedTuple):
    """x[k + 1] = A[k] x[k] + B[k] u[k] of small deviations; the last pair holds for good."""

    A: Array
    """Shape (n, m, m)."""
    B: Array
    """Shape (n, m, nv)."""


class LinearPlant(NamedTuple):
    """An arm near states: d/dt (δq, δv) = A (δq, δv) + B δtau."""

    A: Array
    """Shape (…, 2 nv, 2 nv) [1/s, 1/s²]; at rest gravity's slope and that of the joints' friction."""
    B: Array
    """Shape (…, 2 nv, nv), D⁻¹ [1/(kg m²) or 1/kg] in its lower half."""


def linearised(robot: Robot, q: Array, v: Array, tau: Array) -> LinearPlant:
    """d/dt (δq, δv) = A (δq, δv) + B δtau at states, with Pinocchio's derivatives of the articulated-body algorithm.

    J. Carpentier, N. Mansard: Analytical Derivatives of Rigid Body Dynamics Algorithms, RSS 2018. The joints'
    friction acts as a torque -tau_f(v).

    Args:
        robot: the arm.
        q: position [rad or m], shape (…, nv).
        v: velocity [rad/s or m/s], shape (…, nv).
        tau: torque [N m or N], shape (…, nv).
    """
    _, by_q, by_v, inverse = forward_dynamics_derivatives(robot)(q, v, tau)
    none, one = np.zeros_like(inverse), np.broadcast_to(np.eye(robot.nv), inverse.shape)
    return LinearPlant(np.block([[none, one], [by_q, by_v]]), np.concatenate([none, inverse], axis=-2))


def plant_steps(robot: Robot, ticks: Ticks) -> Steps:
    """Discretise an arm's (δq, δv) along a reference, with torques held over each tick.

    The exponential of the linearisation in the middle of each tick, under its mean torque (the midpoint rule of Magnus:
    Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., section IV.7): its error is of third order in
    the tick. The last pair is of rest at the goal.

    Args:
        robot: the controller's model of the arm.
        ticks: the reference.
    """
    q, v, h = ticks.q, ticks.v, 1 / ticks.rate
    middle_q = (q[:-1] + q[1:]) / 2 - h / 8 * np.diff(v, axis=0)
    middle_v = (v[:-1] + v[1:]) / 2
    tau = np.vstack([ticks.tau[:-1], robot.holding_torque(ticks.goal)])
    states = np.vstack([middle_q, ticks.goal]), np.vstack([middle_v, np.zeros(robot.nv)]), tau
    return Steps(*zero_order_hold(*linearised(robot, *states), h))


def zero_order_hold(A: Array, B: Array, period: float) -> tuple[Array, Array]:
    """Zero-order hold: exact discretisation of ẋ = A x + B u over one tick, x[k + 1] = A' x[k] + B' u.

    Both are parts of one matrix exponential (Åström and Wittenmark, Computer-Controlled Systems, 3rd ed., (2.6)).

    Args:
        A: shape (…, m, m).
        B: shape (…, m, nv).
        period: one tick [s].
    """
    m, nv = B.shape[-2:]
    block = np.zeros((*A.shape[:-2], m + nv, m + nv))
    block[..., :m, :m], block[..., :m, m:] = A, B
    with one_blas_thread():  # there may be a thousand small matrices
        step = np.asarray(expm(period * block))
    return step[..., :m, :m], step[..., :m, m:]


def loop_steps(plant: Steps, delay: int, gathered: Array) -> Steps:
    """Augment the steps by a loop's states: x = (e, ė, ∫e dt, torques decided and not yet applied), the next first.

    All are reference less actual. u is computed at a tick, and applied `delay` ticks later.

    Args:
        plant: (e, ė) from tick to tick, as `plant_steps` has it.
        delay: ticks from a reading to its torque.
        gathered: integration time of an error at each tick [s], shape (n,): the period where the integral runs, else 0.

    Returns:
        Steps of shape (n, (3 + delay) nv, (3 + delay) nv) and (n, (3 + delay) nv, nv).
    """
    count, nv = len(plant.A), plant.B.shape[-1]
    size = (3 + delay) * nv
    A, B = np.zeros((count, size, size)), np.zeros((count, size, nv))
    A[:, : 2 * nv, : 2 * nv] = plant.A
    A[:, 2 * nv : 3 * nv, :nv] = gathered[:, None, None] * np.eye(nv)
    A[:, 2 * nv : 3 * nv, 2 * nv : 3 * nv] = np.eye(nv)
    if not delay:
        B[:, : 2 * nv] = plant.B
        return Steps(A, B)
    A[:, : 2 * nv, 3 * nv : 4 * nv] = plant.B
    A[:, 3 * nv : -nv, 4 * nv :] = np.eye((delay - 1) * nv)
    B[:, -nv:] = np.eye(nv)
    return Steps(A, B)


def best_gains(steps: Steps, Q: Array, R: Array) -> Array:
    """LQR gains K of u[k] = -K[k] x[k] for the cost Σ xᵀ Q[k] x + uᵀ R u, Q and R diagonal.

    Riccati's recursion backwards from the steady state at the goal, the solution of the discrete algebraic equation
    (Anderson and Moore, Optimal Control: Linear Quadratic Methods, sections 2.4 and 3.3).

    Args:
        steps: along the reference, rest at the goal last.
        Q: diagonal weights of x at each tick, shape (n, m).
        R: diagonal weights of u, shape (nv,).

    Returns:
        Shape (n, nv, m).

    Raises:
        ProblemError: at the goal there is no such K, or numbers cannot hold it.
    """
    try:
        P = solve_discrete_are(steps.A[-1], steps.B[-1], np.diag(Q[-1]), np.diag(R))
    except (LinAlgError, ValueError) as error:
        raise ProblemError(
            f"there is no linear-quadratic regulator at the goal ({error}); other weights, another rate, or limits of "
            "torque that fit the arm may help"
        ) from None
    gains = np.empty((len(steps.A), R.size, Q.shape[1]))
    for k in reversed(range(len(gains))):
        A, B = steps.A[k], steps.B[k]
        BP = B.T @ P
        gains[k] = np.linalg.solve(np.diag(R) + BP @ B, BP @ A)
        P = np.diag(Q[k]) + A.T @ P @ (A - B @ gains[k])
        P = (P + P.T) / 2
    return gains
