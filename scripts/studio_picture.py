"""Pictures of the studio, in a real Chromium: a Panda passes a box, its goal dragged 20 cm upwards, and on a phone.

    python scripts/studio_picture.py

Takes several minutes: without a graphics card a frame takes about a second.
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
GOAL = (0.8, 0.3, 0, -1.9, 0, 2.2, 0.785)
STUDIO = (
    f"studio panda --q-start=-0.8,0.3,0,-1.9,0,2.2,0.785 --q-goal {','.join(map(str, GOAL))} "
    "--obstacle box:0.12,0.12,0.6@0.55,0,0.3 --json"
)
DESKTOP, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}
UP = 0.2  # [m]


def look(url: str) -> None:
    """Open the page, take a picture, drag the goal, take another, and one of a second browser on a phone."""
    sys.path.insert(0, str(ROOT / "tests"))
    from show.browser import drag, launched, pixel_of

    def opened(size):
        page = chromium.new_page(viewport=size)
        page.set_default_timeout(300_000)
        page.goto(url)
        page.get_by_text("proven").wait_for()
        page.locator(".mantine-Notification-closeButton").first.click()  # says that there is no graphics card
        return page

    def picture(page, name, moment):
        page.get_by_role("button", name="Pause").click()
        page.locator("label", has_text="time").locator("xpath=../../..").locator("input[inputmode]").fill(str(moment))
        page.wait_for_timeout(20_000)
        page.screenshot(path=ROOT / "docs" / name)
        page.get_by_role("button", name="Play").click()

    robot = ad.Robot.from_library("panda")
    reach, tip = reach_of(robot), frame_placement(robot, robot.tip, np.array(GOAL))
    eye, target = np.array([0.85, -0.75, 0.6]) * reach, np.array([0, 0, 0.22 * reach])
    arrow = tip.translation + 0.14 * reach * tip.rotation[:, 2]  # of the gizmo: it points down, as the tool does
    begin, end = (pixel_of(arrow + np.array([0, 0, z]), eye, target, DESKTOP) for z in (0, UP))
    with launched() as chromium:
        page = opened(DESKTOP)
        picture(page, "studio.png", 0.42)
        drag(page, begin, end, first=5_000, each=1_000)
        page.wait_for_timeout(30_000)
        picture(page, "studio_dragged.png", 0.35)
        page.close()
        page = opened(PHONE)
        picture(page, "studio_phone.png", 0.35)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "armdyn", *STUDIO.split(), "--out", folder]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)  # noqa: S603
        try:
            look(json.loads(process.stdout.readline())["url"])
        finally:
            process.kill()
