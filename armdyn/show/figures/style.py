"""Style of all figures, and the lines of limits in them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib import rc_context, rc_params_from_file
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from armdyn.models import JointLimits
from armdyn.trajectory import Trajectory

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


@rc_context(LOOK)
def one_panel(title: str | None, height: float = 4.4) -> tuple[Figure, Axes]:
    """A figure with one panel, and a title above it if there is one."""
    figure = Figure(figsize=(7.0, height), layout="constrained")
    axes = figure.subplots()
    if title:
        axes.set_title(literal(title), fontsize=12, fontweight="bold")
    return figure, axes


def literal(text: str) -> str:
    """Escape a label for matplotlib, which hides labels that start with _ and reads $...$ as mathematics."""
    return text.replace("$", r"\$").lstrip("_") or "-"


@dataclass(frozen=True)
class Panel:
    """Axes, their quantity and unit, and the joints drawn there."""

    axes: Axes
    quantity: str
    unit: str
    joints: tuple[int, ...]


def scales(limits: JointLimits | None, joints: int) -> list[tuple[int, ...]]:
    """Joints of like torque limits, strongest first: a tenth of another's scale is a flat line."""
    every = tuple(range(joints))
    if limits is None:
        return [every]
    strength = limits.actuators.strongest
    groups: list[list[int]] = []
    for joint in sorted(every, key=lambda i: -strength[i]):
        if groups and (not strength[joint] < strength[groups[-1][0]] / 3 or not np.isfinite(strength[groups[-1][0]])):
            groups[-1].append(joint)
        else:
            groups.append([joint])
    return [tuple(sorted(group)) for group in groups]


def draw_limits(panel: Panel, limits: JointLimits) -> bool:
    """Draw the limits near the curves, and list the others above the panel; returns whether one was drawn."""
    lower, upper = {
        "position": (limits.position_lower, limits.position_upper),
        "velocity": (-limits.velocity, limits.velocity),
        "torque": (limits.effort_lower, limits.effort_upper),
    }[panel.quantity]
    own = list(panel.joints)
    low, high = panel.axes.get_ylim()
    near = 0.25 * (high - low)
    drawn: list[float] = []
    beyond: list[float] = []
    for values in (lower[own], upper[own]):
        common = bool(np.all(values == values[0]))
        for joint, value in zip(own[:1] if common else own, values, strict=False):
            if np.isfinite(value) and low - near <= value <= high + near:
                ink = INK if common else color(joint)
                panel.axes.axhline(value, color=ink, linestyle=(0, (4, 3)), linewidth=0.9, alpha=0.45)
                drawn.append(float(value))
            elif np.isfinite(value):
                beyond.append(float(value))
    if drawn:
        pad = 0.06 * (high - low)
        panel.axes.set_ylim(min(low, min(drawn) - pad), max(high, max(drawn) + pad))
    free = sum(not np.isfinite(lower[joint]) and not np.isfinite(upper[joint]) for joint in own)
    panel.axes.set_title(_limits_caption(panel, drawn, beyond, free), loc="right", fontsize=8, color=SOFT)
    return bool(drawn)


def draw_ranges(panel: Panel, limits: JointLimits, motion: Trajectory) -> None:
    """Draw the torque limits of a motion in its panel, of joints whose motors give less at speed."""
    falling = np.any(limits.actuators.lines[0] > 0, axis=0)
    ends = limits.actuators.range(motion.q, motion.v)
    for joint in filter(falling.__getitem__, panel.joints):
        for end in ends:
            panel.axes.plot(
                motion.t, end[:, joint], color=color(joint), linestyle=(0, (1, 2)), linewidth=0.9, alpha=0.7
            )


def _limits_caption(panel: Panel, drawn: Sequence[float], beyond: Sequence[float], free: int) -> str:
    """Caption of limits that a panel does not show; empty if it shows all."""
    if free == len(panel.joints):
        return f"no {panel.quantity} limits"
    parts = []
    if beyond:
        sizes = sorted({abs(value) for value in beyond})
        span = f"{sizes[0]:.4g}" if len(sizes) == 1 else f"{sizes[0]:.4g} to {sizes[-1]:.4g}"
        sign = "±" if min(beyond) < 0 < max(beyond) else "−" if max(beyond) < 0 else ""
        parts.append(f"{'other ' if drawn else ''}limits beyond the panel: {sign}{span} {panel.unit}")
    if free:
        parts.append(f"{free} of {len(panel.joints)} joints without a limit")
    return "; ".join(parts)
