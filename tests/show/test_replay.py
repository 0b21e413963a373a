"""Replays: one page, no network, the arm moves in a real browser."""

import base64
import gzip
import json
import re
import threading
from dataclasses import replace
from hashlib import sha256

import numpy as np
import pinocchio as pin
import psutil
import pytest

import armdyn as ad
from armdyn.errors import ArmdynWarning, ProblemError, TrajectoryError
from armdyn.models.reading import meshes
from armdyn.show import replay, visuals
from armdyn.show.page.facts import Facts
from armdyn.show.page.motions import ShownMotion
from armdyn.show.page.scene import scene_data
from armdyn.show.page.verdict import verdict_of
from problems import GANTRY, paper_arm, solved
from show.browser import left_the_page, open_page, screenshot, seek
from show.motions import HANGING, RAISED, quintic
from show.page.runs import FACTS

DRAWN = {"width": 400, "height": 300, "drawn": True}
"""A small picture: each of its pixels is computed without a graphics card."""

MESH_ARM = """
<robot name="stranger">
  <link name="base"/>
  <link name="one">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="{mesh}"/></geometry></visual>
  </link>
  <link name="hand"/>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="one"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="5" velocity="5"/>
  </joint>
  <joint name="wrist" type="fixed"><origin xyz="0.5 0 0"/><parent link="one"/><child link="hand"/></joint>
</robot>"""


def motion(arm="rr", duration=0.35, name="minimum time"):
    robot = paper_arm(arm)
    return robot, quintic(robot, HANGING[arm], RAISED[arm], duration, name)


def scene_of(path):
    found = re.search(r'id="armdyn-data">(.*?)</script>', path.read_text("utf-8"), re.S)
    return json.loads(gzip.decompress(base64.b64decode(json.loads(found[1])["scene"])))


def mesh_arm(folder, mesh):
    path = folder / "arm.urdf"
    path.write_text(MESH_ARM.format(mesh=mesh))
    return ad.Robot.from_urdf(path)


def tip_of(robot, q):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.configuration(q))
    return data.oMf[robot.model.getFrameId(robot.tip)].translation


def test_the_scene_of_joints_that_slide_is_as_large_as_their_way():
    robot = ad.Robot.from_urdf_string(GANTRY)
    motions = [quintic(robot, [0.0, 0.0], goal, 1.0) for goal in ([0.3, -0.5], [-0.8, 0.1])]
    assert scene_data(robot, motions)["reach"] == pytest.approx(0.8 + 0.5)


@pytest.mark.slow
def test_the_arm_moves_in_a_browser_without_a_network(chromium, tmp_path):
    robot, run = motion()
    path = replay.write_html(robot, [run], tmp_path / "rr.html")
    with open_page(chromium, path, **DRAWN) as (page, requests, errors):
        assert page.evaluate("armdyn.duration") == pytest.approx(run.duration)
        pictures = set()
        for time in (0.0, 0.2, run.duration):
            pictures.add(sha256(screenshot(page, time)).hexdigest())
            seen = page.evaluate("armdyn.linkPosition('tip')")
            # Read from the scene: 32-bit floats, and straight lines between 60 frames per second.
            np.testing.assert_allclose(seen, tip_of(robot, run(time).q), rtol=0, atol=1e-4)
        assert len(pictures) == 3
        page.evaluate("armdyn.seek(0), armdyn.play()")
        page.wait_for_function("armdyn.time > 0.05", timeout=30_000)
        assert not errors
        assert requests
        assert not left_the_page(requests)


@pytest.mark.slow
def test_several_trajectories_move_apart(chromium, tmp_path):
    robot, fast = motion("rrr", 0.35)
    slow = quintic(robot, HANGING["rrr"], [0.5, 0.6, 0.7], 2.0, "PID")
    path = replay.write_html(robot, [fast, slow], tmp_path / "race.html", slow_motion=5)
    with open_page(chromium, path) as (page, _, errors):
        seek(page, 1.0)
        first, second = (np.array(page.evaluate(f"armdyn.linkPosition('tip', {k})")) for k in (0, 1))
        np.testing.assert_allclose(first[[0, 2]], tip_of(robot, fast(0.35).q)[[0, 2]], atol=1e-4)
        np.testing.assert_allclose(second[[0, 2]], tip_of(robot, slow(1.0).q)[[0, 2]], atol=1e-4)
        assert abs(first[1] - second[1]) > 0.1
        assert page.locator("#speed option:checked").inner_text() == "×0.2"
        assert [text.split("\n")[0] for text in page.locator(".run").all_inner_texts()] == ["minimum time", "PID"]
        # Torques of both motions; the one that has arrived says so.
        assert page.locator(".run b").all_inner_texts() == ["0.3500 s ✓", "2.0000 s"]
        assert page.locator(".row:not(.head)").count() == 6
        assert not errors


