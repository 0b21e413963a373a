"""Identification against simulated logs of known arms."""

import re

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import LogError, ProblemError
from armdyn.identification import FitOptions, IdentifyOptions, identify
from armdyn.identification.equations import mean_regressor, rigid_torques
from armdyn.identification.unknowns import Unknowns
from oracles import random_states, robot_named
from simulated_logs import fourier_states, simulated_log

QUICK = IdentifyOptions(held_out=0)


def stirred(robot, seed=0):
    """The robot with other, physical inertias, and friction."""
    rng, own = np.random.default_rng(seed), {}
    for joint, body in zip(robot.joint_names, list(robot.model.inertias)[1:], strict=True):
        other = pin.Inertia(
            body.mass * rng.uniform(0.7, 1.3), body.lever + rng.normal(size=3) * 0.01, body.inertia * 1.2
        )
        own[joint] = other.toDynamicParameters()
    friction = rng.uniform(0.002, 0.02, robot.nv) * robot.limits.effort_upper
    return robot.with_inertias(own).with_friction(friction / 2, friction)


@pytest.mark.parametrize("name", ["rrr", "ur5", "panda"])
def test_the_regressor_is_that_of_the_inverse_dynamics(name):
    robot = robot_named(name)
    q, v, a = (np.array(each) for each in zip(*random_states(robot.nv, count=4), strict=True))
    parameters = np.concatenate([body.toDynamicParameters() for body in list(robot.model.inertias)[1:]])
    columns = mean_regressor(robot, q, v, a, 1)
    free = rigid_torques(robot, q, v, a) - robot.model.armature * a
    np.testing.assert_allclose(columns @ parameters, free, atol=1e-10)


def test_the_divergence_along_a_step_rises_as_its_gradient_says():
    rng = np.random.default_rng(0)
    unknowns = Unknowns((0, 1), np.tile(np.eye(4), (2, 1, 1)), *(np.ones(2) for _ in range(4)))
    x, step = 0.1 * rng.normal(size=(2, unknowns.size))
    ray = unknowns.divergence_near(x).along(step)
    for length in (0.0, 0.5, 0.99 * min(ray.border, 3.0)):
        assert ray.slope(length) == pytest.approx(unknowns.divergence_near(x + length * step).gradient @ step, rel=1e-9)


@pytest.mark.parametrize("name", ["rrr", "ur5"])
def test_noise_free_logs_give_the_arm_back(name):
    prior = robot_named(name)
    true = stirred(prior)
    log = simulated_log(true, noise=0.0, step=0.0, velocities=True)
    # A log without noise: the prior counts for nothing.
    options = IdentifyOptions(held_out=0, fit=FitOptions(weights=(1e-2,)))
    estimate = identify(prior, log, options=options)
    _, q, v, a = fourier_states(prior, seed=7)
    expected = rigid_torques(true, q, v, a) + true.friction.torque(v)
    error = np.sqrt(np.mean((estimate.torques(q, v, a) - expected) ** 2, axis=0))
    # Error of the accelerations' filter: 1e-3 of the torques.
    assert np.all(error < 2e-3 * np.sqrt(np.mean(expected**2, axis=0)) + 1e-3 * np.abs(expected).max(axis=0))
    np.testing.assert_allclose(estimate.robot.friction.coulomb, true.friction.coulomb, rtol=0.03)
    np.testing.assert_allclose(estimate.robot.friction.damping, true.friction.damping, rtol=0.05)
    assert len(estimate.likely(3)) == 3  # the covariance is positive definite, from 1e-10 to 1e3


@pytest.mark.slow
def test_all_bodies_are_physical_and_errors_fall_on_data_held_out():
    prior = robot_named("panda")
    estimate = identify(prior, simulated_log(stirred(prior, 1), noise=0.01, duration=6.0))
    for body in list(estimate.robot.model.inertias)[1:]:
        pseudo = pin.PseudoInertia.FromDynamicParameters(body.toDynamicParameters()).toMatrix()
        assert np.linalg.eigvalsh(pseudo)[0] > 0
    assert np.all(estimate.judged.after < 1.2 * 0.01 * prior.limits.effort_upper)
    assert np.all(estimate.judged.after <= estimate.judged.before)
    assert estimate.measured_combinations <= estimate.combinations
    assert estimate.torque_deviation(np.zeros(7), np.ones(7), np.ones(7)).shape == (7,)


