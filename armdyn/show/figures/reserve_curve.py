"""Figure of a reserve curve: settled time over the torque that is left to feedback."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from armdyn.show.figures.style import COLORS, INK, LOOK, one_panel


@rc_context(LOOK)
def plot_reserves(rows: Sequence[Mapping[str, Any]], title: str | None = None) -> Figure:
    """Settled time over reserve, worst and mean of the plants, for every controller; and the motion's own duration.

    Where some plant does not settle there is no worst and no mean; the count is written there.

    Args:
        rows: `Settling.facts()` of one controller after the other; one row at least.
        title: above the axes.

    Returns:
        A figure of its own: pyplot knows nothing of it.
    """
    names = list(dict.fromkeys(row["controller"] for row in rows))
    figure, axes = one_panel(title)
    times = sorted({(100 * row["reserve"], row["duration"]) for row in rows})
    axes.plot(*zip(*times, strict=True), color=INK, linewidth=1.2, linestyle=(0, (4, 3)), label="the motion itself")
    for place, (name, color) in enumerate(zip(names, COLORS, strict=False)):
        _draw(axes, [row for row in rows if row["controller"] == name], color, place)
    whole = [row for row in rows if row["worst"] is not None]
    if whole:
        best = min(whole, key=lambda row: row["worst"])
        at = (100 * best["reserve"], best["worst"])
        axes.plot(*at, "o", color=COLORS[3], markersize=9, markerfacecolor="none", markeredgewidth=1.8)
        axes.annotate(f"best: {best['reserve']:g}, {best['worst']:.3f} s", at, (8, 10), textcoords="offset points")
    axes.set(xlabel="torque left to feedback [% of the limits]", ylabel="time until settled [s]", ylim=(0, None))
    axes.legend(loc="upper right")
    return figure


def _draw(axes: Axes, rows: Sequence[Mapping[str, Any]], color: str, place: int) -> None:
    """One controller: worst, mean, and how many arms settle where not all do, in a line of its own."""
    whole = [row for row in rows if row["worst"] is not None]
    r, own, worst, mean = (
        np.array([[100 * row["reserve"], row["duration"], row["worst"], row["mean"]] for row in whole]).reshape(-1, 4).T
    )
    axes.fill_between(r, own, worst, color=color, alpha=0.12, linewidth=0)
    axes.plot(r, worst, "o-", color=color, markersize=4, label=f"{rows[0]['controller']}, worst of all arms")
    axes.plot(r, mean, color=color, linewidth=1, alpha=0.6, label=f"{rows[0]['controller']}, mean")
    for row in rows:
        if row["worst"] is None:
            told, at, off = f"{row['settled']} of {row['arms']}", (100 * row["reserve"], 1), (0, -10 - 11 * place)
            look: dict[str, Any] = {"ha": "center", "va": "top", "color": color, "fontsize": 8}
            axes.annotate(told, at, off, ("data", "axes fraction"), "offset points", **look)
