"""Scenes from files: MoveIt's messages and text format, URDFs of cells, and files of strangers."""

import os
import subprocess
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
import trimesh
import yaml

import armdyn as ad
from armdyn.errors import ArmdynError, ProblemError
from armdyn.models.scene.obstacles import Box, Capsule, Cylinder, Group, Mesh, Plane, Sphere
from cli.command import run_here

TETRAHEDRON = {
    "vertices": [
        {"x": 0, "y": 0, "z": 0},
        {"x": 1, "y": 0, "z": 0},
        {"x": 0, "y": 1, "z": 0},
        {"x": 0, "y": 0, "z": 1},
    ],
    "triangles": [{"vertex_indices": one} for one in ([0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3])],
}
TURNED = [0, 0, float(np.sin(0.25)), float(np.cos(0.25))]
"""By 0.5 rad about z."""


def solid(kind, dimensions, at=(0, 0, 0), **more):
    pose = {"position": list(at), "orientation": [0, 0, 0, 1]}
    return {"primitives": [{"type": kind, "dimensions": dimensions}], "primitive_poses": [pose], **more}


def written(folder, *objects, **more):
    path = folder / "scene.yaml"
    path.write_text(yaml.safe_dump({"world": {"collision_objects": list(objects)}, **more}))
    return path


def loaded(folder, *objects, robot=None, **more):
    return ad.load_scene(written(folder, *objects, **more), robot)


def test_shapes_of_a_planning_scene(tmp_path):
    table = solid("box", [1, 0.8, 0.04], id="table", pose={"position": [1, 0, 0], "orientation": TURNED})
    table["primitives"].append({"type": 3, "dimensions": [0.5, 0.05]})
    table["primitive_poses"].append({"position": {"x": 0.2, "y": 0, "z": -0.25}, "orientation": {"w": 1}})
    mesh = {
        "id": "wedge",
        "meshes": [TETRAHEDRON],
        "mesh_poses": [{"position": [0, 2, 0], "orientation": [0, 0, 0, 0]}],
    }
    floor = {"id": "floor", "planes": [{"coef": [0, 0, 2, 1]}], "pose": {"position": [0, 0, -1]}}
    cone = solid("cone", [0.2, 0.1], (0, 0, 3), id="cone")
    found = loaded(tmp_path, table, mesh, floor, solid("sphere", ["1e-1"], (0, 0, 1), id="ball"), cone).obstacles
    assert [one.name for one in found] == ["table", "wedge", "floor", "ball", "cone"]
    group, wedge, plane, ball, pointed = found
    top, leg = group.members
    placed = pin.SE3(pin.rpy.rpyToMatrix(0, 0, 0.5), np.array([1.0, 0, 0]))
    np.testing.assert_allclose(top.pose, placed.homogeneous, atol=1e-15)  # rounding of the quaternion
    np.testing.assert_allclose(leg.a, placed.act(np.array([0.2, 0, -0.5])), atol=1e-15)
    assert leg.radius == 0.05 and ball == Sphere((0, 0, 1), 0.1, name="ball")
    assert isinstance(wedge, Mesh) and wedge.placement[1][3] == 2 and len(wedge.parts) == 1
    assert plane == Plane((0, 0, -1.5), (0, 0, 2), name="floor")
    (corners,) = pointed.parts
    assert corners[-1] == (0, 0, 0.1) and np.linalg.norm(corners[0]) > np.hypot(0.1, 0.1)


def test_a_message_as_it_is_echoed(tmp_path):
    path = written(tmp_path, BALL)
    path.write_text(path.read_text() + "---\n")
    assert [one.name for one in ad.load_scene(path).obstacles] == ["ball"]


