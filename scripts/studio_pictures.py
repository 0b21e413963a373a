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
    """Take a picture, drag the goal along its own z axis in a browser that draws nothing, and take another one."""
    from playwright.sync_api import Page, sync_playwright

    sys.path.insert(0, str(ROOT / "tests"))
    from show.browser import FLAGS, UNDRAWN, find_chromium, pixel_of, wait_until

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=find_chromium(), headless=True, args=FLAGS)

        def opened(drawn: bool) -> Page:
            page = chromium.new_page(viewport=WINDOW)
            page.set_default_timeout(300_000)
            if not drawn:
                page.add_init_script(UNDRAWN)
            page.goto(url)
            page.get_by_text("proven").wait_for()
            return page

        def picture(name: str) -> None:
            page = opened(drawn=True)
            page.locator(".mantine-Notification-closeButton").first.click()  # says that there is no graphics card
            page.wait_for_timeout(20_000)
            page.screenshot(path=DOCS / name)
            print(page.inner_text("#studio-answer"), flush=True)
            page.close()

        hand = opened(drawn=False)
        hand.get_by_role("button", name="Pause").dispatch_event("click")
        time = hand.locator("label", has_text="time").locator("xpath=../../..").locator("input:not([type=hidden])")
        time.fill("0.42")
        picture("studio.png")
        panda = ad.Robot.from_library("panda")
        reach, tip = reach_of(panda), frame_placement(panda, panda.tip, np.array(GOAL))
        eye, target = reach * np.array([0.85, -0.75, 0.6]), np.array([0, 0, 0.22 * reach])
        begin, end = (
            pixel_of(tip.translation + x * reach * tip.rotation[:, 2], eye, target, WINDOW) for x in (0.12, -0.13)
        )
        hand.mouse.move(*begin)
        hand.wait_for_timeout(1000)
        hand.mouse.down()
        for k in range(1, 11):
            hand.mouse.move(*(begin + (end - begin) * k / 10))
            hand.wait_for_timeout(200)
        hand.mouse.up()
        hand.wait_for_timeout(3000)
        wait_until(hand, "!document.querySelector('#studio-answer').innerText.includes('…')", 300)
        picture("studio_dragged.png")
        chromium.close()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "armdyn", *STUDIO.split(), "--out", folder]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)  # noqa: S603
        try:
            look(json.loads(process.stdout.readline())["url"])
        finally:
            process.kill()
