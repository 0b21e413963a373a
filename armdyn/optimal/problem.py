"""What is to be solved: from one pose to another within limits, as fast as can be."""

import warnings
from dataclasses import KW_ONLY, dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from armdyn.errors import ArmdynWarning, ProblemError
from armdyn.models.limits import JointLimits
from armdyn.models.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MinimumTimeProblem:
    """Bring an arm from one state to another in minimum time, or minimum time and effort.

    Minimise J = ∫ (1 + w/2 τᵀτ) dt over the torques and the final time, subject to the equations of
    motion and the limits. With w = 0 this is equation (8) of the paper with (9) put right.

    Attributes:
        robot: the arm.
        q_start: joint positions at the start [rad or m], shape (nv,).
        q_goal: joint positions at the end, shape (nv,).
        v_start: joint velocities at the start [rad/s or m/s], shape (nv,); None: at rest.
        v_goal: joint velocities at the end, shape (nv,); None: at rest.
        effort_limit: torque limits [N m or N]: one number, one per joint, or (lower, upper); None: the robot's.
        velocity_limit: [rad/s or m/s]: one number or one per joint, inf for none; None: the robot's.
        position_limit: (lower, upper) [rad or m], each one number or one per joint; None: the robot's.
        effort_weight: w [1/(N m)²].
        limits: the limits that hold, each of shape (nv,).

    Raises:
        ProblemError: wrong length, not finite, a state outside the limits, start = goal, or a joint
            without a finite, non-zero torque limit.

    Warns:
        ArmdynWarning: the actuators cannot hold the goal. A fast motion to it may exist all the same.
    """

    robot: Robot
    _: KW_ONLY
    q_start: ArrayLike
    q_goal: ArrayLike
    v_start: ArrayLike | None = None
    v_goal: ArrayLike | None = None
    effort_limit: ArrayLike | tuple[ArrayLike, ArrayLike] | None = None
    velocity_limit: ArrayLike | None = None
    position_limit: tuple[ArrayLike, ArrayLike] | None = None
    effort_weight: float = 0.0
    limits: JointLimits = field(init=False, repr=False)

    def __post_init__(self) -> None:
        zero = np.zeros(self.robot.nv)
        for name in ("q_start", "q_goal", "v_start", "v_goal"):
            given = getattr(self, name)
            array = self._joints(zero if given is None else given, name)
            if not np.all(np.isfinite(array)):
                raise ProblemError(f"{name} = {array} is not finite")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if not (np.isfinite(self.effort_weight) and self.effort_weight >= 0):
            raise ProblemError(f"effort_weight is {self.effort_weight}; it must be finite and not negative")
        object.__setattr__(self, "limits", self._resolve_limits())
        for q, v, name in ((self.q_start, self.v_start, "start"), (self.q_goal, self.v_goal, "goal")):
            self._check_state(np.asarray(q), np.asarray(v), name)
        if np.array_equal(self.x_start, self.x_goal):
            raise ProblemError(
                f"start and goal are the same state, q = {self.x_start[: self.robot.nv]}: nothing is to be moved"
            )
        self._warn_if_not_held()

    @property
    def x_start(self) -> Array:
        """Start state (q, v), shape (2 nv,)."""
        return np.concatenate([np.asarray(self.q_start), np.asarray(self.v_start)])

    @property
    def x_goal(self) -> Array:
        """Goal state (q, v), shape (2 nv,)."""
        return np.concatenate([np.asarray(self.q_goal), np.asarray(self.v_goal)])

    def holding_torque(self) -> Array:
        """Torque that holds the arm still at the goal [N m or N], shape (nv,)."""
        model = self.robot.model
        q = self.robot.configuration(np.asarray(self.q_goal))
        return np.array(pin.computeGeneralizedGravity(model, model.createData(), q))

    def duration_bound(self) -> float:
        """No motion within the velocity limits is faster than this [s]; 0 without such limits."""
        distance = np.abs(np.asarray(self.q_goal) - np.asarray(self.q_start))
        return float(np.max(distance / self.limits.velocity))

    def _joints(self, value: ArrayLike, name: str) -> Array:
        array = np.asarray(value, dtype=float)
        if array.shape != (self.robot.nv,):
            raise ProblemError(
                f"{name} has shape {array.shape}; {self.robot.name} needs {self.robot.nv} numbers, for "
                f"{', '.join(self.robot.joint_names)}"
            )
        return array.copy()

    def _limit(self, value: ArrayLike, name: str) -> Array:
        array = np.asarray(value, dtype=float)
        array = self._joints(np.full(self.robot.nv, array) if array.ndim == 0 else array, name)
        if np.any(np.isnan(array)):
            raise ProblemError(f"{name} = {array} has a NaN")
        return array

    def _resolve_limits(self) -> JointLimits:
        own = self.robot.limits
        effort_lower, effort_upper = own.effort_lower, own.effort_upper
        if isinstance(self.effort_limit, tuple) and len(self.effort_limit) == 2:
            effort_lower, effort_upper = (self._limit(x, "effort_limit") for x in self.effort_limit)
        elif self.effort_limit is not None:
            effort_upper = self._limit(self.effort_limit, "effort_limit")
            effort_lower = -effort_upper
        velocity = own.velocity
        if self.velocity_limit is not None:
            velocity = self._limit(self.velocity_limit, "velocity_limit")
        lower, upper = own.position_lower, own.position_upper
        if self.position_limit is not None:
            if len(self.position_limit) != 2:
                raise ProblemError("position_limit must be a pair (lower, upper) [rad or m]")
            lower, upper = (self._limit(x, "position_limit") for x in self.position_limit)
        for i, joint in enumerate(self.robot.joint_names):
            if not effort_lower[i] < effort_upper[i] or not np.isfinite(effort_upper[i] - effort_lower[i]):
                raise ProblemError(
                    f"joint {joint!r} has torque limits [{effort_lower[i]}, {effort_upper[i]}] N m; minimum time "
                    "needs finite ones, the lower below the upper: give effort_limit="
                )
            if not velocity[i] > 0:
                raise ProblemError(f"joint {joint!r} has velocity limit {velocity[i]} rad/s; it must be positive")
            if not lower[i] < upper[i]:
                raise ProblemError(f"joint {joint!r} has position limits [{lower[i]}, {upper[i]}] rad: no room")
        return JointLimits(
            position_lower=lower, position_upper=upper, velocity=velocity,
            effort_lower=effort_lower, effort_upper=effort_upper,
        )  # fmt: skip

    def _check_state(self, q: Array, v: Array, name: str) -> None:
        limits, slack = self.limits, 1e-9  # a pose typed with ten digits may lie on its limit
        for i, joint in enumerate(self.robot.joint_names):
            if not limits.position_lower[i] - slack <= q[i] <= limits.position_upper[i] + slack:
                raise ProblemError(
                    f"{name} of joint {joint!r} (index {i}) is {q[i]:.6g} rad, outside its limits "
                    f"[{limits.position_lower[i]:.6g}, {limits.position_upper[i]:.6g}] rad"
                )
            if abs(v[i]) > limits.velocity[i] + slack:
                raise ProblemError(
                    f"{name} velocity of joint {joint!r} (index {i}) is {v[i]:.6g} rad/s, beyond its limit "
                    f"{limits.velocity[i]:.6g} rad/s"
                )

    def _warn_if_not_held(self) -> None:
        torque = self.holding_torque()
        for i, joint in enumerate(self.robot.joint_names):
            bound = self.limits.effort_upper[i] if torque[i] > 0 else self.limits.effort_lower[i]
            if abs(torque[i]) > abs(bound):
                warnings.warn(
                    f"joint {joint!r} needs {torque[i]:.4g} N m to hold the goal but its limit is {bound:.4g} N m: "
                    "a motion to the goal may exist, staying there is beyond this actuator",
                    ArmdynWarning,
                    stacklevel=4,
                )
