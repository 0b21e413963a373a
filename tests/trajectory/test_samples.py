"""Even times: stamps that increase, torques that add up to the motion's impulse, ends that rest."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import armdyn as ad
from armdyn.dynamics.numeric import forward_dynamics
from armdyn.errors import TrajectoryError
from armdyn.trajectory import Samples, Trajectory
from armdyn.trajectory.interpolation import interpolated
from armdyn.trajectory.pieces import backwards as reversed_in_time
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
    for end in (0, -1):
        np.testing.assert_array_equal(samples.q[end], motion.q[end])
    assert np.all(samples.tau <= motion.tau.max(axis=0) + 1e-12)
    assert np.all(samples.tau >= motion.tau.min(axis=0) - 1e-12)
    np.testing.assert_array_equal(samples.tau[-1], samples.tau[-2])
    for end in (0, -1):
        at_rest = np.all(np.abs(motion.v[end]) <= 1e-4)
        np.testing.assert_array_equal(samples.v[end], 0 * motion.v[end] if at_rest else motion.v[end])
        assert not at_rest or not np.any(samples.a[end])


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
def test_accelerations_are_the_dynamics_at_the_stamps_where_torques_do_not_jump(arm):
    solution, rate = solved(arm), 4000
    samples, dynamics = solution.trajectory.resample(rate), forward_dynamics(solution.problem.robot)
    own = np.stack([dynamics(*state) for state in zip(*solution.trajectory(samples.t), strict=True)])
    before, after = samples.tau[:-2], samples.tau[1:-1]
    steady = np.all(np.isclose(before, after, rtol=1e-9), axis=1)
    assert np.count_nonzero(steady) > 0.8 * steady.size  # RRR slides along a limit, under torques that vary
    # A cubic's accelerations are lines between samples a millisecond apart: 1.6e-3 of the largest was measured on RRR.
    np.testing.assert_allclose(samples.a[1:-1][steady], own[1:-1][steady], atol=3e-3 * np.abs(own).max())


def test_of_two_accelerations_at_a_stamp_the_smaller_one_counts():
    # 1 s at 2 rad/s², 1 s at 1 rad/s², 1 s at -3 rad/s²; quintics stay below the 3 rad/s that it reaches.
    v = np.array([0.0, 2.0, 3.0, 0.0])
    q = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2)])
    motion = Trajectory(np.arange(4.0), q[:, None], v[:, None], np.zeros((4, 1)))
    samples = motion.resample(2)
    np.testing.assert_allclose(samples.a[:, 0], [0, 2, 1, 1, 0, -3, 0], atol=1e-12)
    assert interpolated(samples.t, (samples.q, samples.v, samples.a), np.linspace(0, 3, 3001))[1].max() <= 3 + 1e-12


def test_rows_rest_where_the_motion_was_to_rest_and_start_and_end_exactly_there():
    goal = np.array([[[0.0], [0.0]], [[1.0], [0.0]]])
    # A landing that misses by 3e-6 rad, 0.01 rad/s; a start that moves by 1e-9 rad/s.
    motion = Trajectory([0.0, 0.5, 1.0], [[1e-9], [0.5], [1 - 3e-6]], [[1e-9], [2.0], [0.01]], np.ones((3, 1)))
    still = Trajectory.at_rest([1.0], [0.0], 0.1)
    for known in (replace(motion, ends=goal), replace(motion, ends=goal).join(still, tolerance=0.02)):
        for samples in (known.resample(1000), known.resample(7), known.resample()):
            assert (samples.q[0, 0], samples.v[0, 0], samples.a[0, 0]) == (0, 0, 0)
            assert (samples.q[-1, 0], samples.v[-1, 0], samples.a[-1, 0]) == (1, 0, 0)
    assert motion.resample(10).v[-1, 0] == 0.01  # nobody says that it was to rest
    flying = replace(motion, ends=[[[0.0], [0.0]], [[1.0], [0.0101]]]).resample(10)
    assert flying.v[-1, 0] == 0.0101 and flying.a[-1, 0] < 0
    missed = replace(motion, ends=[[[0.1], [0.0]], [[1.1], [0.5]]]).resample(10)  # another motion's ends
    assert missed.q[-1, 0] == motion.q[-1, 0] and missed.v[-1, 0] == 0.01 and missed.q[0, 0] == 1e-9


def test_ends_stay_with_a_motion(tmp_path):
    ends = np.array([[[0.0], [0.1]], [[1.0], [0.0]]])
    motion = Trajectory([0.0, 1.0, 2.0], [[0.0], [0.4], [1.0]], [[0.1], [1.0], [0.0]], np.ones((3, 1)), ends=ends)
    np.testing.assert_array_equal(Trajectory.load(motion.save(tmp_path / "m.npz")).ends, ends)
    back = reversed_in_time(motion)
    np.testing.assert_array_equal(back.ends, [[[1.0], [0.0]], [[0.0], [-0.1]]])
    for part, known in ((motion.slice(end=1.5), [True, False]), (motion.slice(begin=0.5), [False, True])):
        np.testing.assert_array_equal(np.isfinite(part.ends).all(axis=(1, 2)), known)
    both = motion + Trajectory.at_rest([1.0], [0.0], 1.0)
    np.testing.assert_array_equal(np.isfinite(both.ends).all(axis=(1, 2)), [True, False])
    with pytest.raises(TrajectoryError, match=r"ends has shape \(2, 1\); expected \(2, 2, 1\)"):
        replace(motion, ends=[[0.0], [1.0]])


def test_a_piece_ends_where_the_next_one_starts():
    residual = Trajectory([0.0, 0.5, 1.0], [[0.0], [0.5], [1 - 3e-6]], [[0.0], [2.0], [2e-3]], np.ones((3, 1)))
    whole = residual.as_piece(name="there").join(Trajectory.at_rest([1.0], [0.0], 0.1).as_piece(name="stay"), 0.01)
    there, stay = whole.split()
    last = there.resample(100)
    assert (last.q[-1, 0], last.v[-1, 0], last.a[-1, 0]) == (1, 0, 0) and there.v[-1, 0] == 2e-3
    assert stay.ends is None and there.join(stay, 0.01).ends is None


def test_a_solution_rests_exactly_at_its_goal():
    solution = solved("rr")
    assert np.any(solution.trajectory.v[-1])  # the residual of its landing stays in the motion
    samples = solution.trajectory.resample(500)
    np.testing.assert_array_equal(samples.q[[0, -1]], [solution.problem.q_start, solution.problem.q_goal])
    assert not np.any(samples.v[[0, -1]]) and not np.any(samples.a[[0, -1]])


def test_the_last_step_is_as_long_as_it_shall_be():
    motion = Trajectory([0.0, 0.95], [[0.0], [1.0]], [[0.0], [0.0]], [[1.0], [1.0]])
    np.testing.assert_allclose(motion.resample(10).t[-3:], [0.8, 0.9, 0.95])
    np.testing.assert_allclose(motion.resample(10, least=1.0).t[-3:], [0.7, 0.8, 0.95])


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
        ({"t": [0.0, 0.0]}, r"t\[1\]: t = 0 s does not rise above the 0 s of t\[0\]"),
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
