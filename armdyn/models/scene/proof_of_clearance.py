"""Proof that a motion keeps its clearances between the samples: bisection by bounds on speed and acceleration.

Two bodies whose relative motion between two times is at most L are apart by (d0 + d1 - L) / 2 at least in between
(Schwarzer, Saha, Latombe, "Adaptive dynamic collision checking", IEEE Transactions on Robotics 21(3), 2005). Where that
is not enough, the plane between them at either end is moved with the velocities of their points: the accelerations'
share falls with the square of the time.
"""

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arrays import Array
from armdyn.locks import built_once
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.bodies import bodies
from armdyn.models.scene.collision import Clearance, CollisionModel
from armdyn.trajectory import Trajectory
from armdyn.trajectory.interpolation import cubic_accelerations


def motion_bounds(robot: Robot, motion: Trajectory) -> tuple[Array, Array]:
    """Bounds on the motion of the bodies on every joint between the samples of a trajectory.

    The velocity of a cubic lies within its three Bézier coefficients, the acceleration is linear. A point's
    acceleration is J a plus the second derivatives of its position times the velocities, and a second
    derivative by two joints is no longer than the arm to the axis of the outer one.

    Returns:
        How far each joint has come until each sample at most [rad or m], shape (n, nv); largest acceleration of any
        point of the bodies on each joint in each step [m/s²], shape (n - 1, njoints).
    """
    (v, a), h = _joint_bounds(motion), np.diff(motion.t)[:, None]
    reach, acceleration = reaches(robot), np.zeros((len(h), robot.model.njoints))
    for body in range(1, robot.model.njoints):
        acceleration[:, body] = _point_acceleration(robot, body, reach[body], v, a)
    return np.vstack([np.zeros((1, v.shape[1])), np.cumsum(v * h, axis=0)]), acceleration


def frame_accelerations(robot: Robot, motion: Trajectory, frame: str) -> tuple[Array, tuple[Array, Array]]:
    """Bounds on the motion of a frame between the samples of a trajectory, as of `motion_bounds`.

    Args:
        robot: the arm.
        motion: whose joints follow cubics between its samples.
        frame: its name.

    Returns:
        Largest acceleration of its origin in each step [m/s²], shape (n - 1,); largest angular velocities [rad/s] and
        accelerations [rad/s²], likewise.
    """
    v, a = _joint_bounds(motion)
    fixed = robot.frame(frame)
    joint, far = fixed.parentJoint, float(np.linalg.norm(fixed.placement.translation))
    chain = [one - 1 for one in chain_of(robot, joint) if not robot.slides[one - 1]]
    speed, turning = np.sum(v[:, chain], axis=1), np.sum(a[:, chain], axis=1)
    for i, outer in enumerate(chain):  # an axis is turned by the joints inside of it
        turning += v[:, outer] * np.sum(v[:, chain[:i]], axis=1)
    return _point_acceleration(robot, joint, _reach_of(robot, joint, far), v, a), (speed, turning)


def _joint_bounds(motion: Trajectory) -> tuple[Array, Array]:
    """Largest velocities and accelerations of the joints in each step, each of shape (n - 1, nv)."""
    h = np.diff(motion.t)[:, None]
    mean, v0, v1 = np.diff(motion.q, axis=0) / h, motion.v[:-1], motion.v[1:]
    v = np.max(np.abs([v0, 3 * mean - v0 - v1, v1]), axis=0)
    a = np.max(np.abs(cubic_accelerations(motion.t, motion.q, motion.v)), axis=0)
    jumps = motion.jumps
    v[jumps], a[jumps] = np.maximum(np.abs(v0), np.abs(v1))[jumps], 0.0
    return v, a


def _point_acceleration(robot: Robot, joint: int, reach: Array, v: Array, a: Array) -> Array:
    """Largest acceleration of points on a joint in each step [m/s²], shape (n - 1,); reach: from the axes, (nv,)."""
    chain, out = [one - 1 for one in chain_of(robot, joint)], np.asarray(a @ reach)
    for i, outer in enumerate(chain):
        inner = np.sum(v[:, chain[:i]], axis=1)
        out += reach[outer] * v[:, outer] * (v[:, outer] + 2 * inner)
    return out


def chain_of(robot: Robot, joint: int) -> list[int]:
    """A joint and those that carry it, from the base outwards, without the world."""
    return list(robot.model.supports[joint])[1:]


@built_once(maxsize=16)
def reaches(robot: Robot) -> Array:
    """Farthest distance of the bodies on a joint from the axis of one that carries them [m], shape (njoints, nv).

    It is 1 for a sliding joint, and 0 for joints that do not carry them.
    """
    model, beyond = robot.model, np.zeros(robot.model.njoints)
    for body in bodies(robot):
        far = float(np.max(np.linalg.norm(body.points, axis=1))) + body.radius
        beyond[body.joint] = max(beyond[body.joint], far)
    none = np.zeros((1, model.nv))
    return np.vstack([none, *(_reach_of(robot, last, beyond[last]) for last in range(1, model.njoints))])


def _reach_of(robot: Robot, last: int, far: float) -> Array:
    """Farthest distances of points from the axes of the joints that carry them [m], shape (nv,), as of `reaches`.

    Args:
        robot: the arm.
        last: the joint that they are on.
        far: their distance from its origin [m].
    """
    out = np.zeros(robot.model.nv)
    for joint in reversed(chain_of(robot, last)):
        slides = robot.slides[joint - 1]
        out[joint - 1] = 1.0 if slides else far
        far += float(np.linalg.norm(robot.model.jointPlacements[joint].translation))
        if slides:
            ends = robot.limits.position_lower[joint - 1], robot.limits.position_upper[joint - 1]
            far += float(np.max(np.abs(ends)))
    return out


PIECES = 64
"""Equal parts of a motion at the start of the bisection: most need no further one at an arm's usual speeds."""
MOST = 20_000
"""Most bisections before the proof is given up: among shelves it takes a few hundred."""


def prove_clearance(
    model: CollisionModel, motion: Trajectory, required: ArrayLike
) -> tuple[Clearance, tuple[float, ...]]:
    """Prove that every pair keeps its distance along a motion, or find times at which it does not.

    Args:
        model: of the scene.
        motion: between its samples joints follow cubics, as `Trajectory` interpolates them.
        required: distances to be kept [m], shape (pairs,) or one for all.

    Returns:
        The nearest pair, `sure` if every pair keeps its distance at all times; times at which a pair
        is nearer than that [s], increasing.
    """
    if not model.pairs:
        return Clearance(np.inf, float(motion.t[0]), "nothing", "nothing", True), ()
    bounds = *motion_bounds(model.robot, motion), relative_reach(model)
    distances = np.broadcast_to(np.asarray(required, dtype=float), (len(model.pairs),))
    return model.prove(motion, bounds, distances, (PIECES, MOST))


@built_once(maxsize=16)
def relative_reach(model: CollisionModel) -> Array:
    """Largest relative displacement of points of a pair's bodies per joint travel.

    Returns:
        [m/rad], or 1 for a sliding joint, shape (pairs, nv); 0 for joints that move both bodies or none.
    """
    robot, reach = model.robot, reaches(model.robot)
    joints, of_pair = np.unique(model.joints, axis=0, return_inverse=True)
    out = np.zeros((len(joints), robot.nv))
    chains = [set(chain_of(robot, joint)) for joint in range(robot.model.njoints)]
    for k, (first, second) in enumerate(joints):
        for joint in chains[first] ^ chains[second]:
            out[k, joint - 1] = reach[first if joint in chains[first] else second, joint - 1]
    return out[of_pair.reshape(-1)]
