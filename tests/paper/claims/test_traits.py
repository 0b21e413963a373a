import numpy as np
import pytest

import armdyn as ad
from armdyn.paper.claims.traits import PayloadEffect, Traits, largest_error, turning_points


def swing(decay=0.5, frequency=2.0, duration=6.0, n=1201):
    """q = 1 - exp(-d t) cos(2 pi f t), a step response that settles at 1."""
    t = np.linspace(0, duration, n)
    w, e = 2 * np.pi * frequency, np.exp(-decay * t)
    q = 1 - e * np.cos(w * t)
    v = e * (decay * np.cos(w * t) + w * np.sin(w * t))
    return ad.Trajectory(t=t, q=q[:, None], v=v[:, None], tau=3 * np.cos(w * t)[:, None])


def test_turns_and_overshoot_of_a_step_response():
    motion = swing(decay=0.5, frequency=0.5, duration=4.0)
    traits = Traits.of(motion, [1.0])
    # v = 0 where tan(wt) = -d/w: just before 1, 2, 3 and 4 s.
    first = (np.pi - np.arctan(0.5 / np.pi)) / np.pi
    peak = -np.exp(-0.5 * first) * np.cos(np.pi * first)
    trough = np.exp(-0.5 * (first + 1)) * np.cos(np.pi * (first + 1))
    assert traits.reversals == (4,)
    # 20001 samples over 4 s miss an extreme by at most w² (1e-4)²/2 = 5e-8.
    assert traits.overshoot == pytest.approx((peak,), abs=1e-7)
    assert traits.swings == pytest.approx((peak + trough,), abs=1e-7)
    assert traits.position == pytest.approx((1 + peak,), abs=1e-7)
    assert traits.peak_torque == (3.0,)
    assert traits.torque == pytest.approx((6.0,), abs=1e-4)  # 1201 samples of a cosine
    low, high = traits.velocity[0]
    assert low < 0 < high
    assert high == pytest.approx(motion.v.max(), rel=1e-4)


def test_direction_does_not_matter():
    up = swing()
    down = ad.Trajectory(t=up.t, q=-up.q, v=-up.v, tau=-up.tau)
    one, other = Traits.of(up, [1.0]), Traits.of(down, [-1.0])
    assert (one.reversals, one.swings, one.overshoot) == (other.reversals, other.swings, other.overshoot)


def test_small_swings_are_no_reversals():
    q = np.array([0, 0.5, 0.4995, 1.0, 0.9, 0.9005, 0.8, 0.95])
    assert turning_points(q).tolist() == [0, 1.0, 0.8, 0.95]
    assert turning_points(np.zeros(5)).tolist() == [0, 0]
    assert turning_points(np.array([0, -0.3, 0.2])).tolist() == [0, -0.3, 0.2]


def test_largest_error_is_since_a_time():
    motion = swing(decay=1.0, frequency=1.0, duration=3.0)
    at = 1.0  # the envelope's height where the cosine is one
    assert largest_error(motion, [1.0], at) == pytest.approx(np.exp(-1), abs=1e-9)  # a sample is there
    assert largest_error(motion, [1.0], 2.0) == pytest.approx(np.exp(-2), abs=1e-9)


def test_payload_effect():
    rising = PayloadEffect.of([(1.0, 3.0), (0.1, 1.0), (0.5, 2.0)])
    assert (rising.payloads, rising.rises, rising.ratio) == ((0.1, 0.5, 1.0), True, 3.0)
    assert not PayloadEffect.of([(0.1, 1.0), (0.5, 2.0), (1.0, 1.5)]).rises
    broken = PayloadEffect.of([(0.1, 1.0), (0.5, 2.0), (1.0, None)])
    assert not broken.rises
    assert broken.ratio == 2.0
    assert PayloadEffect.of([(0.1, None)]).ratio is None
