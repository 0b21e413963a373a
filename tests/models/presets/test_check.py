"""Motions as controllers see them: of closed form, of Ruckig and toppra, and coarse points as MoveIt leaves them."""

import json
from dataclasses import replace

import numpy as np
import pytest
import ruckig
from scipy.interpolate import BPoly

import armdyn as ad
from armdyn.errors import ProblemError, TrajectoryError
from armdyn.optimal.gap import check_motion
from armdyn.parsing.toml import read_toml, to_toml
from armdyn.trajectory.interpolation import interpolated
from armdyn.trajectory.planned import Planned
from problems import cart, solved

PANDA = ad.ControllerPreset.named("franka-panda")
START = np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785])
GOAL = np.array([1, 0.2, 0.5, -1.5, 0.3, 2, -0.5])


def double_s(way, v, a, j, t):
    """Position of a double-S ramp from rest to rest, with all of its seven phases, and its times of switching."""
    tj, ta = a / j, v / a - a / j
    durations = [tj, ta, tj, way / v - v / a - a / j, tj, ta, tj]
    assert min(durations) > 0
    switches = np.cumsum([0, *durations])
    jerks = np.array([j, 0, -j, 0, -j, 0, j])
    state, out = np.zeros(3), np.zeros((t.size, 3))
    for k in range(7):
        here = (t >= switches[k]) & (t <= switches[k + 1] + 1e-12)
        s = (t - switches[k])[:, None]
        q = state[0] + state[1] * s + state[2] * s**2 / 2 + jerks[k] * s**3 / 6
        qd = state[1] + state[2] * s + jerks[k] * s**2 / 2
        qdd = state[2] + jerks[k] * s
        out[here] = np.hstack([q, qd, qdd])[here]
        h = durations[k]
        onward = np.array([[1, h, h * h / 2], [0, 1, h], [0, 0, 1]])
        state = onward @ state + jerks[k] * np.array([h**3 / 6, h * h / 2, h])
    out[t > switches[-1]] = [way, 0, 0]
    return out, switches


def ramps(joint, *, v, a, j, way=1.0, rate=1000.0, **arrays):
    """A motion of one of Panda's joints, as a planner would leave it: positions, velocities and accelerations."""
    t = np.arange(0, 2, 1 / rate)
    own, switches = double_s(way, v, a, j, t)
    q, qd, qdd = np.tile(START, (t.size, 1)), np.zeros((t.size, 7)), np.zeros((t.size, 7))
    q[:, joint] += own[:, 0]
    qd[:, joint], qdd[:, joint] = own[:, 1], own[:, 2]
    return Planned(t, q, qd, qdd, **arrays), switches


def rows(check, condition):
    return {row.joint: row for row in check.rows if row.condition == condition}


def test_a_motion_on_its_limits_is_accepted():
    motion, _ = ramps(0, v=2.175, a=15.0, j=7500.0)
    check = PANDA.check(motion)
    assert check.ok and not check.offences and "accepted" in str(check)
    for condition, least in (("velocity", 1 - 1e-5), ("acceleration", 1 - 1e-5), ("jerk", 0.9)):  # for two ticks
        assert least < rows(check, condition)["joint1"].share < 1 + 1e-6
    assert check.notes == ("not checked, the motion has no torques: torque, torque_rate",)


@pytest.mark.parametrize(
    ("joint", "limits", "condition", "when"),
    [
        (1, {"v": 2.0, "a": 8.0, "j": 3000.0}, "acceleration", 7.5 / 3000),
        (1, {"v": 2.0, "a": 7.0, "j": 6000.0}, "jerk", 0.001),
        (0, {"v": 2.3, "a": 15.0, "j": 7500.0}, "velocity", 0.001 + 2.175 / 15 + 15 / 7500 / 2),
        (3, {"v": 2.0, "a": 12.0, "j": 6000.0, "way": 2.5}, "position", None),
    ],
)
def test_the_first_offence_is_found_at_its_joint_and_time(joint, limits, condition, when):
    motion, _ = ramps(joint, **limits)
    check = PANDA.check(motion)
    refused = [row for row in check.offences if row.necessary]
    assert not check.ok and refused[0].condition == condition and refused[0].joint == f"joint{joint + 1}"
    assert all(row.joint == f"joint{joint + 1}" for row in refused)
    if when is None:
        when = motion.t[np.argmax(motion.q[:, joint] > -0.0698)]
    assert refused[0].first == pytest.approx(when, abs=0.0021)  # a difference reaches back as many ticks as its order
    assert f"first exceeded at {refused[0].first:.4g} s by {refused[0].first_shown} " in str(check)


