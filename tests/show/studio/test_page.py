"""The studio in a real browser: `armdyn studio` in a process of its own, without a network."""

import contextlib
import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from types import SimpleNamespace

import msgspec
import numpy as np
import psutil
import pytest
import viser
import zstandard
from websockets.sync.client import connect

import armdyn as ad
from armdyn.models.scene.reaching import frame_placement
from armdyn.show.page.scene import reach_of
from armdyn.show.studio.page import Page
from armdyn.show.studio.session import restored
from cli.command import COMMAND, run_here
from problems import POSES, paper_arm
from show.browser import FEW_FRAMES, UNDRAWN, drag, pixel_of, wait_until
from show.studio.test_session import session_of, setup_of

pytestmark = pytest.mark.slow

DESKTOP, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}
COMPUTED = "document.querySelector('#studio-answer')?.innerText.match(/^[0-9.]+ s$/) !== null"


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return probe.getsockname()[1]


SLOW_FRAMES = """
import sys, time
from armdyn.cli import main
from armdyn.show.studio.session import Session
tick = Session.tick
Session.tick = lambda self: (time.sleep(0.2), tick(self))
main()
"""
"""`armdyn` with a studio of which a frame takes a fifth of a second."""


@contextlib.contextmanager
def served(folder, *arguments, robot="rr", command=COMMAND):
    """A running studio, and its first output; killed in the end, if it has not ended."""
    line = [
        *command,
        "studio",
        robot,
        "--json",
        "--out",
        folder,
        "--port",
        free_port(),
        "--search",
        "quick",
        *arguments,
    ]
    process = subprocess.Popen([str(one) for one in line], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        line = process.stdout.readline()
        assert line, process.stderr.read()
        yield process, json.loads(line)
    finally:
        process.kill()
        process.wait()


@contextlib.contextmanager
def browser(chromium):
    """Opens pages, each in a profile of its own; in the end none of them has met an error or called another host."""
    requests, errors, contexts = [], [], []

    def opened(url, size=DESKTOP):
        context = chromium.new_context(viewport=size)
        contexts.append(context)
        context.add_init_script(UNDRAWN + FEW_FRAMES)
        context.set_default_timeout(90_000)  # [ms]: machines that run all tests at once are slow
        page = context.new_page()
        page.on("request", lambda request: requests.append((url, request.url)))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda line: errors.append(line.text) if line.type == "error" else None)
        page.goto(url)
        wait_until(page, COMPUTED)
        return page

    try:
        yield opened
    finally:
        for context in contexts:
            context.close()
    assert not errors
    assert not [link for url, link in requests if not link.startswith((url, "data:", "blob:"))]


def goal(page):
    """Joint positions of the goal's sliders; the first slider is the time's."""
    sliders = page.get_by_role("slider").all()[1:]
    return [float(one.get_attribute("aria-valuenow")) for one in sliders]


def fields(page, label):
    """The numbers in a row of the widgets."""
    return page.locator("label", has_text=label).locator("xpath=../../..").locator("input:not([type=hidden])")


def duration(page):
    wait_until(page, COMPUTED)
    return float(page.inner_text("#studio-answer").split()[0])


def until_goal(page, wanted, within=0.51e-3):  # it is shown in thousandths
    for _ in range(300):
        if len(found := goal(page)) == len(wanted) and np.allclose(found, wanted, rtol=0, atol=within):
            return
        page.wait_for_timeout(50)
    pytest.fail(f"the goal is {goal(page)}, not {wanted}")


def until_saved(file, wanted):
    for _ in range(300):
        if file.exists() and json.loads(file.read_text())["state"]["goal"] == wanted:
            return
        time.sleep(0.05)
    pytest.fail(f"{file.name} has not the goal {wanted}")


def set_goal(page, wanted):
    for joint, value in enumerate(wanted, start=1):
        fields(page, f"joint{joint}").fill(str(value))
    until_goal(page, wanted)


