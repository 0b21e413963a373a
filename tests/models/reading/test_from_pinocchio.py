"""Robots from Pinocchio models that were built elsewhere."""

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import ProblemError, SpecError, UnsupportedJointError, UrdfError
from armdyn.models.robots.library import library_arm
from armdyn.models.scene.bodies import bodies
from oracles import random_states
from problems import POSES

MODEL = ad.Robot.from_model
BODY = pin.Inertia(1.0, np.array([0.1, 0.2, 0.3]), np.diag([1.0, 2.0, 2.5]))


def pendulum(kind=None, name="turn", mass=1.0, inertia=None):
    """One joint and a body, as a script would make it: no limits, no frames but the joint's own."""
    model = pin.Model()
    joint = model.addJoint(0, kind or pin.JointModelRY(), pin.SE3.Identity(), name)
    body = pin.Inertia(mass, np.array([0.0, 0, 0.5]), np.eye(3) if inertia is None else np.diag(inertia))
    model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    return model


@pytest.mark.parametrize("name", ["ur5", "panda", "kinova"])
def test_a_librarys_arm_is_the_same_arm(name):
    path = library_arm(name)[0]
    model = pin.buildModelFromUrdf(str(path))
    same = ad.Robot.from_library(name, damping="urdf", friction="urdf")
    robot = MODEL(model, lock=same.locked, arm=(same.joint_names[0], same.tip))
    assert (robot.joint_names, robot.tip, robot.nv) == (same.joint_names, same.tip, same.nv)
    assert robot.model_hash == same.model_hash and model.nv == pin.buildModelFromUrdf(str(path)).nv
    for what, own in robot.limits.rows.items():
        np.testing.assert_array_equal(own, getattr(same.limits, what), err_msg=what)
    mine, other = ad.Dynamics(robot), ad.Dynamics(same)
    for q, v, a in random_states(robot.nv, count=2):
        np.testing.assert_array_equal(mine.rnea(q, v, a), other.rnea(q, v, a))


def test_all_joints_move_by_default():
    robot = MODEL(pin.buildModelFromUrdf(str(library_arm("panda")[0])), name="hand and arm")
    assert robot.nv == 9 and robot.name == "hand and arm" and robot.source == "Pinocchio model 'hand and arm'"
    assert MODEL(pendulum()).name == "model"


def test_the_same_minimum_time():
    spec = ad.ArmSpec.paper("r")
    same = ad.Robot.from_urdf_string(ad.urdf_from_spec(spec))
    robot = MODEL(pin.buildModelFromXML(ad.urdf_from_spec(spec)))
    options, (start, goal) = ad.MinimumTimeOptions(workers=1), POSES["r"]
    found, expected = (
        ad.solve_minimum_time(ad.MinimumTimeProblem(one, q_start=start, q_goal=goal), options=options)
        for one in (robot, same)
    )
    assert found.success and found.duration == expected.duration  # the same numbers go in
    assert found.trajectory.model_hash == robot.model_hash == same.model_hash


def test_the_model_stays_as_it_is():
    model = pendulum()
    before = model.copy()
    robot = MODEL(model, payload=ad.Payload(mass=1.0))
    assert model == before and robot.model.inertias[1].mass == 2.0
    assert robot.tip == "tip" and "tip" not in {frame.name for frame in model.frames}


def limits(n, effort=2.0):
    return ad.JointLimits(
        position_lower=np.full(n, -1.0), position_upper=np.full(n, 1.0), velocity=np.full(n, 3.0),
        effort_lower=np.full(n, -effort), effort_upper=np.full(n, effort),
    )  # fmt: skip


def test_limits_that_are_given():
    given = limits(1)
    assert MODEL(pendulum(), limits=given).limits is given
    with pytest.raises(SpecError, match="a robot of 1 joint has 1 joint names and 2 limits"):
        MODEL(pendulum(), limits=limits(2))
    with pytest.raises(SpecError, match="limits is 3; it must be a JointLimits"):
        MODEL(pendulum(), limits=3)


def test_missing_torque_limits_are_required():
    robot = MODEL(pendulum())
    assert np.isinf(robot.limits.effort_upper) and np.isinf(robot.limits.velocity)
    with pytest.raises(ProblemError, match=r"joint 'turn' has torque limits .* give `effort_limit`"):
        ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[0.5])
    ad.MinimumTimeProblem(robot.with_limits(20.0, None), q_start=[0.0], q_goal=[0.5])


def test_limits_of_the_model():
    model = pendulum()
    model.upperEffortLimit[:] = 3.0
    own = MODEL(model).limits
    assert (own.effort_lower, own.effort_upper) == (-3.0, 3.0)  # one limit stands for both
    model.lowerEffortLimit[:], model.upperVelocityLimit[:] = -1.0, 5.0
    own = MODEL(model).limits
    assert (own.effort_lower, own.effort_upper, own.velocity) == (-1.0, 3.0, 5.0)
    model.lowerVelocityLimit[:] = -4.0
    assert MODEL(model).limits.velocity == 4.0


def test_friction_of_the_model():
    model = pendulum()
    model.damping[:], model.upperDryFrictionLimit[:] = 0.1, 0.2
    robot = MODEL(model)
    assert (robot.friction.damping, robot.friction.coulomb) == (0.1, 0.2)
    assert not robot.with_friction(0.0, 0.0).friction.present
    model.damping[:] = -1.0
    with pytest.raises(SpecError, match=r"damping of Pinocchio model 'model' of joint 'turn' is -1\.0"):
        MODEL(model)