def test_a_hair_beyond_a_limit_is_shown_as_beyond():
    motion, _ = ramps(0, v=2.3, a=15.0, j=7500.0)
    row = next(row for row in PANDA.check(motion).offences if row.necessary)
    for value, shown in ((7.6152345, "7.6152"), (7.5000213, "7.50002"), (-7.5000213, "-7.50002")):
        assert replace(row, first_value=value, limit=7.5).first_shown == shown
    assert replace(row, first=None, first_value=None).first_shown == ""


def test_offences_of_one_tick_are_found():
    motion, _ = ramps(2, v=1.0, a=5.0, j=2000.0)
    motion.q[700, 4] += 1e-5
    check = PANDA.check(Planned(motion.t, motion.q))
    assert {row.joint for row in check.offences} == {"joint5"}
    assert rows(check, "jerk")["joint5"].first == pytest.approx(0.7, abs=1e-9)
    assert rows(check, "jerk")["joint5"].value == pytest.approx(-3e-5 * 1e9, rel=0.1)  # of +1, -3, +3, -1


def test_between_points_as_ros2_control():
    """Linear, cubic or quintic, by the given derivatives: a polynomial of that degree is reproduced everywhere."""
    t, at = np.linspace(0, 1, 5), np.linspace(0, 1, 41)
    for degree, count in ((1, 1), (3, 2), (5, 3)):
        own = [np.polynomial.Polynomial(np.arange(1.0, degree + 2)).deriv(d) for d in range(3)]
        found = interpolated(t, [one(t)[:, None] for one in own[:count]], at)
        for array, one in zip(found, own, strict=True):
            np.testing.assert_allclose(array[:, 0], one(at), rtol=1e-9, atol=1e-9)


JTC = ad.ControllerPreset.named("ros2-jtc")


def hermite(t, q, v, a=None):
    """Largest speed along SciPy's Hermite polynomials through rows, between them, too: independent of armdyn's."""
    given = np.stack([q, v] if a is None else [q, v, a], axis=1)
    spline = BPoly.from_derivatives(t, given).derivative()
    return np.max(np.abs(spline(np.linspace(t[0], t[-1], 100_001))))


def test_velocities_between_rows_have_one_judge():
    """A joint at 2 rad/s after a ramp within the first of the rows' steps: cubics and quintics overshoot."""
    t = np.arange(0, 20) * 2e-3
    v = np.where(t < 1e-3, 2000 * t, 2.0)[:, None]
    q = np.where(t < 1e-3, 1000 * t**2, 1e-3 + 2 * (t - 1e-3))[:, None]
    a = np.zeros_like(v)
    robot = cart().with_limits(None, 2.0)
    bounded = JTC.fitted(robot.limits, ["slide"]).without("end_velocity")
    for given in (None, a):
        fastest = hermite(t, q, v, given)
        check = bounded.check(Planned(t, q, v, given))
        row = next(row for row in check.offences if row.condition == "velocity")
        own = check_motion(robot, ad.Trajectory(t, q, v, 0 * v), a=given)
        # At 64 points per step the peak of a parabola from rest to rest is met to 2.5e-4; these begin or end at speed.
        assert row.value == pytest.approx(fastest, rel=2.5e-4)
        assert own.velocity_share == pytest.approx(row.share, rel=1e-12) and not own.feasible and not check.ok
        assert own.worst_violation.value == pytest.approx(row.share - 1, rel=1e-9)
        assert own.worst_violation.time == pytest.approx(row.time)


def test_between_points_a_tick_apart_the_same_excess_is_tolerated_as_elsewhere():
    """Points at 1 kHz; the command of each tick keeps 2.175 rad/s, and cubics between points may go beyond."""
    t, arm = np.arange(0, 0.5, 1e-3), ad.Robot.from_library("panda")
    for slower, ok in ((0.002, True), (0.01, False)):
        v = np.zeros((t.size, 7))
        v[:, 0] = 2.175
        q = np.tile(START, (t.size, 1)) + t[:, None] * v
        v[100, 0] -= 2.175 * slower  # at the same positions, so that the cubics around are faster for that
        own = replace(PANDA.chosen, necessary=("velocity",), recommended=())
        check = replace(PANDA, interfaces=(own,)).check(Planned(t, q, v))
        beyond = hermite(t[98:104], q[98:104, 0], v[98:104, 0]) / 2.175 - 1
        assert check.ok is ok and ok == (beyond < 1e-3) and beyond > 5e-4
        judged = check_motion(arm, ad.Trajectory(t, q, v, 0 * v))
        assert judged.feasible is ok and judged.velocity_share == pytest.approx(1 + beyond, rel=1e-5)


