"""The gain region of one joint against eigenvalues, and the least factor against closed forms and measured ones."""

import numpy as np
import pytest

from armdyn.control.laws.pid import PidGains
from armdyn.control.stability.linear import closed_loop_matrix, eigenvalues, plant_at_goal
from armdyn.control.stability.region import GainRegion, least_stable_factor
from armdyn.control.stability.routh import routh_table
from armdyn.errors import ProblemError
from pid_loops import example, loaded_arm

PAPER = PidGains(30, 50, 10)
ROUNDING = 1e-13
"""Largest error of numpy's eigenvalues, as a part of the matrix's norm: some tens of ulps for 3 by 3."""


def growth(arm, gains):
    """Largest real part of the eigenvalues [1/s], and the norm of the matrix that they are of."""
    A = closed_loop_matrix(arm, *PidGains(*gains).per_joint(arm.B.shape[1]))
    return eigenvalues(A)[0].real, np.linalg.norm(A)


def random_case(random):
    """An arm of one joint, perhaps with friction, its goal, and gains."""
    grams = random.choice([0.0, 21.2, 100.6, 500.0, 1000.0])
    robot = loaded_arm("r", "tip", grams)
    if random.random() < 0.3:
        robot = robot.with_friction(0.01, 0.02, 0.1)
    return robot, random.uniform(-np.pi, np.pi, 1), random_gains(random)


def random_gains(random):
    """Gains over six decades, some without ki."""
    kp, ki, kd = 10 ** random.uniform(-3, 3, 3)
    return kp, ki * (random.random() > 0.1), kd


@pytest.mark.slow
@pytest.mark.parametrize("form", ["torque", "acceleration"])
def test_against_eigenvalues_at_random_gains(form):
    """5,000 gains for each form: no disagreement.

    Where the largest real part is as small as an eigenvalue's rounding, its sign says nothing. There the exact table of
    the polynomial decides; the region's own rounding is that of two products.
    """
    random, verdicts, within = np.random.default_rng(7), [], 0
    for _ in range(100):
        robot, goal, _ = random_case(random)
        arm, region = plant_at_goal(robot, goal, form), GainRegion.of(robot, goal, form)
        for _ in range(50):
            gains = random_gains(random)
            stable = bool(region.stable(*gains))
            largest, norm = growth(arm, gains)
            if abs(largest) > ROUNDING * norm:
                assert stable == (largest < 0), (goal, gains)
            else:
                within += 1
                assert stable == routh_table(region.polynomial(*gains)).is_stable, (goal, gains)
            verdicts.append(stable)
    assert 0.2 < np.mean(verdicts) < 0.8
    assert within <= 5


def test_the_exact_table_says_the_same():
    random = np.random.default_rng(5)
    for _ in range(300):
        robot, goal, gains = random_case(random)
        region = GainRegion.of(robot, goal, "torque")
        assert routh_table(region.polynomial(*gains)).is_stable == bool(region.stable(*gains))


@pytest.mark.parametrize("form", ["torque", "acceleration", "computed_torque"])
def test_poles_on_the_boundary_are_imaginary(form):
    robot = loaded_arm("r", "tip", 100.6).with_friction(0.001, 0.0, 0.1)
    goal, ki = np.array([0.3]), 50.0
    region = GainRegion.of(robot, goal, form)
    for kp in (20.0, 30.0, 300.0):
        kd = float(region.least_kd(kp, ki))
        largest, norm = growth(plant_at_goal(robot, goal, form), (kp, ki, kd))
        # A root moves by about 1/norm times the rounding of kd.
        assert abs(largest) < 1e-9 * norm
        # s = ± i √((kp + k) / m) then.
        omega = np.sqrt((kp + region.stiffness) / region.inertia)
        residual = np.polyval(region.polynomial(kp, ki, kd), 1j * omega)
        assert abs(residual) < 1e-9 * region.inertia * omega**3
        assert region.stable(kp, ki, kd * (1 + 1e-9))
        assert not region.stable(kp, ki, kd * (1 - 1e-9))


def test_no_kd_is_enough_where_gravity_is_stiffer():
    robot = loaded_arm("r", "tip", 1000)
    region = GainRegion.of(robot, [np.pi / 2], "torque")  # upright
    assert region.stiffness < 0
    assert region.least_kd(-region.stiffness / 2, 1.0) == np.inf
    assert not region.stable(-region.stiffness / 2, 1.0, 1e6)
    assert np.isfinite(region.least_kd(-2 * region.stiffness, 1.0))
    assert GainRegion(1.0, 0.0, 0.5).least_kd(10.0, 1.0) == 0.0


@pytest.mark.parametrize(
    ("name", "measured"), [("RR Ex5", (0.39, 0.47, 0.87, 1.38)), ("RRR Ex6", (1.49, 2.19, 4.92, 8.12))]
)
def test_the_papers_gains_times_a_factor(name, measured):
    """Beside a scan by an independent prototype, which says the first stable factor of a grid 3.9 % apart."""
    for grams, scanned in zip((0, 100.6, 500, 1000), measured, strict=True):
        robot, poses = example(name, grams=grams)
        factor = least_stable_factor(robot, poses["q_goal"], PAPER)
        assert scanned / 1.04 - 0.005 < factor < scanned + 0.005
        arm = plant_at_goal(robot, np.array(poses["q_goal"]), "acceleration")
        below, above = (growth(arm, factor * side * np.array([30.0, 50.0, 10.0]))[0] for side in (1 - 1e-6, 1 + 1e-6))
        assert below > 0 > above


@pytest.mark.parametrize("grams", [0, 100.6, 1000])
def test_the_factor_of_one_joint_in_closed_form(grams):
    """(kd c) (kp c + k) = ki c at c = (ki / kd - k) / kp."""
    robot, poses = example("R Ex4", grams=grams)
    region = GainRegion.of(robot, poses["q_goal"])
    expected = (50 / 10 - region.stiffness) / 30
    assert least_stable_factor(robot, poses["q_goal"], PAPER) == pytest.approx(expected, rel=1e-9)


def test_ends_of_the_scan():
    robot, poses = example("R Ex4", grams=100.6)
    assert least_stable_factor(robot, poses["q_goal"], PAPER, factors=(1.0, 10.0)) == 1.0
    assert least_stable_factor(robot, poses["q_goal"], PAPER, factors=(0.01, 0.1)) is None


def test_bad_input():
    rr, poses = example("RR Ex5")
    with pytest.raises(ProblemError, match="2 joints"):
        GainRegion.of(rr, poses["q_goal"])
    with pytest.raises(ProblemError, match="form is 'voltage'"):
        GainRegion.of(loaded_arm("r", "tip", 0), [0.0], "voltage")
    with pytest.raises(ProblemError, match="inertia"):
        GainRegion(0.0, 1.0)
    with pytest.raises(ProblemError, match="the least comes first"):
        least_stable_factor(rr, poses["q_goal"], factors=(2.0, 1.0))
