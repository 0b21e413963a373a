from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.control.loop.references import Ticks
from problems import CART, paper_arm


def bang_bang(force=(1.0, -1.0), switch=0.25037, period=0.5):
    """The cart of 1 kg: each force half of the time, exact."""
    t1, t2 = switch, period
    v1 = force[0] * t1
    v2 = v1 + force[1] * (t2 - t1)
    q1 = force[0] * t1**2 / 2
    q2 = q1 + v1 * (t2 - t1) + force[1] * (t2 - t1) ** 2 / 2
    t = np.array([0.0, t1, np.nextafter(t1, 1), t2])
    return ad.Trajectory(
        t=t,
        q=np.array([[0.0], [q1], [q1], [q2]]),
        v=np.array([[0.0], [v1], [v1], [v2]]),
        tau=np.array([[force[0]], [force[0]], [force[1]], [force[1]]]),
    )


@pytest.fixture(scope="module")
def cart():
    return ad.Robot.from_urdf_string(CART)


def test_a_mean_is_exact_where_the_force_jumps_within_a_tick(cart):
    ticks = Ticks.of(cart, bang_bang(), 100.0)
    # The jump is at 0.25037 s: the 26th tick has 0.37 ms of +1 N and 9.63 ms of -1 N.
    assert ticks.tau[24, 0] == pytest.approx(1.0, abs=1e-12)
    assert ticks.tau[25, 0] == pytest.approx((0.37 - 9.63) / 10, abs=1e-9)
    assert ticks.tau[26, 0] == pytest.approx(-1.0, abs=1e-12)


@pytest.mark.parametrize("rate", [100.0, 333.0, 1000.0])
def test_of_a_cart_mean_force_is_mean_acceleration(cart, rate):
    reference = bang_bang(switch=0.25)  # it ends at rest: its speed does not jump there
    ticks = Ticks.of(cart, reference, rate)
    assert ticks.tau == pytest.approx(ticks.a, abs=1e-9)  # rounding of speeds over a tick of 1 ms
    at = reference(np.arange(len(ticks.q)) / rate)
    assert np.array_equal(ticks.q, at.q)


def test_impulses_add_up(cart):
    reference = bang_bang(force=(1.0, -0.3))
    ticks = Ticks.of(cart, reference, 1000.0)
    whole = 0.25037 - 0.3 * (0.5 - 0.25037)
    assert ticks.tau.sum() / 1000.0 == pytest.approx(whole, abs=1e-12)  # the cart needs nothing to stand still


def test_a_linear_torque_has_the_mean_of_its_ends(cart):
    t = np.array([0.0, 0.1])
    reference = ad.Trajectory(t=t, q=np.zeros((2, 1)), v=np.zeros((2, 1)), tau=np.array([[0.0], [1.0]]))
    means = Ticks.of(cart, reference, 100.0).tau[:10, 0]
    assert means == pytest.approx(0.05 + 0.1 * np.arange(10), abs=1e-12)


def test_after_the_motion_the_arm_is_held():
    arm = paper_arm("rr")
    q = np.tile([0.3, -0.7], (2, 1))
    reference = ad.Trajectory(t=np.array([0.0, 0.01]), q=q, v=0 * q, tau=0 * q + 0.5)
    ticks = Ticks.of(arm, reference, 1000.0)
    holding = ad.Dynamics(arm).gravity(q[0])
    assert ticks.tau[:10] == pytest.approx(np.full((10, 2), 0.5), abs=1e-12)  # a tick's length is rounded
    assert ticks.tau[10:] == pytest.approx(np.tile(holding, (len(ticks.tau) - 10, 1)), abs=1e-12)
    assert len(ticks.tau) > 10


def test_torques_that_a_motion_has_not_are_computed():
    """A ramp's own torques are those of inverse dynamics; a tick's mean is off by its curvature, 1e-4 of the most."""
    arm = paper_arm("rr")
    ramp = ad.ramp(arm, [0, 0], [1, 1], 1.0)
    known, computed = (Ticks.of(arm, one, 1000.0).tau for one in (ramp, replace(ramp, tau=0 * ramp.tau)))
    assert computed == pytest.approx(known, abs=5e-3 * np.max(np.abs(known)))


def test_the_last_row_is_rest_at_the_goal(cart):
    ticks = Ticks.of(cart, bang_bang(force=(1.0, -0.3)), 1000.0)  # it ends in motion
    assert ticks.v[-1] == 0
    assert ticks.a[-1] == 0
    assert np.abs(ticks.a).max() == pytest.approx(1.0, abs=1e-9)  # and is not braked within a tick
    assert ticks.goal == pytest.approx(bang_bang(force=(1.0, -0.3)).q[-1], abs=1e-15)  # a cubic's end, rounded


def test_torques_ahead_end_in_the_last(cart):
    ticks = Ticks.of(cart, bang_bang(), 1000.0)
    assert np.array_equal(ticks.ahead(0), ticks.tau)
    assert np.array_equal(ticks.ahead(2)[:-2], ticks.tau[2:])
    assert np.array_equal(ticks.ahead(2)[-3:], np.tile(ticks.tau[-1], (3, 1)))
    assert np.array_equal(ticks.ahead(10_000), np.tile(ticks.tau[-1], (len(ticks.tau), 1)))


def test_a_trajectory_may_begin_at_any_time(cart):
    smooth = ad.Trajectory(
        t=np.array([0.0, 0.3]), q=np.array([[0.0], [1.0]]), v=np.zeros((2, 1)), tau=np.array([[4.0], [-4.0]])
    )
    late = ad.Trajectory(t=smooth.t + 3.0, q=smooth.q, v=smooth.v, tau=smooth.tau)
    now, then = Ticks.of(cart, smooth, 1000.0), Ticks.of(cart, late, 1000.0)
    assert then.q == pytest.approx(now.q, abs=1e-12)
    assert then.tau == pytest.approx(now.tau, abs=1e-9)  # times near 3 s are rounded to 4e-16 s, ticks are 1e-3 s


def test_another_number_of_joints_is_refused(cart):
    with pytest.raises(ad.ArmdynError, match=r"1 joints; .* has 2"):
        Ticks.of(paper_arm("rr"), bang_bang(), 1000.0)


def test_more_ticks_than_two_million_are_refused(cart):
    slow = bang_bang()
    slow = ad.Trajectory(t=slow.t * 1e5, q=slow.q, v=slow.v / 1e5, tau=slow.tau / 1e10)
    with pytest.raises(ad.ArmdynError, match="ticks; expected at most 2000000"):
        Ticks.of(cart, slow, 1000.0)
