"""What is left to do where no motion to the goal is found: go on along the last motion, brake, or stay."""

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.landing.limit_violations import limit_violation
from armdyn.optimal.live.distances import Distances
from armdyn.optimal.live.improving import LimitedArm
from armdyn.optimal.live.last import LastMotion
from armdyn.optimal.live.program import Ends
from armdyn.optimal.problem.status import Status
from armdyn.optimal.proof.certificate import LIMIT_TOLERANCE
from armdyn.trajectory import Trajectory

_REST = 0.1
"""Duration of the motion that is handed out where an arm stays at rest [s]."""


def fallback(
    arm: LimitedArm, ends: Ends, inertia: Array, last: LastMotion | None, distances: Distances | None
) -> tuple[Status, Trajectory] | None:
    """A motion to rest that keeps all limits, and what it is; None: none that was tried does.

    Args:
        arm: with its limits.
        ends: whose start state it begins in.
        inertia: of each joint at the start [kg m² or kg], shape (nv,).
        last: motion that was handed out.
        distances: to be kept; None: none.
    """
    rest = None if last is None else rest_of_last(arm, ends, last, distances)
    if rest is not None:
        return Status.FOLLOWED, rest
    stop = _brake(arm, ends, inertia, distances) if np.any(ends.v) else at_rest(arm, ends.q, distances)
    return None if stop is None else (Status.STOPPED, stop)


def rest_of_last(arm: LimitedArm, ends: Ends, last: LastMotion, distances: Distances | None) -> Trajectory | None:
    """The rest of the last motion from the start state on; None: that is not on it, or a limit is no longer kept."""
    rest = last.rest(ends.q, ends.v, arm.program.policy)
    fits = rest is not None and rest.model_hash == arm.robot.model_hash and _kept(arm, rest, distances)
    return rest if fits else None


def at_rest(arm: LimitedArm, q: Array, distances: Distances | None) -> Trajectory | None:
    """Rest at joint positions, shape (nv,); None: the motors cannot hold the arm there."""
    hold, names = arm.robot.holding_torque(q), arm.robot.joint_names
    stay = Trajectory.at_rest(q, hold, _REST, names, name="stays", model_hash=arm.robot.model_hash)
    return stay if _kept(arm, stay, distances) else None


def _brake(arm: LimitedArm, ends: Ends, inertia: Array, distances: Distances | None) -> Trajectory | None:
    """The shortest stop that was tried and keeps all limits, along the straight line of the velocity.

    Its accelerations are constant: after the time T the arm rests at q + v T / 2. T grows by a factor from half of
    what the weakest joint takes by its inertia.
    """
    program, policy = arm.program, arm.program.policy
    duration = float(np.max(np.abs(ends.v) * inertia / program.half)) / 2
    first, second = program.mesh.basis.monomials()
    shape = (first - second / 2)[:, None]
    for _ in range(policy.brakes):
        seen = arm.seen(ends.q + shape * ends.v * duration, duration)
        if arm.keeps(seen, distances) and _holds(arm, seen.q[-1]):
            return arm.motion(seen, "stop")
        duration *= policy.longer
    return None


def _holds(arm: LimitedArm, q: Array) -> bool:
    """Whether the motors hold the arm at rest there."""
    return bool(np.all(arm.program.limits.actuators.allows(arm.robot.holding_torque(q), q, np.zeros_like(q))))


def _kept(arm: LimitedArm, motion: Trajectory, distances: Distances | None) -> bool:
    """Whether a motion keeps limits of torque, velocity and position, and distances."""
    kept = limit_violation(arm.program.limits, motion) <= LIMIT_TOLERANCE
    return kept and (distances is None or distances.kept(motion))
