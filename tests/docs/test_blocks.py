"""Every page's Python runs as it stands, from its first block to its last."""

import contextlib
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page):
    """The Python of a page, each line where it stands there, so that an error names the page's own line."""
    lines, inside, wanted = page.read_text().split("\n"), False, []
    for line in lines:
        if line.startswith("```"):
            inside = line == "```python"
            wanted.append("")
        else:
            wanted.append(line if inside else "")
    return "\n".join(wanted)


WITH_CODE = [page for page in PAGES if blocks(page).strip() and page.name != "extending.md"]
"""The sections of extending.md, which register their classes, are run by tests/test_extending.py."""


def test_most_pages_show_code():
    assert len(WITH_CODE) >= 9


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.name)
def test_a_pages_code_runs(page, tmp_path, capsys):
    script = tmp_path / page.with_suffix(".py").name
    script.write_text(blocks(page))
    with contextlib.chdir(tmp_path):
        runpy.run_path(str(script), run_name="__main__")