def test_it_gives_the_verdict_on_each_motion():
    robot, run = motion()
    made = replay.replay_of(robot, [solved("rr"), run, ShownMotion("saved", run, Facts(FACTS))])
    levels, headlines = zip(*made.data["verdicts"], strict=True)
    assert levels == ("good", "none", "fair")
    assert headlines[0] and not headlines[1] and headlines[2]


@pytest.mark.slow
def test_the_verdict_is_seen(chromium, tmp_path):
    robot, run = motion()
    facts = Facts({"arrival_rule": "<b>", "arrival_time": 0.3, "message": "<b>late</b>"})
    path = replay.write_html(robot, [ShownMotion("saved", run, facts), run], tmp_path / "rr.html")
    with open_page(chromium, path) as (page, _, errors):
        assert page.locator(".run small").all_inner_texts() == [verdict_of(facts).headline]
        assert "<b>late</b>" in page.locator(".verdict").inner_text()
        assert not errors


@pytest.mark.slow
def test_curves_are_a_click_away(chromium, tmp_path):
    robot, run = motion()
    with open_page(chromium, replay.write_html(robot, [run], tmp_path / "rr.html")) as (page, _, errors):
        assert not page.locator("#plots").is_visible()
        wide = page.locator("#pane").bounding_box()["width"]
        page.locator("#view").click()
        page.locator("#plots").wait_for(state="visible")
        assert page.locator("#pane").bounding_box()["width"] < wide
        page.locator("#view").click()
        page.locator("#plots").wait_for(state="hidden")
        assert not errors


@pytest.mark.slow
def test_a_panda_is_drawn_by_its_meshes(chromium, tmp_path):
    robot = ad.Robot.from_library("panda")
    home = np.array([0, -0.3, 0, -2.2, 0, 2, 0.8])
    run = quintic(robot, home, home + 0.4, 0.8)
    path = replay.write_html(robot, [run], tmp_path / "panda.html")
    assert len(scene_of(path)["commands"]) > 30
    assert path.stat().st_size < 30e6
    with open_page(chromium, path, **DRAWN) as (page, requests, errors):
        before, after = (screenshot(page, time) for time in (0.0, 0.8))
        assert before != after
        np.testing.assert_allclose(
            page.evaluate("name => armdyn.linkPosition(name)", robot.tip), tip_of(robot, run.q[-1]), atol=1e-4
        )
        assert not errors
        assert not left_the_page(requests)


def test_the_page_holds_no_links_and_the_same_input_gives_the_same_bytes(tmp_path):
    robot, run = motion()
    first, second = (replay.write_html(robot, [run], tmp_path / name).read_bytes() for name in ("a", "b"))
    assert first == second
    assert not re.findall(rb"(?:https?|wss?|ftp)://", first.replace(b"`ws://", b""))
    assert not re.findall(rb"<(?:link|img|iframe)\b|<script[^>]+src", first)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b"]


@pytest.mark.slow
def test_names_from_strangers_stay_text(chromium, tmp_path):
    robot, run = motion()
    evil = "</script><script>window.broken = 1</script><img src=x onerror='broken=1'>{{viewer}}"
    robot, run = replace(robot, name=evil, joint_names=(evil, "joint2")), replace(run, name=evil)
    path = replay.write_html(robot, [run], tmp_path / "evil.html")
    with open_page(chromium, path) as (page, _, errors):
        assert page.evaluate("window.broken") is None
        assert page.locator("h1").inner_text() == evil
        assert page.title().startswith(evil[:20])
        assert not errors


@pytest.mark.parametrize("mesh", ["package://nowhere/x.stl", "broken.stl", "../secret.stl", "file:///etc/passwd"])
def test_a_mesh_that_cannot_be_drawn_becomes_a_rod(tmp_path, mesh):
    home = tmp_path / "home"
    home.mkdir()
    (home / "broken.stl").write_text("no mesh")
    (tmp_path / "secret.stl").write_text("solid secret")
    robot = mesh_arm(home, mesh)
    run = quintic(robot, [-1.0], [1.0], 1.0)
    with pytest.warns(ArmdynWarning, match="'one'"):
        path = replay.write_html(robot, [run], home / "x.html")
    with pytest.warns(ArmdynWarning):
        assert [type(shape.geometry).__name__ for shape in visuals.robot_shapes(robot)] == [
            "Sphere",
            "Cylinder",
        ]
    assert scene_of(path)["commands"]


