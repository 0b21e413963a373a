"""Repairs of a URDF: nearest inertias against brute force, and packages found around the file."""

import re

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize

import armdyn as ad
from armdyn.errors import SpecError, UrdfError
from armdyn.models.reading.nearest_inertia import THINNEST, InertiaRepair, nearest_physical, second_moments
from armdyn.models.reading.urdf_check import inertia_fault

RR = ad.Robot.from_spec(ad.ArmSpec.paper("rr")).urdf
TAG = re.search(r"<inertia [^>]*>", RR)[0]
BROKEN = '<inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="9e-4"/>'


def written(folder, text, name="arm.urdf"):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text)
    return folder / name


@pytest.mark.parametrize("seed", range(5))
def test_nothing_physical_is_nearer(seed):
    """The clipped tensor against a search over L Lᵀ, which every second moment of a body is."""
    random = np.random.default_rng(seed)
    turn, mass = np.linalg.qr(random.normal(size=(3, 3)))[0], 2.0
    tensor = turn @ np.diag(random.uniform(-0.2, 1.0, 3)) @ turn.T
    nearest = nearest_physical(mass, tensor)

    def distance(lower):
        root = np.zeros((3, 3))
        root[np.tril_indices(3)] = lower
        return np.sum((root @ root.T + mass * THINNEST**2 * np.eye(3) - second_moments(tensor)) ** 2)

    best = min(minimize(distance, random.normal(size=6), tol=1e-14).fun for _ in range(3))
    own = np.sum((second_moments(nearest) - second_moments(tensor)) ** 2)
    assert own <= best * (1 + 1e-6) + 1e-12
    assert not inertia_fault(nearest)
    assert np.linalg.eigvalsh(second_moments(nearest))[0] >= 0.999 * mass * THINNEST**2


def test_physical_inertias_stay():
    tensor = np.diag([1.0, 2.0, 2.5])
    np.testing.assert_allclose(nearest_physical(1.0, tensor), tensor, atol=1e-15)


def test_only_the_numbers_and_the_mark_change(tmp_path):
    text = "<!-- kept: <inertia> -->\n" + RR.replace(TAG, BROKEN, 1)
    file = written(tmp_path, text)
    with pytest.raises(
        UrdfError,
        match=r"triangle inequality.*; to mend: ad.Robot.from_urdf_string\(ad.repair_urdf\('.*arm.urdf'\).text\)$",
    ):
        ad.Robot.from_urdf(file)
    found = ad.repair_urdf(file)
    (repair,) = found.inertias
    assert repair.fault.startswith("inertia breaks the triangle inequality") and 0 < repair.change < 1
    kept = re.sub(r"\n  <armdyn [^>]*>", "", found.text)
    assert kept.partition(TAG.split()[0])[0] == text.partition(TAG.split()[0])[0]
    before, after = (re.sub(r"<inertia [^>]*>", "", each) for each in (text, kept))
    assert before == after
    assert file.read_text() == text
    assert not ad.repair_urdf(written(tmp_path, found.text, "mended.urdf")).inertias


def test_results_of_a_repaired_model_are_marked(tmp_path):
    found = ad.repair_urdf(written(tmp_path, RR.replace(TAG, BROKEN, 1)))
    robot = ad.Robot.from_urdf_string(found.text)
    assert robot.name == "rr (repaired model)" and robot.repaired == "link1"
    assert ad.Robot.from_urdf_string(RR).repaired == ""
    np.testing.assert_allclose(robot.model.inertias[1].mass, ad.Robot.from_urdf_string(RR).model.inertias[1].mass)
    problem = ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[0.1, 0])
    assert "repaired model" in repr(problem) and "repaired model" in robot.with_payload(None).name
    motion = ad.ramp(robot, [0, 0], [1, 1], 1.0)
    solution, run = ad.solve_minimum_time(problem), ad.track(robot, motion)
    names = [one.name for one in (motion, solution.trajectory, solution.trajectory.resample(100), run.trajectory)]
    assert all(name.endswith(" (repaired model)") and name.count("repaired") == 1 for name in names)
    assert "repaired" not in ad.ramp(ad.Robot.from_urdf_string(RR), [0, 0], [1, 1], 1.0).name


def test_hostile_names_stay_names(tmp_path):
    text = RR.replace(TAG, BROKEN, 1).replace('"link1"', '"a&quot;/>&lt;x y=&apos;"')
    found = ad.repair_urdf(written(tmp_path, text))
    assert ad.Robot.from_urdf_string(found.text).repaired == "a\"/><x y='"


