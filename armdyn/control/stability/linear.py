"""Linearisation of an arm and of a controller's law at rest at a goal; eigenvalues of a continuous PID loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.arguments import expect, one_of
from armdyn.arrays import Array
from armdyn.control.laws.linear import LinearPlant, linearised
from armdyn.control.laws.pid import DEFAULT_GAINS, FORMS, Form, PidGains
from armdyn.control.loop.loop import Controller, Law, Loop, expect_controller, expect_loop, law_of
from armdyn.control.loop.references import Ticks, set_point
from armdyn.errors import ProblemError
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot, expect_robot

_NEWTON_STEPS = 20
_NEAR = 1e-12
"""Newton's method for the integrals at rest ends when a step is so small a part of them."""


class BeyondNumbersError(ProblemError):
    """A loop exceeds the range of floating-point numbers: its gains, friction or period are too large."""


@dataclass(frozen=True, eq=False)
class LawDerivatives:
    """A law near rest: δtau = q δq + v δv + integral δz + pending δp, of its readings.

    Attributes:
        q: [N m/rad], shape (nv, nv).
        v: [N m s/rad], shape (nv, nv).
        integral: [N m/(rad s)], shape (nv, k), of the k joints whose integral the law uses.
        pending: [-], shape (nv, delay nv).
        used: which joints those k are, shape (k,).
    """

    q: Array
    v: Array
    integral: Array
    pending: Array
    used: NDArray[np.intp]

    @classmethod
    def of(cls, law: Law, goal: Array, holding: Array, delay: int) -> Self:
        """Differentiate a law by CasADi in its last row, with the integrals that hold the arm.

        Where no integral can, as without integral gains, the torque is another than the holding one and the arm would
        rest away from the goal; the derivatives are those at the goal all the same.

        Args:
            law: of a reference that rests at the goal.
            goal: [rad or m], shape (nv,).
            holding: torque that holds the arm there [N m or N], shape (nv,).
            delay: ticks.

        Raises:
            BeyondNumbersError: a derivative is not finite.
        """
        nv, row = goal.size, law.rows[-1]
        pending, jacobian = np.tile(holding, delay), law.function.jacobian()
        z, old = np.zeros(nv), np.zeros(nv)
        for _ in range(_NEWTON_STEPS):
            readings = (goal, old, z, pending, row)
            blocks = [np.array(block) for block in jacobian(*readings, np.zeros(nv))]
            rest = holding - np.array(law.function(*readings)).ravel()
            step = np.linalg.lstsq(blocks[2], rest, rcond=None)[0]
            if not all(np.all(np.isfinite(part)) for part in (*blocks[:4], step)):
                raise BeyondNumbersError(
                    "the law's derivatives at the goal exceed the range of floating-point numbers; "
                    "its gains are too large"
                )
            if np.abs(step).max() <= _NEAR * max(1.0, np.abs(z).max()):
                break
            z = z + step
        used = np.flatnonzero(np.any(blocks[2] != 0, axis=0))
        return cls(blocks[0], blocks[1], blocks[2][:, used], blocks[3].reshape(nv, delay * nv), used)


@dataclass(frozen=True, eq=False)
class Rest:
    """A loop at rest at a goal: the arm, the controller's model of it, and the law.

    Attributes:
        plant: the arm.
        model: the controller's model of the arm.
        law: its derivatives.
    """

    plant: LinearPlant
    model: LinearPlant
    law: LawDerivatives

    @classmethod
    def of(
        cls, robot: Robot, q_goal: ArrayLike, controller: Controller, loop: Loop, plant: Robot | None = None
    ) -> Self:
        """Linearise a controller's loop.

        Args:
            robot: the controller's model of the arm.
            q_goal: [rad or m], shape (nv,).
            controller: of the loop.
            loop: connection to the arm.
            plant: the arm; None: the model is right.

        Raises:
            ProblemError: the goal, the controller or the plant does not fit the robot, or the controller the loop.
        """
        expect_robot(robot)
        arm = robot if plant is None else expect_robot(plant, "plant")
        if arm.nv != robot.nv:
            raise ProblemError(f"the plant {arm.name} has {arm.nv} joints; the controller's model has {robot.nv}")
        goal = pose_given(robot, q_goal, "q_goal")
        rest, holding = np.zeros(robot.nv), arm.holding_torque(goal)
        ticks = Ticks.of(robot, set_point(robot, goal, expect_loop(loop).period), loop.rate)
        law = law_of(expect_controller(controller), robot, ticks, loop)
        return cls(
            linearised(arm, goal, rest, holding),
            linearised(robot, goal, rest, holding),
            LawDerivatives.of(law, goal, holding, loop.delay),
        )


