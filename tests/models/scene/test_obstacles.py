"""Obstacles as values, and as JSON."""

import json
import os

import numpy as np
import pinocchio as pin
import pytest

from armdyn.errors import ProblemError
from armdyn.models.scene.obstacles import (
    Box,
    Capsule,
    Cylinder,
    Plane,
    Sphere,
    load_obstacles,
    obstacle_entry,
    obstacle_from,
)
from armdyn.models.values.placement import homogeneous, pose_of


def test_equal_obstacles_are_equal_and_hash_alike():
    at = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([1.0, 2.0, 3.0]))
    assert Box([1, 2, 3], at) == Box((1.0, 2.0, 3.0), at.homogeneous)
    assert len({Sphere([0, 0, 1], 2), Sphere((0, 0, 1), 2.0), Capsule([0, 0, 1], [0, 1, 0], 2)}) == 2
    np.testing.assert_array_equal(Box([1, 1, 1], [4, 5, 6]).pose[:3, 3], [4, 5, 6])


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Sphere([0, 0], 1), "center"),
        (lambda: Sphere([0, 0, np.nan], 1), "center"),
        (lambda: Sphere([0, 0, 0], 0), "radius"),
        (lambda: Capsule([0, 0, 0], "abc", 1), "b of obstacle"),
        (lambda: Box([1, 1, -1], [0, 0, 0]), "edge"),
        (lambda: Cylinder([0, 0, 1], [0, 0, 1], 1), "two ends"),
        (lambda: Plane([0, 0, 1], [0, 0, 0]), "normal of obstacle"),
        (lambda: Box([1, 1, 1], np.eye(3)), "placement"),
        (lambda: Box([1, 1, 1], np.diag([1, 1, -1, 1])), "rotation"),
        (lambda: homogeneous(None, "it"), "it"),
        (lambda: pose_of([0, 0, 0], [0, 0, 0, 0], None, "it"), "quaternion"),
        (lambda: pose_of([0, 0, 0], [0, 0, 0, 1], [0, 0, 0], "it"), "one of them"),
    ],
)
def test_faults_are_named(make, says):
    with pytest.raises(ProblemError, match=says):
        make()


def test_json(tmp_path):
    path = tmp_path / "scene.json"
    half = np.sqrt(0.5)
    path.write_text(
        json.dumps(
            [
                {"type": "sphere", "center": [0, 0, 1], "radius": 0.1, "name": "ball"},
                {"type": "capsule", "a": [0, 0, 0], "b": [0, 0, 1], "radius": 0.2},
                {"type": "box", "size": [1, 2, 3], "position": [1, 0, 0], "rpy": [0, 0, np.pi / 2]},
                {"type": "box", "size": [1, 2, 3], "position": [1, 0, 0], "quaternion": [0, 0, half, half]},
            ]
        )
    )
    ball, _, turned, same = load_obstacles(path)
    assert ball == Sphere((0, 0, 1), 0.1, name="ball")
    np.testing.assert_allclose(turned.pose, same.pose, atol=1e-15)  # rounding of a sine
    np.testing.assert_allclose(turned.pose[:3, 0], [0, 1, 0], atol=1e-15)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "JSON"),
        ("[]", "list"),
        ('{"type": "sphere"}', "list"),
        ("[1]", "type"),
        ('[{"type": "cone"}]', "cone"),
        ('[{"type": "sphere", "center": [0, 0, 0]}]', "radius"),
        ('[{"type": "sphere", "center": [0, 0, 0], "radius": "x"}]', "obstacle 1"),
        ('[{"type": "sphere", "center": [0, 0, 0], "radius": 1, "colour": 2}]', "colour"),
        ("[" * 100_000, "JSON"),
        ('[{"type": []}]', "type"),
        (
            '[{"type": "box", "size": [1, 1, 1], "position": [0, 0, 0], "quaternion": [1e308, 0, 0, 1e308]}]',
            "four numbers",
        ),
        ('[{"type": "sphere", "center": [0, 0, 1e400], "radius": 1}]', "not JSON"),
        ('[{"type": "sphere", "center": [0, 0, 0], "radius": ' + "9" * 400 + "}]", "not JSON"),
        ('[{"type": "sphere", "center": [0, 0, 0], "radius": 1, "name": "\\ud800"}]', "not JSON"),
        ('[{"type": "sphere", "center": [0, 0, 0], "radius": 1, "name": "' + "x" * 201 + '"}]', "201 characters"),
    ],
)
def test_json_that_is_none(tmp_path, text, says):
    path = tmp_path / "scene.json"
    path.write_text(text)
    with pytest.raises(ProblemError, match=says):
        load_obstacles(path)
    with pytest.raises(ProblemError, match="no file"):
        load_obstacles(tmp_path / "nowhere.json")


def test_another_file_of_obstacles(tmp_path):
    os.mkfifo(tmp_path / "pipe.json")
    with pytest.raises(ProblemError, match="it is a named pipe"):
        load_obstacles(tmp_path / "pipe.json")
    with pytest.raises(ProblemError, match="it is a device"):
        load_obstacles("/dev/zero")


def test_messages_are_short(tmp_path):
    path = tmp_path / "scene.json"
    path.write_text(json.dumps([{"type": "sphere", "center": [0] * 10_000, "radius": 1}]))
    with pytest.raises(ProblemError) as raised:
        load_obstacles(path)
    assert "three" in str(raised.value) and len(str(raised.value)) < 500


def test_an_obstacles_entry_restores_the_obstacle():
    turned = Box([0.1, 0.2, 0.3], pose_of([1, 2, 3], None, [0.1, -0.4, 2.0], "it"), name="crate")
    for one in (
        Sphere([1, 2, 3], 0.1),
        Capsule([0, 0, 0.1], [1, 0, 0], 0.2, name="pipe"),
        Box([1, 2, 3], [0, 0, 1]),
        Cylinder([0, 0, 0.1], [1, 0, 0], 0.2),
        Plane([0, 0, 1], [0, 1, 0]),
    ):
        assert obstacle_from(json.loads(json.dumps(obstacle_entry(one))), "it") == one
    again = obstacle_from(obstacle_entry(turned), "it")
    assert (again.size, again.name) == (turned.size, turned.name)
    # By way of a quaternion: some roundings of 1e-16 each.
    np.testing.assert_allclose(again.pose, turned.pose, atol=1e-14)
