"""Inverse kinematics: joint positions that bring a frame of an arm to a pose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from armdyn.arguments import number, several, shown, text
from armdyn.arrays import Array, Flags
from armdyn.errors import ProblemError
from armdyn.locks import cached_property
from armdyn.models.robots.robot import Robot
from armdyn.models.values.joint_limits import JointLimits
from armdyn.models.values.placement import Placement, homogeneous
from armdyn.reprs import brief

Row = tuple[float, ...]

_STARTS = 80
_STEPS = 100
REACHED = 1e-9
"""Largest error of a reached pose [m and rad]: far below any encoder's, far above rounding."""
_DEPENDENT = 1e-6
"""Singular values of a frame's Jacobian below this share of the greatest: joints that move together leave it there."""
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
"""Names of a goal pose's directions."""
_DISTINCT = 0.3
"""Largest distance of a joint between solutions of one branch [rad or m]."""


@brief
@dataclass(frozen=True)
class GoalPose:
    """Goal of a frame: a pose, or a region around it.

    Deviations are measured along the axes of `placement`: of the position [m], and of the orientation as a rotation
    vector [rad]. With one free rotation it is the vector of the turn that brings that axis to the frame's.

    Attributes:
        frame: its name; a link or a joint of the URDF.
        placement: in the world: a pose, shape (4, 4) or `pin.SE3`, or a position [m], shape (3,), which leaves
            the orientation open (a planar arm cannot choose it). Kept as rows of numbers.
        free: directions without a limit: of "x", "y", "z", "rx", "ry", "rz", with one rotation or all three. ("rz",)
            lets a tool turn about its own z axis.
        tolerance: largest deviation either way along and about x, y, z [m, rad], six numbers; () stands for zeros.
    """

    frame: str
    placement: Placement
    free: tuple[str, ...] = ()
    tolerance: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        text(self.frame, "frame of a goal pose")
        pose = homogeneous(self.placement, f"placement of the goal pose of {self.frame!r}")
        rows = pose[:3, 3].tolist() if np.shape(self.placement) == (3,) else map(tuple, pose.tolist())
        object.__setattr__(self, "placement", tuple(rows))
        object.__setattr__(self, "free", _free_of(self.free, self.placement))
        object.__setattr__(self, "tolerance", _tolerance_of(self.tolerance, self.free, self.placement))

    @cached_property
    def deviations(self) -> Array:
        """Largest deviations along and about x, y, z [m, rad], shape (6,), read-only; inf where they are free."""
        most = np.array(self.tolerance or (0.0,) * 6)
        most[[DIRECTIONS.index(name) for name in self.free]] = np.inf
        most[3:] = np.inf if np.ndim(self.placement) == 1 else most[3:]
        most.flags.writeable = False
        return most

    @cached_property
    def oriented(self) -> bool:
        """Whether the goal pose has an orientation."""
        return not np.all(np.isinf(self.deviations[3:]))

    @cached_property
    def axis(self) -> int | None:
        """Number of the axis about which the frame may turn; None: it may not, or about any."""
        turns = np.flatnonzero(np.isinf(self.deviations[3:]))
        return int(turns[0]) if turns.size == 1 else None

    @property
    def exact(self) -> bool:
        """Whether it has neither tolerances nor free directions, but perhaps a free orientation."""
        return not (self.free or any(self.tolerance))

    @property
    def pose(self) -> pin.SE3:
        """Pose in the world; without an orientation, with the world's."""
        return pin.SE3(self._pose)  # a copy: the caller may change it

    @cached_property
    def _pose(self) -> pin.SE3:
        """`pose` as a cached SE3, which inverse kinematics read in every step."""
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
        most: largest number of solutions.

    Raises:
        SpecError: the robot has no such frame.
        ProblemError: the frame does not move, or no position was found that reaches the goal; with the least distance.
    """
    frame = robot.frame(goal.frame)
    if frame.parentJoint == 0:
        raise ProblemError(f"frame {goal.frame!r} of {robot.name} does not move: it has no goal")
    near = np.asarray(near, dtype=float)
    ends = tuple(limits.position_lower.tolist()), tuple(limits.position_upper.tolist())
    reached, missed = _searched(robot, goal, tuple(near.tolist()), ends, seed)
    found = [_unwound(robot, q, near, limits) for q in reached]
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


@lru_cache(maxsize=32)
def _searched(
    robot: Robot, goal: GoalPose, near: Row, ends: tuple[Row, Row], seed: int
) -> tuple[list[Array], list[tuple[float, float]]]:
    """Joint positions that reach a goal from many starts, and distances [m, rad] of those that miss it.

    Kept, as variants of a problem ask for the same.
    """
    random = np.random.default_rng(seed)
    middle, (lower, upper) = np.array(near), map(np.array, ends)
    low = np.maximum(lower, np.minimum(middle, upper) - np.pi)
    high = np.minimum(upper, np.maximum(middle, lower) + np.pi)
    reached: list[Array] = []
    missed: list[tuple[float, float]] = []
    for start in [middle, *(random.uniform(low, high) for _ in range(_STARTS - 1))]:
        q, error = approached(robot, goal, start, (lower, upper))
        if np.linalg.norm(error) <= REACHED:
            reached.append(q)
        else:
            missed.append((float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))))
    return reached, missed


def free_directions(robot: Robot, goal: GoalPose, q: Array) -> Array:
    """Orthonormal directions of the joint positions that leave the frame at its goal, shape (nv, k); k is 0 if none.

    Args:
        robot: the arm.
        goal: where the frame is.
        q: joint positions that reach it [rad or m], shape (nv,).
    """
    _, by = _error(robot, goal, robot.frame(goal.frame), robot.model.createData(), q)
    jacobian = by()
    if not np.any(jacobian):  # in the midst of a region
        return np.eye(robot.nv)
    _, sizes, rows = np.linalg.svd(jacobian)
    rank = int(np.sum(sizes > _DEPENDENT * sizes[0]))
    return np.asarray(rows[rank:].T)


def slid(robot: Robot, goal: GoalPose, q: Array, step: Array, limits: JointLimits) -> Array | None:
    """The joint positions near q + step that reach the goal, too; None: none was found. Each of shape (nv,)."""
    moved, error = approached(robot, goal, q + step, (limits.position_lower, limits.position_upper))
    return moved if np.linalg.norm(error) <= REACHED else None


def frame_placement(robot: Robot, frame: str, q: Array) -> pin.SE3:
    """Placement of a frame in the world at joint positions q [rad or m], shape (nv,)."""
    return _placed(robot, robot.frame(frame), robot.model.createData(), q)


def deviations_of(robot: Robot, goal: GoalPose, q: Array) -> Array:
    """Deviations of a frame from its goal along and about x, y, z, as `GoalPose` defines them [m, rad].

    Args:
        robot: the arm.
        goal: the pose from which the frame deviates.
        q: joint positions [rad or m], shape (nv,), or several, shape (m, nv).

    Returns:
        Shape (6,) or (m, 6).
    """
    fixed, data = robot.frame(goal.frame), robot.model.createData()
    found = [_deviations(goal, goal._pose.actInv(_placed(robot, fixed, data, one))) for one in np.atleast_2d(q)]
    return np.reshape(found, (*np.shape(q)[:-1], 6))


def moving_directions(robot: Robot, goal: GoalPose) -> Flags:
    """Directions along and about the axes of a goal in which the frame can move, shape (6,): of a planar arm three."""
    fixed, data, random = robot.frame(goal.frame), robot.model.createData(), np.random.default_rng(0)
    most, back = np.zeros(6), goal.pose.rotation.T
    for q in random.uniform(-1, 1, (3, robot.nv)):
        frame, own = _placed(robot, fixed, data, q), _jacobian(robot, fixed, data)
        rows = np.vstack([back @ frame.rotation @ own[:3], back @ frame.rotation @ own[3:]])
        most = np.maximum(most, np.max(np.abs(rows), axis=1))
    return np.asarray(most > REACHED)


def _deviations(goal: GoalPose, off: pin.SE3) -> Array:
    """Deviations of a frame placed at `off` in that of the goal [m, rad], shape (6,): see `GoalPose`."""
    if goal.axis is None:
        return np.concatenate([off.translation, pin.log3(off.rotation)])
    axis = np.eye(3)[goal.axis]
    return np.concatenate([off.translation, swing(axis, off.rotation @ axis)])


def _error(
    robot: Robot, goal: GoalPose, frame: pin.Frame, data: pin.Data, q: Array
) -> tuple[Array, Callable[[], Array]]:
    """Error of a frame from its goal or region [m, rad], and a function that returns its Jacobian by q.

    The function is valid until `data` is of other joint positions.
    """
    here = _placed(robot, frame, data, q)
    if not goal.exact:
        return _outside(goal, goal._pose.actInv(here), partial(_jacobian, robot, frame, data))
    off = here.actInv(goal._pose)
    if goal.oriented:
        return pin.log6(off).vector, lambda: pin.Jlog6(off.inverse()) @ _jacobian(robot, frame, data)
    return off.translation, lambda: _jacobian(robot, frame, data)[:3]


def _placed(robot: Robot, frame: pin.Frame, data: pin.Data, q: Array) -> pin.SE3:
    """Placement of a frame in the world; `data` then has the joints' Jacobians, too."""
    pin.computeJointJacobians(robot.model, data, robot.configuration(q))
    return data.oMi[frame.parentJoint] * frame.placement


