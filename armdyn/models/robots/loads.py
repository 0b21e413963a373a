"""Loads of a motion's pieces, from and to an arm with its payload; motions reversed in time."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from armdyn.arguments import expect
from armdyn.errors import ArmdynError, TrajectoryError
from armdyn.models.robots.arm import payload_inertia
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.values.spec import Payload
from armdyn.trajectory import Load, Trajectory
from armdyn.trajectory.pieces import backwards

_FLANGE = re.compile(r"(?:.*_)?(?:tool0|link8)")
"""Names of the flange in the descriptions of Universal Robots' and Franka's arms: its axes are their controllers'."""

_DECIMALS = 9
"""Of a load about the flange [m, kg m²]: rotations typed with seven digits leave 1e-13 where nothing is."""
_BEYOND = 1e-6
"""Of half a joint's torque range: motions keep their limits to that."""


def load_of(robot: Robot) -> Load:
    """The payload of a robot as the load of a motion's piece; of a robot without a payload a mass of 0.

    `Load.at_flange` is there if the model has its flange's frame, "tool0" or "link8", on the same joint.

    Raises:
        ProblemError: no Robot.
    """
    payload = expect_robot(robot).payload
    frame = robot.frame(robot.tip) if payload is None else robot.frame_of(payload)
    on_joint = (one for one in robot.model.frames if one.parentJoint == frame.parentJoint)
    flange = next((one for one in on_joint if _FLANGE.fullmatch(one.name)), None)
    if payload is None:
        return Load(0.0, frame=robot.tip, at_flange=None if flange is None else Load(0.0, frame=str(flange.name)))
    at_flange = None
    if flange is not None:
        moved = (flange.placement.inverse() * frame.placement).act(payload_inertia(payload))
        com, inertia = (np.round(x, _DECIMALS) + 0.0 for x in (moved.lever, moved.inertia))
        at_flange = Load(payload.mass, com, inertia, str(flange.name))
    return Load(payload.mass, payload.com, payload.inertia, str(frame.name), at_flange)


def robots_of(robot: Robot, motion: Trajectory) -> tuple[Robot, ...]:
    """The arm of each piece of a motion: the robot with the piece's load.

    Args:
        robot: the arm; its own payload is that of pieces without a load.
        motion: of it.

    Raises:
        TrajectoryError: pieces are of different models, and one that is not the robot's has no load.
        SpecError: a load does not fit the robot.
    """
    found: dict[Load | None, Robot] = {None: robot, _bare(load_of(robot)): robot}
    robots = []
    for i, piece in enumerate(motion.own_pieces, 1):
        if piece.load is None and len(motion.model_hashes) > 1 and piece.model_hash != robot.model_hash:
            name = f", {piece.name!r}," if piece.name else ""
            raise TrajectoryError(
                f"piece {i}{name} of the motion has no load, and its model is not that of {robot.name}: give pieces "
                "their loads, load_of(robot)"
            )
        load = _bare(piece.load)
        if load not in found:
            found[load] = robot.with_payload(_payload(load))
        robots.append(found[load])
    return tuple(robots)


def is_motion_of(robot: Robot, motion: Trajectory) -> bool:
    """Whether at least one piece of a motion has the model of the robot with the piece's load."""
    try:
        robots = robots_of(robot, motion)
    except ArmdynError:
        return robot.model_hash in motion.model_hashes
    return any(one.model_hash == arm.model_hash for arm, one in zip(robots, motion.own_pieces, strict=True))


def reversed_motion(robot: Robot, motion: Trajectory) -> Trajectory:
    """The motion reversed in time, q(T - t), under the same torques.

    Without friction the equations of motion, D(q) a + C(q, v) v + g(q) = tau, are the same for v and -v. Friction is
    not: backwards a torque of twice the friction more is needed, which may be beyond the limits; solve for that motion
    instead. Pieces keep their loads and names; their events are left out, for a grasp backwards is a release.

    Args:
        robot: the arm.
        motion: of it.

    Raises:
        TrajectoryError: a joint has friction, its range of torques at -v does not contain the torque, or the motion has
            other joints, or `hold` is not "linear".
    """
    friction = expect_robot(robot).friction
    expect(motion, Trajectory, "motion", error=TrajectoryError)
    if motion.v.shape[1] != robot.nv:
        raise TrajectoryError(f"the motion has {motion.v.shape[1]} joints; {robot.name} has {robot.nv}")
    if friction.present:
        damping, coulomb = friction.per_joint(robot.nv)
        worst = int(np.argmax((damping > 0) | (coulomb > 0)))
        raise TrajectoryError(
            f"{robot.joint_names[worst]} of {robot.name} has friction, so that the motion backwards takes other "
            "torques: solve for it, from the goal to the start"
        )
    if motion.hold != "linear":
        raise TrajectoryError("torques that are constant between samples cannot be reversed; they must be linear there")
    beyond = robot.limits.actuators.excess(motion.tau, motion.q, -motion.v)
    beyond -= np.maximum(robot.limits.actuators.excess(motion.tau, motion.q, motion.v), 0)
    k, joint = np.unravel_index(np.argmax(beyond), beyond.shape)
    if beyond[k, joint] > _BEYOND * robot.limits.actuators.scale[joint]:
        raise TrajectoryError(
            f"backwards {robot.joint_names[joint]} would take {motion.tau[k, joint]:.4g} at a velocity of "
            f"{-motion.v[k, joint]:.4g}, at {motion.t[-1] - motion.t[k]:.6g} s, {beyond[k, joint]:.3g} more than its "
            "motor has at that speed"
        )
    return backwards(motion)


def _bare(load: Load | None) -> Load | None:
    """The load without its name and geometry: what the equations of motion depend on."""
    return load if load is None else replace(load, at_flange=None) if load.mass else Load(0.0)


def _payload(load: Load | None) -> Payload | None:
    if load is None or not load.mass:
        return None
    return Payload(mass=load.mass, com=load.com, inertia=load.inertia, frame=load.frame or None)