def test_the_rules_of_joint_trajectory_controller():
    robot, t = cart().with_limits(None, 2.0), np.linspace(0, 1, 11)
    x = t[:, None]
    q, v, a = 10 * x**3 - 15 * x**4 + 6 * x**5, 30 * x**2 - 60 * x**3 + 30 * x**4, 60 * x - 180 * x**2 + 120 * x**3
    motion = Planned(t, q, v, a)
    found = JTC.check(motion)  # of any arm, whose limits nobody says
    assert found.ok and {row.condition for row in found.rows} == {"end_velocity", "time_step"}
    assert "no robot says its limits: position, velocity" in found.notes[0] and "start" in found.notes[1]
    fitted = JTC.fitted(robot.limits, robot.joint_names)
    assert fitted.joints == robot.joint_names and PANDA.fitted(robot.limits, robot.joint_names) is PANDA
    assert fitted.check(motion, present=[0.009]).ok
    away = fitted.check(motion, present=[0.011])
    assert not away.ok and away.offences[0].condition == "start" and away.offences[0].value == pytest.approx(-0.011)
    for last, ok in ((1.19e-7, True), (-1.2e-7, False)):  # epsilon of a float: 1.192e-7
        ends = v.copy()
        ends[-1] = last
        assert fitted.check(replace(motion, v=ends)).ok is ok
    near = fitted.check(Planned(np.append(t, 1 + 5e-5), *(np.vstack([x, x[-1:]]) for x in (q, v, a))))
    assert near.ok and [row.condition for row in near.offences] == ["time_step"]  # recommended only
    assert near.offences[0].value == pytest.approx(5e-5) and near.offences[0].joint == "all joints"
    with pytest.raises(TrajectoryError, match="present has shape"):
        fitted.check(motion, present=[0.0, 1.0])


def test_a_preset_for_any_arm_is_written_and_read(tmp_path):
    file = tmp_path / "own.toml"
    file.write_text(to_toml({"preset": JTC.to_table()}))
    assert ad.ControllerPreset.from_table(read_toml(file), "preset") == JTC
    samples = solved("rr").trajectory.resample(1000)
    assert JTC.check(samples).ok and JTC.check(solved("rr").trajectory).ok  # as its rows rest


def test_coarse_points_with_positions_only_are_corners():
    """As MoveIt's time parametrisation leaves them at 10 Hz, without velocities."""
    motion, _ = ramps(0, v=1.0, a=5.0, j=2000.0, rate=10.0)
    check = PANDA.check(Planned(motion.t, motion.q))
    assert not check.ok and "moves straight from one to the next" in check.notes[-1]
    slopes = np.diff(motion.q[:, 0], prepend=motion.q[0, 0]) / 0.1
    worst = rows(check, "acceleration")["joint1"]
    assert abs(worst.value) == pytest.approx(1000 * np.max(np.abs(np.diff(slopes))), rel=1e-6)  # within one tick
    assert worst.first == pytest.approx(0.001, abs=1e-9)


def test_points_at_the_ticks_need_no_velocities():
    motion, _ = ramps(0, v=2.175, a=15.0, j=7500.0)
    check = PANDA.check(Planned(motion.t, motion.q))
    assert check.ok and check.interpolation == "linear" and len(check.notes) == 1  # no torques
    assert rows(check, "zero_acceleration")["joint1"].ok and rows(check, "zero_velocity")["joint1"].ok
    count = 100
    ends = PANDA.check(Planned(motion.t[:count], motion.q[:count]))  # cut off while it accelerates
    assert rows(ends, "zero_acceleration")["joint1"].value == pytest.approx(15, rel=1e-3)
    assert rows(ends, "zero_velocity")["joint1"].value == pytest.approx(motion.v[count - 1, 0], rel=1e-3)


