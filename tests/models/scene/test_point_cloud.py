"""Point clouds and height maps: few boxes that contain them, and files as cameras write them."""

import json

import numpy as np
import pytest
import trimesh

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.models.scene.obstacles import HeightMap, PointCloud, obstacle_entry, obstacle_from
from armdyn.show.visuals import obstacle_shapes


def ends(obstacle):
    """Corners of its boxes [m]."""
    placed = [(pose[:3, 3], np.array(box.halfSide)) for pose, box in obstacle.solids()]
    return np.array([place - half for place, half in placed]), np.array([place + half for place, half in placed])


def inside(points, low, high, margin=1e-12):
    """Which points are in one of the boxes."""
    beyond = np.maximum(low - points[:, None], points[:, None] - high)
    return np.any(np.max(beyond, axis=-1) <= margin, axis=1)


def noisy_table():
    random = np.random.default_rng(0)
    table = trimesh.creation.box((1.0, 0.8, 0.02)).sample(4000, seed=0)
    return table + random.normal(scale=0.003, size=table.shape)


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.02, 0.05])
def test_boxes_contain_the_points_and_reach_a_cube_further_at_most(size):
    points = noisy_table()
    cloud = PointCloud(points, size)
    low, high = ends(cloud)
    assert np.all(inside(points, low, high)) and len(low) < 60
    random = np.random.default_rng(1)
    within = random.uniform(low[:, None], high[:, None], (len(low), 50, 3)).reshape(-1, 3)
    from_cubes = np.abs(within[:, None] - np.array(cloud.points)).max(axis=-1).min(axis=1)
    assert np.max(from_cubes) <= 1.5 * size + 1e-12  # half a cube to its face, and its neighbour


def test_a_cloud_is_a_value():
    points = noisy_table()
    cloud = PointCloud(points, 0.05, name="seen")
    same = PointCloud(np.vstack([points[::-1], [[np.nan, 0, 0]]]), 0.05, name="seen")
    assert cloud == same and hash(cloud) == hash(same) and PointCloud(cloud.points, 0.05, name="seen") == cloud
    assert obstacle_from(json.loads(json.dumps(obstacle_entry(cloud))), "here") == cloud
    assert len(obstacle_shapes([cloud])) == 1


PCD = """# .PCD v0.7
FIELDS rgb x y z
SIZE 4 4 4 4
POINTS 3
DATA ascii
4e6 0.1 0.2 0.3
4e6 nan nan nan
4e6 0.11 0.2 0.3
"""


def test_files(tmp_path):
    points = np.array([[0.1, 0.2, 0.3], [0.31, 0.2, 0.3]])
    np.save(tmp_path / "a.npy", np.column_stack([points, [1, 2]]))
    np.savetxt(tmp_path / "a.xyz", points)
    trimesh.PointCloud(points).export(tmp_path / "a.ply")
    (tmp_path / "a.pcd").write_text(PCD.replace("0.11", "0.31"))
    for name in ("a.npy", "a.xyz", "a.ply", "a.pcd"):
        assert PointCloud.from_file(tmp_path / name, 0.05, (0.001, 0.001, 0.001)) == PointCloud(
            points + 0.001, 0.05, name="a"
        )
    said = {"type": "point cloud", "file": "a.npy", "size": 0.05, "position": [1, 0, 0]}
    assert obstacle_from(said, "here", tmp_path) == PointCloud(points + np.array([1, 0, 0]), 0.05, name="a")
    with pytest.raises(ProblemError, match="names no others"):
        obstacle_from(said, "here")


