"""Gains of a PID controller: accepted values, one number per joint."""

import dataclasses

import numpy as np
import pytest

from armdyn.control import PidGains
from armdyn.control.laws.pid import DEFAULT_GAINS
from armdyn.errors import ProblemError


def test_one_number_serves_every_joint():
    kp, ki, kd = DEFAULT_GAINS.per_joint(3)
    for gain, expected in ((kp, 30.0), (ki, 50.0), (kd, 10.0)):
        np.testing.assert_array_equal(gain, np.full(3, expected))


def test_one_number_per_joint():
    kp, ki, kd = PidGains(kp=np.array([1, 2]), ki=[3, 4], kd=5).per_joint(2)
    np.testing.assert_array_equal([kp, ki, kd], [[1, 2], [3, 4], [5, 5]])


def test_gains_are_values():
    assert PidGains([1, 2], 3, 4) == PidGains(kp=np.array([1.0, 2.0]), ki=3.0, kd=4)
    assert hash(PidGains([1, 2], 3, 4)) == hash(PidGains((1, 2), 3, 4))
    with pytest.raises(dataclasses.FrozenInstanceError):
        DEFAULT_GAINS.kp = 1.0
    assert dataclasses.replace(DEFAULT_GAINS, ki=0).ki == 0.0


@pytest.mark.parametrize("field", ["kp", "ki", "kd"])
@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf, [1.0, -1.0], [], [[1.0]], "much", None])
def test_bad_gains_name_the_field(field, bad):
    with pytest.raises(ProblemError, match=field):
        PidGains(**({"kp": 1.0, "ki": 1.0, "kd": 1.0} | {field: bad}))


def test_gains_of_different_lengths():
    with pytest.raises(ProblemError, match="2 and 3 joints"):
        PidGains(kp=[1, 2], ki=[1, 2, 3], kd=1)


def test_gains_of_another_robot():
    with pytest.raises(ProblemError, match="kp has 2 numbers"):
        PidGains(kp=[1, 2], ki=1, kd=1).per_joint(3)


def test_gains_of_more_joints_than_any_arm_has():
    with pytest.raises(ProblemError, match="kp has 1000000 numbers; expected one, or one per joint"):
        PidGains(kp=np.ones(10**6), ki=1, kd=1)
