"""robot_descriptions, as it is when installed: a package of this name that a test lays on the path."""

import sys

import pytest

import armdyn as ad
from armdyn.errors import SpecError, UnknownRobotError, UrdfError
from armdyn.models.robots.library import is_description
from models.mjcf.arms import RR

READ = ad.Robot.from_description


@pytest.fixture
def absent(monkeypatch):
    """robot_descriptions is not installed, whether it is or not."""
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)


@pytest.fixture
def package(tmp_path, monkeypatch):
    """The package with four robots, which finds their files in its own folder."""
    home = tmp_path / "robot_descriptions"
    home.mkdir()
    names = ("rr_description", "rr_mj_description", "rr_xacro_description", "far_description")
    (home / "__init__.py").write_text(f"DESCRIPTIONS = dict.fromkeys({names!r})")
    (home / "rr.urdf").write_text(ad.urdf_from_spec(ad.ArmSpec.paper("rr")))
    (home / "rr.xml").write_text(RR)
    where = f"import warnings\nREPOSITORY_PATH = {str(tmp_path)!r}\nPACKAGE_PATH = {str(home)!r}\nprint('Cloning')\n"
    where += "warnings.warn('will be another', FutureWarning)\n"
    (home / "rr_description.py").write_text(f"{where}URDF_PATH = PACKAGE_PATH + '/rr.urdf'")
    (home / "rr_mj_description.py").write_text(f"{where}MJCF_PATH = PACKAGE_PATH + '/rr.xml'")
    (home / "rr_xacro_description.py").write_text(f"{where}XACRO_PATH = PACKAGE_PATH + '/rr.xacro'")
    (home / "far_description.py").write_text("raise RuntimeError('no route to host')")
    monkeypatch.syspath_prepend(tmp_path)
    for module in [name for name in sys.modules if name.partition(".")[0] == "robot_descriptions"]:
        monkeypatch.delitem(sys.modules, module)
    yield home
    for module in [name for name in sys.modules if name.partition(".")[0] == "robot_descriptions"]:
        del sys.modules[module]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("prefix", ["", "robot_descriptions:"])
def test_urdf_and_mjcf(package, prefix, capsys):
    robot, same = READ(f"{prefix}rr_description"), READ(f"{prefix}rr_mj_description", payload=ad.Payload(mass=0.1))
    assert robot.urdf and str(package) in robot.package_dirs and robot.source == str(package / "rr.urdf")
    assert not same.urdf and same.payload.mass == 0.1
    assert READ("rr_description", lock={"joint2": 0.1}, arm=("joint1", "link2")).joint_names == ("joint1",)
    assert capsys.readouterr().out == ""  # its cloning's output is no result


def test_unsupported_requests(package):
    with pytest.raises(UrdfError, match=r"cannot provide it \(RuntimeError\('no route to host'\)\); it clones"):
        READ("far_description")
    with pytest.raises(UrdfError, match="as xacro only"):
        READ("rr_xacro_description")
    with pytest.raises(
        UnknownRobotError, match=r"no robot named 'rrr_description'; did you mean 'rr_description'\? Kn"
    ):
        READ("rrr_description")
    with pytest.raises(UnknownRobotError):
        READ("__init__")
    with pytest.raises(SpecError, match="must be text"):
        READ(None)


def test_not_installed(absent):
    with pytest.raises(UnknownRobotError, match="not installed: pip install robot_descriptions") as caught:
        READ("ur5_description")
    assert caught.value.name == "ur5_description" and caught.value.known == ()


def test_the_library_points_to_it():
    with pytest.raises(UnknownRobotError, match=r"Robot\.from_description"):
        ad.Robot.from_library("ur5_mj_description")
    with pytest.raises(UnknownRobotError) as caught:
        ad.Robot.from_library("ur5e")
    assert "description" not in str(caught.value).partition("Known")[0]


def test_names_of_robot_descriptions():
    names = ("ur5_description", "panda_mj_description", "robot_descriptions:ur5_description", "ur5")
    assert [is_description(name) for name in names] == [True, True, True, False]
