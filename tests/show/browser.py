"""A real Chromium without a network, for looking at replays.

`python tests/show/browser.py replay.html picture.png [time]` takes a screenshot at a time [s].
"""

import contextlib
import shutil
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

PLAYWRIGHTS = ("HttpsUpgrades", "MediaRouter", "OptimizationHints", "PaintHolding", "ThirdPartyStoragePartitioning")
"""Features that playwright turns off; a browser reads the last list alone."""

ADDRESS_BAR = ("WebUIOmniboxPopup", "WebUIOmniboxAimPopup")
"""Two pages of the browser's own, loaded with each window: 0.8 of a second of a processor."""

FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    f"--disable-features={','.join((*PLAYWRIGHTS, *ADDRESS_BAR))}",
]

UNDRAWN = """for (const kind of [WebGLRenderingContext, WebGL2RenderingContext]) {
  for (const name of ["drawElements", "drawArrays", "drawElementsInstanced", "drawArraysInstanced", "clear"]) {
    kind.prototype[name] = () => {};
  }
}"""
"""Leaves the scene's canvas blank: without a graphics card a frame takes up to a second. A frame that is not
even cleared is not composed."""

FEW_FRAMES = """const draw = requestAnimationFrame;
window.requestAnimationFrame = (frame) => setTimeout(() => draw(frame), 50);
window.cancelAnimationFrame = clearTimeout;"""
"""A page that draws without an end draws at most 20 frames a second: 60 take half a processor."""


def find_chromium():
    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    found = next((path for path in map(shutil.which, names) if path), None)
    assert found, f"no browser on PATH ({', '.join(names)}); on Debian: apt-get install chromium"
    return found


@contextlib.contextmanager
def launched():
    """Chromium without a window. To start it takes a second of a processor: the tests of a process share one."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=find_chromium(), headless=True, args=FLAGS)
        try:
            yield chromium
        finally:
            chromium.close()


@contextlib.contextmanager
def open_page(chromium, path, width=1280, height=800, ready="window.armdyn !== undefined", drawn=False):
    """A page, once its scripts say that it is ready, its requests (URLs) and its errors; by default a replay's.

    It has a profile of its own, without a network. The arm moves in the scene, but only where pictures are compared
    (`drawn`) is the scene rendered, and in more than 20 frames a second.
    """
    requests, errors = [], []
    context = chromium.new_context(viewport={"width": width, "height": height}, offline=True)
    try:
        if not drawn:
            context.add_init_script(UNDRAWN + FEW_FRAMES)
        page = context.new_page()
        session = context.new_cdp_session(page)
        session.send("Network.enable")
        session.on("Network.requestWillBeSent", lambda event: requests.append(event["request"]["url"]))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda line: errors.append(line.text) if line.type == "error" else None)
        page.goto(Path(path).resolve().as_uri())
        wait_until(page, ready)
        yield page, requests, errors
    finally:
        context.close()


def wait_until(page, expression, seconds=60.0):
    """Ask until it is so: playwright's own waiting evaluates text within the page, which a strict page refuses."""
    end = time.monotonic() + seconds
    while not page.evaluate(expression):
        assert time.monotonic() < end, f"{expression} is not true after {seconds} s"
        page.wait_for_timeout(20)


def pixel_of(point, eye, target, window):
    """Where the studio's camera, z up and with viser's field of view of 75 degrees, sees a point [px], shape (2,).

    Args:
        point: in the world [m], shape (3,).
        eye: the camera's place.
        target: that it looks at.
        window: {"width": …, "height": …} [px].
    """
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, [0, 0, 1]) / np.linalg.norm(np.cross(ahead, [0, 0, 1]))
    up, way = np.cross(right, ahead), point - eye
    scale = window["height"] / 2 / np.tan(np.radians(75) / 2) / (way @ ahead)
    return np.array([window["width"] / 2 + scale * (way @ right), window["height"] / 2 - scale * (way @ up)])


def drag(page, begin, end, first=300, each=40):
    """Drag by the mouse in ten steps, with pauses before and between [ms]; begin and end: [px], shape (2,)."""
    page.mouse.move(*begin)
    page.wait_for_timeout(first)
    page.mouse.down()
    for k in range(1, 11):
        page.mouse.move(*(begin + (end - begin) * k / 10))
        page.wait_for_timeout(each)
    page.mouse.up()


def left_the_page(requests):
    return [url for url in requests if urlsplit(url).scheme not in ("file", "data", "blob")]


def seek(page, moment):
    """Show a time of the motion [s]."""
    page.evaluate("t => { armdyn.pause(); armdyn.seek(t); }", moment)
    settle(page)


def settle(page):
    """Give the page time to draw itself anew."""
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def resize(page, size):
    """Give the page a size, its beginning in sight, and time to draw itself anew."""
    page.set_viewport_size(size)
    page.evaluate("scrollTo(0, 0)")
    settle(page)


def screenshot(page, moment, path=None):
    """The page at a time of the motion [s], as png bytes."""
    seek(page, moment)
    return page.screenshot(path=path)


if __name__ == "__main__":
    with launched() as chromium, open_page(chromium, sys.argv[1], drawn=True) as (page, _, _):
        screenshot(page, float(sys.argv[3]) if len(sys.argv) > 3 else 0.0, sys.argv[2])
