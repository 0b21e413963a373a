"""Closure equations: the joint positions that bring a frame to a pose close a chain of joints."""

from collections.abc import Sequence
from itertools import combinations

import casadi as ca
import numpy as np

from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.reaching import GoalPose
from armdyn.optimal.bound.enclosure import EnclosedFunction

_TRIALS = 20
"""Number of random positions at which a polynomial of sines and cosines, of second degree in each joint's, vanishes
with probability zero unless it is identically zero."""

_IDLE = 1e-12
"""Derivative of a squared distance [m²/rad] below which it does not depend on a joint, up to rounding."""


def chain_to(robot: Robot, goal: GoalPose) -> list[int]:
    """Joints between the world and the frame, in order."""
    return list(robot.model.supports[robot.frame(goal.frame).parentJoint])[1:]


@built_once(maxsize=16)
def closure(dynamics: Dynamics, goal: GoalPose) -> EnclosedFunction:
    """Equations of q that are zero exactly where the frame is at its goal."""
    q, chain = ca.SX.sym("q", dynamics.nv), chain_to(dynamics.robot, goal)
    # By experiment on UR5 and Panda: a cut in the middle, one joint later with an orientation, needs fewest boxes.
    own = chain[: min(len(chain) // 2 + goal.oriented, len(chain) - 1)]
    if own:
        at = slice(4 * (own[-1] - 1), 4 * own[-1])
        inner = dynamics.placements(q)[:, at]
        outer_q = _behind(q, own)
        fixed = dynamics.placements(np.zeros(dynamics.nv))[:, at]
    else:
        inner, outer_q, fixed = ca.horzcat(ca.SX.eye(3), ca.SX.zeros(3)), q, np.eye(3, 4)
    rotation, origin = dynamics.frame_placement(outer_q, goal.frame)
    back = ca.SX(fixed[:, :3].T.copy())
    rotation, origin = back @ rotation, back @ (origin - fixed[:, 3])
    rows = [inner[:, :3].T @ (goal.pose.translation - inner[:, 3]) - origin]
    if goal.axis is not None:
        axis = ca.SX.eye(3)[:, goal.axis]
        rows.append(inner[:, :3].T @ (ca.SX(goal.pose.rotation.copy()) @ axis) - rotation @ axis)
    elif goal.oriented:
        rows.append(ca.vec(inner[:, :3] - ca.SX(goal.pose.rotation.copy()) @ rotation.T))
    if goal.exact and goal.oriented:
        rows += _distances(dynamics, goal, q)
    return EnclosedFunction.of(ca.Function("closure", [q], [ca.cse(ca.densify(ca.vertcat(*rows)))]))


def _distances(dynamics: Dynamics, goal: GoalPose, q: ca.SX) -> list[ca.SX]:
    """Equations of a few joints each: squared distances between two joints' origins [m²].

    The distances follow from the joints between these two, and from the other joints, through the world and the goal.
    Joints that turn about either origin have no effect.
    """
    n, chain, rng = dynamics.nv, chain_to(dynamics.robot, goal), np.random.default_rng(0)
    found = []
    for i, j in combinations(range(len(chain)), 2):
        first, last = 4 * (chain[i] - 1), 4 * (chain[j] - 1)
        between = dynamics.placements(_behind(q, chain[: i + 1]))
        inner = between[:, last + 3] - between[:, first + 3]
        fixed = dynamics.placements(np.zeros(n))[:, last : last + 4]
        rotation, origin = dynamics.frame_placement(_behind(q, chain[: j + 1]), goal.frame)
        back = ca.SX(goal.pose.rotation.copy()) @ rotation.T
        outer = goal.pose.translation - back @ (origin - fixed[:, 3]) - dynamics.placements(q)[:, first + 3]
        row = ca.sumsqr(inner) - ca.sumsqr(outer)
        gradient = ca.Function("gradient", [q], [ca.jacobian(row, q)])
        sizes = [np.abs(gradient(rng.uniform(-np.pi, np.pi, n)).full()[0]) for _ in range(_TRIALS)]
        idle = [int(k) + 1 for k in np.flatnonzero(np.max(sizes, axis=0) < _IDLE)]
        found.append((n - len(idle), ca.substitute(row, q, _behind(q, idle))))
    return [row for count, row in found if 0 < count <= n - 2]


def _behind(q: ca.SX, joints: Sequence[int]) -> ca.SX:
    """Joint positions with zeros for some joints."""
    return ca.vertcat(*(0.0 if k + 1 in joints else q[k] for k in range(q.numel())))
