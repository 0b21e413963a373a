"""PID loops between two poses against reference times, a closed form, other integrators, and Newton's law."""

import json

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import armdyn as ad
from armdyn.control import PidGains, simulate_pid
from armdyn.control.tracking.arrival import Arrival
from armdyn.control.tracking.pid import pid_summary
from armdyn.errors import ProblemError
from armdyn.paper import continuous_pid
from pid_loops import example, loaded_arm

# Last entry of |e1| into 0.005 rad [s], by payload reading and mass [g]: R Example 4, RR Example 5.
ARRIVALS = {
    ("mM", 21.2): (4.2657, 4.1692),
    ("mM", 51.8): (4.2924, 4.3890),
    ("mM", 100.6): (4.3236, 4.6670),
    ("mM", 200): (4.3637, 5.0876),
    ("mM", 500): (4.4162, None),
    ("mM", 1000): (4.4458, None),
    ("tip", 21.2): (4.2213, 4.1427),
    ("tip", 51.8): (4.1986, 4.3181),
    ("tip", 100.6): (4.1735, 4.5535),
    ("tip", 200): (4.1436, 4.9310),
    ("tip", 500): (4.1080, 9.5208),
    ("tip", 1000): (4.0896, None),
}
FIRST = "last_entry_first_joint"  # the paper's rule
SAMPLING = 2e-3  # the references were read off grids of 1e-4 to 5e-4 s


@pytest.mark.parametrize(("reading", "grams"), ARRIVALS)
def test_arrival_in_the_papers_examples(reading, grams):
    for name, expected in zip(("R Ex4", "RR Ex5"), ARRIVALS[reading, grams], strict=True):
        robot, poses = example(name, reading, grams)
        run = simulate_pid(robot, **poses, arrival_rule=FIRST)
        if expected is None:
            assert run.arrival_time is None
            assert not run.settled
            assert run.max_real_eigenvalue > 0
            assert "not stable" in run.message
        else:
            assert run.arrival_time == pytest.approx(expected, abs=SAMPLING)


def test_arrival_rules():
    robot, poses = example("RR Ex5", "mM", 100.6)
    all_joints = simulate_pid(robot, **poses)
    assert all_joints.arrival_time == all_joints.settled_time == pytest.approx(6.1211, abs=SAMPLING)
    assert all_joints.settled
    assert all_joints.arrival_rule == "last_entry_all_joints"
    first = simulate_pid(robot, **poses, arrival_rule=FIRST)
    assert first.arrival_time < first.settled_time == all_joints.arrival_time
    robot, poses = example("R Ex4", "mM", 100.6)
    crossing = simulate_pid(robot, **poses, arrival_rule="first_crossing")
    assert crossing.arrival_time == pytest.approx(1.976, abs=SAMPLING)
    assert crossing.arrival_rule == "first_crossing"


@pytest.mark.parametrize("name", ["R Ex4", "RR Ex5", "RR Ex2", "RRR Ex6"])
def test_settled_and_arrived_are_one_by_default(name):
    robot, poses = example(name, grams=100.6)
    run = simulate_pid(robot, **poses)
    assert run.settled == (run.arrival_time is not None)
    assert run.arrival_time == run.settled_time


def test_summary_is_json():
    robot, poses = example("RR Ex5", grams=100.6)
    summary = pid_summary(simulate_pid(robot, **poses, arrival_rule=FIRST))
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    assert summary["arrival_rule"] == FIRST
    assert summary["arrival_time"] == pytest.approx(4.5535, abs=SAMPLING)
    assert summary["settling_time"] == pytest.approx(5.8535, abs=1e-2)
    assert summary["limits_exceeded"] == []


def test_arrival_lies_on_the_tolerance():
    robot, poses = example("R Ex4")
    run = simulate_pid(robot, **poses, samples=20001)
    error = np.abs(poses["q_goal"][0] - run.trajectory(run.arrival_time).q)
    assert error == pytest.approx(0.005, abs=1e-9)  # cubic between samples 0.5 ms apart
    after = run.trajectory.t > run.arrival_time
    assert np.abs(poses["q_goal"][0] - run.trajectory.q[after, 0]).max() < 0.005


