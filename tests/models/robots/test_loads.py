from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import TrajectoryError
from armdyn.models.robots.loads import is_motion_of, load_of, robots_of
from armdyn.optimal import replay_torques

TOOL = ad.Tool(mass=0.5, tip=(0, 0, 0.1), com=(0, 0, 0.05))
PART = ad.Payload(mass=1.2, com=(0.01, 0, 0.06), inertia=(1e-3, 2e-3, 2.5e-3, 1e-4, 0, 0))


@pytest.fixture(scope="module")
def ur5():
    return ad.Robot.from_library("ur5", tool=TOOL)


def test_a_load_makes_the_very_arm_again(ur5):
    carrying = ur5.with_payload(PART)
    load = load_of(carrying)
    assert (load.mass, load.com, load.inertia, load.frame) == (1.2, PART.com, PART.inertia, "tool")
    motion = ad.Trajectory.at_rest(np.zeros(6), np.zeros(6), 1.0, model_hash=carrying.model_hash).as_piece(load=load)
    (again,) = robots_of(ur5, motion)
    assert again.model_hash == carrying.model_hash != ur5.model_hash
    (bare,) = robots_of(carrying, motion.as_piece(load=load_of(ur5)))
    assert bare.model_hash == ur5.model_hash and load_of(ur5).mass == 0


def test_the_same_body_in_the_axes_of_the_flange(ur5):
    carrying = ur5.with_payload(PART)
    load = load_of(carrying).at_flange
    assert load.frame == "tool0" and load.mass == 1.2
    xx, yy, zz, xy, xz, yz = load.inertia
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moved = ur5.frame("tool0").placement.act(pin.Inertia(load.mass, np.array(load.com), tensor))
    last = ur5.frame("tool0").parentJoint
    expected = carrying.model.inertias[last].toDynamicParameters() - ur5.model.inertias[last].toDynamicParameters()
    np.testing.assert_allclose(moved.toDynamicParameters(), expected, rtol=0, atol=1e-8)  # it has nine decimals
    assert load_of(ur5).at_flange == ad.Load(0.0, frame="tool0")
    assert load_of(ad.Robot.from_spec(ad.ArmSpec.paper("rr"))).at_flange is None


def pendulum(**options):
    return ad.Robot.from_spec(ad.ArmSpec.paper("rr"), **options)


def test_pieces_without_a_load_are_of_the_robot_or_refused():
    arm = pendulum()
    there, back = ad.ramp(arm, [0, 0], [1, 0.5], 0.4), ad.ramp(arm, [1, 0.5], [0, 0], 0.5)
    assert robots_of(arm, there + back) == (arm, arm)
    heavy = replace(back, model_hash="another")
    with pytest.raises(
        TrajectoryError, match="piece 2, 'ramp', of the motion has no load, and its model is not that of"
    ):
        robots_of(arm, there + heavy)
    assert is_motion_of(arm, there + heavy) and not is_motion_of(arm, heavy)
    assert not is_motion_of(arm, replace(there, model_hash=""))  # unknown


def test_one_arm_for_all_pieces_with_the_same_load():
    arm, part = pendulum(), ad.Load(0.2, (0.01, 0, 0), frame="tip")
    there, back = ad.ramp(arm, [0, 0], [1, 0.5], 0.4), ad.ramp(arm, [1, 0.5], [0, 0], 0.5)
    other = replace(part, at_flange=ad.Load(0.2, frame="tool0"))
    first, second = robots_of(arm, there.as_piece(load=part) + back.as_piece(load=other))
    assert first is second and first.payload.mass == 0.2
    assert robots_of(arm, there.as_piece(load=ad.Load(0.0, frame="link1"))) == (arm,)  # nothing is carried there


def test_a_motion_of_loaded_pieces_is_one_of_the_bare_arm():
    arm, part = pendulum(), ad.Payload(mass=0.2)
    loaded = arm.with_payload(part)
    motion = ad.ramp(loaded, [0, 0], [1, 0.5], 0.4).as_piece(load=load_of(loaded))
    assert is_motion_of(arm, motion) and not is_motion_of(arm.with_friction(1.0), motion)


def test_backwards_the_same_torques_lead_back():
    arm = pendulum()
    motion = ad.ramp(arm, [0.3, 0], [1, 0.5], 0.4) + ad.Trajectory.at_rest(
        [1, 0.5], arm.holding_torque([1, 0.5]), 0.1, arm.joint_names, model_hash=arm.model_hash
    ).as_piece(event="wait")
    back = ad.reversed_motion(arm, motion)
    assert back.duration == pytest.approx(motion.duration, rel=1e-15) and back.jumps.sum() == motion.jumps.sum() == 1
    assert [piece.event for piece in back.pieces] == ["", ""]
    assert [part.duration for part in back.split()] == pytest.approx([0.1, 0.4])
    exact = replay_torques(arm, replace(motion, pieces=()))  # whose torques are linear between the samples
    end = replay_torques(arm, ad.reversed_motion(arm, exact)).q[-1]
    np.testing.assert_allclose(end, [0.3, 0], rtol=0, atol=1e-8)  # the integrator's tolerance, grown on the way
    again = ad.reversed_motion(arm, back)
    np.testing.assert_array_equal(again.q, motion.q)
    np.testing.assert_allclose(again.t, motion.t, rtol=0, atol=1e-15)


def test_refused_if_it_cannot_be_reversed():
    arm = pendulum()
    motion = ad.ramp(arm, [0.3, 0], [1, 0.5], 0.4)
    with pytest.raises(TrajectoryError, match=f"{arm.joint_names[1]} of .* has friction, so that the motion backwards"):
        ad.reversed_motion(arm.with_friction([0.0, 0.1]), motion)
    with pytest.raises(TrajectoryError, match="torques that are constant between samples cannot"):
        ad.reversed_motion(arm, replace(motion, hold="zero-order"))
    # Braking may use the whole torque, driving only the torque at the motor's speed.
    weak = arm.with_limits(10.0, None).with_torque_speed({arm.joint_names[0]: [[0.0, 10.0], [2.0, 0.1]]})
    still = 0 * motion.tau
    braking = replace(motion, v=np.full_like(still, [-1.5, 0]), tau=np.full_like(still, [5.0, 0]))
    with pytest.raises(TrajectoryError, match=f"backwards {arm.joint_names[0]} would take 5 at a velocity of 1.5"):
        ad.reversed_motion(weak, braking)
