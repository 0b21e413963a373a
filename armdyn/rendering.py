"""Registry of the renderer, which draws values in notebooks, figures and reports.

Values below `armdyn.show` draw themselves through the registry and do not import drawing code. `armdyn/__init__.py`,
above all of them, registers the renderer: matplotlib and meshcat are imported when the first value is drawn.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Renderer(Protocol):
    """Functions that draw values."""

    def card(self, value: object) -> str:
        """HTML that a notebook shows of a value."""

    def figure(self, solution: Any) -> Figure:
        """Figure of a minimum-time solution."""

    def report(self, solution: Any, path: str | os.PathLike[str]) -> Path:
        """Write the report of a minimum-time solution; returns the path."""


_loaders: list[Callable[[], Renderer]] = []


def register_renderer(load: Callable[[], Renderer]) -> None:
    """Set the function that imports and returns the renderer; `renderer` calls it."""
    _loaders[:] = [load]


def renderer() -> Renderer:
    """The registered renderer."""
    return _loaders[0]()