def _jacobian(robot: Robot, frame: pin.Frame, data: pin.Data) -> Array:
    """Jacobian of a frame in its own axes, shape (6, nv), where `_placed` has placed it."""
    own = pin.getJointJacobian(robot.model, data, frame.parentJoint, pin.ReferenceFrame.LOCAL)
    return np.asarray(frame.placement.toActionMatrixInverse() @ own)


def _outside(goal: GoalPose, off: pin.SE3, jacobian: Callable[[], Array]) -> tuple[Array, Callable[[], Array]]:
    """Deviations beyond a region, with the sign that leads back, and a function that returns their rows by q.

    Rows of deviations within the region are zero.

    Args:
        goal: the region.
        off: the frame's placement in that of the goal.
        jacobian: returns that of the frame in its own axes, shape (6, nv).
    """
    deviation, most = _deviations(goal, off), goal.deviations

    def by() -> Array:
        own = jacobian()
        if goal.axis is None:
            turning = pin.Jlog3(off.rotation) @ own[3:]
        else:
            axis = np.eye(3)[goal.axis]
            # Exact where the axes agree, and near enough elsewhere for a method that compares errors.
            turning = (np.eye(3) - np.outer(axis, axis)) @ off.rotation @ own[3:]
        rows = np.vstack([off.rotation @ own[:3], turning])
        return np.where((np.abs(deviation) >= most - REACHED)[:, None], rows, 0.0)

    return np.clip(deviation, -most, most) - deviation, by


