"""Pictures of the studio: a Panda and a box, before and after its goal is dragged by the mouse in a real Chromium.

    python scripts/studio_pictures.py

Takes minutes: without a graphics card a frame takes about a second.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import armdyn as ad
from armdyn.models.scene.reaching import frame_placement
from armdyn.show.page.scene import reach_of

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
GOAL = [0.8, 0.3, 0, -1.9, 0, 2.2, 0.785]
STUDIO = (
    "studio panda --q-start=-0.8,0.3,0,-1.9,0,2.2,0.785 --q-goal 0.8,0.3,0,-1.9,0,2.2,0.785 "
    "--obstacle box:0.12,0.12,0.6@0.55,0,0.3 --json --port 8765"
)
WINDOW = {"width": 1280, "height": 800}


def look(url: str) -> None:
    """Open the page, take a picture, drag the goal along its own z axis, and take another one."""
    from playwright.sync_api import sync_playwright

    sys.path.insert(0, str(ROOT / "tests"))
    from show.browser import FLAGS, find_chromium, pixel_of, wait_until

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=find_chromium(), headless=True, args=FLAGS)
        page = chromium.new_page(viewport=WINDOW)
        page.set_default_timeout(300_000)
        page.goto(url)
        page.get_by_text("proven").wait_for()
        page.locator(".mantine-Notification-closeButton").first.click()  # says that there is no graphics card
        page.get_by_role("button", name="Pause").click()
        field = page.locator("label", has_text="time").locator("xpath=../../..").locator("input:not([type=hidden])")

        def picture(name: str, time: str) -> None:
            field.fill(time)
            page.wait_for_timeout(20_000)
            page.screenshot(path=DOCS / name)
            print(page.inner_text("#studio-answer"))

        picture("studio.png", "0.42")
        panda = ad.Robot.from_library("panda")
        reach, tip = reach_of(panda), frame_placement(panda, panda.tip, np.array(GOAL))
        eye, target = reach * np.array([0.85, -0.75, 0.6]), np.array([0, 0, 0.22 * reach])
        begin, end = (
            pixel_of(tip.translation + x * reach * tip.rotation[:, 2], eye, target, WINDOW) for x in (0.12, -0.13)
        )
        page.mouse.move(*begin)
        page.wait_for_timeout(5000)
        page.mouse.down()
        for k in range(1, 11):
            page.mouse.move(*(begin + (end - begin) * k / 10))
            page.wait_for_timeout(1000)
        page.mouse.up()
        page.wait_for_timeout(5000)
        wait_until(page, "!document.querySelector('#studio-answer').innerText.includes('…')")
        picture("studio_dragged.png", "0.42")
        chromium.close()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "armdyn", *STUDIO.split(), "--out", folder]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)  # noqa: S603
        try:
            look(json.loads(process.stdout.readline())["url"])
        finally:
            process.kill()
