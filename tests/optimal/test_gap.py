from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

import armdyn as ad
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.errors import ProblemError, TrajectoryError
from armdyn.optimal.gap import TimeOptimality, check_motion, time_optimality, trajectory_from_path
from problems import POSES, cart, paper_arm, pick_and_place, solved


def quintic(robot, start, goal, duration, n=201):
    """Rest to rest along a straight joint path, s = 10 x³ - 15 x⁴ + 6 x⁵: positions only."""
    x = np.linspace(0, 1, n)[:, None]
    start, goal = np.asarray(start), np.asarray(goal)
    q = start + (goal - start) * (10 * x**3 - 15 * x**4 + 6 * x**5)
    v = (goal - start) * (30 * x**2 - 60 * x**3 + 30 * x**4) / duration
    a = (goal - start) * (60 * x - 180 * x**2 + 120 * x**3) / duration**2
    return x.ravel() * duration, q, v, a


@lru_cache
def judged_one_link():
    robot = paper_arm("r")
    optimum = solved("r")
    t, q, v, _ = quintic(robot, *POSES["r"], 2 * optimum.duration)
    return optimum, time_optimality(robot, trajectory_from_path(robot, t, q, v, name="quintic"))


def test_an_optimum_has_ratio_one_and_no_idle_joint():
    optimum = solved("rr")
    result = time_optimality(optimum.problem.robot, optimum.trajectory)
    assert result.ratio == pytest.approx(1, abs=1e-8)  # the same deterministic solve, of the same problem
    assert result.gap == pytest.approx(0, abs=1e-8)
    assert result.feasible
    assert result.replay_error < 1e-6 and 1 < result.growth < 1e4 and "unstable" not in str(result)
    assert "unstable open loop (growth 2e+06)" in str(replace(result, growth=2e6))
    assert np.all(result.idle < 1e-3)  # bang-bang: a torque jumps over the middle of its range in no time
    assert all(not spans or max(b - a for a, b in spans) < 1e-3 for spans in result.idle_intervals)


def test_the_double_integrator_at_half_force_is_slower_by_root_two():
    robot = cart()
    half = 2.0  # 0.5 N on 1 kg for 2 s, then back: 2 m, where 1 N would need 2 √2 s
    t = [0.0, np.nextafter(half, 0), half, 2 * half]
    motion = ad.Trajectory(t, [[0], [1], [1], [2]], [[0], [1], [1], [0]], [[0.5], [0.5], [-0.5], [-0.5]])
    result = time_optimality(robot, motion)
    assert result.ratio == pytest.approx(np.sqrt(2), rel=1e-6)
    assert result.idle == pytest.approx([1.0])
    assert result.idle_intervals == (((0.0, 4.0),),)


def test_idle_is_where_torque_is_off_its_limit():
    robot = cart()
    t = [0.0, 1.0, np.nextafter(1.0, 2), 3.0, np.nextafter(3.0, 4), 4.0]  # push, coast for 2 s, brake
    force = [[1], [1], [0], [0], [-1], [-1]]
    motion = ad.Trajectory(t, [[0], [0.5], [0.5], [2.5], [2.5], [3]], [[0], [1], [1], [1], [1], [0]], force)
    result = time_optimality(robot, motion)
    assert result.idle == pytest.approx([0.5], abs=1e-3)  # the grid's cells
    (spans,) = result.idle_intervals
    np.testing.assert_allclose(spans, [(1.0, 3.0)], atol=3e-3)
    coasting = time_optimality(robot.with_limits(None, 1.0), motion)
    assert coasting.idle == pytest.approx([0.0], abs=1e-3)  # now it coasts on its velocity limit
    assert coasting.ratio == pytest.approx(1.0, abs=1e-6)


def test_a_quintic_of_twice_the_duration():
    optimum, result = judged_one_link()
    assert result.solution.success, result.solution.message
    assert result.duration == pytest.approx(2 * optimum.duration)
    assert result.ratio == pytest.approx(2, rel=1e-6)
    assert result.gap == pytest.approx(optimum.duration, rel=1e-6)
    assert result.feasible
    assert result.worst_violation is None
    assert result.idle[0] > 0.5
    assert result.trajectory.name == "quintic"
    assert "kept" in str(result)
    assert "joint1" in str(result)


def test_missing_torques_are_recomputed():
    _, result = judged_one_link()
    bare = ad.Trajectory(result.trajectory.t, result.trajectory.q, result.trajectory.v, 0 * result.trajectory.tau)
    again = time_optimality(paper_arm("r"), bare)
    np.testing.assert_array_equal(again.trajectory.tau, result.trajectory.tau)


def test_a_motion_beyond_the_limits_is_flagged():
    optimum, _ = judged_one_link()
    robot = paper_arm("r")
    fast = trajectory_from_path(robot, *quintic(robot, *POSES["r"], 0.8 * optimum.duration))
    result = time_optimality(robot, fast)
    assert not result.feasible
    assert result.worst_violation.constraint == "torque limit"
    assert result.worst_violation.value == pytest.approx(np.max(np.abs(fast.tau)) / 3 - 1)
    assert result.ratio == pytest.approx(0.8, rel=1e-6)
    assert "BROKEN" in str(result)


