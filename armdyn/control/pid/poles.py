"""Whether a PID loop is stable at its goal: the loop's linearisation and its eigenvalues."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.control.pid.gains import DEFAULT_GAINS, ContinuousPid, Form, PidGains
from armdyn.control.pid.motion import EquationsOfMotion, Motion, motion_of
from armdyn.errors import ProblemError
from armdyn.models import Robot
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import expect_robot

Array = NDArray[np.float64]


def closed_loop_matrix(motion: Motion, goal: Array, controller: ContinuousPid) -> Array:
    """Matrix A of the loop linearised at its goal, ẋ = A x, with x = (∫e, q - goal, v).

        ⎡ 0      -I       0    ⎤      B = I      for the forms whose output is an acceleration,
        ⎢ 0       0       I    ⎥          D⁻¹    for form "torque";
        ⎣ B Ki   S - B Kp -B Kd - F⎦  S = ∂(plant's acceleration)/∂q with the controller's output held;
                                      F = D⁻¹ ∂tau_f/∂v at rest, of the joints' friction, but 0 for
                                      "computed_torque", which cancels it.

    At rest at the goal the integral carries what keeps the arm up: D u = g for "acceleration", u = g for
    "torque", nothing for "computed_torque". "acceleration" multiplies by D at the *present* position, so
    only D⁻¹(-g) varies there: S is taken at tau = 0; for "torque" at tau = g; for "computed_torque" S = 0.

    Effort limits do not enter: A describes the loop while no torque saturates.

    Args:
        motion: the arm's equations of motion.
        goal: [rad or m], shape (nv,).
        controller: whose loop it is.

    Returns:
        Shape (k + 2 nv, k + 2 nv). k is the number of joints with ki > 0: without an integral gain the
        integral acts on nothing and is left out. Such a joint does not come to rest at the goal under
        gravity; A then says how it would move about the goal if gravity were held there.

    Raises:
        ProblemError: the gains are for another number of joints.
    """
    nv, form = goal.size, controller.form
    kp, ki, damping = controller.coefficients(nv)
    B: Array = np.eye(nv)
    S: Array = np.zeros((nv, nv))
    F: Array = np.zeros((nv, nv))
    if form != "computed_torque":
        F = np.asarray(np.linalg.solve(motion.inertia(goal), np.diag(motion.drag(goal))), dtype=float)
    if form == "acceleration":
        S = motion.stiffness(goal, np.zeros(nv))
    elif form == "torque":
        B = np.asarray(np.linalg.inv(motion.inertia(goal)), dtype=float)
        S = motion.stiffness(goal, motion.bias(goal, np.zeros(nv)))
    A = np.block(
        [
            [np.zeros((nv, nv)), -np.eye(nv), np.zeros((nv, nv))],
            [np.zeros((nv, 2 * nv)), np.eye(nv)],
            [B * ki, S - B * kp, -B * damping - F],
        ]
    )
    kept = np.r_[np.flatnonzero(ki > 0), nv : 3 * nv]
    return np.asarray(A[np.ix_(kept, kept)])


def eigenvalues(A: Array) -> NDArray[np.complex128]:
    """Of a matrix of shape (n, n) [1/s], largest real part first, shape (n,).

    Raises:
        ProblemError: it is not finite.
    """
    if not np.all(np.isfinite(A)):
        raise ProblemError(
            "the loop at its goal leaves what numbers can hold: gains, friction or inertia are too large"
        )
    values = np.linalg.eigvals(A).astype(complex)
    return np.asarray(values[np.argsort(-values.real, kind="stable")])


def closed_loop_eigenvalues(
    robot: Robot,
    q_goal: ArrayLike,
    gains: PidGains = DEFAULT_GAINS,
    form: Form = "acceleration",
    *,
    dynamics: EquationsOfMotion | None = None,
) -> NDArray[np.complex128]:
    """Eigenvalues [1/s] of `closed_loop_matrix`, largest real part first; the loop is stable if that is < 0.

    Args:
        robot: an arm.
        q_goal: goal [rad or m], shape (nv,).
        gains: see `PidGains`; by default `DEFAULT_GAINS`.
        form: see `Form`.
        dynamics: other equations of motion than the robot's own.

    Returns:
        Shape (k + 2 nv,), k the number of joints with ki > 0.

    Raises:
        ProblemError: q_goal or the gains do not fit the robot; unknown form.
    """
    goal = pose_given(expect_robot(robot), q_goal, "q_goal")
    controller = ContinuousPid(gains, form)
    return eigenvalues(closed_loop_matrix(motion_of(robot, dynamics), goal, controller))
