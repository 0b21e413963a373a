"""The report in a real browser without a network: one time for arm, curves, slider and numbers."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.models.scene.obstacles import Box, Capsule
from armdyn.show.page.facts import Facts
from armdyn.show.page.motions import ShownMotion, Subject
from armdyn.show.page.report import report_html, report_of
from oracles import robot_named
from show.browser import left_the_page, open_page, resize, screenshot, seek, wait_until
from show.motions import HANGING, RAISED, quintic
from show.page.runs import judged
from show.page.test_report import EVIL

pytestmark = pytest.mark.slow

DESKTOP, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}


def written(folder, robot, *moves, title="rr"):
    path = folder / "report.html"
    path.write_text(report_html(report_of(Subject.of(robot), moves, title)))
    return path


def pair():
    """A quintic, and another that takes longer."""
    robot, _ = judged()
    fast, slow = (quintic(robot, HANGING["rr"], RAISED["rr"], duration, name) for duration, name in
                  ((0.35, "fast"), (0.5, "slow")))  # fmt: skip
    return robot, ShownMotion("fast", fast, Facts()), ShownMotion("slow", slow, Facts())


@pytest.fixture(scope="module")
def opened(chromium, tmp_path_factory):
    """A page of a pair, which tests give their size: its robot, motions, requests and errors."""
    robot, fast, slow = pair()
    with open_page(chromium, written(tmp_path_factory.mktemp("pair"), robot, fast, slow)) as (page, requests, errors):
        yield page, (robot, fast, slow), requests, errors


def anew(page, size):
    """Give the page a size, and see all of the time."""
    resize(page, size)
    whole = page.get_by_role("button", name="see all of the time")
    if whole.is_enabled():
        whole.click()


def tip_of(robot, q):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.configuration(q))
    return data.oMf[robot.model.getFrameId(robot.tip)].translation


def agree(page, time, pixels):
    """Slider, clock and the cursors of all charts are at a time, as near as a pixel."""
    duration = page.evaluate("armdyn.duration")
    assert page.evaluate("armdyn.time") == pytest.approx(time, abs=pixels)
    np.testing.assert_allclose(page.evaluate("armdyn.cursors"), time, atol=pixels)
    assert float(page.locator("#scrubber").input_value()) == pytest.approx(time / duration, abs=pixels / duration)
    assert float(page.locator("#clock").inner_text().split()[0]) == pytest.approx(time, abs=pixels + 1e-4)


@pytest.mark.parametrize("side", [-1, 1])
def test_the_camera_is_where_a_wall_does_not_hide_the_arm(chromium, tmp_path, side):
    robot = robot_named("panda")
    motion = quintic(robot, np.zeros(7), np.array([1.0, 0.5, 0, -1.5, 0, 2, 0]), 1.0, "swing")
    wall = Box((3, 0.02, 3), (0, 0.9 * side, 1.5), name="wall")
    path = tmp_path / "report.html"
    path.write_text(report_html(report_of(Subject.of(robot, [wall]), [ShownMotion("swing", motion, Facts())], "panda")))
    with open_page(chromium, path) as (page, _, errors):
        assert side * page.evaluate("armdyn.camera")[1] < 0 and not errors


@pytest.mark.parametrize("size", [DESKTOP, PHONE])
def test_arm_curves_and_slider_have_one_time(opened, size):
    page, (robot, fast, slow), requests, errors = opened
    anew(page, size)
    assert page.evaluate("armdyn.duration") == pytest.approx(0.5)
    for time in (0.0, 0.2, 0.4, 0.5):
        seek(page, time)
        agree(page, time, 1e-9)
        for k, move in enumerate((fast, slow)):  # both stand in one place; a motion that has arrived stays
            seen = page.evaluate(f"armdyn.linkPosition('tip', {k})")
            # Read from the scene: 32-bit floats, and straight lines between 60 frames per second.
            np.testing.assert_allclose(seen, tip_of(robot, move.motion(time).q), rtol=0, atol=1e-4)
    for k in range(4):  # a drag in any chart
        over = page.locator(".u-over").nth(k)
        over.evaluate("node => node.scrollIntoView({ block: 'center' })")  # not below the player, which stays in view
        box = over.bounding_box()
        page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 0.3 * box["height"])
        page.mouse.down()
        page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.3 * box["height"], steps=4)
        page.mouse.up()
        agree(page, 0.3, 2 * 0.5 / box["width"])
    page.locator("#scrubber").fill("0.25")
    agree(page, 0.125, 1e-9)
    page.evaluate("armdyn.seek(0), armdyn.play()")
    wait_until(page, "armdyn.time > 0.02")
    assert not errors
    assert not left_the_page(requests)


def spans(page):
    """Visible time spans of the charts [s], shape (charts, 2)."""
    return np.array(page.evaluate("armdyn.seen"))


def plane(page, k=0):
    """A chart's plane, in view."""
    over = page.locator(".u-over").nth(k)
    over.evaluate("node => node.scrollIntoView({ block: 'center' })")
    return over.bounding_box()


