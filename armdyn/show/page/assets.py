"""The parts of a page that do not change: templates, scripts and styles, armdyn's own and those of others."""

import re
from importlib.resources import files
from pathlib import Path

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
    return _fit(asset(name), name)


def viewer_script() -> str:
    """Meshcat's script bundle, escaped for a script element, without external links.

    Raises:
        RuntimeError: it contains a closing script tag.
    """
    import meshcat

    bundle = Path(str(meshcat.__file__)).with_name("viewer") / "dist" / "main.min.js"
    # XML namespaces are no links, but a search of the page for links should find none.
    return _fit(re.sub(r'"http(s?)://', r'"http\1:"+"//', bundle.read_text("utf-8")), "meshcat's bundle")


def _fit(text: str, name: str) -> str:
    if _CLOSING.search(text):
        raise RuntimeError(f"{name} cannot stand in a page: it contains a closing script tag")
    return text