def continuous_matrix(rest: Rest) -> Array:
    """Matrix of the loop as a differential equation, without sampling and delay: ẋ = A x, x = (∫e, q, v).

    Args:
        rest: of a loop without delay, such as `Loop.ideal()`.

    Returns:
        Shape (k + 2 nv, k + 2 nv), k the number of joints whose integral the law uses.

    Raises:
        BeyondNumbersError: it is not finite.
    """
    law = rest.law
    with np.errstate(over="ignore", invalid="ignore"):
        A = _closed(rest.plant, np.hstack([law.integral, law.q, law.v]), law.used)
    if not np.all(np.isfinite(A)):
        raise BeyondNumbersError(
            "the continuous loop exceeds the range of floating-point numbers; its gains are too large"
        )
    return A


def _closed(plant: LinearPlant, gains: Array, used: NDArray[np.intp]) -> Array:
    """Matrix of a loop with the output gains · (∫e of the joints `used`, q, v), gains of shape (nv, k + 2 nv)."""
    k = used.size
    A = np.zeros((k + len(plant.A),) * 2)
    A[np.arange(k), k + used] = -1.0
    A[k:, k:] = plant.A
    A[k:] += plant.B @ gains
    return A


def plant_at_goal(robot: Robot, goal: Array, form: Form) -> LinearPlant:
    """An arm under a PID output u, linearised at rest at a goal: d/dt (δq, δv) = A (δq, δv) + B δu.

    At rest the integral holds the arm up: D u = g for form "acceleration", u = g for "torque", nothing for
    "computed_torque". "acceleration" multiplies by D at the *present* position, so only D⁻¹(-g) varies there: A is
    taken at tau = 0; for "torque" at tau = g. "computed_torque" cancels gravity and friction. But for "torque" the
    lower half of B is I.

    Args:
        robot: the arm.
        goal: [rad or m], shape (nv,).
        form: see `Form`.
    """
    nv = robot.nv
    B = np.eye(2 * nv, nv, -nv)
    if form == "computed_torque":
        return LinearPlant(np.eye(2 * nv, k=nv), B)
    rest = np.zeros(nv)
    plant = linearised(robot, goal, rest, robot.holding_torque(goal) if form == "torque" else rest)
    return plant if form == "torque" else plant._replace(B=B)


def closed_loop_matrix(plant: LinearPlant, kp: Array, ki: Array, kd: Array) -> Array:
    """Matrix A of the loop linearised at its goal, ẋ = A x, with x = (∫e, q - goal, v).

        ⎡ 0      -I       0       ⎤
        ⎢ 0       0       I       ⎥   with K = diag(k), and S, -F and B the lower halves of the plant's matrices.
        ⎣ B Ki   S - B Kp -B Kd - F⎦

    Effort limits do not enter: A describes the loop while no torque saturates.

    Args:
        plant: of `plant_at_goal`.
        kp: gains of u = kp e + ki ∫e dt - kd v, shape (nv,); likewise the others.
        ki: integral gains.
        kd: derivative gains.

    Returns:
        Shape (k + 2 nv, k + 2 nv). k is the number of joints with ki > 0: without an integral gain the
        integral acts on nothing and is left out. Such a joint does not come to rest at the goal under
        gravity; A then says how it would move about the goal if gravity were held there.
    """
    used = np.flatnonzero(ki > 0)
    return _closed(plant, np.hstack([np.diag(ki)[:, used], -np.diag(kp), -np.diag(kd)]), used)


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
    return eigenvalues(closed_loop_matrix(plant_at_goal(robot, goal, form), *per_joint))