def test_allowed_contacts(tmp_path):
    matrix = {
        "entry_names": ["link1", "can", "elsewhere"],
        "entry_values": [{"enabled": [False, True, True]}, {"enabled": [1, 0, 0]}, {"enabled": [True, False, False]}],
        "default_entry_names": ["mat", "link2"],
        "default_entry_values": [True, False],
    }
    things = [solid("sphere", [0.1], (0, 0, z), id=name) for z, name in ((5, "can"), (6, "mat"))]
    found = loaded(tmp_path, *things, allowed_collision_matrix=matrix).allowed_contacts
    assert set(found) == {
        ("can", "link1"),
        ("elsewhere", "link1"),
        ("can", "mat"),
        ("link1", "mat"),
        ("elsewhere", "mat"),
    }
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    scene = loaded(tmp_path, *things, robot=robot, allowed_collision_matrix=matrix)
    assert {("can", "link1"), ("link1", "mat")} <= set(scene.allowed_contacts)
    assert not any("elsewhere" in pair or set(pair) == {"link2", "mat"} for pair in scene.allowed_contacts)
    problem = ad.MinimumTimeProblem(
        robot, q_start=[0, 0], q_goal=[1, 0],
        obstacles=scene.obstacles, allowed_contacts=scene.allowed_contacts,
    )  # fmt: skip
    assert ("link1", "can") not in problem.collision_model().pairs
    with pytest.raises(ProblemError, match="'elsewhere'"):  # the user's own names stay strict
        replace(problem, allowed_contacts=found)


def test_frames(tmp_path):
    robot = ad.Robot.from_library("panda")
    ball = solid("sphere", [0.1], (1, 0, 0), id="ball", header={"frame_id": "/panda_link0"})
    assert loaded(tmp_path, ball, robot=robot).obstacles[0].center == (1, 0, 0)
    moved = {"child_frame_id": "panda_link0", "transform": {"translation": [0, 0, 0.5], "rotation": [0, 0, 0, 1]}}
    assert loaded(tmp_path, ball, fixed_frame_transforms=[moved]).obstacles[0].center == (1, 0, 0.5)
    with pytest.raises(ProblemError, match=r"'ball': its frame 'panda_link0' has no pose in the file"):
        loaded(tmp_path, ball)
    with pytest.raises(ProblemError, match=r"'ball': its frame 'panda_hand' moves"):
        loaded(tmp_path, ball | {"header": {"frame_id": "panda_hand"}}, robot=robot)
    away = {"multi_dof_joint_state": {"transforms": [{"translation": [0, 0, 1], "rotation": [0, 0, 0, 1]}]}}
    with pytest.raises(ProblemError, match="places the robot elsewhere"):
        loaded(tmp_path, ball, robot=robot, robot_state=away)


BALL = solid("sphere", [0.1], id="ball")


@pytest.mark.parametrize(
    ("objects", "more", "says"),
    [
        ([BALL, BALL], {}, "two objects are called 'ball'"),
        ([BALL | {"id": ""}], {}, r"collision_objects\[0\]: its id is ''"),
        ([BALL | {"operation": 1}], {}, "'ball': its operation is '1'"),
        ([{"id": "nothing"}], {}, "'nothing': it has no primitives"),
        ([BALL | {"primitive_poses": [{}, {}]}], {}, "1 primitives and 2 primitive_poses"),
        ([solid("sphere", [".nan"], id="ball")], {}, "finite|numbers"),
        ([solid("sphere", [float("nan")], id="ball")], {}, "'ball': dimensions"),
        ([solid("sphere", [-1], id="ball")], {}, "radius of obstacle 'ball' is -1"),
        ([solid("box", [1, 1], id="it")], {}, "'it': a box has the sizes"),
        ([solid("prism", [1, 1], id="it")], {}, "'it': a shape is 'prism'"),
        ([BALL | {"pose": {"position": [0, 0]}}], {}, "position of pose"),
        ([{"id": "it", "meshes": [TETRAHEDRON | {"triangles": TETRAHEDRON["triangles"][:3]}]}], {}, "'it'.* is open"),
        ([{"id": "it", "meshes": [{"vertices": [[0, 0]], "triangles": [[0, 0, 0]]}]}], {}, "no three numbers"),
        ([{"id": "it", "planes": [{"coef": [0, 0, 0, 1]}]}], {}, "coef of its plane"),
        ([BALL], {"allowed_collision_matrix": {"entry_names": ["a"], "entry_values": []}}, "1 rows of 1"),
        ([BALL], {"allowed_collision_matrix": {"default_entry_names": ["a"]}}, "values are true or false"),
        ([BALL], {"robot_state": {"attached_collision_objects": [{"link_name": "hand", "object": BALL}]}}, "'hand'"),
        ([3], {}, "must be a table"),
    ],
)  # fmt: skip
def test_faults_of_a_message_are_named(objects, more, says, tmp_path):
    with pytest.raises(ProblemError, match=says) as caught:
        loaded(tmp_path, *objects, **more)
    assert str(caught.value).startswith(f"{tmp_path / 'scene.yaml'}: ")


