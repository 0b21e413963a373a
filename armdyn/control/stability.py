"""Whether a PID loop is stable at its goal: the loop's linearisation and its eigenvalues."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.control.motion import EquationsOfMotion, motion_of
from armdyn.control.pid import DERIVATIVE_SIGNS, FORMS, PAPER_GAINS, DerivativeSign, Form, PidGains
from armdyn.errors import ProblemError
from armdyn.models import Robot

Array = NDArray[np.float64]


def closed_loop_matrix(
    robot: Robot,
    q_goal: ArrayLike,
    gains: PidGains = PAPER_GAINS,
    form: Form = "acceleration",
    *,
    derivative_sign: DerivativeSign = "corrected",
    dynamics: EquationsOfMotion | None = None,
) -> Array:
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
        robot: an arm.
        q_goal: goal [rad or m], shape (nv,).
        gains: see `PidGains`.
        form: see `Form`.
        derivative_sign: see `DerivativeSign`.
        dynamics: other equations of motion than the robot's own.

    Returns:
        Shape (k + 2 nv, k + 2 nv). k is the number of joints with ki > 0: without an integral gain the
        integral acts on nothing and is left out. Such a joint does not come to rest at the goal under
        gravity; A then says how it would move about the goal if gravity were held there.

    Raises:
        ProblemError: q_goal or the gains do not fit the robot; unknown form or derivative_sign.
    """
    goal = joint_vector(robot, q_goal, "q_goal")
    one_of("form", form, FORMS)
    one_of("derivative_sign", derivative_sign, DERIVATIVE_SIGNS)
    kp, ki, kd = gains.per_joint(robot.nv)
    kd = kd if derivative_sign == "corrected" else -kd
    motion = motion_of(robot, dynamics)
    nv = robot.nv
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
            [B * ki, S - B * kp, -B * kd - F],
        ]
    )
    kept = np.r_[np.flatnonzero(ki > 0), nv : 3 * nv]
    return np.asarray(A[np.ix_(kept, kept)])


def closed_loop_eigenvalues(
    robot: Robot,
    q_goal: ArrayLike,
    gains: PidGains = PAPER_GAINS,
    form: Form = "acceleration",
    *,
    derivative_sign: DerivativeSign = "corrected",
    dynamics: EquationsOfMotion | None = None,
) -> NDArray[np.complex128]:
    """Eigenvalues [1/s] of `closed_loop_matrix`, largest real part first; the loop is stable if that is < 0.

    Args:
        robot: an arm.
        q_goal: goal [rad or m], shape (nv,).
        gains: see `PidGains`.
        form: see `Form`.
        derivative_sign: see `DerivativeSign`.
        dynamics: other equations of motion than the robot's own.

    Returns:
        Shape (k + 2 nv,), k the number of joints with ki > 0.

    Raises:
        ProblemError: as `closed_loop_matrix`.
    """
    A = closed_loop_matrix(robot, q_goal, gains, form, derivative_sign=derivative_sign, dynamics=dynamics)
    values = np.linalg.eigvals(A).astype(complex)
    return np.asarray(values[np.argsort(-values.real, kind="stable")])


def joint_vector(robot: Robot, value: ArrayLike, what: str) -> Array:
    """One finite number per joint, as an array of shape (nv,).

    Raises:
        ProblemError: it is something else.
    """
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ProblemError(f"{what} is {value!r}; expected {robot.nv} numbers, one per joint") from None
    if array.ndim == 0 and robot.nv == 1:
        array = array.reshape(1)
    if array.shape != (robot.nv,):
        raise ProblemError(
            f"{what} has shape {array.shape}; expected ({robot.nv},), one number per joint: "
            f"{', '.join(robot.joint_names)}"
        )
    for name, number in zip(robot.joint_names, array, strict=True):
        if not np.isfinite(number):
            raise ProblemError(f"{what} of joint {name!r} is {number}; it must be finite")
    return array


def one_of(what: str, value: str, known: tuple[str, ...]) -> None:
    """Raises ProblemError unless `value` is one of `known`."""
    if value not in known:
        raise ProblemError(f"{what} is {value!r}; it is one of {', '.join(map(repr, known))}")
