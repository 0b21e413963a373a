"""A hook of mkdocs.yml: mathematics between dollars becomes MathML when the site is built.

Browsers set MathML by themselves, so no page of the site loads a script; GitHub sets the same dollars with
its own. `pymdownx.arithmatex` finds the formulas and leaves code alone; here they are converted.
"""

import html
import re
from typing import Any

from latex2mathml.converter import convert

_FORMULA = re.compile(
    r'<span class="arithmatex">\\\((?P<inline>.+?)\\\)</span>|<div class="arithmatex">\\\[(?P<display>.+?)\\\]</div>',
    re.DOTALL,
)


def mathml(latex: str, display: bool = False) -> str:
    """A formula as MathML.

    Args:
        latex: as in mathematics mode.
        display: on a line of its own.

    Raises:
        ValueError: it is no LaTeX, or has a command that latex2mathml does not know.
    """
    try:
        made = convert(latex, display="block" if display else "inline")
    except Exception as error:
        raise ValueError(f"no mathematics: {latex}: {type(error).__name__} {error}") from error
    if unknown := re.search(r">\s*(\\\w*)", made):
        raise ValueError(f"latex2mathml does not know {unknown[1]} in: {latex}")
    return f'<div class="formula">{made}</div>' if display else made


def on_page_content(page_html: str, **_: Any) -> str:
    """All formulas of a page.

    Raises:
        ValueError: one of them cannot be set.
    """

    def put(found: re.Match[str]) -> str:
        latex, display = found["inline"] or found["display"], found["display"] is not None
        return mathml(html.unescape(latex).strip(), display)

    return _FORMULA.sub(put, page_html)
