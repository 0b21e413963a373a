"""Few boxes of a grid, and convex parts of hollow meshes by them."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from armdyn.models.scene.grid import few_boxes, hollow_parts
from armdyn.models.scene.mesh import Mesh


def test_few_boxes():
    random = np.random.default_rng(0)
    for _ in range(20):
        solid = random.random((5, 6, 7)) < random.uniform(0.1, 0.9)
        allowed = solid | (random.random(solid.shape) < 0.2)
        low, high = few_boxes(solid, allowed)
        filled = np.zeros_like(solid)
        for a, b in zip(low, high, strict=True):
            filled[tuple(map(slice, a, b))] = True
        assert np.all(filled[solid]) and np.all(allowed[filled])
    assert len(few_boxes(np.ones((3, 4, 5), dtype=bool), np.ones((3, 4, 5), dtype=bool))[0]) == 1
    assert len(few_boxes(np.zeros((3, 4, 5), dtype=bool), np.zeros((3, 4, 5), dtype=bool))[0]) == 0


def welded(solid, *planes):
    """The surface of solid cells of a grid, in one piece."""
    corners, faces = [], []
    for cell in np.argwhere(solid):
        for axis in range(3):
            for side in (0, 1):
                beside = cell + (2 * side - 1) * np.eye(3, dtype=int)[axis]
                if np.all((beside >= 0) & (beside < solid.shape)) and solid[tuple(beside)]:
                    continue
                first, second = (one for one in range(3) if one != axis)
                for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    at = cell + side * np.eye(3, dtype=int)[axis]
                    at = at + a * np.eye(3, dtype=int)[first] + b * np.eye(3, dtype=int)[second]
                    corners.append([planes[k][at[k]] for k in range(3)])
                n = len(corners)
                faces += [[n - 4, n - 3, n - 2], [n - 4, n - 2, n - 1]]
    mesh = trimesh.Trimesh(corners, faces)
    trimesh.repair.fix_normals(mesh)
    return mesh


def shelf():
    solid = np.zeros((3, 2, 5), dtype=bool)
    solid[:, :, ::2] = solid[::2] = solid[:, 1] = True  # boards, sides, back
    return welded(solid, [-0.41, -0.39, 0.39, 0.41], [-0.15, 0.14, 0.16], [-0.01, 0.01, 0.29, 0.31, 0.59, 0.61])


def tray(draft=0.0):
    """An open tray with walls of 3 mm that lean outwards."""
    solid = np.ones((3, 3, 2), dtype=bool)
    solid[1, 1, 1] = False
    mesh = welded(solid, [-0.3, -0.297, 0.297, 0.3], [-0.2, -0.197, 0.197, 0.2], [0, 0.003, 0.15])
    mesh.vertices[:, :2] *= 1 + draft * mesh.vertices[:, 2:]
    return mesh


def volume(parts):
    return sum(ConvexHull(part).volume for part in parts)


def beyond(points, parts):
    """How far the points are out of the nearest part [m]."""
    hulls = [ConvexHull(part).equations for part in parts]
    return np.min([np.max(points @ one[:, :3].T + one[:, 3], axis=1) for one in hulls], axis=0)


@pytest.mark.parametrize(
    ("mesh", "most", "larger"),
    [
        (shelf(), 6, 1.02),  # three boards, two sides and the back, which overlap by a micrometre
        pytest.param(shelf().subdivide().subdivide(), 6, 1.02, marks=pytest.mark.slow),
        (tray(), 5, 1.02),
        (tray(0.8), 15, 1.5),
        (trimesh.creation.annulus(0.1, 0.12, 0.5), 20, 1.2),
    ],
)
def test_hollow_meshes(mesh, most, larger):
    parts = hollow_parts(mesh)
    assert len(parts) <= most and volume(parts) < larger * mesh.volume
    surface = mesh.sample(2000, seed=0)
    assert np.max(beyond(np.asarray(surface), parts)) < 1e-9  # rounding
    random = np.random.default_rng(0).uniform(*mesh.bounds, (20_000, 3))
    # Inside of a closed surface the solid angle is all there is.
    a, b, c = (np.asarray(mesh.triangles)[:, k] - random[:500, None] for k in range(3))
    lengths = [np.linalg.norm(one, axis=-1) for one in (a, b, c)]
    dots = [np.sum(one * other, axis=-1) for one, other in ((a, b), (b, c), (c, a))]
    below = np.prod(lengths, axis=0) + dots[0] * lengths[2] + dots[1] * lengths[0] + dots[2] * lengths[1]
    angle = 2 * np.sum(np.arctan2(np.sum(a * np.cross(b, c), axis=-1), below), axis=1)
    inside = np.abs(angle) > 2 * np.pi
    assert np.all(beyond(random[:500][inside], parts) < 1e-9)


def test_a_mesh_takes_the_smaller_parts():
    mesh = shelf()
    made = Mesh.from_triangles(mesh.vertices, mesh.faces)
    assert len(made.parts) == 6 and volume(made.parts) < 1.02 * mesh.volume
    full = trimesh.creation.icosphere(2, 0.1)
    assert len(Mesh.from_triangles(full.vertices, full.faces).parts) == 1