@pytest.mark.slow
def test_hostile_yaml(tmp_path):
    path = tmp_path / "scene.yaml"
    lists = "\n".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 30))
    for text, says in (
        (f"a0: &a0 [x]\n{lists}\n", "references"),
        ("a: &a [*a]\nworld: *a\n", "recursive"),
        ("[" * 41, "deeper than"),
        ("{a: " * 41, "deeper than"),
        ("[" * 100_000, "deeper than"),
        ("{a: " * 100_000, "deeper than"),
        ("a: [", "not YAML"),
        ("- !!python/object/apply:os.system [touch hacked]", "must be a table"),
        ("world: !!python/object/apply:os.system [touch hacked]", "world .*must be a table"),
        ("", "no planning scene"),
        ("a: 1", "no planning scene"),
        ("a: 1\n---\nb: 2", "2 documents"),
        (f"# {'x' * 2**23}", "larger than"),
        (f"[{'1,' * 1_000_001}]", "more than 1000000 values"),
    ):
        path.write_text(text)
        with pytest.raises(ArmdynError, match=says):
            ad.load_scene(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ArmdynError, match=r"scene\.yaml"):
        ad.load_scene(path)
    assert not (tmp_path / "hacked").exists()
    os.mkfifo(tmp_path / "pipe.yaml")
    for name, says in (("pipe.yaml", "named pipe"), ("none.yaml", "no such file"), ("scene.exe", "none of them")):
        with pytest.raises(ArmdynError, match=says):
            ad.load_scene(tmp_path / name)


OLD = """(noname)
* table
2
box
1 0.8 0.04
0 0 0.5
0 0 0 1
0 0 0 0
cylinder
0.05 0.5
0 0 0.2
0 0 0 1
0 0 0 0
* ball
1
sphere
0.1
1 0 0
0 0 0 1
1 0 0 1
.
"""
NEW = """room
* wedge
0 2 0
0 0 0 1
1
mesh
4 4
0 0 0
1 0 0
0 1 0
0 0 1
0 2 1
0 1 3
0 3 2
1 2 3
0 0 1
0 0 0 1
0 0 0 0
0
.
"""


def test_text_format(tmp_path):
    path = tmp_path / "room.scene"
    path.write_text(OLD)
    table, ball = ad.load_scene(path).obstacles
    assert table.members == (
        Box((1, 0.8, 0.04), (0, 0, 0.5), name="table"),
        Cylinder((0, 0, 0.2 - 0.25), (0, 0, 0.45), 0.05, name="table"),
    )
    assert isinstance(table, Group) and ball == Sphere((1, 0, 0), 0.1, name="ball")
    path.write_text(NEW)
    (wedge,) = ad.load_scene(path).obstacles
    assert wedge.name == "wedge" and wedge.pose[:3, 3].tolist() == [0, 2, 1]
    for text, says in (
        (OLD[:80], "no scene of MoveIt"),
        (OLD.replace("* ball\n1", "* ball\n3"), "'ball' is incomplete"),
        (OLD.replace("sphere", "prism"), "'ball'"),
        (OLD.replace("0.1\n", "nan\n"), "finite"),
        (NEW.replace("4 4", "4 99999999"), "'wedge' is incomplete"),
    ):
        path.write_text(text)
        with pytest.raises(ProblemError, match=rf"room\.scene: .*{says}"):
            ad.load_scene(path)


