"""Torques over speeds: motions inside the torque-speed curves of their motors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armdyn.arrays import Array
from armdyn.models.values.actuator_limits import TorqueSpeed
from armdyn.models.values.joint_limits import JointLimits
from armdyn.show.markup import Html, element, join
from armdyn.show.page.course import ShownMotion
from armdyn.show.page.sections import Section

_WIDTH, _HEIGHT, _EDGE = 260.0, 170.0, 6.0
"""Width, height and edge of a picture [px]."""
_POINTS = 600
"""Points of a motion that are drawn, about."""


def motor_section(
    move: ShownMotion, joints: Sequence[str], limits: JointLimits, sliding: Sequence[bool]
) -> Section | None:
    """Torque over speed of every joint that has a torque-speed curve, inside its limits; None: no joint has one."""
    motors, motion = limits.actuators, move.motion
    if not isinstance(motors, TorqueSpeed):
        return None
    last = [np.asarray(motors.curves[name])[-1, 0] if name in motors.curves else 0.0 for name in joints]
    fastest = np.maximum(1.05 * np.max(np.abs(motion.v), axis=0), last)
    v = np.linspace(-fastest, fastest, 201)
    lower, upper = motors.range(np.zeros_like(v), v)
    every = max(len(motion.t) // _POINTS, 1)
    pictures = []
    for j, name in enumerate(joints):
        if name not in motors.curves or limits.passive[j]:
            continue
        unit = ("m/s", "N") if sliding[j] else ("rad/s", "N m")
        size = np.array([fastest[j], np.max(np.abs([lower[:, j], upper[:, j]]))])
        edge = np.concatenate([np.stack([v[:, j], upper[:, j]], 1), np.stack([v[::-1, j], lower[::-1, j]], 1)])
        way = np.stack([motion.v[::every, j], motion.tau[::every, j]], 1)
        caption = f"{name}: ±{size[0]:.4g} {unit[0]} across, ±{size[1]:.4g} {unit[1]} up"
        pictures.append(
            element("figure", _picture(edge / size, way / size, caption), element("figcaption", caption, class_="note"))
        )
    note = "Torque over speed: the motion, within what the motor can give at each speed."
    body = join([element("p", note, class_="note"), element("div", *pictures, class_="motors")])
    return Section("motors", "Torque and speed", body, wide=True)


def _picture(edge: Array, way: Array, label: str) -> Html:
    """A range and a motion, each of numbers from -1 to 1, shape (points, 2), as an SVG."""
    middle, half = np.array([_WIDTH, _HEIGHT]) / 2, np.array([_WIDTH, -_HEIGHT]) / 2 + [-_EDGE, _EDGE]

    def points(of: Array) -> str:
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in middle + half * of)

    cross = f"M 0 {middle[1]:g} H {_WIDTH:g} M {middle[0]:g} 0 V {_HEIGHT:g}"
    return element(
        "svg",
        element("polygon", points=points(edge), fill="var(--fill)", stroke="var(--soft)", stroke_dasharray="5 4"),
        element("path", d=cross, stroke="var(--line)"),
        element("polyline", points=points(way), fill="none", stroke="var(--T)", stroke_width="1.5"),
        viewBox=f"0 0 {_WIDTH:g} {_HEIGHT:g}", width=int(_WIDTH), role="img", aria_label=label,
    )  # fmt: skip