def test_massless_links_and_point_masses_stay(tmp_path):
    zero = '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="1e-16"/>'
    assert not ad.repair_urdf(written(tmp_path, RR.replace(TAG, zero, 1))).inertias


def test_a_gripper_is_locked_and_the_tip_is_found():
    panda = ad.Robot.from_library("panda")
    found = ad.repair_urdf(panda.source)
    assert found.lock == {"panda_finger_joint1": 0.0} and found.arm is None and found.tip == "panda_hand_tcp"
    assert found.tip == panda.tip and not found.refusal and not found.without_effort


def test_of_several_chains_the_longest():
    found = ad.repair_urdf(ad.Robot.from_library("talos", arm=("torso_2_joint", "gripper_left_base_link")).source)
    assert found.arm == ("torso_1_joint", "arm_left_7_joint") and set(found.lock) == {
        "gripper_left_joint", "gripper_right_joint",
    }  # fmt: skip
    assert ad.Robot.from_urdf(found.source, lock=found.lock, arm=found.arm).tip == found.tip


def test_missing_limits_come_with_the_torque_that_holds_the_arm(tmp_path):
    text = re.sub(r'effort="[^"]*" velocity="[^"]*"', 'effort="0" velocity="0"', RR)
    found = ad.repair_urdf(written(tmp_path, text))
    robot = ad.Robot.from_urdf_string(RR)
    assert found.without_velocity == robot.joint_names
    lying = np.abs(pin.computeGeneralizedGravity(robot.model, robot.model.createData(), np.zeros(2)))
    assert lying[0] * 0.95 < found.without_effort["joint1"] <= lying[0] * (1 + 1e-9) or lying[0] == 0


def meshed(name):
    return RR.replace("</inertial>", f'</inertial><visual><geometry><mesh filename="{name}"/></geometry></visual>', 1)


def test_packages_are_found_above_the_file(tmp_path):
    folder = tmp_path / "ws" / "src" / "my_arm_description"
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / "a.stl").write_text("solid")
    file = written(folder / "urdf", meshed("package://my_arm_description/meshes/a.stl"))
    assert ad.repair_urdf(file).packages == {"my_arm_description": str(folder)}
    elsewhere = written(tmp_path / "other", meshed("package://my_arm_description/meshes/a.stl"))
    assert ad.repair_urdf(elsewhere).packages == {"my_arm_description": None}
    assert ad.repair_urdf(elsewhere, package_dirs=[folder]).packages == {"my_arm_description": str(folder)}


@pytest.mark.parametrize(
    "name", ["package://../secret.stl", "package://arm/../../secret.stl", "package://arm/link.stl"]
)
def test_packages_that_lead_out_of_their_folder_are_none(tmp_path, name):
    (tmp_path / "secret.stl").write_text("solid")
    home = tmp_path / "a" / "b" / "c" / "d" / "e" / "f" / "g" / "h"
    (home / "arm").mkdir(parents=True)
    (home / "arm" / "link.stl").symlink_to(tmp_path / "secret.stl")
    assert set(ad.repair_urdf(written(home, meshed(name))).packages.values()) <= {None}


def test_arms_that_no_number_repairs_are_refused(tmp_path):
    with pytest.raises(UrdfError, match="mass is -1"):
        ad.repair_urdf(written(tmp_path, re.sub(r'<mass value="[^"]*"', '<mass value="-1"', RR, count=1)))
    massless = re.sub(r'<mass value="[^"]*"', '<mass value="0"', re.sub(r'i([xyz]{2})="[^"]*"', r'i\1="0"', RR))
    found = ad.repair_urdf(written(tmp_path, massless))
    assert found.without_mass == ("link1", "link2") and not found.refusal and not found.inertias


LOST = '<inertia ixx="0.0027" ixy="0" ixz="0" iyy="0.0023" iyz="0" izz="1.7"/>'
"""Of 1.6 kg, with izz = 1.7e-3 meant."""


def test_large_repairs_are_written_on_request_only(tmp_path):
    file = written(tmp_path, RR.replace(TAG, LOST, 1))
    found = ad.repair_urdf(file)
    (repair,) = found.inertias
    assert repair.large and found.unwritten == ("link1",) and found.text == file.read_text()
    assert "triangle inequality" in found.refusal and "radius of gyration" in found.refusal
    key, tensor = repair.power_of_ten
    assert key == "izz" and np.diag(tensor) == pytest.approx([0.0027, 0.0023, 0.0017])
    for large, moments in (("nearest", (0.85, 0.85, 1.7)), ("power-of-ten", (0.0017, 0.0023, 0.0027))):
        text = ad.repair_urdf(file, large=large).text
        own = ad.repair_urdf(written(tmp_path, text, f"{large}.urdf"))
        assert not own.inertias and ad.Robot.from_urdf_string(text).repaired == "link1"
        robot = ad.Robot.from_urdf_string(text)
        assert np.linalg.eigvalsh(robot.model.inertias[1].inertia) == pytest.approx(moments, rel=1e-3)
    with pytest.raises(SpecError, match="large is 'all'"):
        ad.repair_urdf(file, large="all")


