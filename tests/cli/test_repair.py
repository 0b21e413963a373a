"""`armdyn doctor --repair`."""

import re

import armdyn as ad
from cli.command import run_here, run_json

RR = ad.Robot.from_spec(ad.ArmSpec.paper("rr")).urdf
INERTIA = '<inertia ixx="{}" ixy="0" ixz="0" iyy="0.4" iyz="0" izz="0.3"/>'
BROKEN, LOST = (re.sub(r"<inertia [^>]*>", INERTIA.format(ixx), RR, count=1) for ixx in ("0.9", "300"))
"""A moment too large by a third, which is repaired; one that lost its decimal point, which is offered."""


def test_nothing_is_written_unless_a_file_is_named(tmp_path):
    (tmp_path / "arm.urdf").write_text(BROKEN)
    data = run_json("doctor", "arm.urdf", "--repair", cwd=tmp_path)
    assert (data["status"], data["files"], data["inertias"][0]["link"]) == ("repairable", [], "link1")
    assert data["inertias"][0]["moments_before"][-1] == 0.9
    assert [each.name for each in tmp_path.iterdir()] == ["arm.urdf"]


def test_the_repaired_model_is_marked_in_results(tmp_path):
    (tmp_path / "arm.urdf").write_text(BROKEN)
    remedy = run_json("doctor", "arm.urdf", code=2, cwd=tmp_path)["message"].splitlines()[-1]
    assert remedy == "armdyn doctor arm.urdf --repair --out arm-repaired.urdf"
    data = run_json("doctor", "arm.urdf", "--repair", "--out", "mended.urdf", cwd=tmp_path)
    assert data["files"] == ["mended.urdf"] and (tmp_path / "arm.urdf").read_text() == BROKEN
    read = run_json("doctor", "mended.urdf", cwd=tmp_path)
    assert read["robot"] == "rr (repaired model)" and "repaired model" in read["remarks"][0]
    poses = ["--q-start", "0,0", "--q-goal", "0.2,0"]
    moved = run_json("bound", "mended.urdf", *poses, cwd=tmp_path)
    assert moved["robot"] == "rr (repaired model)"
    assert "repaired model" in run_here("bound", "mended.urdf", *poses, cwd=tmp_path).stdout


def test_the_file_itself_is_never_written(tmp_path):
    (tmp_path / "arm.urdf").write_text(BROKEN)
    (tmp_path / "same.urdf").symlink_to("arm.urdf")
    for name in ("arm.urdf", "same.urdf"):
        data = run_json("doctor", "arm.urdf", "--repair", "--out", name, code=2, cwd=tmp_path)
        assert "the URDF itself" in data["message"]
    assert (tmp_path / "arm.urdf").read_text() == BROKEN


def test_only_urdfs_are_repaired(tmp_path):
    assert "none" in run_json("doctor", "rr", "--repair", code=2)["message"]
    assert "name the file" in run_json("doctor", "--repair", code=2)["message"]
    assert "--repair" in run_json("doctor", "ur5", "--out", tmp_path / "x.urdf", code=2)["message"]


def test_a_physical_library_arm():
    data = run_json("doctor", "panda", "--repair")
    assert (data["status"], data["tip"], data["lock"]) == ("physical", "panda_hand_tcp", {"panda_finger_joint1": 0.0})
    said = run_here("doctor", "panda", "--repair").stdout
    assert "joints of a gripper, or that others mimic: --lock panda_finger_joint1=0" in " ".join(said.split())


def test_remaining_refusals(tmp_path):
    massless = re.sub(r'<mass value="[^"]*"', '<mass value="0"', re.sub(r'i([xyz]{2})="[^"]*"', r'i\1="0"', RR))
    (tmp_path / "arm.urdf").write_text(massless)
    data = run_json("doctor", "arm.urdf", "--repair", cwd=tmp_path)
    assert data["status"] == "no_inertias" and data["without_mass"] == ["link1", "link2"]
    said = run_here("doctor", "arm.urdf", "--repair", cwd=tmp_path).stdout
    assert "physical" not in said and said.count("link1") == 1


def test_a_lost_decimal_point_is_offered_and_not_written(tmp_path):
    (tmp_path / "arm.urdf").write_text(LOST)
    data = run_json("doctor", "arm.urdf", "--repair", "--out", "mended.urdf", code=3, cwd=tmp_path)
    assert data["status"] == "refused" and data["unwritten"] == ["link1"] and not (tmp_path / "mended.urdf").exists()
    said = " ".join(run_here("doctor", "arm.urdf", "--repair", cwd=tmp_path).stdout.split())
    assert "ixx = 0.3 alone is physical" in said and "--large nearest" in said
    options = ("--repair", "--large", "power-of-ten", "--out", "mended.urdf")
    assert run_json("doctor", "arm.urdf", *options, cwd=tmp_path)["files"] == ["mended.urdf"]
    assert 'ixx="0.3' in (tmp_path / "mended.urdf").read_text()
    assert "--large belongs to --repair" in run_json("doctor", "rr", "--large", "nearest", code=2)["message"]


def test_density(tmp_path):
    shape = '<visual><geometry><sphere radius="0.1"/></geometry></visual>'
    bare = re.sub(r"<visual .*?</visual>", "", RR, flags=re.DOTALL)
    (tmp_path / "arm.urdf").write_text(re.sub(r"<inertial>.*?</inertial>", shape, bare, flags=re.DOTALL))
    data = run_json("doctor", "arm.urdf", "--repair", "--density", "2700", "--out", "mended.urdf", cwd=tmp_path)
    assert data["status"] == "repairable" and [one["shapes"] for one in data["estimates"]] == ["visual: sphere"] * 2
    assert run_json("doctor", "mended.urdf", cwd=tmp_path)["dynamics_error"] < 1e-10
