import numpy as np
import pytest

from armdyn.errors import SpecError, UrdfError
from armdyn.models import ArmSpec, JointFriction, Robot
from oracles import joint, link, robot_named, two_links, urdf


def dynamics(damping, friction):
    return (
        '<axis xyz="0 -1 0"/><limit lower="-1" upper="1" effort="2" velocity="3"/>'
        f'<dynamics damping="{damping}" friction="{friction}"/>'
    )


def two_joints(folder):
    path = folder / "arm.urdf"
    joints = [joint(f"j{i}", *ends, inside=dynamics(i, i / 10)) for i, ends in ((1, ("base", "a")), (2, ("a", "b")))]
    path.write_text(urdf('<link name="base"/>', link("a"), link("b"), *joints))
    return path


def test_torque_opposes_the_velocity_and_saturates():
    friction = JointFriction(damping=(2.0, 0.0), coulomb=(0.0, 3.0), width=0.1)
    v = np.array([[0.5, 10.0], [-0.5, -10.0], [0.0, 0.0]])
    # tanh(100) is 1 to the last digit.
    assert np.array_equal(friction.torque(v), [[1.0, 3.0], [-1.0, -3.0], [0.0, 0.0]])
    step = 1e-6
    # The slope is a central difference to O(step²/width²) = 1e-10.
    assert friction.torque(np.full(2, step)) / step == pytest.approx(friction.slope(np.zeros(2)), rel=1e-9)
    assert np.array_equal(friction.slope(np.zeros(2)), [2.0, 30.0])
    assert np.array_equal(friction.slope(np.array([0.0, 50.0])), [2.0, 0.0])


def test_one_number_is_for_every_joint():
    friction = JointFriction(damping=2.0)
    assert np.array_equal(friction.torque(np.array([1.0, -2.0])), [2.0, -4.0])
    assert friction.present
    assert not JointFriction().present


@pytest.mark.parametrize(
    "wrong", [{"damping": -1}, {"coulomb": [1, np.nan]}, {"damping": np.inf}, {"width": 0.0}, {"width": [0.1, np.nan]}]
)
def test_a_wrong_friction_is_refused(wrong):
    with pytest.raises(SpecError, match=next(iter(wrong))):
        JointFriction(**wrong)


def test_a_urdf_is_taken_at_its_word(tmp_path):
    friction = Robot.from_urdf(two_joints(tmp_path)).friction
    assert np.array_equal(friction.damping, [1, 2])
    assert np.array_equal(friction.coulomb, [0.1, 0.2])


def test_arguments_override_the_urdf(tmp_path):
    path = two_joints(tmp_path)
    none = Robot.from_urdf(path, damping=0, friction=0)
    assert not none.friction.present
    friction = Robot.from_urdf(path, damping=[3, 4], friction_width=0.2).friction
    assert np.array_equal(friction.damping, [3, 4])
    assert np.array_equal(friction.coulomb, [0.1, 0.2])
    assert friction.width == 0.2
    again = none.with_friction(friction="urdf").friction
    assert np.array_equal(again.damping, [0, 0])
    assert np.array_equal(again.coulomb, [0.1, 0.2])


def test_locked_joints_take_their_friction_with_them(tmp_path):
    friction = Robot.from_urdf(two_joints(tmp_path), lock={"j1": 0.5}).friction
    assert (friction.damping.tolist(), friction.coulomb.tolist()) == ([2.0], [0.2])


def test_the_librarys_placeholders_are_taken_only_on_request():
    assert not robot_named("z1").friction.present
    friction = Robot.from_library("z1", damping="urdf", friction="urdf").friction
    assert np.array_equal(friction.damping, [1, 2, 1, 1, 1, 1])
    assert np.array_equal(friction.coulomb, [1, 2, 1, 1, 1, 1])


def test_refusals_name_the_joint(file):
    path = file(two_links(joint=joint("shoulder", "base", "arm", inside=dynamics(-0.5, 0))))
    with pytest.raises(UrdfError, match=r"shoulder.*damping is -0\.5"):
        Robot.from_urdf(path)
    arm = Robot.from_spec(ArmSpec.paper("rr"))
    with pytest.raises(SpecError, match="friction has shape"):
        arm.with_friction(friction=[1, 2, 3])
    with pytest.raises(SpecError, match='numbers or "urdf"'):
        arm.with_friction(damping="file")
    with pytest.raises(SpecError, match="must be finite"):
        arm.with_friction(damping=np.inf)