@pytest.mark.parametrize("key", ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"])
@pytest.mark.parametrize("power", [3, 6])
def test_one_entry_off_by_a_power_of_ten_is_found(key, power):
    """Every entry of a physical tensor whose moments are apart by less than ten."""
    tensor = np.array([[3.0, 0.4, -0.3], [0.4, 2.5, 0.2], [-0.3, 0.2, 2.0]]) * 1e-3
    i, j = ("xyz".index(axis) for axis in key[1:])
    wrong = tensor.copy()
    wrong[i, j] = wrong[j, i] = tensor[i, j] * 10.0**power
    repair = InertiaRepair(link="a", fault="", mass=1.0, before=wrong, after=nearest_physical(1.0, wrong))
    assert inertia_fault(wrong) and repair.large
    found, mended = repair.power_of_ten
    assert found == key and not inertia_fault(mended)
    assert -1e-9 <= np.log10(abs(mended[i, j] / tensor[i, j])) <= power - 1 + 1e-9  # the least power that is physical


def test_small_repairs_are_written(tmp_path):
    found = ad.repair_urdf(written(tmp_path, RR.replace(TAG, BROKEN, 1)))
    assert not found.inertias[0].large and not found.unwritten


SHAPES = {
    "link1": '<collision><origin xyz="0 0 0.1"/><geometry><box size="0.1 0.2 0.3"/></geometry></collision>',
    "link2": '<visual><geometry><mesh filename="ball.stl"/></geometry></visual>',
}


def bare_arm(folder, inertial=""):
    """The RR arm whose links have shapes in the place of inertias; one is a ball of 0.1 m."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    folder.mkdir(exist_ok=True)
    ball.export(folder / "ball.stl")
    ball.update_faces(np.arange(len(ball.faces)) > 0)  # open: no watertight one
    ball.export(folder / "open.stl")
    text = re.sub(r"<inertial>.*?</inertial>", inertial, RR, flags=re.DOTALL)
    text = re.sub(r"<visual .*?</visual>", "", text, flags=re.DOTALL)
    for name, shape in SHAPES.items():
        text = text.replace(f'<link name="{name}">', f'<link name="{name}">{shape}')
    return text


def test_inertias_from_shapes_and_a_density(tmp_path):
    """A box in closed form, and a ball's mesh of 5,120 faces, whose volume is 0.2 % smaller than a ball's."""
    zero = '<inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    for text in (bare_arm(tmp_path), bare_arm(tmp_path, zero), bare_arm(tmp_path).replace("ball", "open")):
        found = ad.repair_urdf(written(tmp_path, text), density=1000.0)
        box, ball = found.estimates
        assert (box.link, box.shapes) == ("link1", "collision: box")
        assert ball.shapes == f"visual: mesh, {'convex hull' if 'open' in text else 'watertight'}"
        assert box.mass == pytest.approx(6.0) and box.com == pytest.approx([0, 0, 0.1])
        assert box.moments == pytest.approx([6 * 0.05 / 12, 6 * 0.1 / 12, 6 * 0.13 / 12])
        assert ball.mass == pytest.approx(4 / 3 * np.pi, rel=3e-3)
        assert ball.moments == pytest.approx(3 * [0.4 * ball.mass * 0.01], rel=3e-3)
        robot = ad.Robot.from_urdf_string(found.text)
        assert robot.has_dynamics and robot.repaired == "link1, link2" and found.text.count("<inertial>") == 2
        assert robot.model.inertias[1].mass == pytest.approx(6.0) and not found.without_mass


def test_links_without_shapes_stay_without_mass(tmp_path):
    text = bare_arm(tmp_path).replace(SHAPES["link2"], "")
    found = ad.repair_urdf(written(tmp_path, text), density=1000.0)
    assert [one.link for one in found.estimates] == ["link1"] and found.without_mass == ("link2",)
    with pytest.raises(SpecError, match="density is 0"):
        ad.repair_urdf(written(tmp_path, text), density=0)


def test_a_missing_mesh_is_named(tmp_path):
    found = ad.repair_urdf(written(tmp_path, bare_arm(tmp_path).replace("ball.stl", "gone.stl")), density=1000.0)
    assert "link 'link2': no mesh 'gone.stl'" in found.refusal and not found.estimates
