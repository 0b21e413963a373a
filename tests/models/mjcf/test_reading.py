import pytest

import armdyn as ad
from armdyn.errors import UrdfError
from armdyn.models.mjcf.reading import MAX_FILES, is_mjcf, parse_mjcf, read_mjcf
from armdyn.models.reading.urdf_xml import MAX_BYTES, MAX_ELEMENTS
from models.mjcf.arms import RR, mjcf, one

BOMB = '<!DOCTYPE m [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]><mujoco model="&b;"/>'


@pytest.fixture
def write(tmp_path):
    def to(text, name="arm.xml"):
        file = tmp_path / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
        return file

    return to


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BOMB, "DTD or entity declaration"),
        ("no XML at all", "not XML"),
        ("", "not XML"),
        ('<robot name="r"/>', "this is a URDF; use Robot.from_urdf"),
        ("<svg/>", "the root element is <svg>, not <mujoco>"),
        (f"<mujoco>{'<a/>' * (MAX_ELEMENTS + 1)}</mujoco>", "more than 200000 elements"),
        (f"<mujoco>{'<a>' * 70}{'</a>' * 70}</mujoco>", "nested deeper"),
    ],
)
def test_hostile(write, text, words):
    file = write(text)
    with pytest.raises(UrdfError, match=words) as caught:
        ad.Robot.from_mjcf(file)
    assert caught.value.source == str(file)


def test_too_large(tmp_path):
    file = tmp_path / "large.xml"
    with file.open("wb") as large:
        large.write(b"<mujoco>")
        large.truncate(MAX_BYTES + 1)
    with pytest.raises(UrdfError, match="larger than"):
        ad.Robot.from_mjcf(file)
    assert not is_mjcf(file)
    with pytest.raises(UrdfError, match="larger than"):
        ad.Robot.from_mjcf_string("<" * (MAX_BYTES + 1))


def test_included_files_stand_where_they_are_included(write):
    write(f"<mujocoinclude>{one()}<include file='parts/more.xml'/></mujocoinclude>", "body.xml")
    write("<x>" + one('<joint name="k"/>', name="c") + "</x>", "parts/more.xml")
    robot = ad.Robot.from_mjcf(write(mjcf('<include file="body.xml"/><body name="last"/>')))
    assert robot.joint_names == ("j", "k")
    root = read_mjcf(write(mjcf('<body name="first"/><include file="body.xml"/><body name="last"/>')))
    assert [body.get("name") for body in root.findall("worldbody/body")] == ["first", "b", "c", "last"]


@pytest.mark.parametrize("name", ["../secret.xml", "/etc/hostname", "link.xml", "parts/../../secret.xml"])
def test_includes_from_outside_are_refused(write, tmp_path, name):
    (tmp_path / "secret.xml").write_text("<m><body name='secret'/></m>")
    file = write(mjcf(f'<include file="{name}"/>'), "home/arm.xml")
    (file.parent / "link.xml").symlink_to(tmp_path / "secret.xml")
    with pytest.raises(UrdfError, match="is outside the folder") as caught:
        ad.Robot.from_mjcf(file)
    assert caught.value.element == f"include {name!r}" and caught.value.source == str(file)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("gone.xml", "no such file"),
        ("", "cannot be read"),
        ("bomb.xml", "DTD or entity declaration"),
        ("twice.xml", "is included twice"),
    ],
)
def test_includes_that_cannot_be_read(write, name, words):
    write(BOMB, "bomb.xml")
    write("<m><include file='twice.xml'/></m>", "twice.xml")  # it includes itself
    with pytest.raises(UrdfError, match=words):
        ad.Robot.from_mjcf(write(mjcf(f'<include file="{name}"/>')))


def test_a_text_includes_nothing():
    with pytest.raises(UrdfError, match="a text has no folder"):
        parse_mjcf('<mujoco><include file="x.xml"/></mujoco>', "text")


@pytest.mark.slow
def test_includes_are_bounded_together(write):
    for i in range(MAX_FILES + 1):
        write("<m/>", f"{i}.xml")
    many = "".join(f'<include file="{i}.xml"/>' for i in range(MAX_FILES + 1))
    with pytest.raises(UrdfError, match="includes more than 100 files"):
        read_mjcf(write(f"<mujoco>{many}</mujoco>"))
    for i in range(3):
        write(f"<m>{'<a/>' * (MAX_ELEMENTS // 2)}</m>", f"{i}.xml")
    with pytest.raises(UrdfError, match="includes counted"):
        read_mjcf(write(f"<mujoco>{many}</mujoco>"))


def test_includes_in_includes_are_no_deeper_than_one_file(write):
    deep = "<a>" * 40
    for i in range(3):
        write(f"<m>{deep}<include file='{i + 1}.xml'/>{deep.replace('<', '</')}</m>", f"{i}.xml")
    write("<m/>", "3.xml")
    with pytest.raises(UrdfError, match="nested deeper"):
        read_mjcf(write("<mujoco><include file='0.xml'/></mujoco>"))


def test_mjcf_is_recognised_by_its_root_element(write):
    assert is_mjcf(write(RR))
    assert is_mjcf(write('<?xml version="1.0"?>\n<!-- <robot> --><mujoco/>'))
    assert not is_mjcf(write('<!-- <mujoco> --><robot name="r"/>'))
    assert not is_mjcf(write("<mujocoinclude/>")) and not is_mjcf(write("<!-- " * 1_000_000))
    assert not is_mjcf(write("")) and not is_mjcf("/nowhere.xml") and not is_mjcf("/dev/zero")
