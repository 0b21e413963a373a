"""docs/api.md has every exported name, as its script writes it."""

import armdyn as ad
from scripts_of import script


def test_the_page_of_python_has_every_exported_name():
    api = script("api_page")
    names = " ".join(api.SUBJECTS.values()).split()
    assert sorted(names) == sorted(set(ad.__all__) - {"__version__"})
    assert api.PAGE.read_text() == api.page(), "run: python scripts/api_page.py"


def test_every_line_of_the_page_says_what_the_name_is():
    """A wrong page would pass the comparison with its own script."""
    page = script("api_page").PAGE.read_text()
    for name in set(ad.__all__) - {"__version__"}:
        line = next(line for line in page.split("\n") if line.startswith((f"- `{name}(", f"- `{name}`")))
        assert line.partition(": ")[2].endswith((".", ":")) and f"::: armdyn.{name}\n" in page, line