def test_files_that_are_refused(tmp_path):
    np.save(tmp_path / "pickle.npy", np.array([{}], dtype=object), allow_pickle=True)
    np.save(tmp_path / "flat.npy", np.zeros((4, 2)))
    np.save(tmp_path / "cut.npy", np.zeros((1000, 3)))
    (tmp_path / "cut.npy").write_bytes((tmp_path / "cut.npy").read_bytes()[:200])
    head = b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 3), }"
    (tmp_path / "bomb.npy").write_bytes(head.ljust(127) + b"\n")
    (tmp_path / "text.xyz").write_text("a b c\n")
    (tmp_path / "binary.pcd").write_text(PCD.replace("DATA ascii", "DATA binary"))
    (tmp_path / "no.pcd").write_text(PCD.replace("x y z", "u v w"))
    (tmp_path / "bad.ply").write_text("ply\nformat ascii 1.0\nelement vertex 99999999999\nend_header\n")
    (tmp_path / "cloud.las").write_text("")
    for name in [*sorted(path.name for path in tmp_path.iterdir()), "none.xyz"]:
        with pytest.raises(ProblemError, match=rf"obstacle '{name.split('.')[0]}', .*{name}: "):
            PointCloud.from_file(tmp_path / name, 0.05)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: PointCloud([[0, 0]], 0.1), r"shape \(1, 2\)"),
        (lambda: PointCloud([[np.nan] * 3], 0.1), "all NaN"),
        (lambda: PointCloud([[np.inf, 0, 0]], 0.1), "reach inf m"),
        (lambda: PointCloud([[0, 0, 0], [1e4, 0, 0]], 1e-3), "too far for a size"),
        (lambda: PointCloud([[0, 0, 0], [90, 90, 90]], 1e-2), "span .* cubes: crop"),
        (lambda: PointCloud([[0, 0, 0]], 0), "size of obstacle"),
        pytest.param(
            lambda: PointCloud(np.random.default_rng(0).uniform(size=(9000, 3)), 0.01),
            "take 0.04 m",
            marks=pytest.mark.slow,
        ),
        (lambda: HeightMap([[0, 0]], 0.1), "no column"),
        (lambda: HeightMap([0, 1], 0.1), "of shape"),
        (lambda: HeightMap([[np.nan]], 0.1), "greatest height"),
        (lambda: HeightMap(np.random.default_rng(0).uniform(size=(60, 60)), 0.1, step=1e-3), "larger step"),
        (lambda: HeightMap([[1e5]], 0.1), "greatest height|larger one"),
    ],
)  # fmt: skip
def test_faults_are_named(make, says):
    with pytest.raises(ProblemError, match=says):
        make()


def test_a_height_map():
    x, y = np.meshgrid(np.linspace(0, 1, 20), np.linspace(0, 1, 30), indexing="ij")
    heights = 0.2 + 0.1 * np.sin(4 * x) * np.cos(3 * y)
    heights[3, 4] = -1.0  # a hole
    ground = HeightMap(heights, 0.05, (1, 2, -0.3), 0.02)
    low, high = ends(ground)
    assert np.isclose(low[:, 2].min(), -0.3) and len(low) < 60  # of 600 columns
    index = np.argwhere(heights > 0)
    tops = np.column_stack([[1, 2] + (index + 0.5) * 0.05, heights[heights > 0] - 0.3])
    assert np.all(inside(tops, low, high))
    assert not np.any(inside(tops + np.array([0, 0, 0.04001]), low, high))  # rounded up, and a step
    assert not inside(np.array([[1 + 3.5 * 0.05, 2 + 4.5 * 0.05, -0.29]]), low, high)[0]
    assert obstacle_from(json.loads(json.dumps(obstacle_entry(ground))), "here") == ground


def test_a_pose_inside_a_cloud_is_refused_by_its_name():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    cloud = PointCloud(noisy_table() / 4, 0.02, name="camera 1")
    with pytest.raises(ProblemError, match=r"at the start, 'link\d' is .* mm inside 'camera 1'"):
        ad.MinimumTimeProblem(robot, q_start=[0.0, 0.0], q_goal=[1.0, 0.0], obstacles=[cloud])


def test_a_problem_file_that_would_be_too_large_is_not_written(tmp_path):
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    wall = np.array(np.meshgrid(2.0, np.arange(-1, 1, 0.01), np.arange(-1, 1, 0.01))).reshape(3, -1).T
    cloud = PointCloud(wall, 0.01)
    problem = ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[1, 0], obstacles=[cloud])
    with pytest.raises(ProblemError, match=r"would have \d+ bytes, and 262144 are read"):
        problem.to_toml()
    np.save(tmp_path / "wall.npy", wall)
    text = problem.variant(obstacles=()).to_toml()
    text += '[[problem.obstacles]]\ntype = "point cloud"\nname = "point cloud"\nfile = "wall.npy"\nsize = 0.01\n'
    (tmp_path / "problem.toml").write_text(text)
    assert ad.read_problem(tmp_path / "problem.toml").obstacles == (cloud,)