def plain_duration(q_goal, **arguments):
    robot = paper_arm("rr", 0.0)
    problem = ad.MinimumTimeProblem(robot, q_start=POSES["rr"][0], q_goal=q_goal, **arguments)
    return ad.solve_minimum_time(problem, ad.MinimumTimeOptions(search="quick")).duration


def test_a_fresh_studio_with_two_browsers(chromium, tmp_path):
    """One studio shows all of this: to start it, and to open a page, takes seconds."""
    leave_a_state(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as taken, browser(chromium) as opened:
        port = taken.getsockname()[1]
        with served(tmp_path, "--fresh", "--q-goal", "0.4,0.3", "--port", port) as (process, said):
            assert said["restored"] is False
            assert said["port"] > port
            pages_of_others_cannot_talk_to_it(said["port"])
            desktop = opened(said["url"])
            until_goal(desktop, [0.4, 0.3])
            the_gizmo_is_dragged_by_the_mouse(desktop)
            both_show_the_same(desktop, phone := opened(said["url"], PHONE))
            phone.close()
            a_motion_follows_the_keyboard(desktop)
            obstacles_load_and_files(desktop, tmp_path)
            desktop.close()
            malformed_messages_are_dropped(said["port"])
            with socket.create_connection(("127.0.0.1", said["port"])):  # a client that says nothing: it took 6 s
                ctrl_c_ends_it_and_no_process_is_left(process, 5.0)


def leave_a_state(folder):
    """A session that another studio would take up."""
    setup = setup_of()
    with session_of(setup, folder) as session:
        session.change(goal=(0.7, 0.1))
    assert restored(setup, folder).goal == (0.7, 0.1)


def a_motion_follows_the_keyboard(page):
    set_goal(page, POSES["rr"][1])
    page.wait_for_timeout(300)
    assert float(fields(page, "joint1").input_value()) == pytest.approx(POSES["rr"][1][0], abs=1e-6)  # as typed
    page.get_by_role("slider").nth(1).focus()
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    wanted = [POSES["rr"][1][0] + 5e-3, POSES["rr"][1][1]]
    until_goal(page, wanted, within=1e-3)  # a slider's step
    page.wait_for_timeout(300)
    assert duration(page) == pytest.approx(plain_duration(goal(page)), abs=1e-4)
    page.get_by_role("tab", name="Goal").focus()
    page.keyboard.press("ArrowRight")
    assert page.get_by_role("tab", name="Start").get_attribute("aria-selected") == "true"


def the_gizmo_is_dragged_by_the_mouse(page):
    robot = paper_arm("rr", 0.0)
    reach = reach_of(robot, np.zeros((1, 2)))
    set_goal(page, [0.2, 0.9])
    page.wait_for_timeout(2000)  # until its scene stands
    tip = frame_placement(robot, robot.tip, np.array([0.2, 0.9]))
    along = tip.rotation[:, 2]
    eye = np.array([0, -1.9, 0.2]) * reach
    begin, end = (pixel_of(tip.translation + x * reach * along, eye, np.zeros(3), DESKTOP) for x in (0.12, 0.02))
    drag(page, begin, end)
    wait_until(page, "Math.abs(document.querySelectorAll('[role=slider]')[2].ariaValueNow - 0.9) > 1e-3")
    page.wait_for_timeout(500)
    moved = frame_placement(robot, robot.tip, np.array(goal(page))).translation - tip.translation
    # A tenth of the reach against the arrow's direction, as exact as pixels and the arrow's perspective are.
    np.testing.assert_allclose(moved, -0.1 * reach * along, atol=0.02 * reach)


def both_show_the_same(desktop, phone):
    set_goal(desktop, POSES["rr"][1])
    until_goal(phone, POSES["rr"][1])
    slider = phone.get_by_role("slider").nth(2)
    slider.focus()
    phone.keyboard.press("ArrowLeft")
    until_goal(desktop, goal(phone))
    assert goal(phone)[1] != pytest.approx(POSES["rr"][1][1], abs=1e-6)
    assert duration(desktop) == duration(phone)
    for role, name in (("button", "Pause"), ("tab", "Limits"), ("button", "Problem (TOML)")):
        one = phone.get_by_role(role, name=name)
        one.scroll_into_view_if_needed()
        box = one.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= PHONE["width"]
    assert phone.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]


