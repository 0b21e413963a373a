"""Formulas of the site are set when it is built: as MathML, with errors for unsupported ones."""

import re
from pathlib import Path

import pytest

from scripts_of import script

ROOT = Path(__file__).parents[2]
THEORY = ("theory", "transcriptions", "certificate", "stability")


def test_formulas_become_mathml_and_the_rest_stays():
    page = r'<p>a <span class="arithmatex">\(q &lt; \dot q\)</span> <code>$x$</code></p>'
    page += '<div class="arithmatex">\\[\n\\frac{a}{b}\n\\]</div>'
    made = script("site_mathematics").on_page_content(page)
    assert made.startswith("<p>a <math") and "&#x0003C;" in made and "<code>$x$</code></p>" in made
    assert '<div class="formula"><math' in made and "<mfrac>" in made and "arithmatex" not in made


@pytest.mark.parametrize("latex", [r"\nosuch x", r"\begin{matrix} a"])
def test_unsupported_mathematics_stops_the_build(latex):
    with pytest.raises(ValueError, match=re.escape(latex)):
        script("site_mathematics").mathml(latex)


@pytest.mark.parametrize("page", THEORY)
def test_theory_has_formulas_that_github_sets_alike(page):
    text = re.sub(r"```.*?```|`[^`]*`", "", (ROOT / "docs" / f"{page}.md").read_text(), flags=re.DOTALL)
    found = re.findall(r"\$\$(.+?)\$\$|\$([^$]+)\$", text, flags=re.DOTALL)
    assert len(found) > 10
    for display, inline in found:
        latex = display or inline
        assert script("site_mathematics").mathml(latex.strip(), bool(display))
        # Markdown takes a backslash from before punctuation, so that these would be set as commas and the like.
        assert not re.search(r"\\[,;:!\\{}]", latex), latex
