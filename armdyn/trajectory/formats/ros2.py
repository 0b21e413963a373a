"""ROS 2's trajectory_msgs/msg/JointTrajectory."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

from armdyn.arguments import Checked, checked, flag, number
from armdyn.errors import TrajectoryError
from armdyn.trajectory.formats.output_format import joint_names

if TYPE_CHECKING:
    from armdyn.trajectory.samples import Samples
    from armdyn.trajectory.value import Trajectory

_MOST_SECONDS = 2**31 - 1
"""Of `builtin_interfaces/msg/Duration`, whose sec is an int32."""

_FIELDS = {"positions": "q", "velocities": "v", "accelerations": "a", "effort": "tau"}

HELD = "armdyn: effort held to the next point"
"""`header.frame_id` of own messages, which has no use in this message: tells readers what effort means."""

_NO_YAML = re.compile("[^\x20-\x7e\xa0-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]")
"""Characters that YAML does not have unescaped in a text, and more: https://yaml.org/spec/1.1/#c-printable."""


@dataclass(frozen=True)
class Ros2(Checked):
    """The message as JSON that is YAML of the same meaning, a point per line.

    PyYAML, which ROS reads with, takes 1e-05 for text and 1.0e-05 for a number: YAML 1.1 wants the point.

    Of a motion of several pieces the file has "events", too, which are no field of the message: for each piece
    time_from_start, name, event and load, as in `Piece`, for the node that sets the controller's payload.

    Attributes:
        tolerance: largest allowed `deviation` [rad or m].
        effort: write efforts, too; a controller without an effort command interface refuses points that have any.

    Raises:
        TrajectoryError: the tolerance is no positive number, or effort no flag.
    """

    name: ClassVar[str] = "ros2"
    suffix: ClassVar[str] = ".json"
    summary: ClassVar[str] = "a JointTrajectory message"
    least: ClassVar[float] = 1.0
    """Least length of the last step, as a part of a tick: a remainder is added to the step before."""

    tolerance: float = checked(number, 1e-3, unit="rad or m", sign="positive", error=TrajectoryError)
    effort: bool = checked(flag, True)

    def deviation(self, samples: Samples, motion: Trajectory) -> float:
        """Largest distance of ros2_control's quintic spline through the points from the motion [rad or m].

        Raises:
            TrajectoryError: it is above the tolerance.
        """
        import numpy as np

        from armdyn.trajectory.interpolation import between_rows

        at, spline, _ = between_rows(samples.t, (samples.q, samples.v, samples.a))
        off = float(np.max(np.abs(spline - motion(np.minimum(motion.t[0] + at, motion.t[-1])).q)))
        if off > self.tolerance:
            raise TrajectoryError(
                f"between these points ros2_control's spline is up to {off:.2g} rad or m off the motion, more than "
                f"{self.tolerance:g}: give a higher `rate` or `tolerance`"
            )
        return off

    def text(self, samples: Samples) -> str:
        """The message of `joint_trajectory`, and events."""
        message = joint_trajectory(samples)
        for point in message["points"] if not self.effort else ():
            del point["effort"]
        events = [
            {"time_from_start": _stamp(round(one.start * 1e9)), "name": one.name, "event": one.event,
             "load": one.load and asdict(one.load)} for one in samples.pieces
        ]  # fmt: skip
        points, event_lines = (",\n".join(map(_written, rows)) for rows in (message["points"], events))
        head = f'{{"header": {_written(message["header"])},\n"joint_names": {_written(message["joint_names"])}'
        return f'{head},\n"points": [\n{points}' + (f'\n],\n"events": [\n{event_lines}' if events else "") + "\n]}\n"


def joint_trajectory(samples: Samples) -> dict[str, Any]:
    """See `Samples.to_joint_trajectory`."""
    import numpy as np

    names = joint_names(samples)
    if samples.t[-1] >= _MOST_SECONDS:
        raise TrajectoryError(f"the motion lasts {samples.t[-1]:g} s; ROS counts to {_MOST_SECONDS} s")
    # Halves go up: numpy rounds them to even numbers, so that 1.5 and 2.5 would meet.
    whole = np.floor(samples.t)
    stamps = whole.astype(np.int64) * 10**9 + np.floor((samples.t - whole) * 1e9 + 0.5).astype(np.int64)
    if np.any(np.diff(stamps) <= 0):
        k = int(np.argmax(np.diff(stamps) <= 0))
        raise TrajectoryError(f"t[{k}] and t[{k + 1}], {samples.t[k]!r} s and so, are the same nanosecond")
    rows = zip(*(getattr(samples, what).tolist() for what in _FIELDS.values()), strict=True)
    points: list[dict[str, Any]] = [dict(zip(_FIELDS, row, strict=True)) for row in rows]
    for point, stamp in zip(points, stamps.tolist(), strict=True):
        point["time_from_start"] = _stamp(stamp)
    return {"header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": HELD}, "joint_names": names, "points": points}


def _stamp(nanoseconds: int) -> dict[str, int]:
    """A `builtin_interfaces/msg/Duration`."""
    return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}


def _written(value: object) -> str:
    """Plain values as JSON that is YAML of the same meaning."""
    if isinstance(value, float):
        return _decimal(value)
    if isinstance(value, dict):
        return f"{{{', '.join(f'{_quoted(key)}: {_written(one)}' for key, one in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_written, value))}]"
    return _quoted(value) if isinstance(value, str) else json.dumps(value)


@lru_cache  # each point has the same keys
def _quoted(text: str) -> str:
    return _NO_YAML.sub(_escaped, json.dumps(text, ensure_ascii=False))


def _decimal(value: float) -> str:
    """Format a float with a decimal point and the shortest exact digits."""
    short = repr(value)
    return short.replace("e", ".0e") if "e" in short and "." not in short else short


def _escaped(match: re.Match[str]) -> str:
    return f"\\u{ord(match[0]):04x}"