def test_torque_of_example_4():
    """The applied torque D u, not the u that the paper calls torque."""
    for reading, expected in (("mM", 0.5637241638067403), ("tip", 0.6141519011908051)):
        robot, poses = example("R Ex4", reading, 100.6)
        tau = simulate_pid(robot, **poses).trajectory(4.317).tau
        assert tau == pytest.approx(expected, abs=1e-6)  # linear between samples 10 ms apart


@pytest.mark.parametrize("grams", [0, 100.6, 1000])
@pytest.mark.parametrize("arm", ["r", "rrr"])
def test_computed_torque_is_the_same_for_every_payload(arm, grams):
    robot, poses = example({"r": "R Ex4", "rrr": "RRR Ex6"}[arm], grams=grams)
    run = simulate_pid(robot, **poses, form="computed_torque")
    assert run.settled
    assert run.arrival_time == pytest.approx(3.2321, abs=1e-4)
    assert run.overshoot[0] == pytest.approx(0.5921, abs=1e-4)


def test_computed_torque_against_the_matrix_exponential():
    """e''' + kd e'' + kp e' + ki e = 0 in every joint, by x' = A x with x = (∫e, e, e')."""
    robot, poses = example("RRR Ex6", grams=500)
    kp, ki, kd = np.array([30.0, 20, 40]), np.array([50.0, 10, 0]), np.array([10.0, 9, 8])
    v_start = np.array([0.5, -1.0, 2.0])
    run = simulate_pid(
        robot, **poses, v_start=v_start, gains=PidGains(kp, ki, kd), form="computed_torque", duration=3.0,
        samples=7,
    )  # fmt: skip
    for j in range(3):
        A = np.array([[0, 1, 0], [0, 0, 1], [-ki[j], -kp[j], -kd[j]]])
        x0 = np.array([0.0, poses["q_goal"][j] - poses["q_start"][j], -v_start[j]])
        exact = np.array([expm(A * t) @ x0 for t in run.trajectory.t])
        # The integrator's rtol of 1e-9 per step, over some hundred steps.
        np.testing.assert_allclose(poses["q_goal"][j] - run.trajectory.q[:, j], exact[:, 1], atol=2e-7)
        np.testing.assert_allclose(-run.trajectory.v[:, j], exact[:, 2], atol=2e-7)


@pytest.mark.parametrize("form", ["acceleration", "torque", "computed_torque"])
def test_torque_obeys_newton(form):
    """pin.aba under the recorded torque is the time derivative of the recorded velocity."""
    robot, poses = example("RR Ex2", grams=100.6)
    run = simulate_pid(robot, **poses, form=form, duration=2.0, samples=20001, saturate=False)
    t, q, v, tau = (getattr(run.trajectory, name) for name in ("t", "q", "v", "tau"))
    data = robot.model.createData()
    a = np.array([pin.aba(robot.model, data, *state) for state in zip(q, v, tau, strict=True)])
    late = slice(2000, -1)  # the loop's first transient is faster than the differences
    numeric = (v[2:] - v[:-2]) / (t[2:] - t[:-2])[:, None]
    # Central differences over 2e-4 s: h²/6 v''' ~ 1e-5, and 1e-9 rad/s of the solution over h.
    np.testing.assert_allclose(a[1:-1][late], numeric[late], atol=1e-3)
    moved = q[2:] - q[:-2]
    np.testing.assert_allclose(moved[late], (v[1:-1] * (t[2:] - t[:-2])[:, None])[late], atol=1e-7)