def test_zoom_is_of_all_charts_together(opened):
    page, _, _, errors = opened
    anew(page, DESKTOP)
    seek(page, 0.1)
    np.testing.assert_array_equal(spans(page), [[0, 0.5]] * 4)
    whole = page.get_by_role("button", name="see all of the time")
    assert whole.is_disabled()
    for k in range(4):  # Shift and a drag choose a span
        box = plane(page, k)
        y, pixel = box["y"] + box["height"] / 2, 0.5 / box["width"]
        page.keyboard.down("Shift")
        page.mouse.move(box["x"] + 0.6 * box["width"], y)
        page.mouse.down()
        page.mouse.move(box["x"] + 0.2 * box["width"], y, steps=4)
        page.mouse.up()
        page.keyboard.up("Shift")
        np.testing.assert_allclose(spans(page), [[0.1, 0.3]] * 4, atol=2 * pixel)
        assert page.evaluate("armdyn.time") == 0.1  # which a plain drag would move
        page.mouse.move(box["x"] + 0.5 * box["width"], y)
        page.mouse.down()  # and a plain one still does, in the visible span
        page.mouse.up()
        agree(page, 0.2, 3 * pixel)
        page.mouse.dblclick(box["x"] + 0.5 * box["width"], y)
        np.testing.assert_array_equal(spans(page), [[0, 0.5]] * 4)
        page.evaluate("armdyn.seek(0.1)")
    box = plane(page)
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 20)
    page.keyboard.down("Control")
    page.mouse.wheel(0, -100)
    page.keyboard.up("Control")
    page.wait_for_timeout(100)
    first, last = spans(page)[0]  # 0.2 s stays where it is, and exp(-1/2) of the span is left
    assert last - first == pytest.approx(0.5 * np.exp(-0.5), rel=1e-6)
    assert (0.2 - first) / (last - first) == pytest.approx(0.4, abs=0.01)
    page.evaluate("armdyn.seek(0.5)")  # a time that is sought is seen
    np.testing.assert_allclose(spans(page), [[0.5 - (last - first), 0.5]] * 4, atol=1e-9)
    agree(page, 0.5, 1e-9)
    whole.click()
    page.get_by_role("button", name="zoom in at this time").click()
    np.testing.assert_allclose(spans(page), [[0.25, 0.5]] * 4, atol=1e-9)
    page.evaluate("armdyn.play()")  # the visible span is played
    wait_until(page, "armdyn.time > 0.26 && armdyn.time < 0.4")
    np.testing.assert_allclose(spans(page), [[0.25, 0.5]] * 4, atol=1e-9)
    assert not errors


def test_two_fingers_zoom(opened):
    page, _, _, errors = opened
    anew(page, PHONE)
    seek(page, 0.1)
    box = plane(page)
    session = page.context.new_cdp_session(page)

    def touch(kind, *parts):
        points = [
            {"x": box["x"] + part * box["width"], "y": box["y"] + box["height"] / 2, "id": k}
            for k, part in enumerate(parts)
        ]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", 0.4, 0.6)
    for part in (0.35, 0.25, 0.2):
        touch("touchMove", part, 1 - part)
    touch("touchEnd")
    page.wait_for_timeout(100)
    # 0.2 s and 0.3 s, which were under the fingers, are at 0.2 and 0.8 of the width.
    wide = 0.1 / 0.6
    np.testing.assert_allclose(spans(page), [[0.25 - wide / 2, 0.25 + wide / 2]] * 4, atol=0.01)
    assert not errors