def test_a_velocity_limit_is_looked_at_between_samples():
    robot = cart().with_limits(None, 1.0)
    t, q, v, a = quintic(robot, [0.0], [2.0], 3.0, n=4)  # fastest half-way, 1.25 m/s, where no sample is
    result = time_optimality(robot, trajectory_from_path(robot, t, q, v, a))
    assert result.worst_violation.constraint == "velocity limit"
    assert result.worst_violation.time == pytest.approx(1.5)


def test_a_motion_is_checked_without_a_search():
    robot = paper_arm("rr")
    slow, fast = (ad.ramp(robot, [-1.5, 0.1], [0.2, -0.1], duration) for duration in (0.6, 0.15))
    kept, broken = check_motion(robot, slow), check_motion(robot, fast)
    # Torques of a ramp are linear between its samples, where its own are a polynomial's.
    assert kept.feasible and kept.worst_violation is None and kept.replay_error < 1e-4
    assert not broken.feasible and broken.worst_violation.constraint == "torque limit"
    assert broken.facts()["worst_violation"] == str(broken.worst_violation)
    weak = replace(robot.limits, effort_lower=[-0.5] * 2, effort_upper=[0.5] * 2)
    assert not check_motion(robot, slow, weak).feasible
    with pytest.raises(TrajectoryError, match="2 joints; rrr has 3"):
        check_motion(paper_arm("rrr"), slow)


def test_pieces_are_checked_by_their_own_models():
    robot, motion = pick_and_place()
    found = check_motion(robot, motion)
    assert found.feasible and found.replay_error < 1e-4
    assert check_motion(robot, replace(motion, pieces=())).replay_error > 0.1
    with pytest.raises(TrajectoryError, match="the payload changes along the motion of 3 pieces"):
        time_optimality(robot, motion)


def test_torques_that_lead_elsewhere_show_in_the_replay():
    _, result = judged_one_link()
    assert result.replay_error < 1e-3  # linear torque between 200 samples of a quintic
    wrong = ad.Trajectory(result.trajectory.t, result.trajectory.q, result.trajectory.v, 0.9 * result.trajectory.tau)
    assert time_optimality(paper_arm("r"), wrong).replay_error > 0.01


def test_derivatives_that_are_not_given_come_from_the_others():
    robot = paper_arm("rr")
    t, q, v, a = quintic(robot, *POSES["rr"], 0.5)
    exact = trajectory_from_path(robot, t, q, v, a)
    for some in ((), (v,)):
        guessed = trajectory_from_path(robot, t, q, *some)
        np.testing.assert_allclose(guessed.v, exact.v, atol=1e-4)  # O(h³) at the ends, h = 2.5 ms
        np.testing.assert_allclose(guessed.tau[1:-1], exact.tau[1:-1], atol=0.02)
        for end, inner in ((0, 1), (-1, -2)):  # a mean over the nearest steps: between the torques at their ends
            low, high = np.sort([exact.tau[end], exact.tau[inner]], axis=0)
            assert np.all((guessed.tau[end] > low - 0.02) & (guessed.tau[end] < high + 0.02))
    assert exact.joint_names == robot.joint_names
    # From limit to limit: a spline would be up to a third beyond.
    t = np.linspace(0, 1, 21)
    bang = trajectory_from_path(robot, t, np.zeros((21, 2)), np.minimum(t, 1 - t)[:, None] * [1.0, 0.0])
    assert np.abs(bang.tau[:, 0] - bang.tau[10, 0]).max() == pytest.approx(np.abs(bang.tau[0, 0] - bang.tau[10, 0]))


def test_bad_input():
    robot, other = paper_arm("rr"), paper_arm("r")
    t, q, v, a = quintic(robot, *POSES["rr"], 0.5)
    motion = trajectory_from_path(robot, t, q, v, a)
    with pytest.raises(TrajectoryError, match="2 joints; r has 1"):
        time_optimality(other, motion)
    with pytest.raises(TrajectoryError, match="2 joints; r has 1"):
        trajectory_from_path(other, t, q)
    with pytest.raises(TrajectoryError, match="in this order"):
        time_optimality(robot, ad.Trajectory(t, q, v, motion.tau, ("joint2", "joint1")))
    with pytest.raises(TrajectoryError, match="a has shape"):
        trajectory_from_path(robot, t, q, v, a[:, :1])
    with pytest.raises(TrajectoryError, match="jump"):
        trajectory_from_path(robot, [0, np.nextafter(0, 1), 1], q[:3])
    with pytest.raises(TrajectoryError, match="q has shape"):
        trajectory_from_path(robot, t, q[:-1])
    with pytest.raises(ProblemError, match="same state"):
        time_optimality(robot, trajectory_from_path(robot, [0, 1, 2], np.zeros((3, 2))))
    with pytest.raises(ProblemError, match="outside its limits"):
        time_optimality(robot, trajectory_from_path(robot, t, q + 4, v, a))