@pytest.mark.parametrize("form", ["acceleration", "torque"])
def test_friction_acts_on_the_arm_under_control(form):
    """As above, with the friction written out."""
    robot, poses = example("RR Ex2", grams=100.6)
    damping, coulomb, width = np.array([0.05, 0.02]), np.array([0.1, 0.05]), 0.1
    rubbing = robot.with_friction(damping, coulomb, width)
    run = simulate_pid(rubbing, **poses, form=form, duration=2.0, samples=20001, saturate=False)
    t, q, v, tau = (getattr(run.trajectory, name) for name in ("t", "q", "v", "tau"))
    data, left = robot.model.createData(), tau - damping * v - coulomb * np.tanh(v / width)
    a = np.array([pin.aba(robot.model, data, *state) for state in zip(q, v, left, strict=True)])
    late = slice(2000, -1)
    numeric = (v[2:] - v[:-2]) / (t[2:] - t[:-2])[:, None]
    # As above; where a joint turns around friction changes within milliseconds, and the jerk with it.
    np.testing.assert_allclose(a[1:-1][late], numeric[late], atol=1e-2)
    without = simulate_pid(robot, **poses, form=form, duration=2.0, saturate=False)
    assert np.abs(without.trajectory.q[-1] - run.trajectory.q[-1]).max() > 1e-3


def test_computed_torque_cancels_friction():
    robot, poses = example("RR Ex2", grams=100.6)
    loop = {**poses, "form": "computed_torque", "duration": 2.0, "saturate": False}
    runs = [simulate_pid(arm, **loop).trajectory for arm in (robot, robot.with_friction(0.05, 0.1, 0.1))]
    # Both integrate the same equation to a relative 1e-9 per step.
    np.testing.assert_allclose(runs[1].q, runs[0].q, atol=1e-7)
    lost = 0.05 * runs[0].v + 0.1 * np.tanh(runs[0].v / 0.1)
    np.testing.assert_allclose(runs[1].tau - runs[0].tau, lost, atol=1e-5)


def test_energy_balance():
    """The work of the torque is the arm's gain in energy."""
    robot, poses = example("RRR Ex6", grams=100.6)
    run = simulate_pid(robot, **poses, form="computed_torque", duration=2.0, samples=20001)
    data = robot.model.createData()

    def energy(k):
        q, v = run.trajectory.q[k], run.trajectory.v[k]
        kinetic = pin.computeKineticEnergy(robot.model, data, q, v)
        return kinetic + pin.computePotentialEnergy(robot.model, data, q)

    work = np.trapezoid(np.sum(run.trajectory.tau * run.trajectory.v, axis=1), run.trajectory.t)
    # The trapezoidal rule over steps of 1e-4 s: 2.4e-7 J, out of some joules.
    assert energy(-1) - energy(0) == pytest.approx(work, abs=1e-6)


@pytest.mark.parametrize("name", ["R Ex4", "RR Ex2", "RRR Ex6"])
def test_another_integrator_agrees(name):
    """Equations of the loop (24) written down anew, DOP853 at nearly the precision of its arithmetic."""
    robot, poses = example(name, "mM", 51.8)
    goal, data = np.array(poses["q_goal"]), robot.model.createData()

    def rate(_, x):
        z, q, v = np.split(x, 3)
        free = pin.aba(robot.model, data, q, v, 0 * q)
        return np.concatenate([goal - q, v, free + 30 * (goal - q) + 50 * z - 10 * v])

    x0 = np.concatenate([0 * goal, poses["q_start"], 0 * goal])
    other = solve_ivp(rate, (0, 5), x0, "DOP853", rtol=3e-14, atol=1e-15)
    run = simulate_pid(robot, **poses, duration=5.0)
    # Steps of the loop are good to 1e-14; the unstable loop of three joints makes that e^4 times as large.
    np.testing.assert_allclose(run.trajectory.q[-1], other.y[goal.size : 2 * goal.size, -1], atol=1e-11)