def test_the_numbers_are_those_of_the_moment(chromium, tmp_path):
    robot, move = judged()
    with open_page(chromium, written(tmp_path, robot, move)) as (page, _, errors):
        seek(page, 0.1)
        rows = page.locator("#now .row").all_inner_texts()
        assert "−0.700 rad" in rows[1] and "3.000 N m" in rows[1] and "torque, upper" in rows[1]
        assert "0.300 rad" in rows[2] and "−3.000 N m" in rows[2] and "torque, lower" in rows[2]
        assert page.locator("#ticks i").count() == 2
        slider = page.locator("#scrubber").bounding_box()
        for tick, time in zip(page.locator("#ticks i").all(), (0.08, 0.12), strict=True):
            box = tick.bounding_box()  # half a thumb, 9 pixels, is left at both ends
            assert box["height"] > 20
            at = slider["x"] + 9 + (slider["width"] - 18) * time / 0.21
            assert box["x"] + box["width"] / 2 == pytest.approx(at, abs=1)
        assert not page.locator("#part").is_visible()
        # A bar is full at the joint's limit, and no fuller than that.
        scales = page.evaluate("[...document.querySelectorAll('.bar s')].map(s => s.style.transform)")
        full = 3.0 / robot.limits.effort_upper[0]
        assert [float(scale[7:-1]) for scale in scales] == pytest.approx([full, -full])
        assert "Executable, not proven optimal" in page.locator(".verdict").inner_text()
        assert not errors


def test_a_last_link_that_reaches_beyond_the_tip_is_in_view(chromium, tmp_path):
    away = []
    for length in (0.01, 0.02, 0.6):
        stick = ad.Payload(mass=0.1, shapes=[Capsule([0, 0, 0], [0, 0, length], 0.01)])
        robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), payload=stick)
        move = ShownMotion("swing", quintic(robot, [0, 0], [1, 1], 0.5), Facts())
        with open_page(chromium, written(tmp_path, robot, move)) as (page, _, errors):
            away.append(abs(page.evaluate("armdyn.camera")[1]))
            assert not errors
    assert away[0] == pytest.approx(away[1], rel=1e-9) and away[0] < 0.7 * away[2]


def test_a_phone_shows_all_of_it(chromium, tmp_path):
    robot, move = judged()
    loop = replace(move, name="loop", facts=Facts({"arrival_time": 4.5535}))  # 2068.3 % later
    with open_page(chromium, written(tmp_path, robot, move, loop), **PHONE, drawn=True) as (page, _, errors):
        for scheme in ("light", "dark"):
            resize(page, PHONE)
            page.emulate_media(media="screen", color_scheme=scheme)
            all_of_it_is_seen(page)
            page.set_viewport_size({"width": 844, "height": 390})  # turned on its side
            page.wait_for_timeout(200)
            agree(page, 0.2, 1e-3)
            page.emulate_media(media="print", color_scheme=scheme)  # on paper it is light
            assert page.evaluate("getComputedStyle(document.body).color") == "rgb(31, 41, 51)"
            assert not page.locator(".zoom").is_visible()
        assert not errors


def all_of_it_is_seen(page):
    first, second = (screenshot(page, time) for time in (0.0, 0.2))
    assert first != second
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    broken = """[...document.querySelectorAll(".stacked td:not(.words)")].filter(cell => {
      const text = document.createRange();
      text.selectNodeContents(cell);
      return text.getClientRects().length > 1;
    }).map(cell => cell.textContent)"""
    assert page.evaluate(broken) == []  # no number is apart from its unit
    for selector in ("#clock", "#scrubber", "#toggle", "#speed"):
        box = page.locator(selector).bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 390 and box["y"] + box["height"] <= 844


def test_names_from_strangers_stay_text(chromium, tmp_path):
    robot, move = judged(request={"command": EVIL, "options": {EVIL: EVIL}}, what_to_do=[EVIL])
    robot = replace(robot, name=EVIL, joint_names=(EVIL, "joint2"))
    with open_page(chromium, written(tmp_path, robot, replace(move, name=EVIL), title=EVIL)) as (page, _, errors):
        assert page.evaluate("window.broken") is None
        assert page.locator("h1").inner_text() == EVIL
        assert not errors


def test_curves_without_the_robot(chromium, tmp_path):
    robot, move = judged()
    path = tmp_path / "bare.html"
    path.write_text(report_html(report_of(Subject("rr", robot.joint_names, robot.limits, (False, False)), [move])))
    with open_page(chromium, path) as (page, _, errors):
        seek(page, 0.1)
        agree(page, 0.1, 1e-9)
        assert "not available" in page.locator("#no-scene").inner_text()
        assert not errors
