"""Figures of motions: position, velocity and torque over time."""

import os
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from armdyn.errors import TrajectoryError
from armdyn.files import write_whole
from armdyn.models import JointLimits
from armdyn.reprs import joint_unit
from armdyn.show.figures.style import INK, LOOK, Panel, Style, color, draw_limits, draw_ranges, literal, scales, styles
from armdyn.trajectory import Trajectory

_QUANTITIES = (("position", "rad", "m"), ("velocity", "rad/s", "m/s"), ("torque", "N m", "N"))
"""Quantities of the panels, with the units of joints that turn and of those that slide."""
_DENSE = 1200
_MOST_TICKS = 40
_Place = Literal["outside upper center", "outside lower center"]
UNRESOLVED = " (switching times not resolved)"
"""Remark in the legend for a motion on a mesh or a curve."""
_UNDATED: dict[str, dict[str, str | None]] = {
    "png": {"Software": "armdyn"},
    "pdf": {"Creator": "armdyn", "Producer": "armdyn", "CreationDate": None},
    "svg": {"Creator": "armdyn", "Date": None},
}


def plot_trajectories(
    trajectories: Sequence[Trajectory],
    *,
    limits: JointLimits | None = None,
    title: str | None = None,
    unresolved: Collection[int] = (),
    captions: Sequence[str] | None = None,
    sliding: Sequence[bool] = (),
) -> Figure:
    """Position, velocity and torque of every joint in stacked panels.

    A colour is a joint, a line style a trajectory. The torque's jumps are drawn as jumps; ticks of the joint's colour
    on the time axes say when it switches. Joints whose torque limits differ by more than three times have torque panels
    of their own, so that a wrist is visible next to a shoulder. Limits that are not drawn are listed above the panel.

    Args:
        trajectories: one or more, of the same joints.
        limits: drawn as faint dashed lines where they are finite and near the curves.
        title: above the panels.
        unresolved: places in `trajectories` of those whose switching times are a mesh's or a curve's, as a `Solution`'s
            are whose `phases` are None: they have no ticks, and it is said.
        captions: of each in the legend; None: its name and its duration.
        sliding: which joints slide, `Robot.slides`: their units are m, m/s and N; empty: none does.

    Returns:
        A figure of its own: pyplot knows nothing of it. Its axes are position, velocity and one or more of torque.

    Raises:
        TrajectoryError: there is none, their joints or captions differ in number, or `unresolved` is no place of one.
    """
    if not trajectories:
        raise TrajectoryError("nothing to plot: no trajectory given")
    joints = trajectories[0].v.shape[1]
    for trajectory in trajectories:
        if trajectory.v.shape[1] != joints:
            raise TrajectoryError(f"cannot plot {joints} and {trajectory.v.shape[1]} joints in one figure")
    if wrong := set(unresolved) - set(range(len(trajectories))):
        raise TrajectoryError(
            f"unresolved has {min(wrong)}; expected places of {len(trajectories)} trajectories, from 0"
        )
    if captions is not None and len(captions) != len(trajectories):
        raise TrajectoryError(f"{len(captions)} captions for {len(trajectories)} trajectories")
    figure = plot_panels(trajectories, limits, unresolved, sliding)
    named = [f"{one.name or f'trajectory {k + 1}'}, {one.duration:.4g} s" for k, one in enumerate(trajectories)]
    runs = named if captions is None else list(captions)
    runs = [run + (UNRESOLVED if k in unresolved else "") for k, run in enumerate(runs)]
    put_head(figure, title, run_handles(runs) if len(runs) > 1 or unresolved else ())
    return figure


@rc_context(LOOK)
def plot_panels(
    trajectories: Sequence[Trajectory],
    limits: JointLimits | None,
    unresolved: Collection[int] = (),
    sliding: Sequence[bool] = (),
) -> Figure:
    """Panels of `plot_trajectories`, without title and legend above them."""
    joints = trajectories[0].v.shape[1]
    groups = scales(limits, joints)
    figure = Figure(figsize=(7.0, 7.6 + 1.7 * (len(groups) - 1)), layout="constrained")
    axes = list(figure.subplots(2 + len(groups), 1, sharex=True))
    every = tuple(range(joints))
    slides, kinds = tuple(sliding) or joints * (False,), (*_QUANTITIES[:2], *len(groups) * _QUANTITIES[2:])
    panels = [
        Panel(ax, quantity, joint_unit([slides[j] for j in group], *units), group)
        for ax, group, (quantity, *units) in zip(axes, (every, every, *groups), kinds, strict=True)
    ]
    for k, (trajectory, style) in enumerate(zip(trajectories, styles(len(trajectories)), strict=True)):
        _draw(panels, trajectory, style)
        if k not in unresolved:
            _draw_switches(panels, trajectory)
    for panel in panels:
        panel.axes.set_ylabel(f"{panel.quantity} [{panel.unit}]")
        panel.axes.axhline(0.0, color=INK, linewidth=0.5, alpha=0.5, zorder=1)
        panel.axes.margins(y=0.08)
    axes[-1].set_xlabel("time [s]")
    start = min(float(trajectory.t[0]) for trajectory in trajectories)
    end = max(float(trajectory.t[-1]) for trajectory in trajectories)
    axes[0].set_xlim(start, end + 0.01 * (end - start))
    if limits is not None and not limits.actuators.constant and len(trajectories) == 1:
        for panel in panels[2:]:
            draw_ranges(panel, limits, trajectories[0])
    limited = [limits is not None and draw_limits(panel, limits) for panel in panels]
    figure.align_ylabels(axes)
    _add_legend(figure, trajectories, any(limited), unresolved)
    return figure