def test_rounded_positions_have_a_note():
    motion, _ = ramps(0, v=1.0, a=5.0, j=2000.0)
    check = PANDA.check(Planned(motion.t, np.round(motion.q, 6)))
    assert check.notes[-1] == "positions are rounded to 1e-06 rad, which alone is 4e+03 rad/s³ of jerk"
    assert len(PANDA.check(Planned(motion.t, motion.q)).notes) == 1
    assert len(PANDA.check(Planned(motion.t, np.round(motion.q, 9))).notes) == 1
    few = PANDA.check(Planned(motion.t[::20], np.round(motion.q[::20], 6)))  # its jerk is that of the straight lines
    assert not any("rounded" in note for note in few.notes)


def test_ruckig_keeps_the_limits_that_it_is_given():
    assert PANDA.check(ruckig_motion(1.0)).ok
    fast = PANDA.check(ruckig_motion(1.1), [f"panda_joint{i}" for i in range(1, 8)])
    refused = [row for row in fast.offences if row.necessary]
    assert refused and {row.condition for row in refused} <= {"velocity", "acceleration", "jerk"}
    assert refused[0].joint.startswith("panda_joint")


def ruckig_motion(factor):
    """From START to GOAL at 1 kHz, each limit times a factor."""
    otg, given = ruckig.Ruckig(7), ruckig.InputParameter(7)
    given.current_position, given.target_position = START.tolist(), GOAL.tolist()
    given.max_velocity, given.max_acceleration, given.max_jerk = (
        (factor * PANDA.limit(name)).tolist() for name in ("velocity", "acceleration", "jerk")
    )
    trajectory = ruckig.Trajectory(7)
    otg.calculate(given, trajectory)
    t = np.append(np.arange(0, trajectory.duration, 0.001), trajectory.duration)
    q, v, a = (np.array(each) for each in zip(*(trajectory.at_time(time) for time in t), strict=True))
    return Planned(t, q, v, a)


def test_toppra_keeps_acceleration_but_not_jerk():
    import toppra  # slow to import, and for this test alone
    import toppra.algorithm
    import toppra.constraint

    path = toppra.SplineInterpolator(np.linspace(0, 1, 3), np.array([START, (START + GOAL) / 2, GOAL]))
    kinds = {
        "velocity": toppra.constraint.JointVelocityConstraint,
        "acceleration": toppra.constraint.JointAccelerationConstraint,
    }
    both = [kind(np.column_stack([-PANDA.limit(name), PANDA.limit(name)])) for name, kind in kinds.items()]
    run = toppra.algorithm.TOPPRA(both, path, parametrizer="ParametrizeConstAccel").compute_trajectory()
    t = np.arange(0, run.duration, 0.001)
    check = PANDA.check(Planned(t, run(t), run(t, 1), run(t, 2)))
    first = check.offences[0]
    # It brakes at the largest acceleration to its end, and stops within a tick. At the start a_max / 2 comes in each of
    # two ticks, which is the limit of the jerk.
    assert not check.ok and first.condition == "jerk" and first.joint == "joint2"
    assert first.first == pytest.approx(run.duration, abs=0.0011)
    assert rows(check, "velocity")["joint1"].ok and rows(check, "position")["joint1"].ok
    assert rows(check, "acceleration")["joint1"].share < 1.02  # toppra enforces it at its grid


def test_torque_rates_and_the_torque_interface():
    motion, _ = ramps(0, v=1.0, a=5.0, j=2000.0)
    tau = np.zeros_like(motion.q)
    tau[500:, 5] = 1.5  # one step of 1.5 N m in a millisecond: 1500 N m/s
    check = PANDA.on("torque").check(Planned(motion.t, motion.q, motion.v, tau=tau))
    assert not check.ok and check.offences[0].condition == "torque_rate" and check.offences[0].joint == "joint6"
    assert check.offences[0].first == pytest.approx(0.5, abs=1e-9)
    assert check.offences[0].value == pytest.approx(1500)
    with pytest.raises(TrajectoryError, match="no torques, but the torque interface"):
        PANDA.on("torque").check(motion)
    # In joint position control the rate of the torque is recommended: the motion is accepted.
    assert PANDA.check(Planned(motion.t, motion.q, motion.v, motion.a, tau)).ok


