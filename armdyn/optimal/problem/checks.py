"""Checks of a minimum-time problem: errors and warnings."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from armdyn.arguments import several, shown
from armdyn.arrays import Array, Flags
from armdyn.errors import ContactError, ProblemError
from armdyn.models.reading.faults import mending
from armdyn.models.reading.holding import hardest_poses
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.collision import DEEPEST, Clearance, CollisionModel
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.problem.planning_limits import PathConstraintSpec, reserve_words
from armdyn.reprs import joint_unit

ROUNDING = 1e-9
"""Rounding, relative or in [rad or m]: poses are typed with ten digits, and gravity's torque on an upright pole is not
exactly zero."""

LANDING = 1e-3
"""Largest goal error that counts as landed [rad or m]: about 1 mm at the tip, which a controller corrects. Likewise the
velocity across a position limit [rad/s or m/s] with which a motion slides along the limit."""

LEAST_WAY = 1e-6
"""Least way of some joint [rad or m] that is a motion: the end of a motion is certified to as much, a hundredth of the
resolution of good encoders."""

LONGEST = 3600.0
"""Largest lower bound on the duration that is accepted [s]; beyond, a limit most likely has a wrong unit."""

SLOWEST = ROUNDING
"""Smallest velocity limit that is accepted [rad/s or m/s]: one turn in two hundred years."""


def check_state(robot: Robot, limits: JointLimits, q: Array, v: Array, name: str, reserve: Array) -> None:
    """Refuse a state outside the limits; reserve: parts by which the velocity limits are reduced, shape (nv,)."""
    for i, joint in enumerate(robot.joint_names):
        unit = joint_unit(robot.slides[[i]])
        if not limits.position_lower[i] - ROUNDING <= q[i] <= limits.position_upper[i] + ROUNDING:
            raise ProblemError(
                f"{name} of joint {joint!r} (index {i}) is {q[i]:.6g} {unit}, outside its limits "
                f"[{limits.position_lower[i]:.6g}, {limits.position_upper[i]:.6g}] {unit}"
                f"{_degrees_words(robot, limits, q)}"
            )
        if abs(v[i]) > limits.velocity[i] + ROUNDING:
            raise ProblemError(
                f"{name} velocity of joint {joint!r} (index {i}) is {v[i]:.6g} {unit}/s, beyond its limit "
                f"{limits.velocity[i]:.6g} {unit}/s{reserve_words(reserve[i], limits.velocity[i], f'{unit}/s')}"
            )
        outward = -v[i] if name == "goal" else v[i]  # backwards in time at the goal
        on_upper, on_lower = q[i] >= limits.position_upper[i], q[i] <= limits.position_lower[i]
        if (on_upper and outward > LANDING) or (on_lower and outward < -LANDING):
            raise ProblemError(
                f"{name} of joint {joint!r} (index {i}) is on its position limit {q[i]:.6g} {unit}, and its velocity "
                f"{v[i]:.6g} {unit}/s {'comes from' if name == 'goal' else 'leads'} beyond: no motion keeps the limit"
            )


def _degrees_words(robot: Robot, limits: JointLimits, q: Array) -> str:
    """Hint that a pose, shape (nv,), was given in degrees, where that would be within the limits; else empty."""
    turns = ~robot.slides
    meant = np.where(turns, np.deg2rad(q), q)
    within = (limits.position_lower - ROUNDING <= meant) & (meant <= limits.position_upper + ROUNDING)
    if not (np.all(within) and np.any(np.abs(q[turns]) > np.pi)):
        return ""
    return "; did you mean degrees? They would be within all limits: np.deg2rad(…)"


def check_way(robot: Robot, x_start: Array, x_goal: Array) -> None:
    """Refuse a motion between equal states, and one from rest to rest of less than `LEAST_WAY`: none is needed."""
    if np.array_equal(x_start, x_goal):
        raise ProblemError(f"start and goal are the same state, q = {x_start[: robot.nv]}: no motion is needed")
    way = np.abs(x_goal - x_start)[: robot.nv]
    if not np.any([x_start[robot.nv :], x_goal[robot.nv :]]) and np.max(way) < LEAST_WAY:
        joint = int(np.argmax(way))
        unit = joint_unit(robot.slides[[joint]])
        raise ProblemError(
            f"start and goal are {way[joint]:.3g} {unit} apart (joint {robot.joint_names[joint]!r}), less than the "
            f"{LEAST_WAY:g} {unit} to which the end of a motion is checked: no motion is needed"
        )


def check_motors(robot: Robot, limits: JointLimits, relative_effort_weight: float) -> None:
    """Refuse an arm without motors, and options that need a motor at every joint."""
    if np.all(limits.passive):
        raise ProblemError(
            f"no joint has a motor: all torque limits are zero ({', '.join(robot.joint_names)}); minimum time needs "
            "one above zero: give `effort_limit`, or name fewer joints in `passive`"
        )
    if relative_effort_weight > 0 and np.any(limits.passive):
        name = robot.joint_names[int(np.argmax(limits.passive))]
        raise ProblemError(
            f"relative_effort_weight is {relative_effort_weight:g}, but joint {name!r} has no motor, and its torque no "
            "range: give `effort_weight`"
        )


def check_every_joint_has_motor(robot: Robot, limits: JointLimits, reason: str) -> None:
    """Refuse an arm with a joint without a motor for `reason`, which only B-spline curves can solve."""
    if np.any(limits.passive):
        name = robot.joint_names[int(np.argmax(limits.passive))]
        raise ProblemError(f"{reason}, which takes a motor at every joint; joint {name!r} has none")


_OF_TORQUES = ("effort_limit", "reserve", "passive", "effort_weight", "relative_effort_weight")
"""Arguments of a problem that are about torques."""


def check_without_torques(problem: Any) -> None:
    """Refuse a kinematic `MinimumTimeProblem` with arguments about torques."""
    values = {name: getattr(problem, name) for name in _OF_TORQUES}
    given = [name for name, value in values.items() if value is not None and np.size(value) and np.any(value)]
    if given:
        raise ProblemError(f"`{given[0]}` is about torques, which `kinematic` leaves out: give one of the two")
    for constraint in check_path_constraints(problem.path_constraints):
        if constraint.of_torques:
            raise ProblemError(f"{constraint.name} are about torques, which `kinematic` leaves out")
    if problem.preset is not None and problem.preset.interface == "torque":
        raise ProblemError(f"the torque interface of {problem.preset.name} takes torques, which `kinematic` leaves out")


def check_accelerations(robot: Robot, largest: Array) -> None:
    """Refuse a joint of a kinematic problem with an infinite largest acceleration, shape (nv,)."""
    if not np.all(np.isfinite(largest)):
        name = robot.joint_names[int(np.argmax(largest))]
        raise ProblemError(
            f"joint {name!r} has no limit of its acceleration, which `kinematic` needs in place of the torques: give "
            "`acceleration_limit`, or `jerk_limit` and `velocity_limit`"
        )


def check_limits(robot: Robot, limits: JointLimits, torques: bool = True) -> None:
    """Refuse empty ranges of position or torque, and infinite torque limits unless torques do not count."""
    found, without = [], []
    for i, joint in enumerate(robot.joint_names):
        unit, effort = joint_unit(robot.slides[[i]]), joint_unit(robot.slides[[i]], "N m", "N")
        lower, upper = limits.actuators.lower[i], limits.actuators.upper[i]
        if torques and (not (lower < upper or limits.passive[i]) or not np.isfinite(upper - lower)):
            found.append(f"joint {joint!r} has torque limits [{lower}, {upper}] {effort}")
            without.append(joint)
        if not limits.velocity[i] >= SLOWEST:
            found.append(
                f"joint {joint!r} has velocity limit {limits.velocity[i]} {unit}/s; it must be positive, "
                f"{SLOWEST:g} at least"
            )
        lower, upper = limits.position_lower[i], limits.position_upper[i]
        if not lower < upper:
            found.append(f"joint {joint!r} has position limits [{lower}, {upper}] {unit}: no room")
    if without:
        poses = hardest_poses(robot.model, limits.position_lower, limits.position_upper) if robot.has_dynamics else []
        most = {name: f"{name} {abs(one):.3g}" for name, (_, one) in zip(robot.joint_names, poses, strict=False)}
        need = "minimum time needs finite ones, the lower below the upper: give `effort_limit`, or name the joint in "
        held = f"; holding still takes up to [N m or N]: {', '.join(most[one] for one in without)}" if most else ""
        found.append(f"{need}`passive` if it has no motor{held}; to mend: {mending(without)}")
    if found:
        raise ProblemError("; ".join(found))


def check_poses(poses: Array) -> None:
    """Refuse a leg of zero length; poses: shape (legs + 1, nv)."""
    legs = np.max(np.abs(np.diff(poses, axis=0)), axis=1)
    if legs.size > 1 and np.min(legs) == 0:
        raise ProblemError(f"the leg from pose {int(np.argmin(legs))} to the next has zero length: start, via, goal")


def check_path_constraints(path_constraints: object) -> tuple[PathConstraintSpec, ...]:
    """The path constraints as a tuple; refuse anything else."""
    found = []
    for i, constraint in enumerate(several(path_constraints, "path_constraints")):
        if isinstance(constraint, type) or not isinstance(constraint, PathConstraintSpec):
            raise ProblemError(
                f"path_constraints[{i}] = {shown(constraint)} is no path constraint; give values such as "
                "FrameSpeedLimit(0.25) or TorqueRateLimit(50.0)"
            )
        if not getattr(constraint, "name", ""):
            raise ProblemError(
                f'{type(constraint).__name__} has no name: give its class one, such as "tip-speed limits"'
            )
        found.append(constraint)
    return tuple(found)


def clear_goals(problem: Any) -> tuple[Array, ...]:
    """Goals of a `MinimumTimeProblem` that keep the clearance; refuse a start, a via point or all goals in contact."""
    model, clearance = problem.collision_model(), problem.clearance

    def refused(what: str, q: Array, contacts: tuple[Clearance, ...]) -> ContactError:
        rest = len(contacts) - 1
        more = f", and {rest} more {'pairs are' if rest > 1 else 'pair is'} too near" if rest else ""
        message = f"{what} {contacts[0].bodies()}{more}; {_needed(model, contacts[0], clearance)}"
        return ContactError(message, model.robot, model.obstacles, q, contacts)

    fixed = [("start", problem.poses[0]), *((f"via[{i}]", q) for i, q in enumerate(problem.poses[1:-1]))]
    for name, q in [*fixed, *([("goal", problem.poses[-1])] if problem.goal_pose is None else [])]:
        if contacts := model.nearer(q, clearance):
            raise refused(f"at the {name},", q, contacts)
    if problem.goal_pose is None:
        return tuple(problem.goals)
    near = [model.nearer(q, clearance) for q in problem.goals]
    if all(near):
        k = max(range(len(near)), key=lambda k: near[k][0].distance)
        what = f"the goal pose cannot be reached clear of everything: in the best of {len(near)} branches"
        raise refused(what, problem.goals[k], near[k])
    return tuple(q for q, contacts in zip(problem.goals, near, strict=True) if not contacts)


def _needed(model: CollisionModel, contact: Clearance, clearance: float) -> str:
    """The requirement that a contact violates."""
    if (contact.body, contact.other) in [model.pairs[k] for k in model.touching]:
        return f"end_contacts may overlap by {1e3 * DEEPEST:g} mm at most"
    return f"clearance is {1e3 * clearance:g} mm"


def check_pace(problem: Any) -> None:
    """Refuse velocity, acceleration or jerk limits so low that the motion takes longer than `LONGEST`.

    Raises:
        ProblemError: names the limit, the joint, the least duration and a sufficient limit.
    """
    (acceleration, jerk), net = problem.rates, np.abs(problem.poses[-1] - problem.poses[0])
    limits = {
        "velocity": (problem.limits.velocity, np.sum(np.abs(np.diff(problem.fixed_poses, axis=0)), axis=0), 1.0),
        # From rest to rest: acceleration over half the way; with a jerk limit, four ramps of the acceleration.
        "acceleration": (acceleration, net, 4.0),
        "jerk": (jerk, net, 32.0),
    }
    for order, (name, (limit, way, factor)) in enumerate(limits.items(), start=1):
        if order > 1 and not problem.from_rest_to_rest:
            break
        least = (factor * way / limit) ** (1 / order)
        joint = int(np.argmax(least))
        if least[joint] > LONGEST:
            unit = joint_unit(problem.robot.slides[[joint]])
            per = f"{unit}/s{('', '²', '³')[order - 1]}"
            raise ProblemError(
                f"joint {problem.robot.joint_names[joint]!r} has {name} limit {limit[joint]:g} {per}: its way of "
                f"{way[joint]:.4g} {unit} takes {least[joint]:.3g} s at least, more than {LONGEST:g} s; give "
                f"`{name}_limit` of {factor * way[joint] / LONGEST**order:.2g} {per} or more"
            )


@dataclass(frozen=True)
class HoldingDeficit:
    """A joint whose torque limit is below the torque that holds the arm at rest.

    Attributes:
        joint: its name.
        pose: name of the pose: "start" or "goal".
        excess: (holding torque - limit) / limit [-].
        motor: whether the joint has a motor.
        beyond: whether the actuator itself is too weak, not only its limit less the reserve.
        words: holding torque and limit, with units, for messages.
    """

    joint: str
    pose: str
    excess: float
    motor: bool
    beyond: bool
    words: str


def held(robot: Robot, limits: JointLimits, q: Array, v: Array) -> tuple[Array, Flags]:
    """Holding torques [N m or N], and whether each joint is at rest with a motor that supplies its torque.

    Args:
        robot: the arm.
        limits: limits of the torques.
        q: joint positions [rad or m], shape (nv,).
        v: joint velocities [rad/s or m/s], shape (nv,).

    Returns:
        Torques and flags, each of shape (nv,); no joint is held if any moves.
    """
    hold = robot.holding_torque(q)
    return hold, limits.actuators.allows(hold, q, v) & (not np.any(v))


def holding_deficits(
    robot: Robot, limits: JointLimits, q: Array, reserve: Array, pose: str = "goal"
) -> list[HoldingDeficit]:
    """Joints that cannot hold the arm at rest within the limits, largest excess first.

    Args:
        robot: the arm.
        limits: limits of the motion.
        q: joint positions [rad or m], shape (nv,); dry friction reduces the holding torque.
        reserve: parts by which the torque limits are reduced, shape (nv,).
        pose: name of the pose, for messages.
    """
    found, torque = [], robot.holding_torque(q)
    lower, upper = limits.actuators.range(q, np.zeros_like(q))
    _, coulomb = robot.friction.per_joint(robot.nv)
    for i, joint in enumerate(robot.joint_names):
        bound = upper[i] if torque[i] > 0 else lower[i]
        room = coulomb[i] + ROUNDING * limits.actuators.scale[i]
        if abs(torque[i]) <= abs(bound) + room:
            continue
        unit = "N" if robot.slides[i] else "N m"
        kept = "" if limits.passive[i] else reserve_words(reserve[i], bound, unit)
        most = "it has no motor" if limits.passive[i] else f"its limit is {bound:.4g} {unit}{kept}"
        own = abs(bound) / (1 - reserve[i])
        excess = (abs(torque[i]) - abs(bound)) / limits.actuators.scale[i]
        words = f"joint {joint!r} needs {torque[i]:.4g} {unit} to hold the {pose} but {most}"
        beyond = bool(abs(torque[i]) > own + room)
        found.append(HoldingDeficit(joint, pose, float(excess), not limits.passive[i], beyond, words))
    return sorted(found, key=lambda one: -one.excess)