def swing(axis: Array, turned: Array) -> Array:
    """Rotation vector of the shortest turn from one direction to another [rad], shape (3,)."""
    across = np.cross(axis, turned)
    sine = float(np.linalg.norm(across))
    return across * (np.arctan2(sine, axis @ turned) / sine if sine > 0 else 1.0)


def _free_of(free: object, placement: Placement) -> tuple[str, ...]:
    if not isinstance(free, tuple | list) or not all(isinstance(name, str) and name in DIRECTIONS for name in free):
        raise ProblemError(f"free is {shown(free)}; it is a tuple of some of {', '.join(DIRECTIONS)}")
    names = tuple(free)
    turns = {name for name in names if name.startswith("r")}
    if len(turns) == 2 or (turns and np.ndim(placement) == 1):
        raise ProblemError("a goal pose has one free rotation or three, and a position alone has none to be named")
    return tuple(name for name in DIRECTIONS if name in names)


def _tolerance_of(tolerance: object, free: tuple[str, ...], placement: Placement) -> tuple[float, ...]:
    values = tuple(
        number(value, "a tolerance of a goal pose", sign="not negative")
        for value in several(tolerance, "tolerance of a goal pose")
    )
    if len(values) not in (0, 6):
        raise ProblemError(f"the tolerance of a goal pose has {len(values)} numbers; it takes x, y, z, rx, ry, rz")
    if any(values[3:]) and np.ndim(placement) == 1:
        raise ProblemError("the goal pose is a position: its tolerance is of x, y, z alone, with zeros for rotations")
    both = [name for name, value in zip(DIRECTIONS, values, strict=False) if value and name in free]
    if both:
        raise ProblemError(f"{both[0]} of a goal pose is free and has a tolerance: give one of these")
    return values if any(values) else ()


def approached(robot: Robot, goal: GoalPose, near: Array, ends: tuple[Array, Array]) -> tuple[Array, Array]:
    """Inverse kinematics from nearby joint positions: the solution, or the nearest position reached.

    Args:
        robot: the arm.
        goal: where the frame is to be.
        near: joint positions to begin with [rad or m], shape (nv,).
        ends: lower and upper position limits [rad or m], each of shape (nv,).

    Returns:
        The positions [rad or m], shape (nv,), and the frame's distance from the goal there [m, rad], shape (6,) or
        (3,).
    """
    frame, data, (low, high) = robot.frame(goal.frame), robot.model.createData(), ends
    q = np.clip(near, low, high)
    error, by = _error(robot, goal, frame, data, q)
    jacobian, damping = by(), 1e-3
    for _ in range(_STEPS):
        cost = float(error @ error)
        if cost <= (REACHED / 10) ** 2 or damping > 1e6:
            break
        normal = jacobian.T @ jacobian
        diagonal = normal.reshape(-1)[:: q.size + 1]
        diagonal += damping * cost
        diagonal += 1e-12
        step = np.linalg.solve(normal, jacobian.T @ error)
        tried = np.minimum(np.maximum(q + step, low), high)
        new_error, by = _error(robot, goal, frame, data, tried)
        if float(new_error @ new_error) < cost:
            q, error, jacobian, damping = tried, new_error, by(), max(damping / 5, 1e-6)
        else:
            damping = max(4 * damping, 1e-3)
    return q, error


def _unwound(robot: Robot, q: Array, near: Array, limits: JointLimits) -> Array:
    """Shift angles by whole turns within the limits, as near as possible to the reference."""
    out = q.copy()
    for i in np.flatnonzero(~robot.slides):
        turned = q[i] - 2 * np.pi * np.round((q[i] - near[i]) / (2 * np.pi))
        if limits.position_lower[i] <= turned <= limits.position_upper[i]:
            out[i] = turned
    return out