def obstacles_load_and_files(page, folder):
    page.get_by_role("tab", name="Goal").click()
    wanted = goal(page)
    page.get_by_role("tab", name="Obstacles").click()
    page.get_by_role("button", name="Add obstacle").focus()
    page.keyboard.press("Enter")
    fields(page, "position").first.wait_for()
    for field, value in zip(fields(page, "position").all(), ("0.1", "0", "0.9"), strict=True):
        field.fill(value)
    page.get_by_role("tab", name="Limits").click()
    fields(page, "payload").fill("0.3")
    page.wait_for_timeout(500)
    assert duration(page) > 0
    page.get_by_role("button", name="Problem (TOML)").click()
    page.get_by_text("Saved:").wait_for()
    saved = ad.read_problem(folder / "problem.toml")
    assert saved.robot.payload.mass == pytest.approx(0.3)
    np.testing.assert_allclose(saved.q_goal, wanted, atol=1e-3)  # a slider's step
    (box,) = saved.obstacles
    np.testing.assert_allclose(np.array(box.placement)[:3, 3], [0.1, 0, 0.9])
    page.get_by_role("button", name="Report (HTML)").click()
    page.get_by_text("report.html").wait_for(timeout=60_000)
    page.get_by_role("button", name="Motion (npz)").click()
    page.get_by_text("trajectory.npz").wait_for()
    assert ad.Trajectory.load(folder / "trajectory.npz").duration == pytest.approx(duration(page), abs=1e-4)
    page.get_by_role("tab", name="Obstacles").click()
    page.get_by_role("button", name="Remove obstacle").click()
    page.get_by_role("button", name="Remove obstacle").wait_for(state="detached")


def test_fields_filled_faster_than_frames_are_drawn_keep_their_values(chromium, tmp_path):
    with served(tmp_path, command=[sys.executable, "-c", SLOW_FRAMES]) as (_, said), browser(chromium) as opened:
        page = opened(said["url"])
        page.get_by_role("tab", name="Obstacles").click()
        page.get_by_role("button", name="Add obstacle").click()
        fields(page, "position").first.wait_for()
        page.wait_for_timeout(600)  # until it is drawn
        for field, value in zip(fields(page, "position").all(), ("0.1", "0", "0.9"), strict=True):
            field.fill(value)
            page.wait_for_timeout(70)  # some arrive while the frame of the first is drawn
        page.get_by_role("tab", name="Goal").click()
        fields(page, "joint1").fill("0.3")
        page.wait_for_timeout(70)
        fields(page, "joint2").fill("0.2")
        page.wait_for_timeout(1000)
        assert goal(page) == pytest.approx([0.3, 0.2])
        page.get_by_role("button", name="Problem (TOML)").click()
        page.get_by_text("Saved:").wait_for()
        (box,) = ad.read_problem(tmp_path / "problem.toml").obstacles
        np.testing.assert_allclose(np.array(box.placement)[:3, 3], [0.1, 0, 0.9])


def test_a_value_of_a_browser_is_not_written_over_before_it_is_noted():
    """Viser sets a widget's value, tells the other browsers, and calls back then."""
    page, slider = Page.__new__(Page), SimpleNamespace(value=0.1)
    page._notes, page._known = {}, {}
    page._write(slider, 0.2)
    assert slider.value == 0.2
    slider.value = 0.7
    page._write(slider, 0.2)
    assert slider.value == 0.7


