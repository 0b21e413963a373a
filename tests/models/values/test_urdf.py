import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest

from armdyn.models import PLANAR_ARMS, ArmSpec, LinkSpec, Payload, urdf_from_spec
from armdyn.models.reading.urdf_check import parse_urdf
from armdyn.paper.printed.examples import PAYLOADS
from scripts_of import script

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module", name="script")
def generate_urdfs():
    return script("generate_urdfs")


def test_urdf_folder_is_written_by_the_script(script):
    files = script.contents()
    assert len(files) == len(PLANAR_ARMS) * (1 + len(PAYLOADS))
    assert {"r.urdf", "rr_100.6g.urdf", "rrr_21.2g.urdf", "r_1000g.urdf"} <= set(files)
    assert script.differing(ROOT / "urdf", files) == []


def test_check_names_the_differences(script, tmp_path, monkeypatch, capsys):
    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["generate_urdfs.py", "--folder", str(tmp_path), *arguments])
        return script.main()

    assert run() == 0
    assert run("--check") == 0
    (tmp_path / "rr.urdf").write_text("<robot/>")
    (tmp_path / "r.urdf").unlink()
    (tmp_path / "left_over.urdf").touch()
    assert run("--check") == 1
    named = [Path(line).name for line in capsys.readouterr().err.splitlines()]
    assert named == ["left_over.urdf", "r.urdf", "rr.urdf"]


def test_same_input_same_text():
    spec = ArmSpec.paper("rrr")
    assert urdf_from_spec(spec, Payload(mass=0.1)) == urdf_from_spec(spec, Payload(mass=0.1))


def test_the_first_arm_of_a_process_comes_from_the_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("ARMDYN_CACHE", str(tmp_path))
    spec, payload = ArmSpec.paper("rr"), Payload(mass=0.1)
    text = urdf_from_spec(spec, payload)
    for imported in (True, False):
        monkeypatch.delitem(sys.modules, "yourdfpy", raising=False)
        assert urdf_from_spec(spec, payload) == text
        assert ("yourdfpy" in sys.modules) is imported
    assert urdf_from_spec(spec, Payload(mass=0.2)) != text


def test_text_passes_the_check_and_has_no_negative_zero():
    for arm in PLANAR_ARMS:
        text = urdf_from_spec(ArmSpec.paper(arm), Payload(mass=0.1))
        parse_urdf(text, arm)
        assert "-0.0 " not in text
        assert '-0.0"' not in text


def test_payload_is_a_link_of_its_own():
    spec = ArmSpec.paper("rr")
    payload = Payload(mass=0.3, com=(0.01, 0.02, 0.03), inertia=(1e-4, 2e-4, 2.5e-4))
    root = ElementTree.fromstring(urdf_from_spec(spec, payload))
    inertial = root.find("link[@name='payload']/inertial")
    assert float(inertial.find("mass").get("value")) == 0.3
    assert [float(inertial.find("inertia").get(key)) for key in ("ixx", "iyy", "izz")] == [1e-4, 2e-4, 2.5e-4]
    joint = root.find("joint[@name='payload_joint']")
    assert joint.get("type") == "fixed"
    assert joint.find("parent").get("link") == "tip"
    assert [float(x) for x in joint.find("origin").get("xyz").split()] == [0.01, 0.02, 0.03]


@pytest.mark.parametrize("mass", [1e-9, 1e-6, 0.1])
def test_a_payload_without_size_is_a_point_at_any_mass(mass):
    link = LinkSpec(length=1e-3, com=5e-4, mass=1e-6, inertia=1e-13)
    spec = ArmSpec(name="tiny", links=(link,))
    model = pin.buildModelFromXML(urdf_from_spec(spec, Payload(mass=mass)))
    about = pin.crba(model, model.createData(), np.zeros(1))[0, 0]
    assert about == pytest.approx(1e-13 + 1e-6 * 5e-4**2 + mass * 1e-3**2, rel=2e-3, abs=0)


@pytest.mark.parametrize("payload", [None, Payload(mass=0.0)])
def test_no_payload_no_link(payload):
    root = ElementTree.fromstring(urdf_from_spec(ArmSpec.paper("rr"), payload))
    assert [link.get("name") for link in root.findall("link")] == ["base", "link1", "link2", "tip"]


def test_numbers_round_trip():
    """Numbers with all seventeen digits come back to the last bit: nothing is rounded on the way."""
    rng = np.random.default_rng(3)
    links = tuple(LinkSpec(length=a, com=b, mass=c, inertia=d) for a, b, c, d in rng.uniform(0.1, 1, (4, 4)))
    spec = ArmSpec(name="random", links=links, position_limit=2.1, velocity_limit=7.7, effort_limit=1 / 3)
    root = ElementTree.fromstring(urdf_from_spec(spec))
    for i, link in enumerate(links, start=1):
        inertial = root.find(f"link[@name='link{i}']/inertial")
        assert float(inertial.find("mass").get("value")) == link.mass
        assert float(inertial.find("inertia").get("iyy")) == link.inertia
        # Poses are rounded to 1e-12 m, or rotations would carry 6e-17s into the file.
        assert float(inertial.find("origin").get("xyz").split()[0]) == pytest.approx(link.com, abs=1e-12)
        limit = root.find(f"joint[@name='joint{i}']/limit")
        read = [float(limit.get(key)) for key in ("lower", "upper", "velocity", "effort")]
        assert read == [-2.1, 2.1, 7.7, 1 / 3]


def test_geometry_reads_back():
    spec = ArmSpec.paper("rrr")
    model = pin.buildModelFromXML(urdf_from_spec(spec))
    data = model.createData()
    tip = model.getFrameId("tip")
    pin.framesForwardKinematics(model, data, np.zeros(3))
    reach = sum(link.length for link in spec.links)
    # A sum of three rounded lengths.
    assert np.allclose(data.oMf[tip].translation, [reach, 0, 0], atol=1e-15)
    pin.framesForwardKinematics(model, data, np.array([np.pi / 2, 0, 0]))
    assert np.allclose(data.oMf[tip].translation, [0, 0, reach], atol=1e-15)  # positive turns up


@pytest.mark.parametrize("name", ["a & b", "<arm>", 'say "arm"', "Ärmchen"])
def test_any_name_is_escaped(name):
    text = urdf_from_spec(ArmSpec(name=name, links=ArmSpec.paper("r").links))
    assert ElementTree.fromstring(text).get("name") == name