@pytest.mark.parametrize("rule", ["last_entry_first_joint", "last_entry_all_joints", "first_crossing"])
@pytest.mark.parametrize("name", ["R Ex4", "RR Ex5", "RR Ex2", "RRR Ex6"])
def test_the_papers_integration_agrees(name, rule):
    """LSODA, whose steps are good to a relative 1e-9, with times of arrival on its own continuous solution."""
    robot, poses = example(name, grams=100.6)
    run = simulate_pid(robot, **poses, arrival_rule=rule)
    loop = continuous_pid.ContinuousLoop(robot, poses["q_goal"])
    paper = continuous_pid.simulate(loop, poses["q_start"], Arrival(rule))
    np.testing.assert_allclose(run.trajectory.t, paper.trajectory.t, rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.trajectory.q, paper.trajectory.q, rtol=0, atol=1e-6)
    np.testing.assert_allclose(run.trajectory.tau, paper.trajectory.tau, rtol=0, atol=1e-5)
    assert run.status == paper.status
    assert (run.arrival_time is None) == (paper.arrival_time is None)
    for time in ("arrival_time", "settled_time"):
        if (expected := getattr(paper, time)) is not None:
            assert getattr(run, time) == pytest.approx(expected, abs=1e-6)
    np.testing.assert_allclose(run.overshoot, paper.overshoot, rtol=0, atol=1e-5)  # largest of samples 1 ms apart
    assert run.max_real_eigenvalue == paper.max_real_eigenvalue


def test_unstable_loop_of_three_joints_returns():
    """Loop (24) keeps swinging: gravity and Coriolis torques are not compensated."""
    robot, poses = example("RRR Ex6", grams=100.6)
    run = simulate_pid(robot, **poses)
    assert run.arrival_time is None
    assert run.status == "not_settled"
    assert not run.settled
    assert "max Re λ = +1.303" in run.message
    assert run.trajectory.duration == 10.0


def test_an_unstable_loop_that_is_at_its_goal_names_the_limits_that_it_exceeded():
    robot, _ = example("R Ex4")
    up, slow = {"q_start": [np.pi / 2], "q_goal": [np.pi / 2]}, robot.with_limits(None, velocity_limit=0.01)
    run = simulate_pid(slow, **up, v_start=[0.015], gains=PidGains(3, 0, 0), duration=0.2)
    assert run.status == "not_settled" and run.settled_time is None and run.max_real_eigenvalue > 0
    assert run.message.startswith("not settled: all joints within 0.005 rad of the goal from t = 0 s on; but joint1")
    assert pid_summary(run)["limits_exceeded"] == [*run.limits_exceeded] != []
    assert f"{run.limits_exceeded[0]}; the loop is not stable at the goal" in run.message


def test_torque_saturates_at_the_effort_limits():
    robot, poses = example("R Ex4", grams=100.6)
    run = simulate_pid(robot, **poses, form="torque")
    free = simulate_pid(robot, **poses, form="torque", saturate=False)
    assert np.abs(run.trajectory.tau).max() == 3.0
    assert np.abs(free.trajectory.tau).max() > 50
    assert run.settled
    assert free.settled
    still = run.trajectory.tau[-1]
    held = pin.computeGeneralizedGravity(robot.model, robot.model.createData(), np.array(poses["q_goal"]))
    assert still == pytest.approx(held, abs=1e-2)  # 0.005 rad from the goal or nearer


def test_saturation_does_not_change_a_loop_that_never_reaches_it():
    robot, poses = example("RR Ex5", grams=100.6)
    free, clipped = (simulate_pid(robot, **poses, saturate=on) for on in (False, True))
    assert np.abs(free.trajectory.tau).max() < 3.0
    np.testing.assert_array_equal(free.trajectory.q, clipped.trajectory.q)


def test_anti_windup():
    """With its integral halted, a torque at its limit leaves it as soon as the goal is passed."""
    robot, poses = example("R Ex4", grams=500)
    gains = PidGains(kp=8, ki=16, kd=1.5)
    run = simulate_pid(robot, **poses, gains=gains, form="torque", duration=20.0)
    assert run.settled
    goal, data = poses["q_goal"][0], robot.model.createData()

    def wound_up(_, x):
        z, q, v = x
        tau = np.clip(8 * (goal - q) + 16 * z - 1.5 * v, -3, 3)
        return [goal - q, v, pin.aba(robot.model, data, np.array([q]), np.array([v]), np.array([tau]))[0]]

    plain = solve_ivp(wound_up, (0, 20), [0, poses["q_start"][0], 0], rtol=1e-8, atol=1e-8)
    assert run.overshoot[0] < 0.6 * (plain.y[1].max() - goal)


