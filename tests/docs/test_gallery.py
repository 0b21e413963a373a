"""Every picture that a page shows is made by a script, and no picture lies there that no page shows."""

import re
from pathlib import Path

from scripts_of import script

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
ENDS = {".png", ".svg", ".jpg", ".gif", ".webp"}


def shown():
    """Names of pictures that pages show, as Markdown or as HTML."""
    text = "\n".join(page.read_text() for page in PAGES)
    found = re.findall(r"!\[[^\]]*\]\(([^)\s]+)", text) + re.findall(r'<img[^>]*\ssrc="([^"]+)"', text)
    return {Path(one).name for one in found}


def test_pictures_that_are_shown_are_there_and_others_are_not():
    there = {path.name for path in (ROOT / "docs").iterdir() if path.suffix in ENDS}
    assert len(there) >= 15
    assert shown() == there


def test_every_picture_is_made_by_a_script():
    scripts = "\n".join(path.read_text() for path in sorted((ROOT / "scripts").glob("*.py")))
    made = {*script("gallery").SHOTS, *script("gallery").DRAWN}
    assert not {name for name in shown() - made if name not in scripts}


def test_the_gallery_is_right_about_other_scripts():
    for name, other in script("gallery").ELSEWHERE.items():
        assert name in (ROOT / other).read_text()


def test_every_command_of_the_gallery_is_on_its_page():
    page = " ".join((ROOT / "docs" / "gallery.md").read_text().split())
    for command in script("gallery").COMMANDS.values():
        assert f"armdyn {command.partition(' --out')[0]}" in page, command