@pytest.mark.parametrize("name", ["rrr", "ur5", "panda"])
def test_payload(name):
    prior = robot_named(name)
    size = 0.1 if name == "rrr" else 1.0
    payload = ad.Payload(mass=1.3 * size, com=(0.02, 0, 0.04 * size), inertia=np.array([2e-3, 3e-3, 2e-3]) * size)
    true = stirred(prior).friction
    loaded = prior.with_payload(payload).with_friction(true.damping, true.coulomb)
    found = identify(prior, simulated_log(loaded), "payload", QUICK).robot.payload
    assert found.mass == pytest.approx(payload.mass, rel=0.01)
    seen = [0, 2] if name == "rrr" else [0, 1, 2]  # a planar arm feels nothing of y
    np.testing.assert_allclose(np.take(found.com, seen), np.take(payload.com, seen), atol=5e-3)


@pytest.mark.slow
def test_a_payload_far_from_the_tip():
    prior = robot_named("z1")
    loaded = prior.with_payload(ad.Payload(mass=3.0, com=(0.5, 0, 0))).with_friction(0.01, 0.02)
    found = identify(prior, simulated_log(loaded, 1, duration=4.0), "payload", QUICK)
    assert found.robot.payload.mass == pytest.approx(3.0, rel=0.01) and not found.unfit and not found.warnings
    np.testing.assert_allclose(found.robot.payload.com, (0.5, 0, 0), atol=0.01)


@pytest.mark.slow
def test_a_payload_that_the_prior_pulls_is_unfit_and_is_found_from_one_near_it():
    prior = robot_named("rr")
    loaded = prior.with_payload(ad.Payload(mass=3.0, com=(0.5, 0, 0))).with_friction(0.01, 0.02)
    log = simulated_log(loaded, 1, duration=4.0)
    assert "give the robot a payload near" in identify(prior, log, "payload", QUICK).unfit
    near = prior.with_payload(ad.Payload(mass=2.0, com=(0.4, 0, 0)))
    found = identify(near, log, "payload", QUICK)
    assert found.robot.payload.mass == pytest.approx(3.0, rel=0.02) and not found.unfit and not found.warnings


@pytest.mark.slow
@pytest.mark.parametrize("what", ["payload", "friction"])
def test_a_payload_or_friction_that_makes_up_for_wrong_inertias_is_warned_of(what):
    prior = robot_named("ur5")
    right, wrong = (one.with_friction(0.5, 1) for one in (prior, stirred(prior)))
    assert identify(prior, simulated_log(right, duration=4.0), what, QUICK).warnings == ()
    *_, said = identify(prior, simulated_log(wrong, duration=4.0), what, QUICK).warnings
    assert re.search(rf"other inertias of the links.* shoulder_lift_joint to \d+ %.*the {what} alone", said)
    assert said.endswith(f"(what='all' instead of '{what}')")
    assert identify(prior, simulated_log(wrong, duration=4.0), "all", QUICK).warnings == ()


@pytest.mark.slow
def test_a_simulated_loop_s_own_samples_ask_for_no_other_inertias():
    prior = robot_named("ur5")
    motion = ad.ramp(prior, [0] * 6, [1, -1, 1, 1, 1, 1], 2.0)
    run = ad.track(prior, motion, plant=prior.with_friction(0.5, 1), duration=3.0)
    assert identify(prior, ad.Log.of(run.trajectory), "payload", QUICK).warnings == ()


@pytest.mark.slow
@pytest.mark.parametrize("what", ["all", "payload"])
def test_torques_that_have_nothing_to_do_with_the_motion_are_said_to(what):
    prior = robot_named("ur5")
    log = simulated_log(prior, duration=4.0)
    assert not identify(prior, log, what).unfit
    steps = np.random.default_rng(1).normal(size=log.tau.shape)
    walk = 0.15 * np.std(log.tau, axis=0) * np.cumsum(steps, axis=0)
    found = identify(prior, ad.Log(t=log.t, q=log.q, tau=walk), what)
    assert re.search(r"errors are [\d.]+ % of the torques after .* before it", found.unfit)
    assert ": unfit, " in repr(found)


@pytest.mark.slow
def test_confidence_covers_the_truth():
    prior, hits = robot_named("rrr"), []
    for seed in range(25):
        rng = np.random.default_rng(seed)
        payload = ad.Payload(mass=rng.uniform(0.05, 0.3), com=(rng.uniform(-0.02, 0.05), 0, 0), inertia=[1e-4] * 3)
        friction = rng.uniform(0.01, 0.06, 3)
        loaded = prior.with_payload(payload).with_friction(friction / 2, friction)
        estimate = identify(prior, simulated_log(loaded, seed, duration=5.0), "payload", QUICK)
        truth = [payload.mass, *payload.com, *payload.inertia, 0, 0, 0, *(friction / 2), *friction, 0, 0, 0]
        for own, value in zip(estimate.parameters, truth, strict=True):
            low, high = own.interval
            hits += [low <= value <= high] if own.measured else []
    assert len(hits) > 200
    assert 0.92 <= np.mean(hits) <= 0.98  # some 300 numbers: two standard deviations are 0.025


