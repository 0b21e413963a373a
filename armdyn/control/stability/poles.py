"""Eigenvalues of a continuous PID loop, linearised at its goal."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.arguments import expect, one_of
from armdyn.arrays import Array
from armdyn.control.laws.linear import linearised
from armdyn.control.laws.pid import DEFAULT_GAINS, FORMS, Form, PidGains
from armdyn.dynamics import inverse_dynamics
from armdyn.errors import ProblemError
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot, expect_robot


class ArmAtGoal(NamedTuple):
    """An arm under a PID output u, linearised at rest at a goal: δa = B u + S δq - F v.

    At rest the integral holds the arm up: D u = g for form "acceleration", u = g for "torque", nothing for
    "computed_torque". "acceleration" multiplies by D at the *present* position, so only D⁻¹(-g) varies there: S is
    taken at tau = 0; for "torque" at tau = g. "computed_torque" cancels gravity and friction: S = 0, F = 0.
    """

    B: Array
    """Shape (nv, nv): D⁻¹ for form "torque", else I."""
    S: Array
    """∂a/∂q under a constant output [1/s²], shape (nv, nv)."""
    F: Array
    """D⁻¹ ∂tau_f/∂v at rest, of the joints' friction [1/s], shape (nv, nv)."""

    @classmethod
    def of(cls, robot: Robot, goal: Array, form: Form) -> Self:
        """Linearise an arm at its goal, by Pinocchio's analytic derivatives of the articulated-body algorithm.

        Args:
            robot: the arm.
            goal: [rad or m], shape (nv,).
            form: see `Form`.
        """
        nv, one = robot.nv, np.eye(robot.nv)
        if form == "computed_torque":
            return cls(one, 0 * one, 0 * one)
        rest = np.zeros(nv)
        holding = inverse_dynamics(robot)(goal, rest, rest) if form == "torque" else rest
        A, B = linearised(robot, goal, rest, holding)
        return cls(B[nv:] if form == "torque" else one, A[nv:, :nv], -A[nv:, nv:])


def closed_loop_matrix(arm: ArmAtGoal, kp: Array, ki: Array, kd: Array) -> Array:
    """Matrix A of the loop linearised at its goal, ẋ = A x, with x = (∫e, q - goal, v).

        ⎡ 0      -I       0       ⎤
        ⎢ 0       0       I       ⎥   with K = diag(k).
        ⎣ B Ki   S - B Kp -B Kd - F⎦

    Effort limits do not enter: A describes the loop while no torque saturates.

    Args:
        arm: B, S and F.
        kp: gains of u = kp e + ki ∫e dt - kd v, shape (nv,); likewise the others.
        ki: integral gains.
        kd: derivative gains.

    Returns:
        Shape (k + 2 nv, k + 2 nv). k is the number of joints with ki > 0: without an integral gain the
        integral acts on nothing and is left out. Such a joint does not come to rest at the goal under
        gravity; A then says how it would move about the goal if gravity were held there.
    """
    (B, S, F), nv = arm, kp.size
    A = np.block(
        [
            [np.zeros((nv, nv)), -np.eye(nv), np.zeros((nv, nv))],
            [np.zeros((nv, 2 * nv)), np.eye(nv)],
            [B * ki, S - B * kp, -B * kd - F],
        ]
    )
    kept = np.r_[np.flatnonzero(ki > 0), nv : 3 * nv]
    return np.asarray(A[np.ix_(kept, kept)])


def eigenvalues(A: Array) -> NDArray[np.complex128]:
    """Eigenvalues of a matrix of shape (n, n) [1/s], largest real part first, shape (n,).

    Raises:
        ProblemError: it is not finite.
    """
    if not np.all(np.isfinite(A)):
        raise ProblemError(
            "the loop at its goal exceeds the range of floating-point numbers: gains, friction or inertia are too large"
        )
    values = np.linalg.eigvals(A).astype(complex)
    return np.asarray(values[np.argsort(-values.real, kind="stable")])


def closed_loop_eigenvalues(
    robot: Robot, q_goal: ArrayLike, gains: PidGains = DEFAULT_GAINS, form: Form = "acceleration"
) -> NDArray[np.complex128]:
    """Eigenvalues [1/s] of `closed_loop_matrix`, largest real part first; the loop is stable if that is < 0.

    Args:
        robot: an arm.
        q_goal: goal [rad or m], shape (nv,).
        gains: see `PidGains`; by default `DEFAULT_GAINS`.
        form: see `Form`.

    Returns:
        Shape (k + 2 nv,), k the number of joints with ki > 0.

    Raises:
        ProblemError: q_goal or the gains do not fit the robot; unknown form.
    """
    goal = pose_given(expect_robot(robot), q_goal, "q_goal")
    one_of(form, FORMS, "form")
    per_joint = expect(gains, PidGains, "gains", "PidGains(kp=…, ki=…, kd=…)").per_joint(robot.nv)
    return eigenvalues(closed_loop_matrix(ArmAtGoal.of(robot, goal, form), *per_joint))