@pytest.mark.parametrize("payload", [None, ad.Payload(mass=0.1)])
def test_a_model_is_drawn_as_rods(payload):
    """Of a model or an MJCF nothing is known but its joints."""
    model = pin.buildModelFromXML(ad.urdf_from_spec(ad.ArmSpec.paper("rr")))
    drawn = [
        type(shape.geometry).__name__ for shape in visuals.robot_shapes(ad.Robot.from_model(model, payload=payload))
    ]
    assert drawn == ["Sphere"] * (payload is not None) + ["Sphere", "Sphere", "Cylinder", "Cylinder"]


def test_a_mesh_is_found_only_inside_the_robots_folders(tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    inside, outside = home / "a.stl", tmp_path / "b.stl"
    inside.write_text("x")
    outside.write_text("x")
    (home / "link.stl").symlink_to(outside)
    folders = (str(home),)
    assert meshes.resolve_mesh("a.stl", folders) == inside.resolve()
    assert meshes.resolve_mesh("package://a.stl", folders) == inside.resolve()
    assert meshes.resolve_mesh(f"file://{inside}", folders) == inside.resolve()
    for name in ("../b.stl", "package://../b.stl", str(outside), f"file://{outside}", "link.stl"):
        with pytest.raises(PermissionError):
            meshes.resolve_mesh(name, folders)


def test_nothing_is_left_running(tmp_path):
    robot, run = motion()
    me = psutil.Process()
    before = {child.pid for child in me.children(recursive=True)}, len(me.net_connections())
    threads = set(threading.enumerate())
    replay.write_html(robot, [run], tmp_path / "x.html")
    assert ({child.pid for child in me.children(recursive=True)}, len(me.net_connections())) == before
    assert set(threading.enumerate()) == threads


@pytest.mark.slow
def test_a_payload_that_is_no_link_is_drawn():
    bare = ad.Robot.from_library("ur5")
    loaded = ad.Robot.from_library("ur5", payload=ad.Payload(mass=2.0))
    shapes = visuals.robot_shapes(loaded)
    assert len(shapes) == len(visuals.robot_shapes(bare)) + 1
    assert any(type(shape.geometry).__name__ == "Sphere" for shape in shapes)


def test_bad_input(tmp_path):
    robot, run = motion("rr")
    with pytest.raises(TrajectoryError):
        replay.write_html(robot, [], tmp_path / "x.html")
    with pytest.raises(TrajectoryError, match="2 joints"):
        replay.write_html(paper_arm("rrr"), [run], tmp_path / "x.html")
    for options in ({"fps": 0}, *({"slow_motion": x} for x in (-1.0, float("nan"), 0, 1e-320, "2"))):
        with pytest.raises(ProblemError, match="must be"):
            replay.write_html(robot, [run], tmp_path / "x.html", **options)
    with pytest.raises(OSError, match="nowhere"):
        replay.write_html(robot, [run], tmp_path / "nowhere" / "x.html")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_obstacles_stand_where_they_are(chromium, tmp_path):
    robot, run = motion()
    things = [ad.Box((0.1, 0.2, 0.3), (0.6, 0, 0.1)), ad.Sphere((0, 0, 1), 0.1), ad.Capsule((1, 0, 0), (1, 0, 1), 0.05)]
    shapes = visuals.obstacle_shapes(things)
    kinds = [type(shape.geometry).__name__ for shape in shapes]
    assert kinds == ["_NormalGeometry", "Sphere", "Sphere", "Sphere", "Cylinder"]
    assert all(shape.joint == 0 for shape in shapes)
    np.testing.assert_allclose(shapes[4].placement @ [0, 0.5, 0, 1], [1, 0, 1, 1], atol=1e-15)  # a sine's rounding
    for names in ([run], [run, run]):
        path = replay.write_html(robot, names, tmp_path / "post.html", obstacles=things)
        with open_page(chromium, path, **DRAWN) as (page, _, errors):
            seen, bare = screenshot(page, 0.1), None
            assert not errors
        with open_page(chromium, replay.write_html(robot, names, tmp_path / "bare.html"), **DRAWN) as (
            page,
            _,
            errors,
        ):
            bare = screenshot(page, 0.1)
        assert seen != bare
