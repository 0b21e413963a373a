import os
import time

import numpy as np
import pytest

from armdyn.errors import ArmdynError, UnsupportedJointError, UrdfError
from armdyn.models import Robot
from armdyn.models.reading.urdf_check import MAX_LINKS, MAX_MOVING, parse_urdf
from armdyn.models.reading.urdf_xml import MAX_BYTES, MAX_DEPTH, MAX_ELEMENTS, read_urdf
from oracles import INERTIAL, LIMIT, joint, link, two_links, urdf

BASE = '<link name="base"/>'


def inertial(mass="1", moments=("0.01", "0.02", "0.02"), products="0"):
    ixx, iyy, izz = moments
    return (
        f'<inertial><mass value="{mass}"/><inertia ixx="{ixx}" ixy="{products}" ixz="0" iyy="{iyy}" '
        f'iyz="0" izz="{izz}"/></inertial>'
    )


def heavy(**changes):
    return two_links(link=link("arm", inertial(**changes)))


def jointed(kind="revolute", inside=LIMIT):
    return two_links(joint=joint("shoulder", "base", "arm", kind, inside))


# Fault, text, element that must be named, words of the message.
BAD = {
    "empty": ("", None, "not XML"),
    "not XML": ("hello", None, "not XML"),
    "cut off": (two_links()[:-20], None, "not XML"),
    "merge conflict": ("<<<<<<< HEAD\n" + two_links(), None, "git's conflict marker '<<<<<<< HEAD' in line 1"),
    "rest of a merge": (two_links().replace("</robot>", "\n>>>>>>> arm\n</robot>"), None, "'>>>>>>> arm' in line 2"),
    "no URDF": ("<html/>", None, "no URDF"),
    "no link": ("<robot name='x'/>", None, "no <link>"),
    "nameless link": (urdf("<link/>"), None, "no name"),
    "joint without limits": (jointed(inside=""), "joint 'shoulder'", "needs <limit"),
    "prismatic without limits": (jointed("prismatic", ""), "joint 'shoulder'", "needs <limit"),
    "negative effort": (
        jointed(inside='<limit effort="-1" velocity="3"/>'),
        "joint 'shoulder'",
        "must not be negative",
    ),
    "NaN effort": (jointed(inside='<limit effort="nan" velocity="3"/>'), "joint 'shoulder'", "not a finite number"),
    "lower above upper": (
        jointed(inside='<limit lower="2" upper="1" effort="1" velocity="1"/>'),
        "joint 'shoulder'",
        "lower limit 2.0 is above upper limit 1.0",
    ),
    "limit in words": (
        jointed(inside='<limit lower="none" upper="1" effort="1" velocity="1"/>'),
        "joint 'shoulder'",
        "not a finite number",
    ),
    "zero axis": (jointed(inside=f'<axis xyz="0 0 0"/>{LIMIT}'), "joint 'shoulder'", "axis is zero"),
    "short axis": (jointed(inside=f'<axis xyz="0 1"/>{LIMIT}'), "joint 'shoulder'", "not 3 finite numbers"),
    "NaN origin": (jointed(inside=f'<origin xyz="0 nan 0"/>{LIMIT}'), "joint 'shoulder'", "not 3 finite numbers"),
    "endless axis": (jointed(inside=f'<axis xyz="0 1e8 0"/>{LIMIT}'), "joint 'shoulder'", "its length should be 1"),
    "tiny axis": (jointed(inside=f'<axis xyz="0 1e-200 0"/>{LIMIT}'), "joint 'shoulder'", "its length should be 1"),
    "NaN damping": (jointed(inside=f'{LIMIT}<dynamics damping="nan"/>'), "joint 'shoulder'", "not a finite number"),
    "negative friction": (
        jointed(inside=f'{LIMIT}<dynamics friction="-1"/>'),
        "joint 'shoulder'",
        "friction is -1.0; it must not be negative",
    ),
    "Python's digits": (
        jointed(inside='<limit effort="1_0" velocity="3"/>'),
        "joint 'shoulder'",
        "not a finite number",
    ),
    "other digits": (heavy(mass="١"), "link 'arm'", "not a finite number"),
    "two numbers for one": (heavy(mass="1 2"), "link 'arm'", "not a finite number"),
    "too large for a double": (heavy(mass="1e400"), "link 'arm'", "not a finite number"),
    "a mass beyond measure": (heavy(mass="1e10"), "link 'arm'", "<mass> value='1e10' is beyond 1e+09"),
    "moments beyond measure": (heavy(moments=("1e308",) * 3), "link 'arm'", "is beyond 1e+09"),
    "a length beyond measure": (
        jointed(inside=f'<origin xyz="0 1e300 0"/>{LIMIT}'),
        "joint 'shoulder'",
        "<origin> xyz='0 1e300 0' is beyond 1e+09",
    ),
    "nameless robot": (two_links().replace('name="test"', ""), None, "<robot> has no name"),
    "xacro number": (heavy(mass="${m}"), None, "<mass value='${m}'> is xacro that was not expanded"),
    "xacro substitution": (heavy(mass="$(arg m)"), None, "is xacro that was not expanded"),
    "xacro macro": (
        two_links()
        .replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
        .replace("<joint", '<xacro:property name="m" value="1"/><joint', 1),
        None,
        "<xacro:property> is xacro",
    ),
    "xacro without its namespace": (two_links().replace("<joint", "<xacro:arm/><joint", 1), None, "is xacro"),
    "negative mass": (heavy(mass="-1"), "link 'arm'", "mass is -1.0 kg"),
    "NaN mass": (heavy(mass="nan"), "link 'arm'", "not a finite number"),
    "infinite mass": (heavy(mass="inf"), "link 'arm'", "not a finite number"),
    "no mass": (two_links(link=link("arm", "<inertial/>")), "link 'arm'", "lacks the element"),
    "negative moment": (heavy(moments=("-0.01", "0.02", "0.02")), "link 'arm'", "not positive definite"),
    "large product": (heavy(products="0.5"), "link 'arm'", "not positive definite"),
    "triangle": (heavy(moments=("0.01", "0.01", "0.05")), "link 'arm'", "triangle inequality"),
    "two roots": (urdf(BASE, link("arm"), link("other"), joint("j", "base", "arm")), None, "2 roots"),
    "two links without joint": (urdf(BASE, link("arm")), None, "2 roots"),
    "cycle": (urdf(link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")), None, "cycle"),
    "cycle beside a tree": (
        urdf(BASE, link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")),
        None,
        "cycle through a, b",
    ),
    "two parents": (
        urdf(BASE, link("a"), link("b"), joint("i", "base", "a"), joint("j", "base", "b"), joint("k", "a", "b")),
        "joint 'k'",
        "child of two joints",
    ),
    "duplicate link": (urdf(BASE, BASE), "link 'base'", "defined twice"),
    "duplicate joint": (
        urdf(BASE, link("a"), link("b"), joint("j", "base", "a"), joint("j", "a", "b")),
        "joint 'j'",
        "defined twice",
    ),
    "dangling joint": (urdf(BASE, joint("j", "base", "ghost")), "joint 'j'", "'ghost' does not exist"),
    "DTD": ('<!DOCTYPE robot [<!ELEMENT robot ANY>]><robot name="x"/>', None, "DTD"),
    "outside entity": (
        '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/hostname">]><robot name="x">&x;</robot>',
        None,
        "DTD",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_urdf_is_named(case, file):
    text, element, words = BAD[case]
    path = file(text)
    with pytest.raises(UrdfError) as caught:
        Robot.from_urdf(path)
    error = caught.value
    assert error.source == str(path)
    assert error.element == element
    assert str(error).startswith(str(path))
    assert element is None or element in str(error)
    assert words in str(error)
    assert isinstance(error, ArmdynError)


def test_missing_limits_of_torque_and_velocity_are_not_known(read):
    limits = read(jointed(inside='<limit lower="-1" upper="1"/>')).limits
    assert np.isinf([*limits.effort_lower, *limits.effort_upper, *limits.velocity]).all()
    assert (*limits.position_lower, *limits.position_upper) == (-1, 1)


@pytest.mark.parametrize("kind", ["floating", "planar", "spherical", ""])
def test_unsupported_joint(kind):
    with pytest.raises(UnsupportedJointError) as caught:
        parse_urdf(jointed(kind), "x.urdf")
    assert caught.value.element == "joint 'shoulder'"
    assert "revolute, continuous, prismatic" in str(caught.value)


def test_entity_bomb_is_refused_quickly():
    rows = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 30))
    text = f'<!DOCTYPE robot [<!ENTITY e0 "boom">{rows}]><robot name="x">&e29;</robot>'
    started = time.process_time()
    with pytest.raises(UrdfError, match="DTD"):
        parse_urdf(text, "bomb.urdf")
    # Refused at its first declaration; 10^29 expansions would outlast us all.
    assert time.process_time() - started < 1.0


def test_deep_nesting_is_refused_quickly():
    deep = "<a>" * 200_000
    started = time.process_time()
    with pytest.raises(UrdfError, match=f"deeper than {MAX_DEPTH}"):
        parse_urdf(f"<robot>{deep}", "deep.urdf")
    assert time.process_time() - started < 1.0  # stops at the limit, wherever the text ends


def tree(n, deep, moving):
    """n links, one behind the other or all on the first; every `moving`-th joint moves."""
    parts = [link("l0")]
    for i in range(1, n):
        kind = "fixed" if i % moving else "revolute"
        parts += [link(f"l{i}"), joint(f"j{i}", f"l{i - 1}" if deep else "l0", f"l{i}", kind)]
    return urdf(*parts)


@pytest.mark.parametrize("deep", [True, False])
def test_many_links_are_refused_quickly(deep, tmp_path):
    path = tmp_path / "many.urdf"
    for n, moving, words in ((MAX_LINKS + 1, 10, "more than 1000 links"), (MAX_MOVING + 2, 1, "more than 150 joints")):
        path.write_text(tree(n, deep, moving))
        started = time.process_time()
        with pytest.raises(UrdfError, match=words):
            Robot.from_urdf(path)
        assert time.process_time() - started < 2.0  # 0.03 s on an idle machine


@pytest.mark.parametrize("deep", [pytest.param(True, marks=pytest.mark.slow), False])
def test_the_largest_allowed_tree_does_not_overflow_pinocchios_recursion(deep, read):
    assert read(tree(MAX_LINKS, deep, 7)).nv == 142


@pytest.mark.slow
def test_many_elements_are_refused_quickly():
    started = time.process_time()
    with pytest.raises(UrdfError, match="more than 200000 elements"):
        parse_urdf(f'<robot name="x">{"<a/>" * (MAX_ELEMENTS + 1)}', "many.urdf")
    assert time.process_time() - started < 5.0  # 0.2 s on an idle machine; 8 million fit into MAX_BYTES


def test_messages_are_short():
    with pytest.raises(UrdfError) as caught:
        parse_urdf(two_links(joint=joint("x" * 100_000, "base", "y" * 100_000)), "long.urdf")
    assert "does not exist" in str(caught.value) and len(str(caught.value)) < 500


def test_expanded_xacro_is_read():
    parse_urdf(two_links().replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" '), "expanded")


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.urdf")
    with pytest.raises(UrdfError, match=r"pipe\.urdf: cannot be read \(it is a named pipe"):
        read_urdf(tmp_path / "pipe.urdf")
    with pytest.raises(UrdfError, match="it is a device"):
        read_urdf("/dev/zero")


def test_missing_file(tmp_path):
    with pytest.raises(UrdfError, match=r"nowhere\.urdf: no such file"):
        read_urdf(tmp_path / "nowhere.urdf")


def test_folder_is_no_file(tmp_path):
    with pytest.raises(UrdfError, match="cannot be read"):
        read_urdf(tmp_path)


def test_not_utf8(tmp_path):
    path = tmp_path / "latin.urdf"
    path.write_bytes('<robot name="Ärmchen"/>'.encode("latin-1"))
    with pytest.raises(UrdfError, match=r"not UTF-8 \(byte 13\)"):
        read_urdf(path)


def test_too_large(tmp_path):
    path = tmp_path / "large.urdf"
    with path.open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    with pytest.raises(UrdfError, match="larger than"):
        read_urdf(path)


def test_byte_order_mark_is_skipped(read):
    assert read("\ufeff" + two_links()).nv == 1


def test_a_wrong_encoding_declaration_does_not_matter(file):
    path = file(two_links().replace('?xml version="1.0"', '?xml version="1.0" encoding="ISO-8859-1"'))
    assert Robot.from_urdf(path).nv == 1


def test_good_ones_pass():
    assert parse_urdf(two_links(), "good").tag == "robot"
    parse_urdf(jointed("continuous", ""), "needs no limits")
    parse_urdf(two_links(link=link("arm", "")), "needs no inertial")
    parse_urdf(heavy(moments=("0.01", "0.02", "0.0301")), "rounded moments")
    parse_urdf(two_links(link=link("arm", INERTIAL)), "same")


def test_joint_that_moves_no_inertia(read):
    robot = read(two_links(link=link("arm", "")))
    assert not robot.has_dynamics and robot.nv == 1
    with pytest.raises(UrdfError, match="moves no inertia; links without mass: arm") as caught:
        robot.expect_dynamics()
    assert caught.value.element == "joint 'shoulder'"
    assert robot.with_armature(0.1).has_dynamics


def test_conflict_markers_in_a_comment_are_read(read):
    assert read(two_links().replace("</robot>", "<!--\n<<<<<<< HEAD\n--></robot>")).nv == 1


def test_robot_without_moving_joint(read):
    with pytest.raises(UrdfError, match="no moving joint"):
        read(jointed("fixed", ""))


def test_damaged_files_raise_nothing_else(tmp_path):
    """Bytes of a good file knocked out at random: it is read, or it is an ArmdynError."""
    rng = np.random.default_rng(0)
    good = two_links().encode()
    path = tmp_path / "damaged.urdf"
    for _ in range(300):
        data = bytearray(good)
        for at in rng.integers(0, len(data), 3):
            data[at] = rng.integers(32, 127)
        path.write_bytes(data)
        try:
            Robot.from_urdf(path)
        except ArmdynError as error:
            assert str(path) in str(error)


def test_all_faults_of_links_and_joints_are_told_at_once():
    """The first was told in each run."""
    bare = '<joint name="{0}" type="revolute"><parent link="base"/><child link="{1}"/><axis xyz="0 0 1"/></joint>'
    links = "".join(f'<link name="{name}"/>' for name in ("base", "a", "b"))
    text = f'<robot name="bad">{links}{bare.format("j1", "a")}{bare.format("j2", "b")}</robot>'
    with pytest.raises(UrdfError) as caught:
        parse_urdf(text, "bad.urdf")
    assert caught.value.element == "joint 'j1'"
    assert "bad.urdf: joint 'j1': a revolute joint needs" in str(caught.value)
    assert "; 1 more: joint 'j2': a revolute joint needs" in str(caught.value)
    many = "".join(f'<link name="l{k}"><inertial><mass value="-1"/></inertial></link>' for k in range(20))
    with pytest.raises(UrdfError, match=r"; \d\d more: .*; and \d\d others$"):
        parse_urdf(f'<robot name="bad"><link name="base"/>{many}</robot>', "bad.urdf")
