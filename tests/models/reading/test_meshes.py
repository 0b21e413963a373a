import os

import numpy as np
import pytest

from armdyn.models import Robot
from armdyn.models.reading.meshes import load_meshes, mesh_folders, resolve_mesh
from oracles import two_links


@pytest.fixture
def workspace(tmp_path):
    """A ROS workspace with a package, a package next to it, and a secret outside."""
    for name in ("src/arm/urdf/arm.urdf", "src/arm/meshes/a.stl", "src/arm/package.xml", "src/other/b.stl", "secret"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(two_links() if name.endswith("urdf") else "x")
    return tmp_path


def test_the_urdfs_own_package_is_a_folder(workspace):
    urdf = workspace / "src/arm/urdf/arm.urdf"
    folders = mesh_folders(urdf, ())
    assert folders == (str(urdf.parent), str(workspace / "src/arm"))
    assert Robot.from_urdf(urdf).package_dirs == folders
    mesh = workspace / "src/arm/meshes/a.stl"
    for name in ("package://arm/meshes/a.stl", "../meshes/a.stl", "meshes/a.stl", f"file://{mesh}", str(mesh)):
        assert resolve_mesh(name, folders) == mesh
    with pytest.raises(FileNotFoundError, match=r"--package-dir DIR, in Python package_dirs=\['DIR'\]"):
        resolve_mesh("package://other/b.stl", folders)
    assert resolve_mesh("package://other/b.stl", (*folders, str(workspace / "src"))) == workspace / "src/other/b.stl"
    assert resolve_mesh("model://other/b.stl", (str(workspace / "src/other"),)) == workspace / "src/other/b.stl"


@pytest.mark.parametrize(
    "name",
    [
        "package://arm/../../secret", "package://../../secret", "../../../secret", "file://{top}/secret",
        "{top}/secret", "link", "package://arm/link", "folder/secret", "file:///etc/passwd", "/etc/passwd", "/dev/zero",
    ],
)  # fmt: skip
def test_nothing_outside_is_reached(workspace, name):
    package = workspace / "src/arm"
    (package / "link").symlink_to(workspace / "secret")
    (package / "folder").symlink_to(workspace)
    folders = mesh_folders(package / "urdf/arm.urdf", ())
    with pytest.raises((PermissionError, FileNotFoundError)):
        resolve_mesh(name.format(top=workspace), folders)


@pytest.mark.parametrize("name", ["", "package://", "http://x.org/a.stl", "a" * 10_000, "a\0b", "meshes", "pipe.stl"])
def test_names_that_are_no_file(workspace, name):
    os.mkfifo(workspace / "src/arm/pipe.stl")
    with pytest.raises(FileNotFoundError) as caught:
        resolve_mesh(name, (str(workspace / "src/arm"),))
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("name", ["a.zip", "a.urdf", "a", "a.tar.gz", "a.3mf"])
def test_only_meshes_are_opened(tmp_path, name):
    (tmp_path / name).write_bytes(b"PK")
    with pytest.raises(ValueError, match=r"is none of \.stl"):
        list(load_meshes(tmp_path / name, np.ones(3)))


def test_a_mesh_that_is_no_regular_file(tmp_path):
    os.mkfifo(tmp_path / "a.stl")
    with pytest.raises(ValueError, match="it is a named pipe"):
        list(load_meshes(tmp_path / "a.stl", np.ones(3)))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_mesh_with_a_document_type_is_refused_before_it_is_expanded(tmp_path, encoding):
    """Ten entities of ten each, nine times: 3 GB of text in a mesh of 1 kB."""
    entities = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10 if i else "x" * 10}">' for i in range(9))
    text = f'<?xml version="1.0" encoding="{encoding}"?><!DOCTYPE COLLADA [{entities}]><COLLADA>&e8;</COLLADA>'
    (tmp_path / "a.dae").write_text(text, encoding)
    with pytest.raises(ValueError, match=r"mesh 'a\.dae': it has a DTD"):
        list(load_meshes(tmp_path / "a.dae", np.ones(3)))


def test_files_next_to_a_mesh_are_read_as_it_is(tmp_path):
    """A material is read where it is a file of the mesh's folder; a pipe is not waited for."""
    folder = tmp_path / "meshes"
    folder.mkdir()
    triangle = "mtllib {}\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n"
    (folder / "a.obj").write_text(triangle.format("a.mtl"))
    (folder / "a.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (tmp_path / "out.mtl").write_text("newmtl red\nKd 1 0 0\n")
    os.mkfifo(folder / "pipe.mtl")
    [(_, mesh)] = load_meshes(folder / "a.obj", np.ones(3))
    assert list(mesh.visual.material.main_color[:3]) == [255, 0, 0]
    for other in ("pipe.mtl", "../out.mtl", "/dev/zero", "nowhere.mtl"):
        (folder / "a.obj").write_text(triangle.format(other))
        [(bare, mesh)] = load_meshes(folder / "a.obj", np.ones(3))
        assert len(bare.faces) == 1 and list(mesh.visual.material.main_color[:3]) != [255, 0, 0]


@pytest.mark.parametrize(
    "visual",
    [
        '<geometry><mesh filename="package://gone/a.stl"/></geometry>',
        '<geometry><mesh filename="/etc/passwd"/></geometry>',
        '<geometry><mesh filename="a.stl" scale="nan"/></geometry>',
        '<geometry/><origin xyz="no"/>', '<geometry><box size="-1"/></geometry>',
    ],
)  # fmt: skip
def test_dynamics_need_no_mesh(tmp_path, visual):
    path = tmp_path / "arm.urdf"
    shapes = f"<visual>{visual}</visual><collision>{visual}</collision>"
    path.write_text(two_links().replace("<inertial>", f"{shapes}<inertial>"))
    assert Robot.from_urdf(path).nv == 1
