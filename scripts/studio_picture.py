"""Picture of the studio: a Panda passes a box, in a real Chromium.

    python scripts/studio_picture.py

Takes a minute or more: without a graphics card a frame takes about a second.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
STUDIO = (
    "studio panda --q-start=-0.8,0.3,0,-1.9,0,2.2,0.785 --q-goal 0.8,0.3,0,-1.9,0,2.2,0.785 "
    "--obstacle box:0.12,0.12,0.6@0.55,0,0.3 --json"
)


def look(url: str) -> None:
    """Open the page, stop the motion in its middle, and take the picture."""
    from playwright.sync_api import sync_playwright

    sys.path.insert(0, str(ROOT / "tests"))
    from show.browser import FLAGS, find_chromium

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=find_chromium(), headless=True, args=FLAGS)
        page = chromium.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(300_000)
        page.goto(url)
        page.get_by_text("proven").wait_for()
        page.locator(".mantine-Notification-closeButton").first.click()  # says that there is no graphics card
        page.get_by_role("button", name="Pause").click()
        page.locator("label", has_text="time").locator("xpath=../../..").locator("input[inputmode]").fill("0.42")
        page.wait_for_timeout(20_000)
        page.screenshot(path=ROOT / "docs" / "studio.png")
        chromium.close()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "armdyn", *STUDIO.split(), "--out", folder]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)  # noqa: S603
        try:
            look(json.loads(process.stdout.readline())["url"])
        finally:
            process.kill()
