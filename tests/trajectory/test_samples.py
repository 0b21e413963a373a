"""Even times: stamps that increase, means that add up to the motion's integrals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import armdyn as ad
from armdyn.dynamics.numeric import forward_dynamics
from armdyn.errors import TrajectoryError
from armdyn.trajectory import Samples, Trajectory
from armdyn.trajectory.samples import LEAST_STAMP, MOST_SAMPLES
from problems import solved
from trajectory.motions import trajectories

RATES = st.one_of(st.none(), st.floats(0.01, 2e4), st.sampled_from([1.0, 30.0, 1000.0, 1e4, 1e5 / 3]))


def impulse(motion):
    """∫ tau dt [N m s], shape (nv,): torques are linear between samples, or held."""
    if motion.hold == "zero-order":
        return np.diff(motion.t) @ motion.tau[:-1]
    return np.trapezoid(motion.tau, motion.t, axis=0)


@pytest.mark.slow
@given(trajectories(), RATES)
def test_stamps_increase_and_means_add_up(motion, rate):
    samples = motion.resample(rate)
    t, steps = samples.t, np.diff(samples.t)[:, None]
    assert t[0] == 0 and t[-1] == motion.duration
    assert np.all(np.diff(t) >= 0.999 * LEAST_STAMP)  # of a difference of times, rounded
    # Sums of at most some 10⁴ numbers below 50, times at most 10 s.
    np.testing.assert_allclose(np.sum(samples.tau[:-1] * steps, axis=0), impulse(motion), atol=1e-8)
    np.testing.assert_allclose(
        samples.v[0] + np.cumsum(samples.a[:-1] * steps, axis=0), samples.v[1:], rtol=1e-6, atol=1e-6
    )
    for end in (0, -1):
        np.testing.assert_array_equal(samples.q[end], motion.q[end])
    assert np.all(samples.tau <= motion.tau.max(axis=0) + 1e-12)
    assert np.all(samples.tau >= motion.tau.min(axis=0) - 1e-12)
    np.testing.assert_array_equal(samples.tau[-1], samples.tau[-2])
    at_rest = np.all(np.abs(samples.v[-1]) <= 1e-6)
    np.testing.assert_array_equal(samples.a[-1], 0 * samples.a[-1] if at_rest else samples.a[-2])


@pytest.mark.slow
@given(trajectories(), st.floats(0.5, 2e4))
def test_ticks_are_even_but_for_the_last(motion, rate):
    t = motion.resample(rate).t
    np.testing.assert_array_equal(t[:-1], np.arange(t.size - 1) / rate)
    assert 0 < (t[-1] - t[-2]) * rate <= 1.001 + 1e-9  # with a tick that would have been next to the end
    inner = motion(motion.t[0] + t[1:-1])
    np.testing.assert_array_equal(motion.resample(rate).q[1:-1], inner.q)
    np.testing.assert_array_equal(motion.resample(rate).v[1:-1], inner.v)


def test_whole_ticks_end_with_the_end_once():
    # 0.3 s at 10 Hz: 0.1 + 0.2 is not 0.3 in floats, and 3 / 10 is.
    motion = Trajectory([0.0, 0.1 + 0.2], [[0.0], [1.0]], [[0.0], [0.0]], [[1.0], [1.0]])
    np.testing.assert_array_equal(motion.resample(10).t, [0, 0.1, 0.2, 0.1 + 0.2])


def test_a_jump_within_a_tick_is_shared_by_the_parts_of_the_tick():
    switch = 0.25
    t = [0.0, switch, np.nextafter(switch, 1), 1.0]
    motion = Trajectory(t, np.zeros((4, 1)), np.zeros((4, 1)), [[3.0], [3.0], [-3.0], [-3.0]])
    # 0.05 s of +3 and 0.05 s of -3 in the tick from 0.2 to 0.3 s.
    np.testing.assert_allclose(motion.resample(10).tau[:4, 0], [3, 3, 0, -3], atol=1e-14)


def test_own_samples_of_a_jump_are_one():
    motion = solved("rr").trajectory
    samples = motion.resample()
    assert np.any(motion.jumps) and samples.t.size == motion.t.size - np.count_nonzero(motion.jumps)
    np.testing.assert_array_equal(samples.t, motion.t[np.append(True, ~motion.jumps)])
    # Bang-bang: every mean is at a limit, for any step.
    np.testing.assert_allclose(np.abs(samples.tau), 3.0, rtol=1e-9)


@pytest.mark.parametrize("arm", ["r", "rr", "rrr"])
def test_accelerations_are_the_dynamics_where_torques_do_not_jump(arm):
    solution, rate = solved(arm), 4000
    samples, dynamics = solution.trajectory.resample(rate), forward_dynamics(solution.problem.robot)
    middle = solution.trajectory((samples.t[:-1] + samples.t[1:]) / 2)
    own = np.stack([dynamics(*state) for state in zip(*middle, strict=True)])
    steady = np.all(np.isclose(samples.tau[:-1], middle.tau, rtol=1e-9), axis=1)
    assert np.count_nonzero(steady) > 0.9 * steady.size
    # A cubic's accelerations are lines between samples a millisecond apart: 1.1e-3 of the largest was measured on RRR.
    np.testing.assert_allclose(samples.a[:-1][steady], own[steady], atol=3e-3 * np.abs(own).max())


@pytest.mark.parametrize(
    ("rate", "message"),
    [
        (0, "rate is 0 Hz; it must be positive"),
        (-1.0, "rate is -1.0 Hz"),
        (np.nan, "rate is nan"),
        (np.inf, "rate is inf"),
        ("1000", "rate is '1000'; it must be a number .Hz."),
        (True, "rate is True"),
        (2e5, "rate is 200000 Hz; it must be at most 100000 Hz"),
    ],
)
def test_a_rate_that_is_none(rate, message):
    with pytest.raises(TrajectoryError, match=message):
        solved("r").trajectory.resample(rate)


def test_too_many_samples():
    long = Trajectory([0.0, 1000.0], np.zeros((2, 1)), np.zeros((2, 1)), np.zeros((2, 1)))
    with pytest.raises(TrajectoryError, match=f"1000 s at 1000 Hz samples are 1000001; .* at most {MOST_SAMPLES}"):
        long.resample(1000)
    assert long.resample(100).t.size == 100_001


def test_nothing_to_sample():
    rest = np.zeros((2, 1))
    with pytest.raises(TrajectoryError, match="lasts 1e-09 s; expected at least 1e-08 s"):
        Trajectory([0.0, 1e-9], rest, rest, rest).resample(1000)
    with pytest.raises(TrajectoryError, match="q has 2 columns, v 1"):
        Trajectory([0.0, 1.0], np.zeros((2, 2)), rest, rest).resample(1000)
    with pytest.raises(TrajectoryError, match="a has a value that is not finite"):
        Trajectory([0.0, 1e-3], rest, [[0.0], [1e308]], rest).resample(1000)


def test_names_and_robot_stay_known():
    motion = solved("rr").trajectory
    samples = motion.resample(1000)
    for field in ("joint_names", "name", "model_hash"):
        assert getattr(samples, field) == getattr(motion, field)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t": [0.1, 0.2]}, "from 0 on"),
        ({"t": [0.0, 0.0]}, "increasing"),
        ({"t": [0.0, np.inf]}, "t has a value that is not finite"),
        ({"q": [[0.0]]}, "q has shape .1, 1.; expected .2, joints."),
        ({"tau": [[0.0, 0.0], [0.0, 0.0]]}, "tau has shape"),
        ({"a": "fast"}, "a is 'fast'"),
        ({"joint_names": ("a", "b")}, "2 joint names for 1 joint"),
        ({"name": 3}, "name is 3"),
    ],
)
def test_samples_that_do_not_fit(change, message):
    rest = np.zeros((2, 1))
    with pytest.raises(TrajectoryError, match=message):
        Samples(**{"t": [0.0, 1.0], "q": rest, "v": rest, "a": rest, "tau": rest, **change})


def test_samples_are_frozen():
    samples = solved("r").trajectory.resample(100)
    assert isinstance(samples, ad.Samples)
    with pytest.raises(ValueError, match="read-only"):
        samples.tau[0] = 0
