"""The fastest curve of a cart (1 kg on a level rail, 1 N at most, 2 m to go) against closed forms."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve import Basis, Curve, graded
from armdyn.optimal.curves.layout import CurveSpec
from armdyn.optimal.curves.solve import solve_curve
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.task import Task
from problems import cart

AWAY = 2.0
EVEN = 1.0


def fastest(intervals=56, shortest=EVEN, near=None, goal=AWAY, **options):
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[goal], **options)
    task = Task.of(problem, ad.MinimumTimeOptions(compile=False))
    guess = near.curve if near else Curve.straight(problem, Basis(graded(intervals, shortest)), 3.0)
    solved = solve_curve(task, guess, CurveSpec(TightenedConstraints.of(task)), near)
    assert solved.converged, solved.result.message
    return solved


PROFILES = [
    ({}, 2 * np.sqrt(AWAY)),
    ({"velocity_limit": 0.6}, AWAY / 0.6 + 0.6),
    ({"acceleration_limit": 0.5}, 2 * np.sqrt(AWAY / 0.5)),
    ({"acceleration_limit": 0.5, "velocity_limit": 0.6}, AWAY / 0.6 + 0.6 / 0.5),
    # Double S, see Biagiotti and Melchiorri, Trajectory Planning (2008), section 3.4.
    ({"jerk_limit": 0.5}, 4 * np.cbrt(AWAY / (2 * 0.5))),
    ({"acceleration_limit": 0.4, "jerk_limit": 0.5}, 0.4 / 0.5 + np.sqrt((0.4 / 0.5) ** 2 + 4 * AWAY / 0.4)),
    (
        {"acceleration_limit": 0.4, "jerk_limit": 0.5, "velocity_limit": 0.5},
        AWAY / 0.5 + 0.5 / 0.4 + 0.4 / 0.5,
    ),
    ({"path_constraints": [ad.TorqueRateLimit(0.5)]}, 4 * np.cbrt(AWAY / (2 * 0.5))),  # on 1 kg it is a jerk limit
    ({"path_constraints": [ad.TorqueRateLimit(4.0)]}, 1 / 4 + np.sqrt(1 / 4**2 + 4 * AWAY)),
    ({"path_constraints": [ad.FrameSpeedLimit(0.8)]}, AWAY / 0.8 + 0.8),
    # From 0.3 m/s to 0.6 m/s, cruise, to -0.2 m/s, at 1 m/s².
    (
        {"velocity_limit": 0.6, "v_start": [0.3], "v_goal": [-0.2]},
        0.3 + 0.8 + (AWAY - (0.6**2 - 0.3**2) / 2 - (0.6**2 - 0.2**2) / 2) / 0.6,
    ),
    ({"via": [[0.7]]}, 2 * np.sqrt(AWAY)),  # it lies on the way
    ({"via": [[3.0]]}, 2 * np.sqrt(3) + 2),  # there it turns round
]


@pytest.mark.parametrize(("options", "duration"), PROFILES)
def test_a_cart_takes_the_time_of_its_profile(options, duration):
    coarse, fine = (fastest(intervals, **options).curve.duration / duration - 1 for intervals in (28, 56))
    # A corner of the profile within an interval of 1/56 is rounded: 2e-3, less where the mesh happens to fit.
    assert -1e-5 < fine < 2e-3  # torques at two points of an interval may be a little above one between
    assert fine < 0.6 * coarse or coarse < 2e-3


@pytest.mark.parametrize("weight", [3.0, 5.0])
def test_least_time_and_energy_is_a_cubic(weight):
    solved = fastest(intervals=12, relative_effort_weight=weight)
    # Least ∫u² over T is 12 d²/T³, by u = 6 d/T² (1 - 2t/T); J = T + w/2 of that is least where T⁴ = 18 w d².
    duration = (18 * weight * AWAY**2) ** 0.25
    assert 6 * AWAY / duration**2 < 1  # the torque stays within its limit
    assert solved.curve.duration == pytest.approx(duration, rel=1e-6)  # IPOPT's 1e-7; the curve can be that cubic
    s = np.linspace(0, 1, 33)
    np.testing.assert_allclose(solved.curve.legs[0].at(s)[0][:, 0], AWAY * s**2 * (3 - 2 * s), atol=1e-5)  # its root
    heavier = fastest(intervals=12, effort_weight=weight)  # half the torque's range is 1 N: the same
    assert heavier.curve.duration == pytest.approx(duration, rel=1e-6)


def test_a_via_point_is_passed_when_the_profile_passes_it():
    curve = fastest(via=[[0.7]]).curve
    (passing,) = curve.passing
    assert passing == pytest.approx(np.sqrt(2 * 0.7), rel=2e-3)  # as above
    before, after = (leg.at(np.array([end])) for leg, end in zip(curve.legs, (1.0, 0.0), strict=True))
    assert before[0][0, 0] == after[0][0, 0] == 0.7
    assert before[1][0, 0] == pytest.approx(after[1][0, 0], rel=1e-6)  # an equation: IPOPT's 1e-7


def test_torques_that_may_not_jump_do_not_where_legs_meet():
    curve = fastest(28, via=[[0.7]], jerk_limit=2.0).curve
    before, after = (leg.at(np.array([end]))[2][0, 0] for leg, end in zip(curve.legs, (1.0, 0.0), strict=True))
    assert before == pytest.approx(after, abs=1e-6)  # an equation: IPOPT's 1e-7
    ends = curve.legs[0].at(np.array([0.0]))[2], curve.legs[-1].at(np.array([1.0]))[2]
    np.testing.assert_allclose(ends, 0, atol=1e-9)  # control points that are one point


def test_with_a_jerk_limit_accelerations_are_zero_at_both_ends_in_flight_too():
    ends = fastest(28, v_start=[0.3], v_goal=[0.2], jerk_limit=2.0).curve.legs[0].at(np.array([0.0, 1.0]))
    np.testing.assert_allclose(ends[2], 0, atol=1e-6)  # equations: IPOPT's 1e-7
    np.testing.assert_allclose(ends[1].ravel(), [0.3, 0.2], atol=1e-6)


def test_position_limits_are_kept_everywhere():
    options = {"v_start": [-0.6], "relative_effort_weight": 20.0}
    free, held = (fastest(24, **options, **more) for more in ({}, {"position_limit": (-0.25, 3.0)}))
    lowest = [solved.curve.legs[0].at(np.linspace(0, 1, 2000))[0].min() for solved in (free, held)]
    assert lowest[0] < -0.3
    assert -0.25 - 1e-7 < lowest[1] < -0.2  # control points are bounded, up to IPOPT's relaxation of 1e-8
    assert held.result.status is Status.SOLVED


def test_velocity_limits_are_kept_everywhere():
    leg = fastest(28, 3e-3, velocity_limit=0.6).curve.legs[0]
    v = leg.at(np.linspace(0, 1, 5000))[1]
    assert 0.6 * (1 - 1e-6) < np.max(np.abs(v)) <= 0.6 * (1 + 1e-6)  # IPOPT's 1e-7


def test_a_warm_start_is_quicker_and_as_good():
    options = {"velocity_limit": 0.6}
    cold = fastest(**options)
    warm = fastest(near=cold, **options)
    assert warm.result.iterations < cold.result.iterations / 2
    assert warm.curve.duration == pytest.approx(cold.curve.duration, rel=1e-6)  # IPOPT's 1e-7


def test_another_shape_is_no_warm_start():
    cold = fastest(velocity_limit=0.6)
    other = fastest(near=cold, velocity_limit=0.6, acceleration_limit=0.5)  # its multipliers would not fit
    assert other.shape != cold.shape and other.curve.duration > cold.curve.duration
