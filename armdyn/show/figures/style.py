"""Colours, lines and letters of all figures."""

from pathlib import Path
from typing import Any, Literal

from matplotlib import rc_context, rc_params_from_file
from matplotlib.axes import Axes
from matplotlib.figure import Figure

COLORS = ("#2970b8", "#ed8a24", "#33a05c", "#cc2936", "#7b52ab", "#12a4b4", "#8a5a3b", "#d65fa5")
"""One per joint; the first three are the links' colours in the replay."""

Style = Literal["-", "-."] | tuple[float, tuple[float, ...]]
STYLES: tuple[Style, ...] = ("-", (0, (5, 2)), (0, (1.2, 1.6)), "-.")
"""One per trajectory."""
INK = "#30363d"
"""Colour of text and axes."""
SOFT = "#5f6b78"
"""Colour of remarks."""
LOOK: Any = rc_params_from_file(str(Path(__file__).with_name("armdyn.mplstyle")), use_default_template=False)


def color(joint: int) -> str:
    """A joint's colour."""
    return COLORS[joint % len(COLORS)]


def styles(count: int) -> list[Style]:
    """Line styles for a number of motions."""
    return [STYLES[i % len(STYLES)] for i in range(count)]


def one_panel(title: str | None, height: float = 4.4) -> tuple[Figure, Axes]:
    """A figure with one panel, and a title above it if there is one."""
    with rc_context(LOOK):
        figure = Figure(figsize=(7.0, height), layout="constrained")
        axes = figure.subplots()
        if title:
            axes.set_title(literal(title), fontsize=12, fontweight="bold")
    return figure, axes


def literal(text: str) -> str:
    """Escape a label for matplotlib, which hides labels that start with _ and reads $...$ as mathematics."""
    return text.replace("$", r"\$").lstrip("_") or "-"
