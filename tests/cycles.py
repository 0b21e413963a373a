"""Small cycles that several tests solve."""

from functools import cache

import numpy as np

import armdyn as ad

PART = ad.Payload(mass=0.1, name="bolt")
HERE, THERE = (0.3, 0.0, -0.1), (0.1, 0.0, -0.3)

BOLT = """
[robot]
name = "rr"
[cycle]
start = [0.1, 0.2]
[parts.bolt]
mass = 0.1
[[steps]]
move = "to the bolt"
to = [0.4, 0.6]
[[steps]]
grasp = "bolt"
dwell = 0.2
[[steps]]
move = "to the hole"
to = [1.0, -0.4]
[[steps]]
release = "bolt"
[options]
search = "quick"
"""
"""A cycle file without branches."""


def planar(**changes: object) -> ad.Cycle:
    """RR picks a bolt and places it, two branches at each of the two places."""
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    steps = [
        ad.Move(ad.GoalPose(robot.tip, HERE), name="to the bolt"),
        ad.Grasp(PART, dwell=0.2),
        ad.Move(ad.GoalPose(robot.tip, THERE), name="to the hole"),
        ad.Release(dwell=0.1),
    ]
    return ad.Cycle(robot, **{"start": [0.1, 0.2], "steps": steps, "closed": True, **changes})


@cache
def planar_solved() -> ad.CycleSolution:
    """`planar`, solved once."""
    return ad.solve_cycle(planar(), ad.MinimumTimeOptions(search="quick"))


def down(x: float, y: float, z: float) -> np.ndarray:
    """A pose of a tool that points down, shape (4, 4)."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = x, y, z
    return pose
