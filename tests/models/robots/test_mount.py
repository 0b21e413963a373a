"""Arms on walls and ceilings."""

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import ProblemError, SpecError
from armdyn.models.scene.bodies import bodies
from armdyn.models.values.placement import pose_of
from armdyn.show.visuals import robot_shapes
from oracles import robot_named

CEILING = pose_of([0.1, 0.2, 2.5], None, [np.pi, 0, 0], "mount")
WALL = pose_of([0.1, 0.2, 1.5], None, [0.3, np.pi / 2, -0.4], "mount")


def _gravity(robot: ad.Robot, q: np.ndarray) -> np.ndarray:
    return np.array(pin.computeGeneralizedGravity(robot.model, robot.model.createData(), q))


def test_gravity_of_an_rr_by_hand():
    spec, q = ad.ArmSpec.paper("rr"), np.array([0.3, 0.5])
    first, second = spec.links
    plain, hung = ad.Robot.from_spec(spec), ad.Robot.from_spec(spec, mount=CEILING)
    np.testing.assert_allclose(_gravity(hung, q), -_gravity(plain, q), atol=1e-12)  # rounding
    # On the wall by a turn of 90° about y the plane stays upright: what was horizontal is vertical.
    wall = ad.Robot.from_spec(spec, mount=pose_of([0, 0, 0], None, [0, np.pi / 2, 0], "mount"))
    elbow = second.mass * second.com * np.sin(0.8)
    shoulder = (first.mass * first.com + second.mass * first.length) * np.sin(0.3) + elbow
    torque = 9.81 * np.abs([shoulder, elbow])
    np.testing.assert_allclose(np.abs(_gravity(wall, q)), torque, rtol=1e-9)  # nine digits of the URDF


@pytest.mark.parametrize("mount", [CEILING, WALL])
def test_a_mounted_arm_is_the_arm_in_turned_gravity(mount):
    plain, mounted = robot_named("ur5"), ad.Robot.from_library("ur5", mount=mount)
    turned, place = plain.model.copy(), pin.SE3(mount)
    turned.gravity = pin.Motion(place.rotation.T @ plain.model.gravity.linear, np.zeros(3))
    random = np.random.default_rng(3)
    for q, v, a in random.uniform(-2, 2, (5, 3, 6)):
        expected = pin.rnea(turned, turned.createData(), q, v, a)
        np.testing.assert_allclose(
            pin.rnea(mounted.model, mounted.model.createData(), q, v, a), expected, rtol=1e-9, atol=1e-9
        )
        (turn, at), (own_turn, own_at) = (ad.Dynamics(arm).frame_placement(q, "tool0") for arm in (mounted, plain))
        np.testing.assert_allclose(np.ravel(at), place.act(np.ravel(own_at)), atol=1e-12)  # rounding
        np.testing.assert_allclose(turn, place.rotation @ own_turn, atol=1e-12)
    base = mounted.frame("base_link").placement
    assert base.isApprox(place * plain.frame("base_link").placement)
    moved, own = ([one for one in bodies(arm) if one.joint == 0] for arm in (mounted, plain))
    assert own and all(np.allclose(a.placement, mount @ b.placement) for a, b in zip(moved, own, strict=True))


def test_a_mounted_arm_is_read_again_with_a_payload_and_from_a_table(tmp_path):
    arm = ad.Robot.from_library("ur5", mount=CEILING).with_payload(ad.Payload(mass=1.0))
    assert arm.model.jointPlacements[1].isApprox(pin.SE3(CEILING) * robot_named("ur5").model.jointPlacements[1])
    problem = ad.MinimumTimeProblem(arm, q_start=[0.0] * 6, q_goal=[0.5] * 6)
    (tmp_path / "problem.toml").write_text(problem.to_toml())
    assert ad.read_problem(tmp_path / "problem.toml").robot.model_hash == arm.model_hash


def test_a_wrong_mount_is_refused():
    with pytest.raises(SpecError, match="mount is 'ceiling'; expected a position"):
        ad.Robot.from_library("ur5", mount="ceiling")
    with pytest.raises(SpecError, match="mount has an invalid rotation"):
        ad.Robot.from_library("ur5", mount=2 * np.eye(4))


@pytest.mark.slow
def test_a_motion_of_a_hanging_arm_is_clear_of_an_obstacle_in_the_world():
    arm = ad.Robot.from_library("ur5", mount=CEILING)
    q_start, q_goal = [0, -1.2, 1, 0, 0, 0], [1.5, -1.2, 1, 0, 0, 0]
    bare = ad.Dynamics(arm)
    middle = np.ravel(bare.frame_placement(np.mean([q_start, q_goal], axis=0), "tool0")[1])
    assert middle[2] < 2.5  # it hangs
    ball = ad.Sphere(middle, 0.08)
    problem = ad.MinimumTimeProblem(arm, q_start=q_start, q_goal=q_goal, obstacles=[ball])
    answer = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(search="quick"))
    assert answer.usable
    # Forward kinematics of the arm on the floor, moved by hand: the tool stays outside of the ball.
    plain = ad.Dynamics(robot_named("ur5"))
    for t in np.linspace(0, answer.duration, 300):
        at = pin.SE3(CEILING).act(np.ravel(plain.frame_placement(answer.trajectory(t).q, "tool0")[1]))
        assert np.linalg.norm(at - middle) > 0.08
    with pytest.raises(ProblemError):
        ad.MinimumTimeProblem(arm, q_start=q_start, q_goal=np.mean([q_start, q_goal], axis=0), obstacles=[ball])


def test_rods_of_an_arm_without_geometry_begin_at_its_base():
    model = robot_named("ur5").model
    plain, hung = (robot_shapes(ad.Robot.from_model(model, mount=mount)) for mount in (None, CEILING))
    assert len(plain) == len(hung)
    for one, other in zip(plain, hung, strict=True):
        place = CEILING if one.joint == 0 else np.eye(4)
        np.testing.assert_allclose(other.placement[:3, 3], (place @ one.placement)[:3, 3], atol=1e-9)  # rounding
