"""Colours, lines and letters of all figures."""

from typing import Any, Literal

COLORS = ("#2970b8", "#ed8a24", "#33a05c", "#cc2936", "#7b52ab", "#12a4b4", "#8a5a3b", "#d65fa5")
"""One per joint; the first three are the links' colours in the replay."""

Style = Literal["-", "-."] | tuple[float, tuple[float, ...]]
STYLES: tuple[Style, ...] = ("-", (0, (5, 2)), (0, (1.2, 1.6)), "-.")
"""One per trajectory."""
INK = "#30363d"
"""Colour of text and axes."""
_GRID = "#d9dee4"
SOFT = "#5f6b78"
"""Colour of remarks."""
LOOK: Any = {
    "font.size": 9.5,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "grid.color": _GRID,
    "grid.linewidth": 0.6,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.direction": "out",
    "legend.frameon": False,
    "legend.fontsize": 9,
    "pdf.fonttype": 42,
    "svg.hashsalt": "armdyn",
}


def color(joint: int) -> str:
    """A joint's colour."""
    return COLORS[joint % len(COLORS)]


def styles(count: int) -> list[Style]:
    """A line style for each of so many motions."""
    return [STYLES[i % len(STYLES)] for i in range(count)]


def literal(text: str) -> str:
    """The text as it is: matplotlib hides labels that start with _, and reads $...$ as mathematics."""
    return text.replace("$", r"\$").lstrip("_") or "-"
