"""Make the pictures of the documents: figures of commands, and their pages in a real Chromium.

    python scripts/gallery.py [PICTURE ...]      # report.png, figure.png, paper_page.png, …; by default all

Commands run in results/gallery and are not run again while their results are there. All of it takes ten minutes, most
of them the map of goals and the paper. Some pictures come with the numbers that other scripts measure: see `ELSEWHERE`.
"""

import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCS, WORK = ROOT / "docs", ROOT / "results" / "gallery"

COMMANDS = {
    "mintime-rr": "mintime rr --payload 0.1006",
    "mintime-rrr": "mintime rrr --payload 0.1006",
    "mintime-panda": "mintime panda --q-start ready --q-goal 1,0.2,0.5,-1.5,0.3,2,-0.5",
    "mintime-ur5": "mintime ur5 --q-start home --q-goal 90deg,-45deg,60deg,-90deg,0,0",
    "mintime-cart_pole": "mintime cart_pole --q-start 0,0 --q-goal 0,pi",
    "post": "mintime panda --q-start=-0.8,0.3,0,-1.9,0,2.2,0.785 --q-goal 0.8,0.3,0,-1.9,0,2.2,0.785"
    " --obstacle box:0.12,0.12,0.6@0.55,0,0.3 --out results/post",
    "bins": "mintime examples/bins.toml --out results/bins",
    "shelf": "mintime examples/shelf.toml --out results/shelf",
    "cycle-cell": "cycle examples/cell.toml",
    "track-rr": "track rr --payload 0.1006 --reserve 0.1 --plant-payload 0.12",
    "optimality-rr": "optimality rr toppra.npz --payload 0.1006",
    "pid-rr": "pid rr --payload 0.1006 --q-start=-pi/2,pi/84 --q-goal=pi/20,-pi/84 --form torque --gains 60,100,4",
    "compare-rr": "compare results/mintime-rr results/track-rr results/optimality-rr/trajectory.npz results/pid-rr"
    " --until 0.5",
    "monte-carlo-rr": "monte-carlo rr --payload 0.1006 --reserve 0.1",
    "sweep-rr": "sweep rr",
    "sweep-goals": "sweep examples/goals.toml",
    "paper": "reproduce --out results/paper",
}
"""By the folder in `results` that each writes."""

NEEDS = {"compare-rr": ("mintime-rr", "track-rr", "optimality-rr", "pid-rr")}

PLANNED = "from_toppra.md"
"""The page whose code writes toppra.npz."""


@dataclass(frozen=True)
class Shot:
    """A page as a browser shows it.

    Attributes:
        folder: of the command that wrote it.
        moment: of the motion [s].
        size: of the window [px], (width, height).
        dark: whether the reader's system prefers dark pages.
        part: the cut-out, as a CSS selector; empty: all of the window.
    """

    folder: str
    moment: float = 0.0
    size: tuple[int, int] = (1280, 960)
    dark: bool = False
    part: str = ""

    def take(self, page_file: Path, picture: Path) -> None:
        """Open the page without a network and take the picture.

        Raises:
            SystemExit: the page has an error.
        """
        sys.path.insert(0, str(ROOT / "tests"))
        from show.browser import launched, open_page, screenshot

        report = page_file.name == "report.html"
        ready = "window.armdyn !== undefined" if report else "document.readyState === 'complete'"
        with (
            launched() as chromium,
            open_page(chromium, page_file, *self.size, ready=ready, drawn=True) as (page, _, errors),
        ):
            page.emulate_media(color_scheme="dark" if self.dark else "light")
            page.wait_for_timeout(300)  # pages redraw themselves in the other scheme
            if report:
                screenshot(page, self.moment)
            (page.locator(self.part) if self.part else page).screenshot(path=picture)
            if errors:
                raise SystemExit(f"{page_file}: {errors}")


SHOTS = {
    "report.png": Shot("mintime-rr", 0.12),
    "report_dark.png": Shot("mintime-panda", 0.25, dark=True),
    "report_phone.png": Shot("mintime-ur5", 0.3, (390, 844)),
    "obstacles.png": Shot("post", 0.3, part="#pane"),
    "bins.png": Shot("bins", 0.357, part="#pane"),
    "shelf.png": Shot("shelf", 1.331, part="#pane"),
    "cycle.png": Shot("cycle-cell", 0.95, (1280, 900)),
    "cart_pole.png": Shot("mintime-cart_pole", 0.6),
    "compare.png": Shot("compare-rr", 0.16),
    "paper_page.png": Shot("paper", size=(1280, 1400)),
}

DRAWN = {
    "figure.png": "mintime-rr/figure.png",
    "arcs.png": "mintime-rrr/figure.png",
    "payloads.png": "sweep-rr/figure.png",
    "goals.png": "sweep-goals/map.png",
    "envelope.png": "monte-carlo-rr/envelope.png",
    **{f"paper_figure{n}.png": f"paper/figures/figure{n}.png" for n in range(2, 8)},
}
"""Files of `results` that are pictures as they are."""

ELSEWHERE = {
    "run_it_on_a_robot.png": "scripts/run_it_on_a_robot.py",
    "stability.png": "scripts/stability.py",
    "studio.png": "scripts/studio_picture.py",
    **{f"sweep_{kind}.png": "scripts/sweep_pictures.py" for kind in ("curve", "map", "pareto")},
}


def plan() -> None:
    """Run the Python of the page about toppra, which leaves toppra's motion as a file."""
    code = "\n".join(re.findall(r"^```python\n(.*?)^```", (DOCS / PLANNED).read_text(), flags=re.DOTALL | re.MULTILINE))
    subprocess.run([sys.executable, "-c", code], cwd=WORK, check=True)  # noqa: S603


def written(folder: str) -> Path:
    """The folder of a command, which is run if its results are not there."""
    results = WORK / "results"
    for needed in NEEDS.get(folder, ()):
        written(needed)
    done = results / f"{folder}.done"
    if not done.exists():
        WORK.mkdir(parents=True, exist_ok=True)
        if "toppra.npz" in COMMANDS[folder]:
            plan()
        print(f"armdyn {COMMANDS[folder]}", flush=True)
        words = COMMANDS[folder].replace("examples/", f"{ROOT}/examples/").split()
        subprocess.run([sys.executable, "-m", "armdyn", *words], cwd=WORK, check=True)  # noqa: S603
        done.touch()
    return results / folder


def make(picture: str) -> None:
    """One picture of `docs`.

    Raises:
        SystemExit: there is no such picture, or its page has an error.
    """
    if picture in ELSEWHERE:
        print(f"docs/{picture} is made by {ELSEWHERE[picture]}")
    elif picture in DRAWN:
        folder, _, file = DRAWN[picture].partition("/")
        shutil.copyfile(written(folder) / file, DOCS / picture)
    elif picture in SHOTS:
        shot = SHOTS[picture]
        page = "index.html" if shot.folder == "paper" else "report.html"
        shot.take(written(shot.folder) / page, DOCS / picture)
    else:
        raise SystemExit(f"no picture {picture}; there are {', '.join([*SHOTS, *DRAWN, *ELSEWHERE])}")


if __name__ == "__main__":
    for wanted in sys.argv[1:] or [*SHOTS, *DRAWN, *ELSEWHERE]:
        make(wanted)
