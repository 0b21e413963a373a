"""Logs that are none of the arm: each message names the joint and the cause."""

from dataclasses import replace

import numpy as np
import pytest

from armdyn.errors import LogError
from armdyn.identification import IdentifyOptions, identify
from oracles import robot_named
from simulated_logs import simulated_log

PANDA = robot_named("panda")
GOOD = simulated_log(PANDA.with_friction(0.2, 0.3), velocities=True, duration=5.0)
DEAD = np.ones(7) - np.eye(7)[3]
SWAPPED = [1, 0, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"q": np.rad2deg(GOOD.q)}, r"panda_joint\d is logged from .* these are degrees"),
        ({"q": GOOD.q + 2.0}, r"panda_joint\d is logged .* rad, outside its limits .* another order"),
        ({"v": np.rad2deg(GOOD.v)}, r"velocity of panda_joint1 is 57.\d times .* degrees per second"),
        ({"v": GOOD.v[:, SWAPPED]}, r"velocity of panda_joint1 .* that of panda_joint2"),
        ({"v": GOOD.v * DEAD}, r"velocity of panda_joint4 is constant, but the joint moves"),
        ({"tau": GOOD.tau * DEAD}, r"torque of panda_joint4 is constant, 0: its channel is dead"),
        ({"tau": GOOD.tau[:, [0, 3, 2, 1, 4, 5, 6]]}, r"torque of panda_joint\d is that of panda_joint\d"),
        ({"tau": GOOD.tau / 12}, r"torque of panda_joint2 is 0.08\d* times .* currents"),
        ({"tau": -GOOD.tau}, r"torque of panda_joint2 is -.* opposite"),
        ({"q": GOOD.q[:1].repeat(5000, 0), "v": None}, "no joint moves"),
    ],
)
def test_a_wrong_log_of_this_arm_is_refused(changes, message):
    with pytest.raises(LogError, match=message):
        identify(PANDA, replace(GOOD, **changes))


def test_a_log_too_short_for_a_fit_is_refused():
    with pytest.raises(LogError, match=r"5 s are too short: .* 9 means over 400 ms, and a fit takes 25 at least"):
        identify(PANDA, GOOD, options=IdentifyOptions(step=0.4))


def test_a_good_log_of_another_load_is_none_of_these():
    from armdyn.models import Payload

    loaded = PANDA.with_payload(Payload(mass=3.0))
    assert identify(PANDA, simulated_log(loaded, 2, duration=4.0), "payload").robot.payload.mass == pytest.approx(
        3, 0.01
    )
