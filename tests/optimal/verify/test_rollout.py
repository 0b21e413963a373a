from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.optimal.verify import rollout
from problems import cart, paper_arm, pick_and_place, solved


def test_double_integrator_with_a_jump_of_the_force_is_exact():
    half = 1.0
    t = np.array([0.0, np.nextafter(half, 0), half, 2 * half])
    zero = np.zeros((4, 1))
    motion = ad.Trajectory(t, zero, zero, [[1], [1], [-1], [-1]])
    replay = ad.replay_torques(cart(), motion)
    # One unit of force for one second, then back: x = 1, v = 0. The polynomial is exact for DOP853.
    np.testing.assert_allclose([replay.q[-1, 0], replay.v[-1, 0]], [1.0, 0.0], atol=1e-14)


@pytest.mark.parametrize("friction", [(0.0, 0.0), (0.01, 0.05)], ids=["none", "friction"])
def test_energy_is_the_work_of_torque_less_that_of_friction(friction):
    robot = paper_arm("rrr").with_friction(*friction, 0.5)
    random = np.random.default_rng(0)
    t = np.linspace(0, 0.3, 61)
    rest = np.zeros((61, 3))
    bent = np.tile([0.1, -0.4, 0.8], (61, 1))
    replay = ad.replay_torques(robot, ad.Trajectory(t, bent, rest, random.normal(size=(61, 3))))
    model, data = robot.model, robot.model.createData()

    def energy(k):
        return pin.computeMechanicalEnergy(model, data, replay.q[k], replay.v[k])

    fine = np.linspace(0, 0.3, 60 * 100 + 1)
    sample = replay(fine)
    lost = friction[0] * sample.v + friction[1] * np.tanh(sample.v / 0.5)
    power = np.sum((sample.tau - lost) * sample.v, axis=1)
    # The cubic between samples, 5 ms apart, carries the velocity to about 1e-4 of its 20 rad/s.
    np.testing.assert_allclose(energy(60) - energy(0), np.trapezoid(power, fine), rtol=1e-3)


def test_a_damped_body_coasts_to_rest_where_its_momentum_is_gone():
    damping = 2.0
    robot = cart().with_friction(damping)
    t = np.linspace(0, 3, 7)
    zero = np.zeros((7, 1))
    replay = ad.replay_torques(robot, ad.Trajectory(t, zero, zero + 1.5, zero))
    # 1 kg: v = v0 exp(-d t), x = v0 (1 - exp(-d t)) / d; the integrator's tolerance is 1e-11.
    np.testing.assert_allclose(replay.v[:, 0], 1.5 * np.exp(-damping * t), atol=1e-9)
    np.testing.assert_allclose(replay.q[:, 0], 1.5 / damping * -np.expm1(-damping * t), atol=1e-9)


@pytest.mark.parametrize("length", [2.0, 5.2, 5.65, 5.8, 7.0])
def test_steps_much_longer_than_a_damped_joint_takes_to_stop_are_right(length):
    # Dormand-Prince's estimate of its error vanishes at 5.65 times the joint's time, where the step is off by 0.25.
    damping, v = 14000.0, 1e-5
    robot = cart().with_friction(damping)  # 1 kg
    still = np.zeros((2, 1))
    replay = ad.replay_torques(robot, ad.Trajectory([0, length / damping], still, still + v, still))
    np.testing.assert_allclose(replay.v[-1, 0], v * np.exp(-length), atol=1e-12)


def test_a_stiff_arm_does_not_hold_it_up(monkeypatch):
    # Damping stops this joint within 1e-8 s, and an explicit integrator has to follow.
    monkeypatch.setattr(rollout, "_SPARE", 2000)
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("r")).with_friction(damping=1e6)
    still, torque = np.zeros((3, 1)), np.array([[0.0], [1.0], [0.0]])
    replay = ad.replay_torques(robot, ad.Trajectory([0.0, 0.5, 1.0], still, still, torque, robot.joint_names))
    assert replay.t[-1] < 1.0  # it ended early


def test_a_diverging_replay_gets_fewer_steps_after_the_deadline(monkeypatch):
    robot, motion = solved("rr").problem.robot, solved("rr").trajectory
    monkeypatch.setattr(rollout, "SPARE_WHEN_LATE", 0)
    assert rollout.replay_torques(robot, motion, stop=lambda: True).t[-1] == motion.t[-1]  # well-posed
    switch = int(np.flatnonzero(motion.jumps)[0])
    ends = [0, switch]  # steps as long as an arc have to be made in halves
    few = replace(motion, t=motion.t[ends], q=motion.q[ends], v=motion.v[ends], tau=motion.tau[ends])
    on_time, late = (rollout.replay_torques(robot, few, stop=lambda say=say: say) for say in (False, True))
    np.testing.assert_allclose(on_time.q[-1], motion.q[switch], atol=1e-8)
    np.testing.assert_array_equal(late.q[-1], late.q[0])  # it has come to an end where it began


def test_dense_samples_have_the_same_torques():
    motion = solved("rr").trajectory
    more = rollout.dense(motion, 500)
    assert 500 <= more.t.size < 600 and more.t[-1] == motion.t[-1]
    np.testing.assert_array_equal(more.jumps.sum(), motion.jumps.sum())
    np.testing.assert_allclose(more(motion.t).tau, motion.tau, atol=1e-12)
    replay = ad.replay_torques(solved("rr").problem.robot, more)
    np.testing.assert_allclose(replay.q[-1], motion.q[-1], atol=1e-8)


def test_each_piece_is_replayed_by_its_own_model():
    robot, motion = pick_and_place()
    replayed = ad.optimal.replay_torques(robot, motion)
    np.testing.assert_array_equal(replayed.t, motion.t)
    assert replayed.pieces == motion.pieces
    # Torques of a ramp are linear between its samples, where its own are a polynomial's.
    np.testing.assert_allclose(replayed.q, motion.q, rtol=0, atol=1e-4)
    bare = replace(motion, pieces=())
    assert (
        np.max(np.abs(ad.optimal.replay_torques(robot, bare).q[-1] - motion.q[-1])) > 0.1
    )  # as if nothing was carried
    carrying = robot.with_payload(ad.Payload(mass=0.1006))
    np.testing.assert_array_equal(ad.optimal.replay_torques(carrying, motion).q, replayed.q)  # whichever one it is


def test_a_replay_of_pieces_that_breaks_off_ends_there():
    robot, motion = pick_and_place()
    tau = motion.tau.copy()
    tau[50] = 1e300
    replayed = ad.optimal.replay_torques(robot, replace(motion, tau=tau))
    assert replayed.t.size == 50 and replayed.pieces == motion.pieces[:1]
