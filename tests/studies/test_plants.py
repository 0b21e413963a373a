"""Samples, and the arms that they make."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import armdyn as ad
from armdyn.dynamics.driven import plant_of
from armdyn.errors import ProblemError
from armdyn.studies.plant_study import identity
from armdyn.studies.plants import with_payload_times
from problems import paper_arm

BOTH = ad.Plants(coulomb=(0.01, 0.06), damping=(0.0, 0.003), start=0.02, seed=3)


def accelerations(robot, states):
    dynamics = ad.Dynamics(robot)
    return np.array([dynamics.aba(*state) for state in states])


@pytest.mark.parametrize("arm", ["generated", "panda", "off the tip"])
def test_a_multiple_of_a_payload_is_the_payload_of_that_mass(arm):
    inertia = np.array([2e-3, 3e-3, 4e-3])

    def carrying(times):
        body = {"com": (0.02, 0.0, -0.01), "inertia": times * inertia}
        if arm == "panda":
            return ad.Robot.from_library("panda", ad.Payload(mass=1.5 * times, **body))
        frame = "link1" if arm == "off the tip" else None
        return ad.Robot.from_spec(ad.ArmSpec.paper("rrr"), ad.Payload(mass=0.1 * times, frame=frame, **body))

    one, more = carrying(1.0), carrying(1.3)
    scaled = with_payload_times(one, 1.3)
    states = np.random.default_rng(1).normal(size=(5, 3, one.nv))
    # Both sum the same dynamic parameters in another order.
    np.testing.assert_allclose(accelerations(scaled, states), accelerations(more, states), rtol=1e-9, atol=1e-9)
    assert np.abs(accelerations(one, states) - accelerations(more, states)).max() > 1e-2
    assert scaled.payload.mass == pytest.approx(more.payload.mass)
    np.testing.assert_allclose(scaled.payload.tensor, more.payload.tensor)


@given(k=st.integers(0, 10_000), nv=st.integers(1, 7))
def test_a_draw_is_within_its_ranges_and_always_the_same(k, nv):
    draw = BOTH.sample(k, nv)
    assert draw == ad.Plants(coulomb=(0.01, 0.06), damping=(0.0, 0.003), start=0.02, seed=3).sample(k, nv)
    assert 0.8 <= draw.payload <= 1.2
    assert len(draw.coulomb) == len(draw.damping) == len(draw.start) == nv
    assert all(0.01 <= x <= 0.06 for x in draw.coulomb)
    assert all(0.0 <= x <= 0.003 for x in draw.damping)
    assert all(-0.02 <= x <= 0.02 for x in draw.start)


def test_samples_are_evenly_spread_and_differ_by_number_and_seed():
    from scipy.stats import kstest  # slow to import, and for this test alone

    loads = np.array([BOTH.sample(k, 3).payload for k in range(2000)])
    # With this seed the hypothesis of an even spread is not rejected; a triangle's would be at 1e-100.
    assert kstest(loads, "uniform", args=(0.8, 0.4)).pvalue > 0.05
    assert len(set(loads)) == 2000
    assert BOTH.sample(0, 3).payload != ad.Plants(seed=4).sample(0, 3).payload
    drawn = [BOTH.sample(k, 2) for k in range(2000)]
    both = np.array([[*draw.coulomb, *draw.damping, *draw.start] for draw in drawn])
    # 2000 pairs: correlations of independent numbers are below 4 / sqrt(2000) = 0.09.
    assert np.abs(np.corrcoef(both.T) - np.eye(6)).max() < 0.09


def test_the_payload_does_not_change_with_the_friction():
    plain = ad.Plants(seed=3)
    assert [plain.sample(k, 3).payload for k in range(9)] == [BOTH.sample(k, 3).payload for k in range(9)]


def test_friction_is_added_to_the_robots_own():
    robot = paper_arm("rr").with_friction(0.001, 0.1)
    draw = BOTH.sample(5, 2)
    damping, coulomb = draw.arm(robot).friction.per_joint(2)
    np.testing.assert_allclose(damping, 0.001 + np.array(draw.damping))
    np.testing.assert_allclose(coulomb, 0.1 + np.array(draw.coulomb))


def test_corners_are_three_payloads_with_the_least_and_the_greatest_friction():
    arms = ad.Plants(coulomb=(0, 0.06), damping=(0, 0.003)).corners(paper_arm("rr"))
    drawn = [(arm.payload.mass / 0.1006, *(float(x[0]) for x in arm.friction.per_joint(2))) for arm in arms]
    loads = (0.8, 1.0, 1.2)
    expected = [*((load, 0.0, 0.0) for load in loads), *((load, 0.003, 0.06) for load in loads)]
    np.testing.assert_allclose(drawn, expected)
    assert len(ad.Plants().corners(paper_arm("rr"))) == 3
    assert len(ad.Plants(payload=(1, 1)).corners(ad.Robot.from_spec(ad.ArmSpec.paper("r")))) == 1


def test_all_arms_share_one_compiled_function():
    arms = BOTH.arms(paper_arm("rrr"), 4)
    assert len({id(plant_of(arm).function) for arm in arms}) == 1
    assert len({plant_of(arm).parameters.tobytes() for arm in arms}) == 4


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"payload": (1.2, 0.8)}, "payload goes from 1.2 to 0.8 times its mass; the least comes first"),
        ({"payload": (0, 1)}, r"payload\[0\] is 0 times its mass; it must be positive and finite"),
        ({"payload": 0.2}, "payload is 0.2; it must be a list"),
        ({"coulomb": (1,)}, r"coulomb is \(1,\); expected its least and its greatest \[N m or N\]"),
        ({"damping": (-1, 0)}, r"damping\[0\] is -1 N m s/rad or N s/m; it must be finite and not negative"),
        ({"start": -1}, "start is -1 rad or m; it must be finite and not negative"),
        ({"seed": 1.5}, "seed is 1.5; it must be a whole number of at least 0"),
    ],
)
def test_ranges_that_are_none_are_refused(given, message):
    with pytest.raises(ProblemError, match=message):
        ad.Plants(**given)


def test_a_robot_without_payload_has_none_that_could_differ():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("r"))
    with pytest.raises(ProblemError, match=r"0\.8 to 1\.2 times the payload of r, which has none"):
        ad.Plants().arms(robot, 1)
    assert ad.Plants(payload=(1, 1), damping=(0, 1)).arms(robot, 1)[0].friction.present


def test_a_study_distinguishes_motors():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    falling = robot.with_torque_speed({"joint1": [[0, 3], [9, 1]]})
    assert "torque_speed" not in identity(robot) and identity(falling) != identity(robot)


def test_likely_arms_are_taken_in_turn():
    robot = paper_arm("rr")
    likely = tuple(robot.with_friction(0.0, dry) for dry in (0.01, 0.02))
    plants = ad.Plants(likely=likely, coulomb=(0.0, 0.005), seed=2)
    arms = plants.arms(robot, 4)
    added = [arm.friction.coulomb - likely[k % 2].friction.coulomb for k, arm in enumerate(arms)]
    assert np.all(np.array(added) > 0) and np.all(np.array(added) < 0.005)
    assert all(plants.sample(k, 2).payload == 1 and plants.sample(k, 2).likely == k % 2 for k in range(4))
    assert len(plants.corners(robot)) == 4
    run = ad.monte_carlo(
        robot, ad.ramp(robot, [0, 0], [0.1, 0], 0.5), plants=plants, options=ad.MonteCarloOptions(count=3)
    )
    assert [row.sample.likely for row in run.rows] == [0, 1, 0]
    assert run.plant(1).friction.coulomb[0] > 0.02
    with pytest.raises(ProblemError, match=r"likely\[0\] has 3 joints"):
        ad.Plants(likely=(paper_arm("rrr"),)).arms(robot, 1)