def single(read, mass, kind, axis):
    """An arm of one joint, whose link has a mass [kg]; level, vertical, sliding or turning."""
    return read(
        '<robot name="single"><link name="base"/><link name="car"><inertial><origin xyz="0.2 0 0"/>'
        f'<mass value="{mass}"/>'
        '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="tip"/>'
        '<joint name="flange" type="fixed"><parent link="car"/><child link="tip"/><origin xyz="0.5 0 0"/></joint>'
        f'<joint name="x" type="{kind}"><parent link="base"/><child link="car"/><axis xyz="{axis}"/>'
        '<limit lower="-1" upper="1" effort="60" velocity="3"/></joint></robot>'
    )


@pytest.mark.parametrize("axis", ["1 0 0", "0 0 1"])  # a vertical one's weight is the torque sensor's offset, too
@pytest.mark.parametrize(("guess", "mass", "rotor"), [(0.61, 0.53, 1.64), (4.4, 4.65, 1.96), (2.1, 2.8, 0.2)])
def test_the_mass_of_a_slider_whose_rotor_is_unknown_is_not_measured(read, axis, guess, mass, rotor):
    true = single(read, mass, "prismatic", axis).with_armature([rotor]).with_friction(0.5, 0.8)
    estimate = identify(single(read, guess, "prismatic", axis), simulated_log(true, 3, noise=0.005, duration=4.0))
    own = {one.name: one for one in estimate.parameters}
    assert not own["mass of x"].measured
    assert own["mass of x"].deviation > 0.4 * mass
    for name, value in (("mass of x", mass), ("armature of x", rotor)):
        assert own[name].interval[0] < value < own[name].interval[1]
    assert own["coulomb of x"].measured
    assert estimate.torque_deviation([0], [0], [1])[0] < 0.05 * (mass + rotor)  # their sum is measured


def test_a_payload_whose_place_is_unknown_is_not_measured_about_one_vertical_axis(read):
    prior = single(read, 2.0, "revolute", "0 0 1")
    true = prior.with_payload(ad.Payload(mass=1.0, com=(0.3, 0, 0))).with_friction(0.5, 0.8)
    estimate = identify(prior, simulated_log(true, 3, noise=0.005, duration=4.0), "payload", QUICK)
    (mass,) = (one for one in estimate.parameters if one.name == "mass of payload")
    assert not mass.measured
    assert mass.interval[0] < 1.0 < mass.interval[1]


def faulty(log, true, fault):
    """The log of an arm as it would be with a fault of its first joint: in the gear, the sensor or the friction."""
    q, tau, v = log.q.copy(), log.tau.copy(), np.gradient(log.q, log.t, axis=0)
    coulomb, sign = true.friction.coulomb[0], np.tanh(v[:, 0] / true.friction.width)
    if fault == "backlash":  # the encoder follows the link within 4 mrad
        for i in range(1, len(q)):
            q[i, 0] = np.clip(q[i - 1, 0], log.q[i, 0] - 4e-3, log.q[i, 0] + 4e-3)
    elif fault == "sensor":
        tau[:, 0] *= 1.08
    elif fault == "stribeck":
        tau[:, 0] += 2 * coulomb * np.exp(-((v[:, 0] / 0.2) ** 2)) * sign
    elif fault == "direction":
        tau[:, 0] += 0.3 * coulomb * np.abs(sign)
    return ad.Log(t=log.t, q=q, tau=tau)


