"""What the limits along the way share: accelerations along a replayed motion, and what is said of them."""

import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.numeric import forward_dynamics
from armdyn.models.robot import Robot
from armdyn.optimal.conditions.condition import Kept
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


def kept_by_joints(name: str, what: str, share: float) -> Kept:
    """That a rate's largest value is this part of its limit, as nearly as a mesh keeps it."""
    reasons = (
        (f"a joint's {what} exceeds its limit by {100 * (share - 1):.2g} %",)
        if share > 1 + ConditionsPolicy.rate_tolerance
        else ()
    )
    return Kept(name, f"{100 * share:.4g} % of the limit at most", share, reasons)
