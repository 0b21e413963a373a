"""Figures of motions: position, velocity and torque over time, as in Figures 2-7 of the paper."""

import os
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from armdyn.errors import TrajectoryError
from armdyn.files import write_whole
from armdyn.models import JointLimits
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

COLORS = ("#2970b8", "#ed8a24", "#33a05c", "#cc2936", "#7b52ab", "#12a4b4", "#8a5a3b", "#d65fa5")
"""One per joint; the first three are the links' colours in the replay."""

Style = Literal["-", "-."] | tuple[float, tuple[float, ...]]
STYLES: tuple[Style, ...] = ("-", (0, (5, 2)), (0, (1.2, 1.6)), "-.")
"""One per trajectory."""
INK = "#30363d"
"""Of text and axes."""
_GRID = "#d9dee4"
_DENSE = 1200
_LEGEND_WIDTH = 95
"""Characters that stand side by side above the panels, lines of the legend included; more would squeeze the panels."""
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
_UNDATED: dict[str, dict[str, str | None]] = {
    "png": {"Software": "armdyn"},
    "pdf": {"Creator": "armdyn", "Producer": "armdyn", "CreationDate": None},
    "svg": {"Creator": "armdyn", "Date": None},
}


def plot_trajectories(
    trajectories: Sequence[Trajectory], *, limits: JointLimits | None = None, title: str | None = None
) -> Figure:
    """Position, velocity and torque of every joint in three stacked panels.

    A colour is a joint, a line style a trajectory. The torque's jumps are drawn as jumps.

    Args:
        trajectories: one or more, of the same joints.
        limits: drawn as faint dashed lines where they are finite and near the curves.
        title: above the panels.

    Returns:
        A figure of its own: pyplot knows nothing of it.

    Raises:
        TrajectoryError: there is none, or their joints differ in number.
    """
    if not trajectories:
        raise TrajectoryError("nothing to plot: no trajectory given")
    joints = trajectories[0].v.shape[1]
    for trajectory in trajectories:
        if trajectory.v.shape[1] != joints:
            raise TrajectoryError(f"cannot plot {joints} and {trajectory.v.shape[1]} joints in one figure")
    with rc_context(LOOK):
        figure = Figure(figsize=(7.0, 7.4), layout="constrained")
        panels = list(figure.subplots(3, 1, sharex=True))
        for trajectory, style in zip(trajectories, _styles(len(trajectories)), strict=True):
            _draw(panels, trajectory, style)
        for panel, label in zip(panels, ("position [rad]", "velocity [rad/s]", "torque [N m]"), strict=True):
            panel.set_ylabel(label)
            panel.axhline(0.0, color=INK, linewidth=0.5, alpha=0.5, zorder=1)
            panel.margins(y=0.08)
        panels[2].set_xlabel("time [s]")
        start = min(float(trajectory.t[0]) for trajectory in trajectories)
        end = max(float(trajectory.t[-1]) for trajectory in trajectories)
        panels[0].set_xlim(start, end + 0.01 * (end - start))
        limited = limits is not None and _draw_limits(panels, limits, joints)
        figure.align_ylabels(panels)
        _add_legends(figure, trajectories, joints, limited)
        if title:
            figure.suptitle(title, fontsize=12, fontweight="bold")
    return figure


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> Path:
    """Write a figure as png, pdf or svg, by the path's suffix; the same figure gives the same bytes.

    Returns:
        The path written, as given.

    Raises:
        ValueError: another suffix.
        OSError: the folder cannot be written.
    """
    kind = Path(path).suffix.lower().removeprefix(".")
    if kind not in _UNDATED:
        raise ValueError(f"{path}: a figure is written as .png, .pdf or .svg")
    return write_whole(path, _rendered(figure, kind))


def svg_text(figure: Figure) -> str:
    """A figure as SVG; the same figure gives the same text."""
    return _rendered(figure, "svg").decode("utf-8")


def _rendered(figure: Figure, kind: str) -> bytes:
    buffer = BytesIO()
    with rc_context(LOOK):
        figure.savefig(buffer, format=kind, dpi=160, metadata=_UNDATED[kind])
    return buffer.getvalue()


def _colors(n: int) -> list[str]:
    return [COLORS[i % len(COLORS)] for i in range(n)]


def _styles(n: int) -> list[Style]:
    return [STYLES[i % len(STYLES)] for i in range(n)]


def _draw(panels: list[Axes], trajectory: Trajectory, style: Style) -> None:
    # Position and velocity are curved between samples; the torque is linear, its samples say it all.
    t = np.union1d(trajectory.t, np.linspace(trajectory.t[0], trajectory.t[-1], _DENSE))
    dense = trajectory(t)
    curves = ((t, dense.q), (t, dense.v), (trajectory.t, trajectory.tau))
    for panel, (time, values) in zip(panels, curves, strict=True):
        for joint, color in enumerate(_colors(values.shape[1])):
            panel.plot(time, values[:, joint], color=color, linestyle=style, linewidth=1.7, zorder=3)
        panel.axvline(trajectory.t[-1], color=INK, linestyle=style, linewidth=0.6, alpha=0.35, zorder=1)


def _draw_limits(panels: list[Axes], limits: JointLimits, joints: int) -> bool:
    """Whether there was one to draw."""
    any_drawn = False
    bounds = (
        (limits.position_lower, limits.position_upper),
        (-limits.velocity, limits.velocity),
        (limits.effort_lower, limits.effort_upper),
    )
    for panel, pair in zip(panels, bounds, strict=True):
        low, high = panel.get_ylim()
        near = 0.25 * (high - low)
        drawn: list[float] = []
        for values in pair:
            common = bool(np.all(values == values[0]))
            for joint, value in enumerate(values[: 1 if common else joints]):
                if np.isfinite(value) and low - near <= value <= high + near:
                    color = INK if common else _colors(joints)[joint]
                    panel.axhline(value, color=color, linestyle=(0, (4, 3)), linewidth=0.9, alpha=0.45)
                    drawn.append(float(value))
        if drawn:
            any_drawn = True
            pad = 0.06 * (high - low)
            panel.set_ylim(min(low, min(drawn) - pad), max(high, max(drawn) + pad))
    return any_drawn


def _add_legends(figure: Figure, trajectories: Sequence[Trajectory], joints: int, limits: bool) -> None:
    names = trajectories[0].joint_names or tuple(f"joint {i + 1}" for i in range(joints))
    handles = [
        Line2D([], [], color=color, linewidth=1.7, label=literal(name))
        for name, color in zip(names, _colors(joints), strict=True)
    ]
    if limits:
        handles.append(Line2D([], [], color=INK, linestyle=(0, (4, 3)), linewidth=0.9, alpha=0.5, label="limit"))
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 5), handlelength=2.6)
    if len(trajectories) > 1:
        runs = []
        for i, (trajectory, style) in enumerate(zip(trajectories, _styles(len(trajectories)), strict=True)):
            caption = f"{trajectory.name or f'trajectory {i + 1}'}, {trajectory.duration:.4g} s"
            runs.append(Line2D([], [], color=INK, linestyle=style, linewidth=1.4, label=literal(caption)))
        longest = max(len(str(run.get_label())) for run in runs)
        columns = max(1, min(len(runs), 3, _LEGEND_WIDTH // (longest + 6)))
        figure.axes[0].legend(handles=runs, loc="lower left", bbox_to_anchor=(0, 1), ncols=columns, borderaxespad=0.2)


def literal(text: str) -> str:
    """The text as it is: matplotlib hides labels that start with _, and reads $...$ as mathematics."""
    return text.replace("$", r"\$").lstrip("_") or "-"