SAID = {
    "right": None,
    "backlash": "joint joint1: residual is larger where the motion turns back: .* N m; more than friction: backlash",
    "sensor": "joint joint1: residual depends on the torque: .* N m; the torque sensor's scale differs",
    "stribeck": "joint joint1: residual depends on the speed: .* N m; friction is not the model's",
    "direction": "",  # the offset is as wide as friction that differs a little; a test needs slow reversals
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", SAID)
def test_faults_that_the_model_lacks_are_named_and_counted_in_the_intervals(fault):
    prior, payload = robot_named("rrr"), ad.Payload(mass=0.2, com=(0.02, 0, 0), inertia=[1e-4] * 3)
    coulomb = np.array([0.03, 0.03, 0.02])
    true = prior.with_payload(payload).with_friction(coulomb / 2, coulomb)
    log = faulty(simulated_log(true, 1, duration=6.0), true, fault)
    estimate = identify(prior, log, "payload", QUICK)
    own = {one.name: one for one in estimate.parameters if one.measured}
    truth = {"mass of payload": 0.2, "com x of payload": 0.02}
    truth |= {f"offset of joint{j}": 0.0 for j in (1, 2, 3)} | {
        f"coulomb of joint{j + 1}": coulomb[j] for j in range(3)
    }
    missed = [name for name in own.keys() & truth if abs(own[name].value - truth[name]) > 3 * own[name].deviation]
    assert bool(estimate.unfit) == (fault == "backlash")
    assert estimate.unfit or not missed, (missed, estimate.warnings)
    if SAID[fault] is None:
        assert not estimate.warnings and "mass of payload" in own
    else:
        assert re.search(SAID[fault], "; ".join([*estimate.warnings, estimate.unfit]))


@pytest.mark.parametrize("seed", [3, 5, 7, 8, 9])  # five of twelve; the prior's pull was a pattern of seven
def test_a_payload_ten_times_the_prior_s_leaves_no_pattern(seed):
    prior, rng = robot_named("rr"), np.random.default_rng(seed)
    coulomb, width = rng.uniform(0.005, 0.02, 2) * prior.limits.effort_upper, rng.choice([0.01, 0.02, 0.05])
    true = prior.with_payload(ad.Payload(mass=1.0, com=(0.05, 0, 0))).with_friction(coulomb / 2, coulomb, float(width))
    assert identify(prior, simulated_log(true, seed, duration=3.0), "payload", QUICK).warnings == ()


def test_a_sensor_s_offset_may_be_friction_that_differs_with_the_direction_and_is_as_wide():
    prior, offset = robot_named("rrr"), np.array([0.02, 0.0, 0.0])
    true = prior.with_friction(0.02, 0.05, 0.01)
    log = simulated_log(true, 2, duration=3.0)
    log = ad.Log(t=log.t, q=log.q, tau=log.tau + offset)
    first, second, _ = identify(prior, log, "friction", QUICK).parameters[-3:]
    assert abs(first.value - 0.02) < 2 * first.deviation and abs(second.value) < 2 * second.deviation
    assert first.deviation > 2 * second.deviation


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])  # the weights of the prior are 0.01, 100 and 32
def test_mass_and_armature_of_a_joint_that_slides_level_are_not_measured_apart(read, noise):
    prior, true = (
        read(
            f'<robot name="slider"><link name="base"/><link name="car"><inertial><mass value="{mass}"/>'
            '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            '<joint name="x" type="prismatic"><parent link="base"/><child link="car"/><axis xyz="1 0 0"/>'
            '<limit lower="-1" upper="1" effort="20" velocity="3"/></joint></robot>'
        )
        for mass in (2.0, 2.3)
    )
    estimate = identify(prior, simulated_log(true.with_friction(0.5, 0.8), noise=noise, duration=4.0))
    own = {one.name: one for one in estimate.parameters}
    mass, armature = own["mass of x"], own["armature of x"]
    assert mass.value + armature.value == pytest.approx(2.3, rel=0.02)
    assert not mass.measured and not armature.measured
    assert mass.interval[0] < 2.3 < mass.interval[1]
    # Likely arms are as uncertain as the numbers: uniform masses that leave the rotor something deviate by 0.66 kg.
    arms = estimate.likely(20)
    assert np.std([arm.model.inertias[1].mass for arm in arms]) > 0.3
    assert np.std([arm.model.inertias[1].mass + arm.model.armature[0] for arm in arms]) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize(("name", "what"), [("rrr", "payload"), ("panda", "all")])
def test_likely_arms_are_physical_and_differ_as_the_confidence_says(name, what):
    prior = robot_named(name)
    estimate = identify(prior, simulated_log(stirred(prior), duration=5.0), what, QUICK)
    arms = estimate.likely(30)
    assert [one.model_hash for one in arms] == [one.model_hash for one in estimate.likely(30)]
    assert len({one.model_hash for one in (*arms, *estimate.likely(30, seed=1), estimate.robot)}) == 61
    for body in (body for arm in arms for body in list(arm.model.inertias)[1:]):
        assert np.linalg.eigvalsh(pin.PseudoInertia.FromDynamicParameters(body.toDynamicParameters()).toMatrix())[0] > 0
    _, q, v, a = (one[::50] for one in fourier_states(prior, seed=9))
    expected = estimate.torques(q, v, a) - estimate.offset
    errors = np.array([rigid_torques(arm, q, v, a) + arm.friction.torque(v) - expected for arm in arms])
    columns, _ = estimate.equations.at(q, v, a, every=1)
    columns[..., -prior.nv :] = 0  # no arm has the sensors' offsets
    spread, deviation = (
        np.sqrt(np.mean(one)) for one in (errors**2, np.einsum("njp,pq,njq->nj", columns, estimate.covariance, columns))
    )
    # On the region's surface p unknowns are each off by 1.1 to 1.3 deviations; the physical border makes it less.
    assert 0.7 * deviation < spread < 1.3 * deviation
    near = estimate.likely(30, confidence=0.5)
    less = [rigid_torques(arm, q, v, a) + arm.friction.torque(v) - expected for arm in near]
    assert np.sqrt(np.mean(np.square(less))) < spread


