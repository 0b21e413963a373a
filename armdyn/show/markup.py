"""HTML of pages: elements, and the scripts and styles that they carry."""

import base64
import gzip
import html
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any


class Html(str):
    """Markup, as opposed to text."""

    __slots__ = ()


def element(tag: str, *content: str, **attributes: str | int) -> Html:
    """An element; text in it is escaped, `Html` is not. `class_` stands for class, `aria_label` for aria-label."""
    named = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{html.escape(str(value))}"' for name, value in attributes.items()
    )
    return Html(f"<{tag}{named}>{join(content)}</{tag}>")


def join(parts: Iterable[str], between: str = "") -> Html:
    """Concatenate parts."""
    return Html(between.join(part if isinstance(part, Html) else html.escape(part) for part in parts))


def table(head: Sequence[Sequence[Html]], rows: Iterable[Sequence[Html]], class_: str = "") -> Html:
    """A table that scrolls by itself where it is too wide.

    Args:
        head: rows of `th` cells.
        rows: rows of `td` cells.
        class_: of the table.
    """
    top = element("thead", *(element("tr", *cells) for cells in head))
    body = element("tbody", *(element("tr", *cells) for cells in rows))
    # A scrolling region must be reachable by keyboard.
    return element("div", element("table", top, body, class_=class_), class_="scroll", tabindex=0)


def fill(template: str, parts: Mapping[str, str]) -> str:
    """The template with its {{name}} replaced, in one pass: parts may contain {{name}}, too."""
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], template)


def inline_svg(text: str, prefix: str, label: str, colors: Mapping[str, str]) -> Html:
    """An SVG file's content as an element of a page.

    Args:
        text: the file.
        prefix: of the ids, which must differ from those of the page's other pictures.
        label: description of the picture, for screen readers.
        colors: CSS that takes a colour's place, so that the picture follows the page from light to dark.
    """
    svg = text[text.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\s(?:xmlns(?::\w+)?|version)="[^"]*"', "", svg)  # the page's own parser knows them
    svg = re.sub(r'\b(id="|href="#|url\(#)', rf"\g<1>{prefix}-", svg)
    meant = set(re.findall(r'(?:href="#|url\(#)([^")]+)', svg))
    # Of the other ids some are there twice: marks of one kind.
    svg = re.sub(r'\sid="([^"]+)"', lambda match: match[0] if match[1] in meant else "", svg)
    for color, css in colors.items():
        svg = svg.replace(color, css)
    return Html(svg.replace("<svg ", f'<svg role="img" aria-label="{html.escape(label)}" ', 1))


def script_json(data: Mapping[str, Any]) -> str:
    """JSON that is safe between script tags, with any strings.

    Raises:
        ValueError: a number is not finite.
    """
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def packed_text(text: str) -> str:
    """Text compressed by gzip, as base64: at level 6 meshes are as small as at level 9, in a third of the time."""
    return base64.b64encode(gzip.compress(text.encode(), 6, mtime=0)).decode("ascii")


_CLOSING = re.compile(r"</script|<!--", re.IGNORECASE)


def asset(name: str) -> str:
    """Read a file of `show/assets` without the external links in its comments."""
    text = files("armdyn.show").joinpath("assets", *name.split("/")).read_text("utf-8")
    return re.sub(r"https?://", "", text)


def script(name: str) -> str:
    """Read a script of `show/assets`, escaped for a script element.

    Raises:
        RuntimeError: it contains a closing script tag.
    """
    return _without_closing(asset(name), name)


def viewer_script() -> str:
    """Meshcat's script bundle, escaped for a script element, without external links.

    Raises:
        RuntimeError: it contains a closing script tag.
    """
    import meshcat

    bundle = Path(str(meshcat.__file__)).with_name("viewer") / "dist" / "main.min.js"
    # XML namespaces are no links, but a search of the page for links should find none.
    return _without_closing(re.sub(r'"http(s?)://', r'"http\1:"+"//', bundle.read_text("utf-8")), "meshcat's bundle")


def _without_closing(text: str, name: str) -> str:
    if _CLOSING.search(text):
        raise RuntimeError(f"{name} cannot stand in a page: it contains a closing script tag")
    return text
