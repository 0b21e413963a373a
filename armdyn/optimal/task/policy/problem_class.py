"""Problem class: speed-limited or torque-limited."""

import numpy as np
import pinocchio as pin

from armdyn.optimal.problem.problem import MinimumTimeProblem


def is_speed_limited(problem: MinimumTimeProblem) -> bool:
    """Whether velocity limits shape the fastest motion, by an estimate.

    They do if the joint that they keep longest on its way reaches its limit on it: alone, from and to rest, with the
    inertia that it has at the start of its leg and half the range of its torque.

    Args:
        problem: any.
    """
    ways, limits, robot = np.abs(np.diff(problem.poses, axis=0)), problem.limits, problem.robot
    times = ways / limits.velocity
    leg, j = np.unravel_index(int(np.argmax(times)), times.shape)
    if times[leg, j] == 0:
        return False
    inertia = pin.crba(robot.model, robot.model.createData(), robot.configuration(problem.poses[leg]))[j, j]
    torque = limits.actuators.half_range[j]
    return bool(limits.velocity[j] ** 2 * inertia <= ways[leg, j] * torque)
