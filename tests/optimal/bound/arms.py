"""Arms, and random problems of theirs, that several tests bound."""

import numpy as np

import armdyn as ad
from problems import cart, paper_arm

ARMS = {
    "panda": lambda: ad.Robot.from_library("panda"),
    "ur5": lambda: ad.Robot.from_library("ur5", payload=ad.Payload(mass=2.0), armature=0.1),
    "rr": lambda: paper_arm("rr").with_limits(None, 6.0).with_friction(0.05, 0.1, [0.05, 0.1]),
    "cart": lambda: cart().with_limits(None, 0.5),
}
"""Many joints; payload and rotors; friction; a rail."""


def random_problem(robot, seed, share=0.8, **given):
    """From one pose to another within a share of the range, at most half a turn to each side."""
    rng = np.random.default_rng(seed)
    lower = np.maximum(robot.limits.position_lower, -np.pi)
    upper = np.minimum(robot.limits.position_upper, np.pi)
    middle, half = (lower + upper) / 2, share * (upper - lower) / 2
    poses = [rng.uniform(middle - half, middle + half) for _ in range(2)]
    return ad.MinimumTimeProblem(robot, q_start=poses[0], q_goal=poses[1], **given)


def drawn(rng, interval):
    """A point in each interval, often at one of its ends."""
    share = np.clip(rng.uniform(-0.5, 1.5, interval.lower.shape), 0, 1)
    return np.clip(interval.lower + share * (interval.upper - interval.lower), interval.lower, interval.upper)