def test_a_faster_motion_within_its_limits_is_compared_with_no_optimum():
    optimum, result = judged_one_link()
    missed = replace(result, solution=replace(result.solution, duration=3 * optimum.duration))
    assert missed.feasible and missed.ratio < 0.7
    assert "faster than the fastest motion found" in str(missed)
    assert "of the optimum" not in str(missed)
    assert "of the optimum" in str(replace(missed, feasible=False))
    near = replace(optimum.certificate, hamiltonian_spread=1.0, lower_bound=optimum.duration, gap=0.0155)
    for certificate, claim in ((optimum.certificate, "locally optimal (Pontryagin)"),
                               (replace(optimum.certificate, hamiltonian_spread=1.0), "not proven optimal"),
                               (near, "proven within 1.55 % of the fastest")):  # fmt: skip
        said = str(replace(result, solution=replace(optimum, certificate=certificate)))
        assert f"of the optimum of {optimum.duration:.4f} s, {claim}\n" in said


@pytest.mark.slow
def test_without_an_optimum_there_is_no_ratio():
    _, result = judged_one_link()
    weak = paper_arm("r").with_limits(0.05, None)  # cannot lift its own weight
    with pytest.warns(ad.ArmdynWarning):
        lost: TimeOptimality = time_optimality(weak, result.trajectory, ad.MinimumTimeOptions(starts=1))
    assert np.isnan(lost.ratio)
    assert not lost.feasible
    assert "no optimum" in str(lost)


def slowed(robot, motion, factor, rate, velocities):
    """A table of a motion whose time is scaled: positions at a rate [Hz], and perhaps velocities."""
    t = np.append(np.arange(int(np.ceil(factor * motion.duration * rate - 1e-3))) / rate, factor * motion.duration)
    at = motion(np.minimum(t / factor, motion.duration))
    return trajectory_from_path(robot, t, at.q, at.v / factor if velocities else None)


@pytest.mark.slow
@pytest.mark.parametrize("arm", ["rr", "rrr"])
@pytest.mark.parametrize("rate", [1000, 2000, 4000, 8000])
@pytest.mark.parametrize("velocities", [False, True])
def test_a_motion_from_limit_to_limit_keeps_them_if_slowed_and_breaks_them_if_sped_up(arm, rate, velocities):
    """Torques at 0.4 % from their limits, which jump between rows; and 4 % beyond."""
    robot, motion = paper_arm(arm), solved(arm).trajectory
    kept = check_motion(robot, slowed(robot, motion, 1.002, rate, velocities))
    assert kept.feasible, kept.worst_violation
    broken = check_motion(robot, slowed(robot, motion, 0.98, rate, velocities))
    assert not broken.feasible and broken.worst_violation.constraint == "torque limit"
    assert 0.02 < broken.worst_violation.value < 0.5


def test_a_first_acceleration_is_not_extrapolated_joint_by_joint():
    """Near a jump each joint's own extrapolation is of a motion that there is not."""
    robot = paper_arm("rr")
    t = np.linspace(0, 0.1, 11)
    q = np.column_stack([50 * t**2, np.where(t < 0.015, -50 * t**2, 50 * (t - 0.03) ** 2 - 0.0225)])
    table = trajectory_from_path(robot, t, q)
    assert table.derived == ("v", "tau")
    a = (q[2] - 2 * q[1] + q[0]) / 0.01**2  # of both joints the same three rows
    expected = inverse_dynamics(robot)(table.q[:1], table.v[:1], a[None])[0]
    assert table.tau[0] == pytest.approx(expected, abs=1e-9)  # rounding


def test_a_table_too_coarse_to_tell_says_so():
    robot, motion = paper_arm("rr"), solved("rr").trajectory
    found = check_motion(robot, slowed(robot, motion, 1.002, 100, True))
    assert found.feasible and found.unresolved.constraint == "torque limit"
    assert "kept, as far as the rows show; more rows would show whether torque limit" in found.limits_kept
    assert found.facts()["unresolved"] == str(found.unresolved)
    exact = replace(motion, t=1.002 * motion.t, v=motion.v / 1.002)  # its own torques are judged as they are
    assert check_motion(robot, exact).unresolved is None


def test_positions_alone_are_judged_as_the_controller_runs_them():
    """Straight from row to row: between rows no faster than the differences, where a spline overshoots."""
    robot = cart().with_limits(None, 1.0)
    t = np.linspace(0, 3, 7)
    q = np.interp(t, [0.5, 2.5], [0.0, 2.0])[:, None]  # at once 1 m/s, at once at rest
    assert check_motion(robot, replace(trajectory_from_path(robot, t, q), tau=np.zeros((7, 1)))).feasible
    speeds = replace(trajectory_from_path(robot, t, q), tau=np.zeros((7, 1)), derived=())
    assert check_motion(robot, speeds).worst_violation.constraint == "velocity limit"
