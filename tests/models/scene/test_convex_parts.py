"""Convex parts contain the mesh, and are not much larger."""

import coal
import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from armdyn.models.scene import convex_parts as cutting
from armdyn.models.scene.bodies import bodies
from armdyn.models.scene.convex_parts import convex_parts
from oracles import robot_named


def plate(size, center):
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(center))


def bin_():
    walls = [plate((0.01, 0.3, 0.2), (x, 0, 0.1)) for x in (-0.195, 0.195)]
    walls += [plate((0.4, 0.01, 0.2), (0, y, 0.1)) for y in (-0.145, 0.145)]
    return trimesh.util.concatenate([plate((0.4, 0.3, 0.01), (0, 0, 0)), *walls])


def inside_of_parts(parts, points):
    within = [np.all(hull.equations[:, :3] @ points.T <= 1e-9 - hull.equations[:, 3:], axis=0) for hull in parts]
    return np.any(within, axis=0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mesh", "most"),
    [
        (trimesh.creation.icosphere(3), 1.0 + 1e-9),
        (trimesh.creation.annulus(0.08, 0.1, 0.2), 1.3),  # its hull: 2.8
        (trimesh.creation.torus(0.3, 0.05), 1.35),  # 2.5
        (bin_(), 4.5),  # 6.1
    ],
    ids=["ball", "ring", "torus", "bin"],
)
def test_parts_contain_the_mesh(mesh, most):
    parts = [ConvexHull(corners) for corners in convex_parts(mesh)]
    points, _ = trimesh.sample.sample_surface(mesh, 20_000, seed=0)
    assert np.all(inside_of_parts(parts, points))
    assert sum(part.volume for part in parts) <= most * mesh.volume


def test_a_flat_mesh_has_a_thickness():
    square = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    (part,) = [ConvexHull(corners) for corners in convex_parts(square)]
    assert 1e-5 < part.volume < 1e-3


def test_a_ur5_has_few_parts():
    own = bodies(robot_named("ur5"))
    meshes = [body for body in own if isinstance(body.geometry, coal.ConvexBase)]
    assert len({body.name for body in meshes}) == 7 and len(meshes) == 12


@pytest.mark.slow
def test_parts_are_cut_once(tmp_path, monkeypatch):
    monkeypatch.setenv("ARMDYN_CACHE", str(tmp_path))
    ring = trimesh.creation.annulus(0.08, 0.1, 0.2)
    parts = cutting.convex_parts(ring)
    (file,) = (tmp_path / "convex_parts").iterdir()
    monkeypatch.setattr(cutting, "_cut", lambda *given: [])
    again = cutting.convex_parts(ring)
    assert len(parts) == len(again) > 1 and all(map(np.array_equal, parts, again))
    assert cutting.convex_parts(trimesh.creation.annulus(0.08, 0.1, 0.21)) == []  # another mesh
    file.write_bytes(file.read_bytes()[:-1])
    assert cutting.convex_parts(ring) == []  # a damaged file is not read
