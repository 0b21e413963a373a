"""Figures of many runs at once: how far joints are from their reference over time."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from armdyn.control.tracking.envelope import Envelope
from armdyn.show.figures.style import COLORS, INK, LOOK, literal

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
        figure.suptitle(title, fontsize=12, fontweight="bold")
    return figure
