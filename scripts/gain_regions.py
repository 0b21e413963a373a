"""The figure of stable gains, docs/stability.png: see stability.py."""

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from armdyn.errors import ProblemError
from armdyn.show.figures.style import COLORS, INK, LOOK

_MOST_COLUMNS = 3
_SAMPLED, _CONTINUOUS = 0.005, 1.0
"""By how much log(radius) [-] and growth [1/s] turn from -1 to 1 about a boundary. Far from it they differ by orders of
magnitude on both sides, and a straight line between them would not cross zero near the boundary."""


@rc_context(LOOK)
def plot_regions(panels, *, mark=None, marked="marked gains", title=None):
    """Stable regions in the plane of kp and kd, both logarithmic: a panel per case, a colour per payload.

    Dashed is the boundary of the continuous loop, which is stable above it. Solid is that of the sampled loop, which is
    stable where its colour fills the plane.

    Args:
        panels: a panel's title, and in it the name of each payload and its plane.
        mark: (kp, kd) to be marked in every panel.
        marked: name of the mark.
        title: above the panels.

    Returns:
        A figure of its own: pyplot knows nothing of it.

    Raises:
        ProblemError: there is nothing to plot; gains that are not positive.
    """
    if not panels or not all(panels.values()):
        raise ProblemError("nothing to plot: every panel needs one plane of gains at least")
    if any(plane.kp[0] <= 0 or plane.kd[0] <= 0 for planes in panels.values() for plane in planes.values()):
        raise ProblemError("a plane begins with a gain of 0, which a logarithmic axis does not have; begin above it")
    names = list(dict.fromkeys(name for planes in panels.values() for name in planes))
    colors = {name: COLORS[k % len(COLORS)] for k, name in enumerate(names)}
    columns = min(len(panels), _MOST_COLUMNS)
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(3.4 * columns + 0.6, 3.1 * rows + 1.0), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes, (label, planes) in zip(grid.flat, panels.items(), strict=False):
        for name, plane in planes.items():
            _draw_plane(axes, plane, colors[name])
        if mark is not None:
            axes.plot(*mark, "+", color=INK, markersize=11, markeredgewidth=1.8, zorder=5)
        axes.set_title(label, fontsize=10.5)
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    for axes in grid[-1]:
        axes.set_xlabel("kp")
    for axes in grid[:, 0]:
        axes.set_ylabel("kd")
    handles = [Patch(color=colors[name], alpha=0.6, label=name) for name in names]
    handles += [
        Line2D([], [], color=INK, linestyle=(0, (4, 2)), label="continuous: stable above and to the right"),
        Line2D([], [], color=INK, label="sampled: stable where filled"),
    ]
    if mark is not None:
        handles.append(Line2D([], [], color=INK, linestyle="", marker="+", markersize=10, label=marked))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    if title:
        figure.suptitle(title, fontsize=12, fontweight="bold")
    return figure


def _draw_plane(axes, plane, color):
    """Both boundaries of one payload, between the grid's points on straight lines."""
    axes.set(xscale="log", yscale="log", xlim=(plane.kp[0], plane.kp[-1]), ylim=(plane.kd[0], plane.kd[-1]))
    sampled, continuous = np.tanh(np.log(plane.radius) / _SAMPLED), np.tanh(plane.growth / _CONTINUOUS)
    axes.contourf(plane.kp, plane.kd, sampled, levels=[-1.0, 0.0], colors=[color], alpha=0.13)
    for field, style in ((sampled, "-"), (continuous, (0, (4, 2)))):
        if field.min() < 0 < field.max():
            axes.contour(plane.kp, plane.kd, field, levels=[0.0], colors=[color], linewidths=1.5, linestyles=[style])
