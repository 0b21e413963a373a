"""All faults of a URDF in one message, with the remedy."""

import itertools

import pytest

import armdyn as ad
from armdyn.errors import UrdfError
from armdyn.models.reading.dynamics_check import _moving
from armdyn.models.reading.urdf_arm import whole_robot
from oracles import LIMIT, joint, link, urdf

BODY = '<inertial><mass value="{mass}"/><inertia ixx="{ixx}" ixy="0" ixz="0" iyy=".02" iyz="0" izz=".01"/></inertial>'
GOOD, NEGATIVE, UNPHYSICAL = (BODY.format(mass=mass, ixx=ixx) for mass, ixx in ((1, ".02"), (-1, ".02"), (1, ".04")))
BEYOND = BODY.format(mass=1, ixx=".9")
NO_EFFORT, NO_VELOCITY = LIMIT.replace('effort="2"', ""), LIMIT.replace('velocity="3"', 'velocity="0"')


def arm(l1=GOOD, l2=GOOD, l3=GOOD, j1=LIMIT, j2=LIMIT, j3=LIMIT, more="", name=' name="test"'):
    bodies = link("base", "") + link("l1", l1) + link("l2", l2) + link("l3", l3)
    joints = (
        joint("j1", "base", "l1", inside=j1),
        joint("j2", "l1", "l2", inside=j2),
        joint("j3", "l2", "l3", inside=j3),
    )
    return urdf(bodies, *joints, more).replace(' name="test"', name)


def refusal(text, **options):
    with pytest.raises(UrdfError) as caught:
        ad.Robot.from_urdf_string(text, source="arm.urdf", **options)
    return str(caught.value)


def test_mass_inertia_and_limits_are_told_at_once(file):
    """Each of the three was told after the one before was mended."""
    text = arm(NEGATIVE, UNPHYSICAL, j2=NO_EFFORT, j3=NO_VELOCITY)
    said = refusal(text)
    assert "link 'l1': mass is -1.0 kg" in said and "1 more: link 'l2': inertia breaks the triangle" in said
    assert "no torque limit: j2; no velocity limit (none is kept): j3; first mend link 'l1' by hand, then: " in said
    path = file(text)
    with pytest.raises(UrdfError) as caught:
        ad.Robot.from_urdf(path)
    call = f"ad.Robot.from_urdf_string(ad.repair_urdf({str(path)!r}).text, effort_limit={{'j2': …}})"
    assert str(caught.value).endswith(call)
    path.write_text(path.read_text().replace('value="-1"', 'value="1"'))
    robot = eval(call.replace("…", "7.0"), {"ad": ad})  # as a user copies it
    assert robot.limits.effort_upper.tolist() == [2, 7, 2]


def test_a_large_repair_is_in_the_remedy(file):
    path = file(arm(l2=BEYOND))
    with pytest.raises(UrdfError) as caught:
        ad.Robot.from_urdf(path)
    assert eval(str(caught.value).partition("to mend: ")[2], {"ad": ad}).nv == 3


def test_an_impossible_inertia_of_a_locked_link_is_no_fault():
    assert ad.Robot.from_urdf_string(arm(UNPHYSICAL), lock={"j1": 0.0}).joint_names == ("j2", "j3")
    said = refusal(arm(UNPHYSICAL, NEGATIVE), lock={"j1": 0.0})
    assert "'l1'" not in said and "more" not in said
    assert "'l1'" in refusal(arm(UNPHYSICAL, NEGATIVE), lock={"j1": "free"})


MIMIC = f'{LIMIT}<mimic joint="x"/>'
FAULTS = {
    "name": ({"name": ""}, "<robot> has no name"),
    "twice": ({"more": link("l3", GOOD)}, "link 'l3': is defined twice"),
    "axis": ({"j1": f'<axis xyz="0 0 0"/>{LIMIT}'}, "joint 'j1': axis is zero"),
    "order": ({"j2": LIMIT.replace('lower="-1"', 'lower="4"')}, "joint 'j2': lower limit 4"),
    "parents": ({"more": joint("j4", "base", "l3")}, "joint 'j4': link 'l3' is the child of two joints"),
    "kind": ({"more": link("e") + joint("j5", "l3", "e", "ball")}, "joint 'j5': type 'ball' is none of"),
    "mimic": ({"more": link("f") + joint("j6", "l3", "f", inside=MIMIC)}, "joint 'j6': mimics 'x', which is no joint"),
    "root": ({"more": link("g")}, "has 2 roots, base, g"),
    "ghost": ({"more": joint("j7", "l3", "ghost")}, "joint 'j7': child link 'ghost' does not exist"),
    "mass": ({"l2": NEGATIVE}, "link 'l2': mass is -1.0 kg"),
    "inertia": ({"l3": UNPHYSICAL}, "link 'l3': inertia breaks the triangle inequality"),
}


PAIRS = [pair for pair in itertools.combinations(FAULTS, 2) if pair != ("root", "ghost")]
"""With a joint that leads nowhere, links without a joint are no news."""


@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_any_two_faults_are_told_together(pair):
    (first, _), (second, _) = (FAULTS[one] for one in pair)
    more = first.get("more", "") + second.get("more", "")
    said = refusal(arm(**{**first, **second, "more": more}))
    assert all(FAULTS[one][1] in said for one in pair), said


def test_an_inertia_is_told_with_a_coupled_joint():
    coupled = joint("j4", "l3", "f", inside=f'{LIMIT}<mimic joint="j2"/>')
    said = refusal(arm(l2=UNPHYSICAL, more=link("f") + coupled))
    assert "joint 'j4': mimics 'j2', which moves" in said and "link 'l2': inertia breaks" in said


@pytest.mark.parametrize("name", ["panda", "ur5", "baxter_left", "talos_arm"])
def test_links_move_as_in_pinocchios_model(name):
    """Frames with a free joint among the supports, by Pinocchio's tree."""
    robot = ad.Robot.from_library(name)
    root, _, model = whole_robot(robot.urdf, "arm.urdf")
    free = {i for i, joint in enumerate(model.names) if i and joint not in robot.locked}
    links = {link.get("name") for link in root.findall("link")}
    moving = {frame.name for frame in model.frames if free & set(model.supports[frame.parentJoint])} & links
    assert _moving(root, robot.locked.keys())[0] == moving and 0 < len(moving) < len(links)