def test_a_goal_that_the_limits_cannot_hold():
    robot, poses = example("RRR Ex6", grams=1000)
    run = simulate_pid(robot, **poses, form="torque", gains=PidGains(30, 20, 2))
    assert not run.settled
    assert "effort limit of joint1, joint2 does not hold" in run.message


def test_a_library_robot_settles_under_torque():
    robot = ad.Robot.from_library("ur5")
    run = simulate_pid(
        robot,
        q_start=[0, -1, 1, 0, 0, 0],
        q_goal=[0.5, -1.2, 1.3, 0, 0.2, 0],
        gains=PidGains(500, 300, 50),
        form="torque",
    )
    assert run.settled
    assert run.trajectory.joint_names == robot.joint_names
    assert np.all(np.abs(run.trajectory.tau) <= robot.limits.effort_upper)
    np.testing.assert_allclose(run.trajectory.q[-1], [0.5, -1.2, 1.3, 0, 0.2, 0], atol=0.005)


def test_start_at_the_goal():
    robot, poses = example("R Ex4")
    at_goal = {"q_start": poses["q_goal"], "q_goal": poses["q_goal"]}
    still = simulate_pid(robot, **at_goal, form="computed_torque")
    assert still.settled
    assert still.arrival_time == 0.0
    assert still.overshoot[0] < 1e-9
    # Loop (24) first sinks under gravity, until the integral has learnt it.
    sinking = simulate_pid(robot, **at_goal)
    assert sinking.overshoot[0] > 0.1
    assert sinking.arrival_time > 1


def test_a_start_far_away_is_not_divergence():
    robot = loaded_arm("r", "tip", 0.0)
    run = simulate_pid(robot, q_start=[5e3], q_goal=[0.0], form="computed_torque", duration=20.0)
    assert run.settled


def test_uniform_samples():
    robot, poses = example("R Ex4")
    run = simulate_pid(robot, **poses, duration=2.5, samples=26)
    np.testing.assert_allclose(run.trajectory.t, np.linspace(0, 2.5, 26), atol=1e-15)
    np.testing.assert_array_equal(run.trajectory.q[0], poses["q_start"])


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"q_start": [0.0]}, "q_start has shape"),
        ({"q_start": [0.0, 0.0, 0.0]}, "q_start has shape"),
        ({"q_start": 0.0}, "q_start has shape"),
        ({"q_start": ["a", "b"]}, "q_start"),
        ({"q_goal": [0.0, np.inf]}, "q_goal of joint 'joint2' is inf"),
        ({"v_start": [0.0, np.nan]}, "v_start of joint 'joint2' is nan"),
        ({"duration": 0.0}, "duration is 0.0 s"),
        ({"duration": -1.0}, "duration"),
        ({"duration": np.nan}, "duration"),
        ({"duration": np.inf}, "duration"),
        ({"arrival_tolerance": 0.0}, "arrival_tolerance"),
        ({"form": "force"}, "form is 'force'; it is one of 'acceleration'"),
        ({"arrival_rule": "any"}, "arrival_rule"),
        ({"samples": 1}, "samples"),
        ({"samples": 2.5}, "samples"),
        ({"gains": PidGains([1, 2, 3], 1, 1)}, "kp has 3 numbers"),
    ],
)
def test_bad_input(change, match):
    robot, poses = example("RR Ex5")
    with pytest.raises(ProblemError, match=match):
        simulate_pid(robot, **(poses | change))


def test_start_goal_and_gains_by_position():
    robot, poses = example("RR Ex5", grams=100.6)
    given = poses["q_start"], poses["q_goal"]
    gains = PidGains(100, 200, 20)
    same = simulate_pid(robot, **poses, gains=gains, duration=1.0, form="computed_torque")
    run = simulate_pid(robot, *given, gains, duration=1.0, form="computed_torque")
    assert np.array_equal(run.trajectory.q, same.trajectory.q)
    assert "default" not in run.message
    assert "the gains are the default PidGains(kp=30.0, ki=50.0" in simulate_pid(robot, *given, duration=0.1).message
