"""Motors: torque that falls with speed, and continuous torque, against closed forms and hand-written phases."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import armdyn as ad
from armdyn.errors import ProblemError

INERTIA, PEAK = 0.5, 10.0
TURNTABLE = f"""<robot name="turntable"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="{INERTIA}"/></inertial></link>
<joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit effort="{PEAK}" velocity="100"/></joint></robot>"""
ONE = ad.MinimumTimeOptions(calm=0.0, workers=1)


def turntable(**options):
    return ad.Robot.from_urdf_string(TURNTABLE, **options)


def driving_and_braking(distance, rest, slope, corner=0.0):
    """Duration [s] of J v' = min(PEAK, rest - slope v), then of J v' = -PEAK, over a distance from and to rest."""
    rate = slope / INERTIA

    def after(speeding):
        """Distance and duration if it drives for a time beyond the corner, then brakes."""
        first = corner * INERTIA / PEAK
        top = rest / slope
        v = top + (corner - top) * np.exp(-rate * speeding)
        way = corner * first / 2 + top * speeding + (corner - top) * (1 - np.exp(-rate * speeding)) / rate
        braking = v * INERTIA / PEAK
        return way + v * braking / 2, first + speeding + braking

    speeding = brentq(lambda t: after(t)[0] - distance, 0.0, 100.0, xtol=1e-14)
    return after(speeding)[1]


@pytest.mark.parametrize(
    ("curve", "expected"),
    [
        ([[0, 10], [5, 0]], driving_and_braking(2.0, 10.0, 2.0)),
        ([[0, 10], [2, 10], [4, 2]], driving_and_braking(2.0, 18.0, 4.0, corner=2.0)),
    ],
)
def test_one_joint_in_closed_form(curve, expected):
    robot = turntable(torque_speed={"turn": curve})
    found = ad.solve_minimum_time(ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[2.0]), ONE)
    assert found.usable and not found.certificate.ok
    # A mesh whose torque is linear between knots, refined until its duration changes by less than 5e-4.
    assert expected * (1 - 1e-7) < found.duration < expected * (1 + 3e-4)


def test_a_pendulum_against_its_two_phases():
    """Under gravity: it drives along its curve, then brakes with all its torque; the switch by the energy left.

    Independent of armdyn's limits and integrators: J and m g l by hand, the curve by interpolation, LSODA. Backwards in
    time braking has constant torque, so that v² follows from energy: J v²/2 = ∫ (τ + m g l cos q) dq.
    """
    length, mass, start, goal, curve = 0.4, 0.8, -0.5, 0.9, [[0.0, 8.0], [3.0, 8.0], [9.0, 2.0]]
    inertia, weight = 0.02 + mass * length**2, mass * 9.81 * length
    robot = ad.Robot.from_urdf_string(
        f"""<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="{length} 0 0"/>
        <mass value="{mass}"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
        <joint name="swing" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 -1 0"/>
        <limit lower="-3" upper="3" effort="8" velocity="100"/></joint></robot>""",
        torque_speed={"swing": curve},
    )

    def driven(_, x):
        return [x[1], (np.interp(x[1], *np.transpose(curve)) - weight * np.cos(x[0])) / inertia]

    def fast(_, x):  # as fast as braking from here to the goal takes away
        taken = 8.0 * (goal - x[0]) + weight * (np.sin(goal) - np.sin(x[0]))
        return inertia * x[1] ** 2 / 2 - taken

    fast.terminal = True
    driving = solve_ivp(driven, (0, 9), [start, 0.0], "LSODA", events=fast, rtol=1e-11, atol=1e-12)
    braking = solve_ivp(
        lambda _, x: [x[1], (-8.0 - weight * np.cos(x[0])) / inertia],
        (0, 9), driving.y[:, -1], "LSODA", events=lambda _, x: x[1], rtol=1e-11, atol=1e-12,
    )  # fmt: skip
    expected = driving.t[-1] + braking.t_events[0][0]
    assert braking.y_events[0][0][0] == pytest.approx(goal, abs=1e-8)
    found = ad.solve_minimum_time(ad.MinimumTimeProblem(robot, q_start=[start], q_goal=[goal]), ONE)
    assert found.usable
    assert np.max(found.trajectory.v) > 3.0  # beyond the curve's corner
    assert expected * (1 - 1e-6) < found.duration < expected * (1 + 3e-4)  # as above


CURVE = [[0.0, 3.0], [5.0, 3.0], [20.0, 0.9]], [[0.0, 3.0], [11.0, 3.0], [43.0, 0.9]]


def rr():
    bare = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), payload=ad.Payload(mass=0.1006))
    return bare.with_torque_speed(dict(zip(bare.joint_names, CURVE, strict=True)))


def hand_written_phases(robot, start, goal, guess):
    """Duration [s] of the bang-bang motion + +, + -, - -, - +, whose joints keep their limits at every speed.

    Independent of armdyn's limits and integrators: driving torque by interpolation, `pin.aba`, LSODA, and fsolve for
    the durations of the four phases.
    """
    model, data = robot.model, robot.model.createData()

    def torque(sign, v):
        driving = [np.interp(abs(speed), *np.transpose(points)) for speed, points in zip(v, CURVE, strict=True)]
        return np.where(sign * v > 0, driving, 3.0) * sign

    def rates(_, x, sign):
        return np.concatenate([x[2:], pin.aba(model, data, x[:2], x[2:], torque(sign, x[2:]))])

    def end(durations):
        x = np.concatenate([start, np.zeros(2)])
        for sign, duration in zip(([1, 1], [1, -1], [-1, -1], [-1, 1]), durations, strict=True):
            x = solve_ivp(rates, (0, duration), x, args=(np.array(sign),), method="LSODA", rtol=1e-10, atol=1e-10)
            x = x.y[:, -1]
        return x - np.concatenate([goal, np.zeros(2)])

    durations, _, solved, message = fsolve(end, guess, full_output=True, xtol=1e-10)
    assert solved == 1, message
    return np.sum(durations)


@pytest.mark.slow
def test_two_joints_against_hand_written_phases():
    start, goal = np.zeros(2), np.array([1.0, 0.5])
    problem = ad.MinimumTimeProblem(rr(), q_start=start, q_goal=goal)
    found = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(workers=1, starts=4))
    assert found.usable
    t, tau = found.trajectory.t, found.trajectory.tau
    switches = [float(t[np.flatnonzero(np.diff(np.sign(tau[:, i])))[k]]) for i, k in ((1, 0), (0, 0), (1, 1))]
    expected = hand_written_phases(problem.robot, start, goal, np.diff([0.0, *switches, t[-1]]))
    assert expected * (1 - 1e-6) < found.duration < expected * (1 + 1e-3)


@pytest.mark.slow
def test_a_larger_arm_keeps_its_curves_and_has_a_proven_gap():
    robot = ad.Robot.from_library("panda")
    pairs = zip(robot.joint_names, robot.limits.effort_upper, robot.limits.velocity, strict=True)
    robot = robot.with_torque_speed({name: [[0, most], [0.3 * v, most], [v, 0.2 * most]] for name, most, v in pairs})
    start, goal = [0, -0.785, 0, -2.356, 0, 1.571, 0.785], [1, 0.2, 0.5, -1.5, 0.3, 2, -0.5]
    found = ad.solve_minimum_time(ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal), ONE)
    motion = found.trajectory
    assert found.usable and found.gap_proven and found.gap < 1e-3
    assert np.max(robot.limits.actuators.excess(motion.tau, motion.q, motion.v) / robot.limits.effort_upper) < 1e-6
    assert "torque-speed curve" in {share.limit for share in found.decides}


def test_a_loop_gives_the_motors_torque_at_its_speed():
    robot = turntable(torque_speed={"turn": [[0, 10], [5, 0]]})
    hard = ad.PidGains(kp=1e4, ki=0, kd=1)
    run = ad.simulate_pid(robot, q_start=[0.0], q_goal=[20.0], gains=hard, duration=1.0, form="torque")
    t, v, tau = run.trajectory.t, run.trajectory.v[:, 0], run.trajectory.tau[:, 0]
    assert np.allclose(v, 5 * (1 - np.exp(-4 * t)), atol=1e-9)  # J v' = 10 - 2 v
    assert np.allclose(tau, 10 - 2 * v, atol=1e-9) and run.saturated == 1.0


def test_a_goal_is_held_with_the_torque_at_rest():
    robot = ad.Robot.from_spec(
        ad.ArmSpec.paper("r"), payload=ad.Payload(mass=1.0), torque_speed={"joint1": [[0, 0.5], [9, 0.1]]}
    )
    with pytest.warns(ad.ArmdynWarning, match=r"needs .* to hold the goal but its limit is 0.5 N m"):
        ad.MinimumTimeProblem(robot, q_start=[1.0], q_goal=[0.1])


def least_heat(distance, rms, dwell, peak=np.inf):
    """Duration [s] of the fastest motion of J q'' = τ whose ∫ τ² dt is rms² (T + dwell), with |τ| ≤ peak.

    For a given T the least ∫ τ² dt is that of a torque linear in time (a cubic profile), cut off at the peak: a convex
    problem. The peak is reached for all but 2 m of T; distance and heat are linear in powers of m and T.
    """

    def distance_and_heat(T, m):
        level = peak if m < T / 2 else 6 * INERTIA * distance / T**2
        linear, flat = level * m**2 * 2 / 3, level * ((T / 2) ** 2 - m**2)
        return (linear + flat) / INERTIA, 2 * level**2 * (m / 3 + T / 2 - m)

    free = brentq(lambda T: distance_and_heat(T, T / 2)[1] - rms**2 * (T + dwell), 1e-2, 1e2, xtol=1e-13)
    if 6 * INERTIA * distance / free**2 <= peak:
        return free

    def missed(unknowns):
        T, m = unknowns[0], unknowns[1] * unknowns[0] / 2
        way, heat = distance_and_heat(T, m)
        return way - distance, heat - rms**2 * (T + dwell)

    (duration, _), _, solved, message = fsolve(missed, [free, 0.9], full_output=True, xtol=1e-13)
    assert solved == 1, message
    return duration


@pytest.mark.parametrize(("rms", "dwell", "peak"), [(2.0, 0.0, 10.0), (2.0, 1.0, 10.0), (3.0, 0.5, 4.5)])
def test_continuous_torque_of_one_joint(rms, dwell, peak):
    options = {"path_constraints": [ad.RmsTorque(rms, dwell=dwell)], "effort_limit": peak}
    found = ad.solve_minimum_time(ad.MinimumTimeProblem(turntable(), q_start=[0.0], q_goal=[2.0], **options), ONE)
    expected = least_heat(2.0, rms, dwell, peak)
    assert found.usable and not found.certificate.ok
    assert expected * (1 - 2e-6) < found.duration < expected * (1 + 2e-4)  # torque constant between knots


LIFT = """<robot name="lift"><link name="base"/><link name="car"><inertial><mass value="2"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="rope" type="prismatic"><parent link="base"/><child link="car"/><axis xyz="0 0 1"/>
<limit lower="-9" upper="9" effort="90" velocity="100"/></joint></robot>"""


def test_a_dwell_counts_the_holding_torque():
    """m q'' = τ - m g: the weight adds (m g)² to the mean square, moving or not."""
    robot, weight, rms, dwell = ad.Robot.from_urdf_string(LIFT), 2 * 9.81, 22.0, 0.7
    options = [ad.RmsTorque(rms, dwell=dwell)]
    found = ad.solve_minimum_time(
        ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[1.5], path_constraints=options), ONE
    )
    surplus = rms**2 - weight**2
    expected = brentq(lambda T: 12 * 2**2 * 1.5**2 / T**3 - surplus * (T + dwell), 1e-2, 1e2)
    assert found.usable
    assert expected * (1 - 2e-6) < found.duration < expected * (1 + 2e-4)  # as above


def test_a_limit_that_does_not_matter_changes_nothing_and_an_exceeded_one_is_named():
    problem = ad.MinimumTimeProblem(turntable(), q_start=[0.0], q_goal=[2.0], path_constraints=[ad.RmsTorque(10.0)])
    found = ad.solve_minimum_time(problem, ONE)
    assert found.duration == pytest.approx(2 * np.sqrt(2.0 * INERTIA / PEAK), rel=2e-4)  # bang-bang
    kept = ad.RmsTorque([5.0]).check(problem, found.trajectory, np.empty(0))
    assert kept.share == pytest.approx(2.0, rel=1e-3) and kept.order == 1
    assert kept.reasons[0].startswith("the root mean square of the torque of joint 'turn' exceeds its limit by 1e+02 %")


@pytest.mark.slow
def test_curves_keep_continuous_torques():
    robot = ad.Robot.from_library("panda")
    limit = [8.0, 50.0, 12.0, 24.0, 2.5, 3.0, 1.2]
    start, goal = [0, -0.785, 0, -2.356, 0, 1.571, 0.785], [1, 0.2, 0.5, -1.5, 0.3, 2, -0.5]
    options, more = ({"path_constraints": [ad.RmsTorque(np.multiply(k, limit), dwell=0.05)]} for k in (1.0, 1.01))
    found, faster = (
        ad.solve_minimum_time(ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, **own), ONE)
        for own in (options, more)
    )
    parts = [share.part for share in found.decides if share.limit == "continuous-torque limit"]
    # A difference of 1 %, and limits kept a little below where curves overshoot.
    assert sum(parts) == pytest.approx(-np.log(faster.duration / found.duration) / np.log(1.01), rel=0.02)
    motion = found.trajectory
    square = (motion.tau[1:] ** 2 + motion.tau[:-1] ** 2) / 2  # trapezoids, of some hundred samples
    held = 0.05 * robot.holding_torque(np.array(goal)) ** 2
    used = np.sqrt((np.diff(motion.t) @ square + held) / (motion.duration + 0.05)) / limit
    assert found.usable and found.duration > 1.05 * 0.4934
    assert 0.99 < np.max(used) < 1 + 1e-4


@pytest.mark.parametrize(
    ("constraint", "words"),
    [
        (lambda: ad.RmsTorque("x"), "RmsTorque limit is 'x'; expected one number, or one per joint"),
        (lambda: ad.RmsTorque([1.0, 2.0]), "RmsTorque limit has shape (2,)"),
        (lambda: ad.RmsTorque(0.0), "RmsTorque limit of joint 'turn' is 0.0 N m"),
        (lambda: ad.RmsTorque(1.0, dwell=-1.0), "RmsTorque dwell is -1.0 s"),
    ],
)
def test_wrong_continuous_torques_are_refused(constraint, words):
    with pytest.raises(ProblemError) as refused:
        ad.MinimumTimeProblem(turntable(), q_start=[0.0], q_goal=[2.0], path_constraints=[constraint()])
    assert words in str(refused.value)


def test_a_dwell_needs_rest():
    with pytest.raises(ProblemError, match="RmsTorque has a dwell of 1 s at the goal, where the arm is in flight"):
        ad.MinimumTimeProblem(
            turntable(), q_start=[0.0], q_goal=[2.0], v_goal=[1.0], path_constraints=[ad.RmsTorque(2.0, dwell=1.0)]
        )