def test_a_motion_appears_and_a_killed_studio_takes_up_its_last_state(chromium, tmp_path):
    with served(tmp_path) as (process, said), browser(chromium) as opened:
        assert said["restored"] is False
        page = opened(said["url"])
        assert duration(page) == pytest.approx(plain_duration(POSES["rr"][1]), abs=1e-4)  # as many digits are shown
        until_goal(page, POSES["rr"][1])
        fields(page, "joint1").fill("0.7")
        until_goal(page, [0.7, POSES["rr"][1][1]])
        until_saved(tmp_path / "studio.json", [0.7, POSES["rr"][1][1]])  # which is twice a second
        page.close()
        process.kill()
    with served(tmp_path) as (_, said), browser(chromium) as opened:
        assert said["restored"] is True
        until_goal(opened(said["url"]), [0.7, POSES["rr"][1][1]])
        assert json.loads((tmp_path / "studio.json").read_text())["state"]["goal"] == [0.7, POSES["rr"][1][1]]


def malformed_messages_are_dropped(port):
    """Values that no widget has, and poses that are none, from a client that is one of viser's otherwise."""
    with connect(f"ws://127.0.0.1:{port}", subprotocols=[f"viser-v{viser.__version__}"], max_size=None) as client:
        camera = dict.fromkeys(("position", "look_at", "up_direction"), (0.0, 0.0, 1.0)) | {"wxyz": [1.0, 0, 0, 0]}
        sizes = {"fov": 1.0, "near": 0.1, "far": 9.0, "image_height": 800, "image_width": 1000}
        client.send(msgspec.msgpack.encode({"type": "ViewerCameraMessage", **camera, **sizes}))
        names = set()
        until = time.monotonic() + 2.0
        with contextlib.suppress(TimeoutError):
            while (raw := client.recv(timeout=1.0)) and time.monotonic() < until:
                packed = raw[raw.find(b"\x28\xb5\x2f\xfd") :]  # zstandard's mark
                names.update(
                    re.findall(
                        rb"\xd9\x24([0-9a-f-]{36})", zstandard.ZstdDecompressor().decompressobj().decompress(packed)
                    )
                )
        assert len(names) > 20
        for name in names:
            for updates in (
                {"value": [1, 2, 3]},
                {"value": "abc"},
                {"value": float("nan")},
                {"min": "x"},
                {"options": 1},
            ):
                message = {"type": "GuiUpdateMessage", "uuid": name.decode(), "updates": updates}
                client.send(msgspec.msgpack.encode(message))
        for wxyz, position in (([1], [0, 0, 0]), ([0, 0, 0, 0], [0, 0, 0]), ([1, 0, 0, 0], [float("nan")] * 3)):
            pose = {"wxyz": wxyz, "position": position, "owner": "server"}
            client.send(msgspec.msgpack.encode({"type": "TransformControlsUpdateMessage", "name": "/goal", **pose}))
        time.sleep(0.5)


def ctrl_c_ends_it_and_no_process_is_left(process, within=30.0):
    born = psutil.Process(process.pid).children(recursive=True)
    assert born  # the solver's
    os.kill(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=within)
    assert process.returncode == 130
    assert json.loads(out.splitlines()[-1])["status"] == "interrupted"
    assert "Traceback" not in err
    assert not psutil.wait_procs(born, timeout=10)[1]


def pages_of_others_cannot_talk_to_it(port):
    own = f"127.0.0.1:{port}"
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
               "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol": "viser-v1"}  # fmt: skip
    for headers, status in (
        ({}, 200),
        ({"Host": "evil.example"}, 403),
        ({**upgrade, "Origin": f"http://{own}"}, 101),
        ({**upgrade, "Origin": "http://evil.example"}, 403),
    ):
        connection = http.client.HTTPConnection(own, timeout=30)
        connection.request("GET", "/", headers=headers)
        assert connection.getresponse().status == status, headers
        connection.close()


def test_a_missing_package_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr("armdyn.cli.studio.find_spec", lambda name: None)
    done = run_here("studio", "rr", "--out", tmp_path)
    assert done.returncode == 2
    assert "pip install viser" in done.stderr
