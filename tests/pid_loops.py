"""The paper's PID examples: arms, payload readings and poses."""

from functools import cache

import numpy as np

from armdyn.models import ArmSpec, Payload, Robot

PI = np.pi
POSES = {
    "R Ex4": ("r", [-PI / 2], [PI / 20]),
    "RR Ex5": ("rr", [-PI / 84, PI / 84], [PI / 84, -PI / 84]),
    "RR Ex2": ("rr", [-PI / 2, PI / 84], [PI / 20, -PI / 84]),
    "RRR Ex6": ("rrr", [-PI / 2, PI / 84, -PI / 84], [PI / 20, -PI / 84, PI / 84]),
}


@cache
def loaded_arm(arm, reading, grams):
    """A paper arm; the payload at the tip ("tip"), or at the last link's centre of mass ("mM")."""
    spec, mass = ArmSpec.paper(arm), grams / 1000
    payload = Payload.at_last_com(spec, mass) if reading == "mM" else Payload(mass=mass)
    return Robot.from_spec(spec, payload if grams else None)


def example(name, reading="tip", grams=0.0):
    """Robot, and the keywords q_start and q_goal."""
    arm, q_start, q_goal = POSES[name]
    return loaded_arm(arm, reading, grams), {"q_start": q_start, "q_goal": q_goal}
