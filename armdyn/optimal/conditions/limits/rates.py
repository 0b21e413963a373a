"""What the limits along the way share: accelerations along a replayed motion, and what is said of them."""

import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.numeric import forward_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.optimal.conditions.condition import Kept
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.task.policy.landing import ConditionsPolicy
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


def pieces(motion: Trajectory, dense: int = 5) -> tuple[Array, NDArray[np.bool_]]:
    """Times evenly within samples [s], shape (samples between jumps of the torque, dense); which samples those are."""
    steps = np.diff(motion.t)
    flows = ~motion.jumps
    return (motion.t[:-1, None] + steps[:, None] * np.linspace(0, 1, dense))[flows], flows


def accelerations(robot: Robot, motion: Trajectory) -> tuple[Array, Array]:
    """Times [s], shape (pieces, dense), and the accelerations there, by `pin.aba`, shape (pieces, dense, nv)."""
    function, n = forward_dynamics(robot), robot.nv
    t, flows = pieces(motion)
    at, part = motion(t), np.linspace(0, 1, t.shape[1])
    # At its end a sample's torque is its own, not that after the jump.
    tau = motion.tau[:-1][flows][:, None] + part[:, None] * np.diff(motion.tau, axis=0)[flows][:, None]
    states = zip(at.q.reshape(-1, n), at.v.reshape(-1, n), tau.reshape(-1, n), strict=True)
    return t, np.array([function(*state) for state in states]).reshape(*t.shape, n)


def kept_by_joints(robot: Robot, what: str, per: str, t: Array, values: Array, limits: Array) -> Kept:
    """How a rate keeps its limits: the mesh keeps them at its points, not between.

    Args:
        robot: whose joints are limited.
        what: is limited: "acceleration".
        per: its unit, after rad or m: "/s²".
        t: when it was looked at [s], of any shape.
        values: what was seen then, of the same shape and (nv,).
        limits: of its size, shape (nv,).
    """
    seen = np.abs(values).reshape(-1, robot.nv)
    k, i = np.unravel_index(np.argmax(seen / limits), seen.shape)
    share, joint, when = float(seen[k, i] / limits[i]), robot.joint_names[i], float(t.ravel()[k])
    unit = f"{'m' if robot.slides[i] else 'rad'}{per}"
    said = f"{seen[k, i]:.5g} of {limits[i]:.5g} {unit} at most, by {joint!r} at t = {when:.4g} s"
    if share <= 1 + ConditionsPolicy.rate_tolerance:
        return Kept(f"{what} limits", said, share)
    reason = f"joint {joint!r} exceeds its {what} limit by {100 * (share - 1):.2g} % at t = {when:.4g} s"
    return Kept(f"{what} limits", said, share, (reason,), Violation(f"{what} limit", joint, when, share - 1))