@rc_context(LOOK)
def put_head(figure: Figure, title: str | None, handles: Sequence[Line2D] = ()) -> None:
    """A title above the panels, and under it the legend of the line styles."""
    bold = {"size": 12, "weight": "bold"}
    if handles:
        above = literal(title) if title else None
        _legend(figure, handles, "outside upper center", title=above, title_fontproperties=bold)
    elif title:
        figure.suptitle(literal(title), fontproperties=bold)


def run_handles(captions: Sequence[str]) -> list[Line2D]:
    """Legend entries of the trajectories."""
    drawn = zip(captions, styles(len(captions)), strict=True)
    return [Line2D([], [], color=INK, linestyle=style, linewidth=1.4, label=literal(text)) for text, style in drawn]


def switches(trajectory: Trajectory) -> tuple[tuple[float, ...], ...]:
    """Switching times of each joint's torque [s]; small steps of a mesh or a controller are ignored.

    A change of sides is a jump by more than 0.4 of the torque's range.
    """
    found = []
    for joint, times in enumerate(trajectory.switch_times):
        k = np.searchsorted(trajectory.t, times)
        steps = np.abs(trajectory.tau[k, joint] - trajectory.tau[k + 1, joint])
        found.append(tuple(t for t, d in zip(times, steps, strict=True) if d > 0.4 * np.ptp(trajectory.tau[:, joint])))
    return tuple(found)


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


def save_figures(figure: Figure, stem: Path, kinds: Sequence[str]) -> list[Path]:
    """Write a figure in several formats, see `save_figure`; its panels are placed once.

    Args:
        figure: the figure.
        stem: the files' path without a suffix.
        kinds: png, pdf or svg.

    Returns:
        The paths written, in the order of the formats.
    """
    with laid_out(figure):
        return [save_figure(figure, stem.with_name(f"{stem.name}.{kind}")) for kind in kinds]


@contextmanager
def laid_out(figure: Figure) -> Iterator[None]:
    """Place a figure's panels once for several files; matplotlib would place them twice for each of them."""
    engine = figure.get_layout_engine()
    with rc_context(LOOK):
        figure.draw_without_rendering()
    figure.set_layout_engine(None)
    try:
        yield
    finally:
        figure.set_layout_engine(engine)


def svg_text(figure: Figure) -> str:
    """A figure as SVG; the same figure gives the same text."""
    return _rendered(figure, "svg").decode("utf-8")


@rc_context(LOOK)
def _rendered(figure: Figure, kind: str) -> bytes:
    buffer = BytesIO()
    figure.savefig(buffer, format=kind, dpi=160, metadata=_UNDATED[kind])
    return buffer.getvalue()


def _draw(panels: Sequence[Panel], trajectory: Trajectory, style: Style) -> None:
    # Position and velocity are curved between samples; the torque is linear or held, its samples say it all.
    t = np.union1d(trajectory.t, np.linspace(trajectory.t[0], trajectory.t[-1], _DENSE))
    dense = trajectory(t)
    curves = {"position": (t, dense.q), "velocity": (t, dense.v), "torque": (trajectory.t, trajectory.tau)}
    for panel in panels:
        time, values = curves[panel.quantity]
        steps = "steps-post" if panel.quantity == "torque" and trajectory.hold == "zero-order" else "default"
        look: dict[str, Any] = {"linestyle": style, "linewidth": 1.7, "zorder": 3, "drawstyle": steps}
        for joint in panel.joints:
            panel.axes.plot(time, values[:, joint], color=color(joint), **look)
        panel.axes.axvline(trajectory.t[-1], color=INK, linestyle=style, linewidth=0.6, alpha=0.35, zorder=1)


def _draw_switches(panels: Sequence[Panel], trajectory: Trajectory) -> None:
    """Ticks on the time axes, of the joint's colour."""
    times = switches(trajectory)
    for panel in panels:
        across = panel.axes.get_xaxis_transform()
        for joint in panel.joints:
            # Beyond that a torque chatters, and ticks would be a band.
            for t in times[joint] if len(times[joint]) <= _MOST_TICKS else ():
                panel.axes.plot(
                    [t, t], [0.0, 0.09], transform=across, color=color(joint), linewidth=2.2, solid_capstyle="butt",
                    zorder=4, label="_switch",
                )  # fmt: skip


def _add_legend(figure: Figure, trajectories: Sequence[Trajectory], limits: bool, unresolved: Collection[int]) -> None:
    """Legend of colours and marks, under the panels."""
    names = trajectories[0].joint_names or [f"joint {i + 1}" for i in range(trajectories[0].v.shape[1])]
    handles = [Line2D([], [], color=color(i), linewidth=1.7, label=literal(name)) for i, name in enumerate(names)]
    if any(any(switches(one)) for k, one in enumerate(trajectories) if k not in unresolved):
        handles.append(Line2D([], [], color=INK, marker="|", markersize=7, markeredgewidth=2, ls="", label="switch"))
    if limits:
        handles.append(Line2D([], [], color=INK, linestyle=(0, (4, 3)), linewidth=0.9, alpha=0.5, label="limit"))
    _legend(figure, handles, "outside lower center")


def _legend(figure: Figure, handles: Sequence[Line2D], place: _Place, **options: Any) -> None:
    """Add a legend with as many columns as fit: at 9 points a letter takes about 0.075 inches, a handle 0.6."""
    widest = max(len(str(handle.get_label())) for handle in handles)
    rows = -(-len(handles) // max(int((figure.get_figwidth() - 0.3) / (0.075 * widest + 0.6)), 1))
    columns = -(-len(handles) // rows)
    figure.legend(handles=handles, loc=place, ncols=columns, handlelength=2.4, columnspacing=1.4, **options)