CELL = """<robot name="cell"><link name="world"/>
<link name="table"><collision><origin xyz="0 0 -0.02"/><geometry><box size="1 1 0.04"/></geometry></collision></link>
<link name="door">
  <collision><origin xyz="0.5 0 0"/><geometry><box size="1 0.02 1"/></geometry></collision>
  <collision><origin xyz="1 0 0"/><geometry><capsule length="0.2" radius="0.02"/></geometry></collision></link>
<link name="bin"><collision><geometry><mesh filename="package://cell/bin.stl" scale="0.001 0.001 0.001"/></geometry>
  </collision></link>
<joint name="stand" type="fixed"><parent link="world"/><child link="table"/><origin xyz="0 0 0.8"/></joint>
<joint name="hinge" type="revolute"><parent link="world"/><child link="door"/><origin xyz="0 2 0"/><axis xyz="0 0 1"/>
  <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
<joint name="put" type="fixed"><parent link="table"/><child link="bin"/>
  <origin xyz="0 0 0.2" rpy="0 0 1.5707963267949"/>
</joint></robot>"""


def test_the_urdf_of_a_cell(tmp_path):
    home = tmp_path / "cell"
    home.mkdir()
    (home / "package.xml").write_text("<package/>")
    trimesh.creation.box((400, 200, 100)).export(home / "bin.stl")
    path = home / "cell.urdf"
    path.write_text(CELL)
    with pytest.raises(ProblemError, match=r"cell\.urdf: joint 'hinge' moves"):
        ad.load_scene(path)
    with pytest.raises(ProblemError, match="'hinge'"):
        ad.load_scene(path, lock={"hing": 0})
    table, door, box = ad.load_scene(path, lock={"hinge": np.pi / 2}).obstacles
    assert table == Box((1, 1, 0.04), (0, 0, 0.78), name="table") and isinstance(door.members[1], Capsule)
    np.testing.assert_allclose(door.members[0].pose[:3, 3], [0, 2.5, 0], atol=1e-15)  # rounding of a sine
    corners = np.array(box.parts[0]) @ box.pose[:3, :3].T + box.pose[:3, 3]
    np.testing.assert_allclose(corners.max(axis=0), [0.1, 0.2, 1.05], atol=1e-6)  # an STL has single precision
    (tmp_path / "out.stl").write_bytes((home / "bin.stl").read_bytes())
    for mesh, says in (("../out.stl", "outside"), ("file:///etc/passwd", "outside"), ("none.stl", "no mesh")):
        path.write_text(CELL.replace("package://cell/bin.stl", mesh))
        with pytest.raises(ProblemError, match=rf"link 'bin': .*{says}"):
            ad.load_scene(path, lock={"hinge": 0})
    path.write_text('<robot name="cell"><link name="world"/></robot>')
    with pytest.raises(ProblemError, match="no link has geometry"):
        ad.load_scene(path)
    with pytest.raises(ProblemError, match="lock is for joints"):
        ad.load_scene(tmp_path / "scene.yaml", lock={"hinge": 0})


def test_problem_files_and_commands_take_scenes(tmp_path):
    scene = written(tmp_path, solid("sphere", [0.05], (0.0, 0.1, 0.0), id="ball"))
    text = '[robot]\nname = "rr"\n[problem]\nq_start = [0, 0]\nq_goal = [1, 0]\nscene = "scene.yaml"\n'
    (tmp_path / "problem.toml").write_text(text + "obstacles = [{type = 'sphere', center = [2, 0, 0], radius = 0.1}]\n")
    problem = ad.read_problem(tmp_path / "problem.toml")
    assert [one.name for one in problem.obstacles] == ["sphere", "ball"]
    for name in ("../scene.yaml", "/etc/hostname", "none.yaml", 3):
        (tmp_path / "problem.toml").write_text(text.replace('"scene.yaml"', repr(name)))
        with pytest.raises(ProblemError, match=r"problem\.toml, line 6: .*(inside|path)"):
            ad.read_problem(tmp_path / "problem.toml")
    near = written(tmp_path, solid("sphere", [0.05], (0.0, 0.0, -0.2), id="ball"))
    done: subprocess.CompletedProcess[str] = run_here("mintime", "rr", "--scene", str(near), cwd=tmp_path)
    assert done.returncode == 2 and "'ball'" in done.stderr and scene == near
