"""What a planned motion keeps: limits less the reserves for feedback, and path constraints; its fastest profiles.

Profiles have seven phases: the acceleration rises, stays and falls, the joint cruises, and the same is reversed
(Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008, section 3.4).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import several
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.presets.preset import ControllerPreset
from armdyn.models.robots.robot import Robot
from armdyn.models.values.joint_limits import JointLimits, scaled_limits
from armdyn.models.values.per_joint import filled, per_joint
from armdyn.reprs import joint_unit


@dataclass(frozen=True, eq=False)
class Reserve:
    """Parts of the limits that are kept for feedback.

    Attributes:
        effort: part of each torque limit [-], shape (nv,), at least 0 and below 1.
        velocity: part of each velocity limit [-], shape (nv,), likewise.
    """

    effort: Array
    velocity: Array

    @classmethod
    def of(cls, effort: ArrayLike, velocity: ArrayLike, joints: Sequence[str]) -> Self:
        """Reserves from one number, or one per joint.

        Raises:
            ProblemError: wrong length, not a number, negative, or nothing left.
        """
        return cls(_parts(effort, joints, "reserve"), _parts(velocity, joints, "velocity_reserve"))

    @property
    def any(self) -> bool:
        """Whether any part of a limit is kept for feedback."""
        return bool(np.any(self.effort) or np.any(self.velocity))

    def left(self, limits: JointLimits, joints: Sequence[str]) -> JointLimits:
        """Limits of torque and velocity times (1 - reserve).

        Raises:
            ProblemError: a joint's torque limits are both above zero, or both below, and no limits nearer to zero lie
                between them.
        """
        one_sided = (self.effort > 0) & ((limits.effort_lower > 0) | (limits.effort_upper < 0))
        if np.any(one_sided):
            i = int(np.argmax(one_sided))
            raise ProblemError(
                f"reserve of joint {joints[i]!r} is {self.effort[i]:g} (index {i}), but its torque limits "
                f"[{limits.effort_lower[i]:g}, {limits.effort_upper[i]:g}] N m leave out zero; a reserve needs it "
                "between them"
            )
        return scaled_limits(limits, 1 - self.effort, 1 - self.velocity)


def reserve_words(part: float, left: float, unit: str) -> str:
    """Reserve of a limit as the end of a message; empty without a reserve.

    Args:
        part: part of the limit that is kept in reserve [-].
        left: the limit less its reserve.
        unit: of the limit.
    """
    return f" ({100 * part:.3g} % of {abs(left) / (1 - part):.4g} {unit} is kept in reserve)" if part else ""


def resolved_limits(
    robot: Robot,
    effort_limit: ArrayLike | tuple[ArrayLike, ArrayLike] | None,
    velocity_limit: ArrayLike | None,
    position_limit: tuple[ArrayLike, ArrayLike] | None,
    preset: ControllerPreset | None,
) -> JointLimits:
    """The robot's limits, replaced by the given ones, or a controller's where these are tighter.

    Where a controller's velocity limit falls to zero with the position, the position is limited to where the arm can be
    at rest. For the arguments see `MinimumTimeProblem`.

    Raises:
        ProblemError: a limit is neither one number nor one per joint.
    """

    def read(value: Any, name: str, own: Array) -> Array:
        given = filled(value, robot.joint_names, name, own, ProblemError)
        return per_joint(given, robot.joint_names, name, error=ProblemError, finite=False)

    own = robot.limits
    limits, velocity, lower, upper = own, own.velocity, own.position_lower, own.position_upper
    if isinstance(effort_limit, tuple) and len(effort_limit) == 2:
        below, above = effort_limit
        limits = replace(
            own,
            effort_lower=read(below, "effort_limit", own.effort_lower),
            effort_upper=read(above, "effort_limit", own.effort_upper),
        )
    elif effort_limit is not None:
        limits = own.with_effort(effort_limit, robot.joint_names, ProblemError)
    if velocity_limit is not None:
        velocity = read(velocity_limit, "velocity_limit", own.velocity)
    if position_limit is not None:
        pair = several(position_limit, "position_limit")
        if len(pair) != 2:
            raise ProblemError("position_limit must be a pair (lower, upper) [rad or m]")
        lower, upper = map(read, pair, ("position_limit",) * 2, (lower, upper))
    if preset is None:
        return replace(limits, position_lower=lower, position_upper=upper, velocity=velocity)
    fastest, torque = preset.limit("velocity"), preset.limit("torque")
    least, most = preset.limit("position_lower"), preset.limit("position_upper")
    if least is not None and most is not None:
        lower, upper = np.maximum(lower, least), np.minimum(upper, most)
    if (taper := preset.taper) is not None:
        rest = np.square(taper.offset) / np.asarray(taper.gain)
        lower, upper = np.maximum(lower, taper.lower + rest), np.minimum(upper, taper.upper - rest)
    strongest = np.inf if torque is None else torque
    return replace(
        limits, position_lower=lower, position_upper=upper,
        velocity=velocity if fastest is None else np.minimum(velocity, fastest),
        effort_lower=np.maximum(limits.effort_lower, -strongest),
        effort_upper=np.minimum(limits.effort_upper, strongest),
    )  # fmt: skip


def rate_limit(value: ArrayLike | None, name: str, robot: Robot, preset: ControllerPreset | None) -> Array | None:
    """The tighter of a given rate limit and a controller's, shape (nv,) [rad/s² or rad/s³]; None: neither exists.

    Args:
        value: the given limit; None: only the controller's holds.
        name: "acceleration_limit" or "jerk_limit".
        robot: the robot that moves.
        preset: preset of its controller; None: only the given limit holds.

    Raises:
        ProblemError: the value is not one positive number, nor one per joint.
    """
    power = {"acceleration_limit": "²", "jerk_limit": "³"}[name]
    unit = joint_unit(robot.slides, f"rad/s{power}", f"m/s{power}")
    found = None if preset is None else preset.limit(name.removesuffix("_limit"))
    if value is not None:
        given = filled(value, robot.joint_names, name, np.inf, ProblemError)
        own = per_joint(given, robot.joint_names, name, unit=unit, error=ProblemError, finite=False, sign="positive")
        found = own if found is None else np.minimum(own, found)
    if found is not None:
        found.setflags(write=False)
    return found


def _parts(value: ArrayLike, joints: Sequence[str], name: str) -> Array:
    """Reserve of each joint, shape (nv,)."""
    parts = per_joint(filled(value, joints, name, 0.0, ProblemError), joints, name, error=ProblemError)
    for i, part in enumerate(parts):
        if not 0 <= part < 1:
            at = f" (index {i})" if np.ndim(value) else ""
            raise ProblemError(
                f"{name} of joint {joints[i]!r} is {part}{at}; it must be a part of the limit, at least 0 and below 1"
            )
    parts.setflags(write=False)
    return parts


@dataclass(frozen=True, eq=False)
class Profiles:
    """Durations of the phases of every joint's fastest profile [s], of the ways' shape; zero at joints that stay.

    Attributes:
        rising: duration of each phase in which the acceleration changes.
        steady: duration of each phase of largest acceleration.
        cruising: duration of the phase of largest velocity.
    """

    rising: Array
    steady: Array
    cruising: Array

    @classmethod
    def of(cls, way: Array, velocity: Array, acceleration: Array, jerk: Array) -> Self:
        """Profiles of joints that move alone, with zero acceleration at both ends where the jerk is limited.

        Args:
            way: distances [rad or m], shape (…, nv), not negative.
            velocity: velocity limits [rad/s or m/s], shape (nv,); these and the others may be infinite.
            acceleration: acceleration limits [rad/s² or m/s²], shape (nv,).
            jerk: jerk limits [rad/s³ or m/s³], shape (nv,).
        """
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            rising = np.nan_to_num(acceleration / jerk, nan=np.inf)  # to the largest acceleration
            full = velocity > acceleration * rising  # the acceleration limit is reached before the velocity limit
            fast = (
                np.where(full, rising, np.sqrt(velocity / jerk)),
                np.where(full, velocity / acceleration - rising, 0.0),
            )
            cruising = way / velocity - 2 * fast[0] - fast[1]
            half = (rising + np.sqrt(rising**2 + 4 * way / acceleration)) / 2
            reached = way > 2 * acceleration * rising**2
            short = np.where(reached, rising, np.cbrt(way / jerk / 2)), np.where(reached, half - 2 * rising, 0.0)
            pairs = zip((*fast, cruising), (*short, np.zeros_like(cruising)), strict=True)
            phases = [np.where(cruising >= 0, long, brief) for long, brief in pairs]
        return cls(*(np.where(way > 0, np.nan_to_num(each, nan=0.0, posinf=0.0), 0.0) for each in phases))

    @property
    def durations(self) -> Array:
        """Durations of the whole profiles [s], shape (…, nv)."""
        return 4 * self.rising + 2 * self.steady + self.cruising

    @property
    def phases(self) -> Array:
        """Durations of the seven phases [s], shape (7, …, nv)."""
        rising, steady = self.rising, self.steady
        return np.array([rising, steady, rising, self.cruising, rising, steady, rising])


class PathConstraintSpec:
    """Element of `MinimumTimeProblem.path_constraints`; new constraints derive from `PathConstraint`.

    Attributes:
        name: plural, for messages: "torque-rate limits".
        continuous_torque: whether the torque must be continuous, hence linear between knots.
        of_torques: whether the constraint is about torques, so that a kinematic problem cannot have it.
        curves_alone: whether only curves, not meshes, can satisfy the constraint.
    """

    name: ClassVar[str]
    continuous_torque: ClassVar[bool] = False
    of_torques: ClassVar[bool] = False
    curves_alone: ClassVar[bool] = False

    def option_text(self) -> str:
        """Text of the constraint for --limit and problem files, such as "tip-speed=0.25@tool0".

        Raises:
            ProblemError: the constraint has no text.
        """
        raise ProblemError(f"{self!r} has no text for --limit or a problem file: implement option_text")

    def entry(self) -> str | dict[str, Any]:
        """Entry of the constraint in a problem file: the text of `option_text`, or a table of values."""
        return self.option_text()

    def fits(self, problem: Any) -> None:
        """Check the constraint against a whole problem, once its poses are known.

        Args:
            problem: a `MinimumTimeProblem`.

        Raises:
            ProblemError: the constraint cannot hold in the problem.
        """

    def on(self, robot: Robot, start: Array, goal: Array) -> Self:
        """Bind the constraint to an arm; check it against the arm and the motion's ends.

        Args:
            robot: the arm.
            start: its state (q, v), shape (2 nv,).
            goal: goal state (q, v), shape (2 nv,).

        Raises:
            ProblemError: the constraint does not fit; the message names argument, joint or frame, value and remedy.
        """
        return self
