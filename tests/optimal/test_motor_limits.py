"""Motors: torque that falls with speed, against closed forms and hand-written phases."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import armdyn as ad

INERTIA, PEAK = 0.5, 10.0
TURNTABLE = f"""<robot name="turntable"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="{INERTIA}"/></inertial></link>
<joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit effort="{PEAK}" velocity="100"/></joint></robot>"""
ONE = ad.MinimumTimeOptions(workers=1)


def turntable(**options):
    return ad.Robot.from_urdf_string(TURNTABLE, **options)


def driving_and_braking(distance, rest, slope, corner=0.0):
    """Duration [s] of J v' = min(PEAK, rest - slope v), then of J v' = -PEAK, over a distance from and to rest."""
    rate = slope / INERTIA

    def after(speeding):
        """Distance and duration if it drives so long beyond the corner, then brakes."""
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


def test_two_joints_against_hand_written_phases():
    start, goal = np.zeros(2), np.array([1.0, 0.5])
    problem = ad.MinimumTimeProblem(rr(), q_start=start, q_goal=goal)
    found = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(workers=1, starts=4))
    assert found.usable
    t, tau = found.trajectory.t, found.trajectory.tau
    switches = [float(t[np.flatnonzero(np.diff(np.sign(tau[:, i])))[k]]) for i, k in ((1, 0), (0, 0), (1, 1))]
    expected = hand_written_phases(problem.robot, start, goal, np.diff([0.0, *switches, t[-1]]))
    assert expected * (1 - 1e-6) < found.duration < expected * (1 + 1e-3)


def test_a_larger_arm_keeps_its_curves_and_has_a_proven_gap():
    robot = ad.Robot.from_library("panda")
    pairs = zip(robot.joint_names, robot.limits.effort_upper, robot.limits.velocity, strict=True)
    robot = robot.with_torque_speed({name: [[0, most], [0.3 * v, most], [v, 0.2 * most]] for name, most, v in pairs})
    start, goal = [0, -0.785, 0, -2.356, 0, 1.571, 0.785], [1, 0.2, 0.5, -1.5, 0.3, 2, -0.5]
    found = ad.solve_minimum_time(ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal), ONE)
    motion = found.trajectory
    assert found.usable and found.gap_proven and found.gap < 1e-3  # the bound is that of the whole torque
    assert np.max(robot.limits.actuators.excess(motion.tau, motion.q, motion.v) / robot.limits.effort_upper) < 1e-6
    assert "torque-speed curve" in {share.limit for share in found.decides}


def test_a_loop_gives_what_the_motor_gives_at_its_speed():
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
