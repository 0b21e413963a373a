"""Meshes as obstacles: read, cut into convex parts, written, and kept clear of by their name."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.models.scene import mesh as module
from armdyn.models.scene.collision import collision_model
from armdyn.models.scene.obstacles import Box, Group, Mesh, Sphere, load_obstacles, obstacle_entry, obstacle_from
from armdyn.models.scene.proof_of_clearance import prove_clearance
from armdyn.show.visuals import obstacle_shapes


def board(size, at):
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(at))


def shelf():
    """Three boards between two sides [m]."""
    boards = [board((0.8, 0.3, 0.02), (0, 0, z)) for z in (0.0, 0.3, 0.6)]
    return trimesh.util.concatenate([*boards, *(board((0.02, 0.3, 0.62), (x, 0, 0.3)) for x in (-0.4, 0.4))])


def test_a_shelf_of_boards_is_cut_into_its_boards(tmp_path):
    shelf().export(tmp_path / "shelf.stl")
    read = Mesh.from_file(tmp_path / "shelf.stl", (0.5, 0, 0))
    assert read.name == "shelf" and len(read.parts) == 5 and len(read.solids()) == 5
    assert read == Mesh.from_file(tmp_path / "shelf.stl", (0.5, 0, 0)) and len({read, replace(read)}) == 1
    assert read != replace(read, placement=(0.5, 0, 0.1))
    small = Mesh.from_file(tmp_path / "shelf.stl", scale=0.001, name="toy")
    np.testing.assert_allclose(np.concatenate(small.parts).max(axis=0), [0.00041, 0.00015, 0.00061])


def test_it_is_written_and_read(tmp_path):
    trimesh.creation.icosphere(1, 0.1).export(tmp_path / "ball.obj")
    ball = Mesh.from_file(tmp_path / "ball.obj", [0.1, 0.2, 0.3])
    entry = json.loads(json.dumps(obstacle_entry(ball)))
    assert obstacle_from(entry, "here") == ball
    said = {"type": "mesh", "file": "ball.obj", "position": [0.1, 0.2, 0.3]}
    (tmp_path / "scene.json").write_text(json.dumps([said, said | {"scale": 2, "rpy": [0, 0, 1], "name": "large"}]))
    first, second = load_obstacles(tmp_path / "scene.json")
    assert first == ball and second.name == "large"
    np.testing.assert_allclose(second.parts, 2 * np.array(ball.parts), atol=1e-15)  # rounding of the product
    with pytest.raises(ProblemError, match="names no others"):
        obstacle_from(said, "here")
    (tmp_path / "inner").mkdir()
    for name in ("../ball.obj", str(tmp_path / "ball.obj"), "none.obj", "a\0b", 3):
        with pytest.raises(ProblemError, match=r"inside|path"):
            obstacle_from(said | {"file": name}, "here", tmp_path / "inner")
    (tmp_path / "inner" / "link.obj").symlink_to(tmp_path / "ball.obj")
    with pytest.raises(ProblemError, match="inside"):
        obstacle_from(said | {"file": "link.obj"}, "here", tmp_path / "inner")


def test_one_name_is_one_obstacle():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    far = board((0.1, 0.1, 0.1), (0.3, 0.0, 0.0)), board((0.1, 0.1, 0.1), (-0.3, 0.0, 0.0))
    whole = trimesh.util.concatenate(far)
    pair = Mesh.from_triangles(whole.vertices, whole.faces, name="pair")
    model = collision_model(robot, (pair, Sphere((5, 0, 0), 0.1, name="far")), False)
    assert {other for _, other in model.pairs} == {"pair", "far"} and len(model.pairs) == 12  # four bodies of the arm
    boxes = Group([Box((0.1, 0.1, 0.1), (x, 0, 0)) for x in (0.3, -0.3)], name="pair")
    same = collision_model(robot, (boxes, Sphere((5, 0, 0), 0.1, name="far")), False)
    np.testing.assert_allclose(model.distances([0.4, 0.3]), same.distances([0.4, 0.3]), atol=1e-6)  # GJK's tolerance
    with pytest.raises(ProblemError, match=r"at the goal, 'link2' is 14.0 mm inside 'pair'"):
        ad.MinimumTimeProblem(robot, q_start=[1.57, 0.0], q_goal=[0.2, 0.0], obstacles=[pair])
    free = collision_model(robot, (boxes,), False, tuple((link, "pair") for link, _ in model.pairs))
    assert free.pairs == ()


def test_a_problem_file_has_them(tmp_path):
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    cube = Mesh.from_triangles(*(lambda one: (one.vertices, one.faces))(board((0.1, 0.1, 0.1), (0, 0, 0))), (2, 0, 0))
    group = Group([Box((0.1, 0.1, 0.1), (3, 0, 0)), Sphere((4, 0, 0), 0.1), cube], name="several")
    problem = ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[1, 0], obstacles=[cube, group])
    (tmp_path / "problem.toml").write_text(problem.to_toml())
    assert ad.read_problem(tmp_path / "problem.toml").obstacles == (cube, group)
    board((0.1, 0.1, 0.1), (0, 0, 0)).export(tmp_path / "cube.stl")
    text = '[robot]\nname = "rr"\n[problem]\nq_start = [0, 0]\nq_goal = [1, 0]\n[[problem.obstacles]]\ntype = "mesh"\n'
    (tmp_path / "own.toml").write_text(text + 'file = "cube.stl"\nposition = [2, 0, 0]\n')
    (read,) = ad.read_problem(tmp_path / "own.toml").obstacles
    assert read.name == "cube" and read.pose.tolist() == cube.pose.tolist()
    np.testing.assert_allclose(np.ptp(read.parts[0], axis=0), 0.1, atol=1e-8)  # an STL has single precision
    assert len(obstacle_shapes([cube, group])) == 3  # the members of the group that are no balls are drawn as one


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Mesh([]), "0 corners"),
        (lambda: Mesh([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]]), r"parts\[0\] of obstacle 'mesh' is flat"),
        (lambda: Mesh([[[0, 0, np.nan]] * 4]), "finite corners"),
        (lambda: Mesh(3), "must be a list"),
        (lambda: Mesh.from_triangles([[0, 0, 0]], [[0, 0, 1]]), "indices of its 1 vertices"),
        (lambda: Mesh.from_triangles([[0, 0]], [[0, 0, 0]]), "vertices of obstacle 'mesh'"),
        (lambda: Mesh.from_triangles(np.eye(3), [[0, 1, 2]]), "open, 3 of its edges"),
        (lambda: Mesh.from_triangles(*ball(800.0)), "millimetres"),
        (lambda: Mesh.from_triangles(*ball(1.0), placement=[0, 0]), "placement"),
        (lambda: Group([Group([], name="inner")]), "no group"),
        (lambda: Group([3]), "members"),
    ],
)
def test_faults_are_named(make, says):
    with pytest.raises(ProblemError, match=says):
        make()


def ball(radius):
    made = trimesh.creation.icosphere(1, radius)
    return made.vertices, made.faces


def test_files_that_are_refused(tmp_path, monkeypatch):
    half = trimesh.creation.icosphere(1, 0.1)
    half.update_faces(np.arange(len(half.faces)) < 40)
    half.export(tmp_path / "bowl.stl")
    (tmp_path / "bad.stl").write_bytes(b"\x00" * 100)
    (tmp_path / "empty.obj").write_text("")
    (tmp_path / "archive.zip").write_bytes(b"PK")
    with pytest.raises(ProblemError, match=r"'bowl'.*bowl.stl is open, .* its inside is unknown"):
        Mesh.from_file(tmp_path / "bowl.stl")
    for name in ("bad.stl", "empty.obj", "archive.zip", "none.stl"):
        with pytest.raises(ProblemError, match=f"{name}"):
            Mesh.from_file(tmp_path / name)
    with pytest.raises(ProblemError, match="scale"):
        Mesh.from_file(tmp_path / "bowl.stl", scale=0)
    shelf().export(tmp_path / "shelf.stl")
    monkeypatch.setattr(module, "MAX_TRIANGLES", 50)
    with pytest.raises(ProblemError, match="60 triangles; it may have 50"):
        Mesh.from_file(tmp_path / "shelf.stl")
    monkeypatch.setattr(module, "_MAX_BYTES", 200)
    with pytest.raises(ProblemError, match="larger than 200 bytes"):
        Mesh.from_file(tmp_path / "shelf.stl")


def test_clearances_from_a_mesh_are_proven():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    ring = trimesh.creation.annulus(0.53, 0.55, 0.2, sections=24).apply_transform(
        trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0))
    )
    around = Mesh.from_triangles(ring.vertices, ring.faces, name="ring")
    model, motion = collision_model(robot, (around,), False), ad.ramp(robot, [-1.0, 0.3], [1.0, -0.2], 1.0)
    nearest, missed = prove_clearance(model, motion, 0.005)
    sampled = min(model.distances(q).min() for q in motion(np.linspace(0, 1, 300)).q)
    assert nearest.sure and nearest.other == "ring" and not missed
    assert nearest.distance == pytest.approx(sampled, abs=2e-3)  # the arm's travel between samples
    assert len(around.parts) > 8 and nearest.distance < 0.2  # the hull of a ring would be full
