"""Check for limits in a wrong unit: so low that any motion takes longer than `LONGEST`."""

import numpy as np

from armdyn.errors import ProblemError
from armdyn.optimal.problem.problem import MinimumTimeProblem

LONGEST = 3600.0
"""Largest lower bound on the duration that is accepted [s]; beyond, a limit most likely has a wrong unit."""


def check_pace(problem: MinimumTimeProblem) -> None:
    """Refuse velocity, acceleration or jerk limits so low that the motion takes longer than `LONGEST`.

    Raises:
        ProblemError: names the limit, the joint, the least duration and a sufficient limit.
    """
    none = np.full(problem.robot.nv, np.inf)
    net = np.abs(problem.poses[-1] - problem.poses[0])
    limits = {
        "velocity": (problem.limits.velocity, np.sum(np.abs(np.diff(problem.fixed_poses, axis=0)), axis=0), 1.0),
        # From rest to rest: acceleration over half the way; with a jerk limit, four ramps of the acceleration.
        "acceleration": (problem.acceleration_limit, net, 4.0),
        "jerk": (problem.jerk_limit, net, 32.0),
    }
    for order, (name, (limit, way, factor)) in enumerate(limits.items(), start=1):
        if order > 1 and not problem.from_rest_to_rest:
            break
        limit = none if limit is None else np.asarray(limit)
        least = (factor * way / limit) ** (1 / order)
        joint = int(np.argmax(least))
        if least[joint] > LONGEST:
            unit = "m" if problem.robot.slides[joint] else "rad"
            per = f"{unit}/s{('', '²', '³')[order - 1]}"
            raise ProblemError(
                f"joint {problem.robot.joint_names[joint]!r} has {name} limit {limit[joint]:g} {per}: its way of "
                f"{way[joint]:.4g} {unit} takes {least[joint]:.3g} s at least, more than {LONGEST:g} s; give "
                f"`{name}_limit` of {factor * way[joint] / LONGEST**order:.2g} {per} or more"
            )
