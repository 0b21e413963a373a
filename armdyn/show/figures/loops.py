"""Figures of closed loops: many runs at once, settled time over reserve."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from armdyn.control.tracking.run import Envelope
from armdyn.show.figures.style import COLORS, INK, LOOK, literal, one_panel

_LEAST = 1e-5
"""Where the axis of distances begins [rad or m]: a tenth of an encoder's step."""


@rc_context(LOOK)
def plot_envelope(envelope: Envelope, title: str | None = None) -> Figure:
    """Distance from the reference over time, one panel per joint: all runs, their quantiles, the worst.

    Distances are on a logarithmic axis, on which the tolerance at the goal and errors on the way can both be seen.

    Args:
        envelope: of many runs.
        title: above the panels.

    Returns:
        A figure of its own: pyplot knows nothing of it.
    """
    names, t = envelope.joint_names, envelope.t
    figure = Figure(figsize=(7.0, 1.2 + 1.9 * len(names)), layout="constrained")
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for i, (panel, name) in enumerate(zip(panels, names, strict=True)):
        color = COLORS[i % len(COLORS)]
        low, high = (np.maximum(one[:, i], _LEAST) for one in (envelope.low, envelope.high))
        shown = np.where(np.isfinite(high), high, np.nan)
        panel.fill_between(t, low, shown, color=color, alpha=0.15, linewidth=0, label="all runs")
        panel.plot(t, shown, color=color, linewidth=1.0, label="worst")
        if envelope.parts.size > 1:
            ends = np.maximum(envelope.quantiles[[0, -1], :, i], _LEAST)
            word = f"{100 * envelope.parts[0]:g} to {100 * envelope.parts[-1]:g} % of them"
            panel.fill_between(t, *np.where(np.isfinite(ends), ends, np.nan), color=color, alpha=0.35, label=word)
        if 0.5 in envelope.parts:
            median = np.maximum(envelope.quantiles[list(envelope.parts).index(0.5), :, i], _LEAST)
            panel.plot(t, median, color=INK, linewidth=1.3, label="median")
        panel.axhline(envelope.tolerance, color=INK, linestyle=(0, (4, 3)), linewidth=0.9, label="tolerance")
        panel.axvline(envelope.duration, color=INK, linewidth=0.7, alpha=0.5)
        label = f"{literal(name)}: distance [rad or m]" if len(names) == 1 else literal(name)
        panel.set(yscale="log", ylim=(_LEAST, None), ylabel=label, xlim=(t[0], t[-1]))
        panel.yaxis.set_major_locator(LogLocator(numticks=6))
    panels[-1].set_xlabel("time [s]; the thin line is the reference's end")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5)
    if len(names) > 1:
        figure.supylabel("distance from the reference [rad or m]", fontsize=9.5)
    if title:
        figure.suptitle(literal(title), fontsize=12, fontweight="bold")
    return figure


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
        _draw_controller(axes, [row for row in rows if row["controller"] == name], color, place)
    whole = [row for row in rows if row["worst"] is not None]
    if whole:
        best = min(whole, key=lambda row: row["worst"])
        at = (100 * best["reserve"], best["worst"])
        axes.plot(*at, "o", color=COLORS[3], markersize=9, markerfacecolor="none", markeredgewidth=1.8)
        axes.annotate(f"best: {best['reserve']:g}, {best['worst']:.3f} s", at, (8, 10), textcoords="offset points")
    axes.set(xlabel="torque left to feedback [% of the limits]", ylabel="time until settled [s]", ylim=(0, None))
    axes.legend(loc="upper right")
    return figure


def _draw_controller(axes: Axes, rows: Sequence[Mapping[str, Any]], color: str, place: int) -> None:
    """Draw one controller: worst, mean, and in a further line how many arms settle where not all do."""
    whole = [row for row in rows if row["worst"] is not None]
    r, own, worst, mean = (
        np.array([[100 * row["reserve"], row["duration"], row["worst"], row["mean"]] for row in whole]).reshape(-1, 4).T
    )
    axes.fill_between(r, own, worst, color=color, alpha=0.12, linewidth=0)
    axes.plot(r, worst, "o-", color=color, markersize=4, label=f"{rows[0]['controller']}, worst of all arms")
    axes.plot(r, mean, color=color, linewidth=1, alpha=0.6, label=f"{rows[0]['controller']}, mean")
    for row in rows:
        if row["worst"] is None:
            text, at, off = f"{row['settled']} of {row['arms']}", (100 * row["reserve"], 1), (0, -10 - 11 * place)
            look: dict[str, Any] = {"ha": "center", "va": "top", "color": color, "fontsize": 8}
            axes.annotate(text, at, off, ("data", "axes fraction"), "offset points", **look)