def test_velocity_limits_by_position():
    fr3 = ad.ControllerPreset.named("franka-fr3")
    motion, _ = ramps(0, v=1.5, a=9.0, j=4500.0, way=2.5)
    at_q = [row for row in fr3.check(motion).offences if row.necessary]
    assert not at_q  # 1.5 rad/s, and it stops before 2.5 rad
    motion, _ = ramps(0, v=2.5, a=9.0, j=4500.0, way=2.7)
    refused = [row for row in fr3.check(motion).offences if row.necessary]
    assert refused and {row.condition for row in refused} == {"velocity"}
    row = refused[0]
    q = np.interp(row.first, motion.t, motion.q[:, 0])
    assert np.interp(row.first, motion.t, motion.v[:, 0]) == pytest.approx(-0.3 + np.sqrt(12 * (2.7501 - q)), abs=0.02)


def test_a_trajectory_that_ends_in_motion_is_refused():
    motion, switches = ramps(0, v=1.0, a=5.0, j=2000.0)
    cut = motion.t < switches[3]
    check = PANDA.check(Planned(motion.t[cut], motion.q[cut], motion.v[cut], motion.a[cut]))
    assert not check.ok
    ends = rows(check, "zero_velocity")["joint1"]
    assert (
        not ends.necessary
        and ends.first == pytest.approx(motion.t[cut][-1])
        and ends.value == pytest.approx(1.0, abs=0.01)
    )


def test_refusals():
    motion, _ = ramps(0, v=1.0, a=5.0, j=2000.0)
    with pytest.raises(ProblemError, match="has 7 joints, but the motion has 6"):
        PANDA.check(Planned(motion.t, motion.q[:, :6]))
    with pytest.raises(TrajectoryError, match="at least two increasing times"):
        PANDA.check(Planned(motion.t[:1], motion.q[:1]))
    back = motion.t.copy()
    back[10] = back[9]
    with pytest.raises(TrajectoryError, match=r"t\[10\]: t = 0.009 s does not rise above the 0.009 s of t\[9\]"):
        PANDA.check(Planned(back, motion.q))
    with pytest.raises(TrajectoryError, match="ticks"):
        PANDA.check(Planned(motion.t * 1e6, motion.q))
    with pytest.raises(TrajectoryError, match="v has shape"):
        PANDA.check(Planned(motion.t, motion.q, motion.v[:-1]))
    with pytest.raises(TrajectoryError, match="expected a Trajectory"):
        PANDA.check("motion.csv")
    names = ("shoulder_pan_joint", *(f"panda_joint{i}" for i in range(2, 8)))
    with pytest.raises(ProblemError, match="the motion has 'shoulder_pan_joint' in the place of 'joint1'"):
        PANDA.check(motion, names)


def test_facts_are_json():
    motion, _ = ramps(0, v=2.3, a=15.0, j=7500.0)
    facts = PANDA.check(motion).facts()
    assert facts["accepted"] is False and facts["rate"] == 1000
    assert {"condition", "joint", "value", "limit", "first"} <= set(facts["conditions"][0])
    json.dumps(facts, allow_nan=False)


@pytest.mark.parametrize("end", [0, -1])
def test_a_motion_in_flight_goes_on_at_its_end(end):
    """A ramp cut where it moves, at constant acceleration of at most 0.5 rad/s²: commands go on with its velocity."""
    t = np.linspace(0, 1.0, 1001)
    run = 0.25 * t[:, None] ** 2 * np.linspace(1, -1, 7)  # from rest to 0.5 rad/s
    speed = 0.5 * t[:, None] * np.linspace(1, -1, 7)
    q, v = (START + run, speed) if end else (START + run[::-1], -speed[::-1])
    ends = np.array([[q[0], v[0]], [q[-1], v[-1]]])
    motion = ad.Trajectory(t, q, v, np.zeros_like(q), ends=ends)
    for one in (motion, motion.resample(1000), motion.resample(250)):
        found = PANDA.without("jerk", "zero_acceleration").check(one)
        assert found.ok and {row.condition for row in found.offences} == {"zero_velocity"}
        assert abs(rows(found, "acceleration")["joint1"].value) < 1  # of quintics; a stop within a tick has 500
    # A motion that was to rest there, and does not, is stopped within a tick, and so is one of another planner.
    ends = ends.copy()
    ends[:, 1] = 0
    for one in (replace(motion, ends=ends), replace(motion, ends=None), Planned(t, q, v)):
        assert "acceleration" in {row.condition for row in PANDA.check(one).offences if row.necessary}
