"""Inverse kinematics: joint positions that bring a frame of an arm to a pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from armdyn.arguments import text
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot
from armdyn.models.values.joint_limits import JointLimits
from armdyn.models.values.placement import Placement, homogeneous
from armdyn.reprs import brief

Array = NDArray[np.float64]

_STARTS = 80
_STEPS = 100
REACHED = 1e-9
"""Error of a pose [m and rad] that counts as none: far below any encoder's, far above rounding."""
_DEPENDENT = 1e-6
"""Singular values of a frame's Jacobian below this share of the greatest: joints that move together leave it there."""
_DISTINCT = 0.3
"""Solutions of which no joint is further off than this [rad or m] are one branch."""


@brief
@dataclass(frozen=True)
class GoalPose:
    """Where a frame of an arm is to be.

    Attributes:
        frame: its name; a link or a joint of the URDF.
        placement: in the world: a pose, shape (4, 4) or `pin.SE3`, or a position [m], shape (3,), which leaves
            the orientation open (a planar arm cannot choose it). Kept as rows of numbers.
    """

    frame: str
    placement: Placement

    def __post_init__(self) -> None:
        text(self.frame, "frame of a goal pose")
        pose = homogeneous(self.placement, f"placement of the goal pose of {self.frame!r}")
        rows = pose[:3, 3].tolist() if np.shape(self.placement) == (3,) else map(tuple, pose.tolist())
        object.__setattr__(self, "placement", tuple(rows))

    @property
    def oriented(self) -> bool:
        """Whether it says an orientation, too."""
        return np.ndim(self.placement) == 2

    @property
    def pose(self) -> pin.SE3:
        """In the world; without an orientation the world's."""
        return pin.SE3(homogeneous(self.placement, "goal pose"))


def poses_reaching(
    robot: Robot, goal: GoalPose, near: ArrayLike, limits: JointLimits, seed: int = 0, most: int = 8
) -> list[Array]:
    """Joint positions at which a frame is at a goal, of different branches.

    Levenberg and Marquardt's method from many random positions (Sugihara 2011), kept within the position
    limits. A redundant arm has a continuum of them, of which these are samples.

    Args:
        robot: the arm.
        goal: where the frame is to be.
        near: joint positions [rad or m], shape (nv,); solutions come nearest first, by the share of the velocity
            limits that getting there takes, whole turns taken off where the limits allow.
        limits: of the positions, and of the velocities that order them.
        seed: of the random positions.
        most: so many at most.

    Raises:
        SpecError: the robot has no such frame.
        ProblemError: the frame does not move, or no position was found that reaches the goal; with how near it comes.
    """
    frame = robot.frame(goal.frame)
    if frame.parentJoint == 0:
        raise ProblemError(f"frame {goal.frame!r} of {robot.name} does not move: it has no goal")
    near = np.asarray(near, dtype=float)
    random = np.random.default_rng(seed)
    low = np.maximum(limits.position_lower, np.minimum(near, limits.position_upper) - np.pi)
    high = np.minimum(limits.position_upper, np.maximum(near, limits.position_lower) + np.pi)
    starts = [near, *(random.uniform(low, high) for _ in range(_STARTS - 1))]
    found: list[Array] = []
    missed: list[tuple[float, float]] = []
    for start in starts:
        q, error = _approach(robot, goal, frame, start, limits)
        size = float(np.linalg.norm(error))
        if size <= REACHED:
            found.append(_unwound(robot, q, near, limits))
        else:
            missed.append((float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))))
    if not found:
        distance, angle = min(missed, key=lambda miss: miss[0] + miss[1])
        turned = f" and {angle:.3g} rad" if goal.oriented else ""
        raise ProblemError(
            f"frame {goal.frame!r} of {robot.name} cannot reach its goal pose within the joint limits: "
            f"the nearest found is {distance:.3g} m{turned} away, from {_STARTS} starts"
        )
    speed = np.where(np.isfinite(limits.velocity), limits.velocity, 1.0)
    found.sort(key=lambda q: (float(np.max(np.abs(q - near) / speed)), q.tolist()))
    kept: list[Array] = []
    for q in found:
        if all(np.max(np.abs(q - other)) > _DISTINCT for other in kept):
            kept.append(q)
    return kept[:most]


def free_directions(robot: Robot, goal: GoalPose, q: Array) -> Array:
    """Orthonormal directions of the joint positions that leave the frame at its goal, shape (nv, k); k is 0 if none.

    Args:
        robot: the arm.
        goal: where the frame is.
        q: joint positions that reach it [rad or m], shape (nv,).
    """
    _, jacobian = _error(robot, goal, robot.frame(goal.frame), robot.model.createData(), q)
    _, sizes, rows = np.linalg.svd(jacobian)
    rank = int(np.sum(sizes > _DEPENDENT * sizes[0]))
    return np.asarray(rows[rank:].T)


def slid(robot: Robot, goal: GoalPose, q: Array, step: Array, limits: JointLimits) -> Array | None:
    """The joint positions near q + step that reach the goal, too; None: none was found. Each of shape (nv,)."""
    moved, error = _approach(robot, goal, robot.frame(goal.frame), q + step, limits)
    return moved if np.linalg.norm(error) <= REACHED else None


def _error(robot: Robot, goal: GoalPose, frame: pin.Frame, data: pin.Data, q: Array) -> tuple[Array, Array]:
    """The frame's pose error in its own axes [m, rad], and its Jacobian by q."""
    model = robot.model
    pin.computeJointJacobians(model, data, robot.configuration(q))
    here = data.oMi[frame.parentJoint] * frame.placement
    jacobian = pin.getJointJacobian(model, data, frame.parentJoint, pin.ReferenceFrame.LOCAL)
    jacobian = frame.placement.toActionMatrixInverse() @ jacobian
    if goal.oriented:
        off = here.actInv(goal.pose)
        return pin.log6(off).vector, pin.Jlog6(off.inverse()) @ jacobian
    return here.actInv(goal.pose.translation), jacobian[:3]


def _approach(robot: Robot, goal: GoalPose, frame: pin.Frame, start: Array, limits: JointLimits) -> tuple[Array, Array]:
    """Where the method ends, and the error there; damped by the error's own size."""
    data = robot.model.createData()
    q = np.clip(start, limits.position_lower, limits.position_upper)
    error, jacobian = _error(robot, goal, frame, data, q)
    damping = 1e-3
    for _ in range(_STEPS):
        cost = float(error @ error)
        if cost <= (REACHED / 10) ** 2 or damping > 1e6:
            break
        normal = jacobian.T @ jacobian + damping * cost * np.eye(q.size) + 1e-12 * np.eye(q.size)
        step = np.linalg.solve(normal, jacobian.T @ error)
        tried = np.clip(q + step, limits.position_lower, limits.position_upper)
        new_error, new_jacobian = _error(robot, goal, frame, data, tried)
        if float(new_error @ new_error) < cost:
            q, error, jacobian, damping = tried, new_error, new_jacobian, max(damping / 5, 1e-6)
        else:
            damping = max(4 * damping, 1e-3)
    return q, error


def _unwound(robot: Robot, q: Array, near: Array, limits: JointLimits) -> Array:
    """The same pose with every angle as near as whole turns within the limits bring it."""
    out = q.copy()
    for i, joint in enumerate(list(robot.model.joints)[1:]):
        if np.any(np.ravel(joint.createData().S)[:3]):
            continue
        turned = q[i] - 2 * np.pi * np.round((q[i] - near[i]) / (2 * np.pi))
        if limits.position_lower[i] <= turned <= limits.position_upper[i]:
            out[i] = turned
    return out