def test_the_given_robot_is_the_reference_of_an_estimate():
    prior = robot_named("rrr").with_payload(ad.Payload(mass=0.1, com=(0.01, 0, 0))).with_friction(0.01, 0.02)
    estimate = identify(prior, simulated_log(prior, duration=4.0), "payload", QUICK)
    before = {one.name: one.prior for one in estimate.parameters}
    assert before["mass of payload"] == pytest.approx(0.1) and before["com x of payload"] == pytest.approx(0.01)
    assert before["damping of joint2"] == 0.01 and before["coulomb of joint3"] == 0.02


@pytest.mark.slow
def test_several_logs_friction_alone_and_a_joint_that_stands_still():
    prior = robot_named("rrr")
    true = prior.with_friction([0.02, 0.03, 0.01], [0.05, 0.02, 0.04])
    first, second = (simulated_log(true, seed, duration=4.0) for seed in (3, 4))
    estimate = identify(prior, [first, second], "friction")
    np.testing.assert_allclose(estimate.robot.friction.coulomb, true.friction.coulomb, atol=0.01)
    assert estimate.robot.with_friction(0, 0).model_hash == prior.with_friction(0, 0).model_hash
    t, q, v, a = fourier_states(prior, 5)
    q, v, a = (one * [1, 1, 0] for one in (q, v, a))
    still = ad.Log(t=t, q=q, v=v, tau=rigid_torques(true, q, v, a) + true.friction.torque(v))
    assert identify(prior, still, "payload", QUICK).unmoved == ("joint3",)


def test_a_joint_has_its_own_width_of_coulomb_friction_if_the_log_determines_it(tmp_path):
    prior = robot_named("rrr")
    log = simulated_log(prior.with_friction(0.02, 0.2, [0.1, 0.1, 0.01]), noise=0.002, duration=6.0)
    robot = identify(prior, log, "friction", QUICK).robot
    np.testing.assert_array_equal(robot.friction.width, [0.1, 0.1, 0.01])
    file = tmp_path / "identified.toml"
    file.write_text(ad.MinimumTimeProblem(robot, q_start=[0, 0, 0], q_goal=[1, 0, 0]).to_toml())
    assert ad.read_problem(file).robot.model_hash == robot.model_hash
    log = simulated_log(prior.with_friction(0.02, 0.2, 0.1), noise=0.002, duration=6.0)
    assert identify(prior, log, "friction", QUICK).robot.friction.width == 0.1


def test_an_identified_arm_goes_through_a_problem_file(tmp_path):
    prior = robot_named("rrr")
    robot = identify(prior, simulated_log(stirred(prior), duration=4.0), options=QUICK).robot
    file = tmp_path / "identified.toml"
    file.write_text(ad.MinimumTimeProblem(robot, q_start=[0, 0, 0], q_goal=[1, 0, 0]).to_toml())
    assert ad.read_problem(file).robot.model_hash == robot.model_hash
    assert robot.with_payload(ad.Payload(mass=0.1)).with_payload(None).model_hash == robot.model_hash


def test_bad_arguments():
    robot = robot_named("rrr")
    log = simulated_log(robot, duration=1.0)
    with pytest.raises(ProblemError, match="what is 'mass'"):
        identify(robot, log, "mass")
    with pytest.raises(LogError, match="no log"):
        identify(robot, [])
    with pytest.raises(ProblemError, match=r"confidence is 1\.0; it is a probability"):
        identify(robot, log, "friction", QUICK).likely(confidence=1.0)
    with pytest.raises(ProblemError, match="held_out is 1"):
        IdentifyOptions(held_out=1)
    with pytest.raises(LogError, match=r"smoothing by 0.0001 s needs 2\.5e\+03 per second"):
        identify(robot, log, options=IdentifyOptions(smoothing=1e-4))
