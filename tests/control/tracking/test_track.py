"""The compiled loop against independent ones: the paper's differential equation, plain Python, MuJoCo."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
import plain_loop
from armdyn.errors import ProblemError
from armdyn.optimal.gap import check_motion
from armdyn.paper import GAINS, example
from problems import paper_arm


@pytest.fixture(scope="module")
def references():
    """Minimum-time motions that keep a tenth of the torque."""
    return {arm: plain_loop.paper_reference(arm, 0.1) for arm in ("rr", "rrr")}


@pytest.mark.parametrize("form", ["acceleration", "torque", "computed_torque"])
@pytest.mark.parametrize("arm", ["r", "rr", "rrr"])
def test_the_ideal_loop_is_a_differential_equation(arm, form):
    # Both integrate to 1e-8 or better; the third arm's "acceleration" loop is unstable, and makes an error e^6 times as
    # large.
    paper, robot = example(arm, "pid"), paper_arm(arm)
    plain = plain_loop.continuous_pid(robot, paper.q_start, np.array(paper.q_goal), GAINS, form, 10.0)
    goal = ad.set_point(robot, paper.q_goal)
    controller, loop = ad.Pid(GAINS, form, feedforward=False), ad.Loop.ideal(saturate=form == "torque")
    run = ad.track(robot, goal, controller, loop=loop, q_start=paper.q_start, duration=10.0)
    assert run.trajectory.t.size == 10001
    _, q, v = np.split(plain(run.trajectory.t), 3)
    assert np.abs(run.trajectory.q.T - q).max() < 1e-6
    assert np.abs(run.trajectory.v.T - v).max() < 1e-5
    same = ad.simulate_pid(robot, q_start=paper.q_start, q_goal=paper.q_goal, gains=GAINS, form=form)
    assert same.settled == (run.settled and same.max_real_eigenvalue < 0)
    if same.settled:
        assert run.settled_time == pytest.approx(same.settled_time, abs=1e-5)  # it is linear between ticks


LOOPS = {
    "as it is built": ad.Loop(),
    "with perfect encoders": ad.Loop(encoder=0.0),
    "observer, two ticks late": ad.Loop(velocity="observer", delay=2, cutoff=150.0),
    "exact, at once": ad.Loop(velocity="exact", delay=0, encoder=0.0),
    "noise, back calculation": ad.Loop(noise=1e-4, seed=3, antiwindup="back_calculation"),
    "never unwound": ad.Loop(antiwindup="none", rate=800.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.parametrize("controller", [ad.Lqr(), ad.ComputedTorque(), ad.Pid(ad.PidGains(20.0, 20.0, 0.5))])
def test_the_compiled_loop_is_the_one_in_plain_python(references, name, controller):
    loop, robot = LOOPS[name], paper_arm("rr")
    plant = paper_arm("rr", 0.11).with_friction(0.003, 0.06, [0.05, 0.08])
    plain = plain_loop.simulate(plant, robot, references["rr"], controller, loop, 0.25, substeps=32)
    ours = ad.track(robot, references["rr"], controller, plant, loop, 0.25)
    # Until a reading falls on the other side of an encoder's step, which 1e-9 rad may decide, they are the same but
    # for plain Python's steps, which friction makes coarse; then they differ by some steps, more under a lively law.
    n = min(len(plain.q), ours.trajectory.t.size)
    apart = np.abs(plain.q[:n] - ours.trajectory.q[:n]).max(axis=1)
    assert apart.max() < (30 * loop.encoder if loop.encoder else 1e-6)  # a tick may be wrong by 1e-8
    assert apart[:10].max() < 1e-6  # before the first such reading, the tenth or later


def test_ticks_of_a_long_run_take_no_other_steps_than_they_need(references):
    # The torques of the sampled loop, replayed by an integrator of another kind, make the same motion.
    robot = paper_arm("rrr")
    run = ad.track(robot, references["rrr"], duration=0.3)
    q, v = run.trajectory.q[0], run.trajectory.v[0]
    for k, tau in enumerate(run.trajectory.tau[:-1]):
        q, v = _dop853(robot, q, v, tau)
        assert np.abs(q - run.trajectory.q[k + 1]).max() < 1e-8  # that a tick may be wrong by
        q, v = run.trajectory.q[k + 1], run.trajectory.v[k + 1]


def _dop853(robot, q, v, tau):
    from scipy.integrate import solve_ivp

    aba, nv = ad.dynamics.forward_dynamics(robot), robot.nv
    done = solve_ivp(
        lambda _, x: np.concatenate([x[nv:], aba(x[:nv], x[nv:], tau)]),
        (0, 1e-3), np.concatenate([q, v]), method="DOP853", rtol=1e-11, atol=1e-12,
    )  # fmt: skip
    return np.split(done.y[:, -1], 2)


@pytest.mark.parametrize("rate", [1000.0, 200.0])
def test_a_replay_of_a_runs_torques_ends_where_the_run_ended(references, rate):
    robot = paper_arm("rrr")
    run = ad.track(robot, references["rrr"], loop=ad.Loop(rate=rate), duration=0.3)
    assert run.trajectory.hold == "zero-order"
    replayed = ad.replay_torques(robot, run.trajectory)
    # A tick may be wrong by 1e-8; the arm's motion makes that a hundred times as large in 0.3 s.
    assert np.abs(replayed.q - run.trajectory.q).max() < 1e-5
    linear = ad.replay_torques(robot, replace(run.trajectory, hold="linear"))
    assert np.abs(linear.q[-1] - run.trajectory.q[-1]).max() > 1e-3
    assert check_motion(robot, run.trajectory).replay_error < 1e-5


@pytest.mark.parametrize("arm", ["rr", "rrr"])
def test_a_delayed_loop_settles_with_an_exact_model(references, arm):
    run = ad.track(paper_arm(arm), references[arm])
    assert run.settled and run.settled_time < references[arm].duration + 0.005
    assert run.error_at_end < 0.01 and run.saturated < 0.05 and run.failed_time is None


def test_limits_that_are_exceeded_on_the_way_are_named():
    arm = paper_arm("rr")
    fast = ad.ramp(arm, [0.0, 0.0], [0.6, 0.0], 0.3)  # peak speed 1.875 times 0.6 rad in 0.3 s: 3.75 rad/s
    kept = ad.track(arm.with_limits(None, 3.75), fast)
    assert kept.status == "settled" and not kept.limits_exceeded and 1 < kept.peak_velocity < 1.01
    run = ad.track(arm.with_limits(None, 3.0), fast)
    assert run.settled and run.settled_time == kept.settled_time
    assert "joint1 reaches 125" in run.message and "% of its velocity limit at t = 0.1" in run.message
    assert run.summary()["limits_exceeded"] == list(run.limits_exceeded) and len(run.limits_exceeded) == 1
    near = replace(arm, limits=replace(arm.limits, position_upper=np.array([0.5, 1.0])))
    low = ad.track(near, fast)
    assert low.settled and "joint1 is 0.1" in low.message


def test_the_same_noise_twice_and_other_noise(references):
    robot, loop = paper_arm("rr"), ad.Loop(noise=3e-4)
    one, same = (ad.track(robot, references["rr"], loop=loop) for _ in range(2))
    other = ad.track(robot, references["rr"], loop=replace(loop, seed=1))
    assert np.array_equal(one.trajectory.q, same.trajectory.q)
    assert not np.array_equal(one.trajectory.q, other.trajectory.q)


def test_the_papers_gains_at_1_khz_name_their_sampling():
    for arm in ("rr", "rrr"):
        paper, robot = example(arm, "pid"), paper_arm(arm)
        controller = ad.Pid(GAINS, "torque", feedforward=False)
        run = ad.track(robot, ad.set_point(robot, paper.q_goal), controller, q_start=paper.q_start)
        assert run.status == "not_settled" and run.settled_time is None
        assert "unstable for its sampling" in run.message and "1000 Hz" in run.message
        assert run.stability.slowest_stable_rate > 1000.0


def test_unstable_gains_are_reported():
    robot = paper_arm("rr")
    goal, loop = ad.set_point(robot, [0.1, 0.1]), replace(ad.Loop.ideal(), rate=1000.0)
    wrong = ad.Pid(ad.PidGains(0.0, 500.0, 0.0), "acceleration", feedforward=False)
    run = ad.track(robot, goal, wrong, loop=loop, duration=20.0, q_start=[0.0, 0.0])
    assert run.status == "diverged" and "unstable as a continuous loop" in run.message
    assert run.failed_time is not None and run.settled_time is None
    assert np.all(np.isfinite(run.trajectory.q))


def test_a_motor_that_does_not_hold_the_arm_is_reported():
    robot = paper_arm("rr")
    weak = robot.with_limits(0.2, None)
    run = ad.track(robot, ad.set_point(robot, [0.0, 0.0]), ad.Lqr(), weak, q_start=[0.0, 0.0])
    assert (
        run.status == "not_settled" and "rad from the goal" in run.message and "on its limit to the end" in run.message
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"plant": paper_arm("rrr")}, "has 3 joints"),
        ({"reference": "motion.npz"}, "reference"),
        ({"controller": ad.PidGains(1.0, 1.0, 1.0)}, "controller"),
        ({"loop": 1000.0}, "loop"),
        ({"duration": np.inf}, "duration"),
        ({"duration": 1e7}, "at most"),
        ({"q_start": [0.0]}, "q_start"),
        ({"tolerance": 0.0}, "tolerance"),
    ],
)
def test_misfits_are_refused(references, change, words):
    given = {"robot": paper_arm("rr"), "reference": references["rr"]} | change
    with pytest.raises(ProblemError, match=words):
        ad.track(**given)


def test_without_a_compiler_it_is_the_same(references, monkeypatch):
    from armdyn.dynamics import driven

    robot, reference = paper_arm("rr"), references["rr"]
    fast = ad.track(robot, reference, duration=0.3)
    monkeypatch.setattr(driven, "_library", lambda source, instructions: None)
    driven._callable.__wrapped__.cache_clear()
    try:
        slow = ad.track(robot, reference, duration=0.3)
    finally:
        driven._callable.__wrapped__.cache_clear()
    # The same operations, but the compiler may order a sum otherwise; a reading may then fall into the next step.
    assert np.abs(fast.trajectory.q - slow.trajectory.q).max() < 1e-3
    assert np.abs(fast.trajectory.q - slow.trajectory.q)[:20].max() < 1e-9


def test_who_is_near_the_goal_only_when_the_run_ends_has_not_settled():
    robot = paper_arm("rr")
    reference = ad.ramp(robot, [-1.57, 0.0], [0.16, 0.0], 0.5)
    whole = ad.track(robot, reference, ad.ComputedTorque())
    assert whole.settled and whole.settled_time < 0.48
    short = ad.track(robot, reference, ad.ComputedTorque(), duration=whole.settled_time + 0.06)
    assert short.status == "not_settled" and short.settled_time is None
    assert "but the run ends at" in short.message and "they must stay for 0.1 s" in short.message
    assert ad.track(robot, reference, ad.ComputedTorque(), duration=whole.settled_time + 0.11).settled


def test_a_detour_of_the_reference_is_no_overshoot():
    robot = paper_arm("rr")
    there, back = ad.ramp(robot, [-1.5, 0.0], [0.6, 0.2], 0.6), ad.ramp(robot, [0.6, 0.2], [0.1, 0.3], 0.4)
    run = ad.track(robot, there + back, ad.ComputedTorque())
    assert run.settled and np.all(run.overshoot < 0.01) and run.trajectory.q[:, 0].max() > 0.59


def test_a_set_point_without_a_start_shows_holding_alone():
    robot = paper_arm("r")
    held = ad.track(robot, ad.set_point(robot, [0.3]), duration=0.5)
    assert held.settled_time == 0
    assert "starts at the goal" in held.message and "q_start" in held.message
    moved = ad.track(robot, ad.set_point(robot, [0.3]), duration=1.0, q_start=[0.25])
    assert moved.settled_time > 0 and "starts at the goal" not in moved.message