@pytest.mark.parametrize(
    "kind",
    [
        pin.JointModelFreeFlyer(),
        pin.JointModelSpherical(),
        pin.JointModelPlanar(),
        pin.JointModelTranslation(),
        pin.JointModelUniversal(),
        pin.JointModelHX(),
        pin.JointModelComposite(pin.JointModelRX()),
    ],
)
def test_joints_that_are_none_of_ours(kind):
    model = pendulum(kind, "root")
    last = model.addJoint(1, pin.JointModelRX(), pin.SE3.Identity(), "turn")
    model.appendBodyToJoint(last, BODY, pin.SE3.Identity())
    with pytest.raises(UnsupportedJointError, match=f"joint 'root': is a {kind.shortname()}; .* lock it") as caught:
        MODEL(model)
    assert caught.value.element == "joint 'root'"
    assert MODEL(model, lock={"root": 0.0}).joint_names == ("turn",)
    assert MODEL(model, arm=("turn", "turn")).joint_names == ("turn",)
    if kind.nv > 1:
        with pytest.raises(SpecError, match="0 for a joint of several coordinates"):
            MODEL(model, lock={"root": 0.5})


def test_a_mimicking_joint():
    model = pin.buildModelFromUrdf(str(library_arm("panda")[0]), mimic=True)
    with pytest.raises(UnsupportedJointError, match="joint 'panda_finger_joint2': is a JointModelMimic"):
        MODEL(model)
    locked = MODEL(model, lock=dict.fromkeys(("panda_finger_joint1", "panda_finger_joint2"), 0.0))
    assert locked.model_hash == ad.Robot.from_library("panda", damping="urdf", friction="urdf").model_hash


@pytest.mark.parametrize(
    ("kind", "continuous"),
    [
        (pin.JointModelRX(), False),
        (pin.JointModelRUBZ(), True),
        (pin.JointModelRevoluteUnaligned(np.array([0.6, 0.8, 0])), False),
        (pin.JointModelPY(), False),
        (pin.JointModelPrismaticUnaligned(np.array([0.6, 0, 0.8])), False),
    ],
)
def test_joints_that_are(kind, continuous):
    robot = MODEL(pendulum(kind))
    assert (robot.model.nq == 2) == continuous
    q, v, a = next(random_states(1))
    expected = pin.rnea(robot.model, robot.model.createData(), robot.configuration(q), v, a)
    np.testing.assert_allclose(ad.Dynamics(robot).rnea(q, v, a), expected, atol=1e-12)  # other additions


def test_names_that_are_not_there():
    model = pin.buildModelFromUrdf(str(library_arm("ur5")[0]))
    with pytest.raises(SpecError, match=r"cannot lock 'elbow': .*wrist_3_joint; did you mean 'elbow_joint'\?"):
        MODEL(model, lock={"elbow": 0.0})
    with pytest.raises(SpecError, match=r"no link, frame or joint 'tool'; did you mean 'tool0'\?"):
        MODEL(model, arm=("elbow_joint", "tool"))
    with pytest.raises(SpecError, match="'shoulder_pan_joint' is not behind 'elbow_joint'"):
        MODEL(model, arm=("elbow_joint", "shoulder_pan_joint"))
    with pytest.raises(SpecError, match="nothing moves between 'wrist_3_link' and 'tool0'"):
        MODEL(model, arm=("wrist_3_link", "tool0"))
    with pytest.raises(SpecError, match="cannot lock 'elbow_joint' at nan"):
        MODEL(model, lock={"elbow_joint": float("nan")})


def broken(change):
    model = pendulum()
    change(model)
    return model


def bad_inertia(model):
    model.inertias[1] = pin.Inertia(1.0, np.zeros(3), np.diag([1.0, 1.0, 9.0]))


def bad_placement(model):
    model.jointPlacements[1] = pin.SE3(np.eye(3), np.array([0.0, np.nan, 0.0]))


def bad_armature(model):
    model.armature[:] = -1.0


def bad_range(model):
    model.lowerPositionLimit[:], model.upperPositionLimit[:] = 2.0, 1.0


def bad_gravity(model):
    model.gravity.linear = np.array([0.0, 0.0, np.inf])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (bad_inertia, "breaks the triangle inequality"),
        (bad_placement, "is not finite"),
        (bad_armature, "armature is -1.0"),
        (bad_range, "lower limit 2.0 is above upper limit 1.0"),
        (bad_gravity, "gravity is"),
    ],
)
def test_numbers_that_no_arm_has(change, words):
    with pytest.raises(UrdfError, match=words):
        MODEL(broken(change))


def test_no_model():
    with pytest.raises(SpecError, match="it must be a Model"):
        MODEL("arm.urdf")
    with pytest.raises(UrdfError, match="has no moving joint"):
        MODEL(pin.Model())
    with pytest.raises(UrdfError, match="moves no inertia"):
        MODEL(pendulum(mass=0.0, inertia=[0.0, 0.0, 0.0])).expect_dynamics()


def test_it_has_no_geometry():
    robot = MODEL(pendulum()).with_limits(20.0, 5.0)
    with pytest.raises(ProblemError, match="was read from no URDF, so it has no geometry"):
        bodies(robot)
    with pytest.raises(ProblemError, match="a URDF has geometry; with `geometry` False the model has none"):
        ad.mujoco_model(robot)
    with pytest.raises(ProblemError, match="no geometry"):
        ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[0.5], obstacles=[ad.Sphere((1.0, 0.0, 0.0), 0.1)])
