import numpy as np
import pytest

import armdyn as ad
from armdyn.control.laws.readings import reference_of
from armdyn.control.loop.references import Ticks
from plain_loop import Filtered
from problems import paper_arm

ROBOT = paper_arm("rr")
MOTION = ad.ramp(ROBOT, [-1.0, 0.5], [0.3, -0.4], 0.2)


def reference(**loop):
    loop = ad.Loop(**loop)
    return reference_of(ROBOT, Ticks.of(ROBOT, MOTION, loop.rate), loop), loop


def true_velocities(shown, loop):
    """Velocities of the motion at the rows of a reference, the last for good."""
    v = Ticks.of(ROBOT, MOTION, loop.rate).v
    return v[np.minimum(np.arange(len(shown.v)), len(v) - 1)]


@pytest.mark.parametrize("velocity", ["exact", "observer"])
def test_a_loop_without_a_filter_shows_the_velocity_itself(velocity):
    shown, loop = reference(velocity=velocity)
    assert np.array_equal(shown.v, true_velocities(shown, loop))
    assert np.array_equal(shown.v[: 200 + 1], MOTION(np.arange(201) / 1000).v)


@pytest.mark.parametrize(("rate", "cutoff"), [(1000.0, 80.0), (500.0, 20.0), (1000.0, 2000.0)])
def test_a_filtered_velocity_is_the_filters_output_of_the_positions(rate, cutoff):
    shown, loop = reference(rate=rate, cutoff=cutoff)
    true = true_velocities(shown, loop)
    plain = Filtered(loop, shown.q[0], true[0])
    expected = np.array([plain.read(q, None)[1] for q in shown.q])
    assert shown.v == pytest.approx(expected, abs=1e-10)  # differences of positions times the rate are rounded so
    # It lags: without the same filter an arm that follows exactly would have an error.
    assert np.abs(shown.v - true).max() > 1e-3 * np.abs(true).max()
    # The last row holds for good: the filter has come to rest by then, to the millionth that `reference_of` names.
    assert np.abs(shown.v[-1]).max() < 2e-6 * np.abs(true).max()


def test_a_motion_that_begins_fast_is_filtered_from_its_velocity_on():
    t = np.array([0.0, 0.1])
    steady = ad.Trajectory(t=t, q=np.outer(t, [2.0, -1.0]), v=np.tile([2.0, -1.0], (2, 1)), tau=np.zeros((2, 2)))
    loop = ad.Loop()
    shown = reference_of(ROBOT, Ticks.of(ROBOT, steady, loop.rate), loop)
    assert shown.v[:100] == pytest.approx(np.tile([2.0, -1.0], (100, 1)), abs=1e-12)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_torques_are_those_of_the_tick_that_feels_them(delay):
    shown, loop = reference(delay=delay, velocity="exact")
    ticks = Ticks.of(ROBOT, MOTION, loop.rate)
    assert np.array_equal(shown.tau, ticks.ahead(delay))
    assert np.array_equal(shown.a[: len(shown.a) - delay], ticks.a[delay:])
    assert np.array_equal(shown.q, ticks.q)


def test_a_continuous_loop_has_the_torque_of_the_moment():
    loop = ad.Loop.ideal()
    shown = reference_of(ROBOT, Ticks.of(ROBOT, MOTION, loop.rate), loop)
    moment = MOTION(np.arange(201) / 1000).tau
    # The ramp's torque is linear between samples a tick apart: the mean over two ticks is a quarter of the second
    # difference beside the moment's.
    bend = np.abs(np.diff(moment, 2, axis=0)).max()
    assert np.abs(shown.tau[1:200] - moment[1:200]).max() < 1.01 * bend / 4


def test_a_slow_filter_adds_no_more_rows_than_memory_bears():
    shown, _ = reference(rate=1e5, cutoff=1e-3)
    assert len(shown.v) <= 20_000 + 20_002


def test_misfits_are_refused():
    ticks = Ticks.of(ROBOT, MOTION, 500.0)
    with pytest.raises(ad.ArmdynError, match="500 ticks a second; the loop has 1000"):
        reference_of(ROBOT, ticks, ad.Loop())
    with pytest.raises(ad.ArmdynError, match=r"2 joints; .* has 3"):
        reference_of(paper_arm("rrr"), ticks, ad.Loop(rate=500.0))
