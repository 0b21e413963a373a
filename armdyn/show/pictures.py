"""Pictures that fit a notebook's cell: a motion in three small panels, an arm as its skeleton."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

from armdyn.models import Robot
from armdyn.models.values.joint_limits import JointLimits
from armdyn.show.figures.style import COLORS, INK, LOOK, literal
from armdyn.show.plots import plot_trajectories
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_MOST_SAMPLES = 600
"""Most samples that are drawn; a longer motion is resampled at even times."""
_AXES = "xyz"


def motion_picture(motion: Trajectory, limits: JointLimits | None, resolved: bool = True) -> Figure:
    """Position, velocity and torque over time.

    Args:
        motion: the drawn one.
        limits: drawn, too; None: none.
        resolved: its switching times are its own, not a mesh's or a curve's; else it says so.
    """
    figure = plot_trajectories([_thinned(motion)], limits=limits, unresolved=() if resolved else (0,))
    figure.set_size_inches(6.0, 5.4 + 1.4 * (len(figure.axes) - 3))
    return _clear(figure)


def robot_picture(robot: Robot, poses: Sequence[Array]) -> Figure:
    """An arm's joints and tip, joined by lines, seen along the axis of the world in which it extends least.

    Args:
        robot: the arm.
        poses: joint positions [rad or m], each of shape (nv,), the first drawn faintest.
    """
    lines = [_skeleton(robot, q) for q in poses]
    spread = np.ptp(np.concatenate(lines), axis=0)
    across, up = sorted(np.argsort(spread, kind="stable")[1:])  # z, where it is seen, goes up
    with rc_context(LOOK):
        figure = Figure(figsize=(3.4, 3.0), layout="constrained")
        axes = figure.add_subplot()
        for i, line in enumerate(lines):
            shade = 1.0 if len(lines) == 1 else 0.35 + 0.65 * i / (len(lines) - 1)
            last = i == len(lines) - 1
            said = "" if len(lines) == 1 else "start" if i == 0 else "goal" if last else f"via {i}"
            axes.plot(line[:, across], line[:, up], "-o", color=COLORS[0], alpha=shade, markersize=3.5, linewidth=1.8)
            if said:
                axes.annotate(said, (line[-1, across], line[-1, up]), xytext=(4, 4), textcoords="offset points")
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.12)
        axes.set_xlabel(f"{_AXES[across]} [m]")
        axes.set_ylabel(f"{_AXES[up]} [m]")
        axes.set_title(literal(f"tip: {robot.tip[:40]}"), fontsize=9, color=INK)
    return _clear(figure)


def _skeleton(robot: Robot, q: Array) -> Array:
    """Base, joints and tip in the world [m], shape (nv + 2, 3)."""
    model = robot.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, robot.configuration(np.asarray(q, dtype=float)))
    frame = model.getFrameId(robot.frame(robot.tip).name)
    return np.array([np.zeros(3), *(place.translation for place in data.oMi[1:]), data.oMf[frame].translation])


def _thinned(motion: Trajectory) -> Trajectory:
    if motion.t.size <= _MOST_SAMPLES:
        return motion
    t = np.linspace(motion.t[0], motion.t[-1], _MOST_SAMPLES)
    at = motion(t)
    return replace(motion, t=t, q=at.q, v=at.v, tau=at.tau)


def _clear(figure: Figure) -> Figure:
    """Make the background transparent."""
    figure.patch.set_alpha(0.0)
    for axes in figure.axes:
        axes.patch.set_alpha(0.0)
    return figure
