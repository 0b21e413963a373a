"""What others read: a table, ROS 2's message, MuJoCo's keyframes."""

from __future__ import annotations

import csv
import io
import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from armdyn.arguments import flag
from armdyn.errors import MissingPackageError, TrajectoryError

if TYPE_CHECKING:
    from pandas import DataFrame

    from armdyn.trajectory.samples import Samples

_UNITS = {"q": "rad or m", "v": "rad/s or m/s", "a": "rad/s^2 or m/s^2", "tau": "N m or N"}

_MOST_SECONDS = 2**31 - 1
"""Of `builtin_interfaces/msg/Duration`, whose sec is an int32."""

_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML 1.0 has no way to say: https://www.w3.org/TR/xml/#charsets."""

_NO_YAML = re.compile("[^\x20-\x7e\xa0-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]")
"""What YAML does not have unescaped in a text, and more: https://yaml.org/spec/1.1/#c-printable."""


def columns(samples: Samples) -> list[str]:
    """The head of the table: what, of which joint, in which unit."""
    joints = samples.joint_names or [f"joint{i + 1}" for i in range(samples.q.shape[1])]
    return ["t [s]", *(f"{what}_{joint} [{unit}]" for what, unit in _UNITS.items() for joint in joints)]


def csv_text(samples: Samples) -> str:
    """A table of comma-separated values as RFC 4180 has them, but for lines, which end as Unix has it."""
    content = io.StringIO(newline="")
    writer = csv.writer(content, lineterminator="\n")
    writer.writerow(columns(samples))
    writer.writerows(_table(samples).tolist())  # Python's floats are written with as many digits as they need
    return content.getvalue()


def dataframe(samples: Samples) -> DataFrame:
    """The same table as pandas has it."""
    try:
        import pandas
    except ImportError:
        raise MissingPackageError("pandas", "to_dataframe", "to_csv does without") from None
    return pandas.DataFrame(_table(samples), columns=columns(samples))


def joint_trajectory(samples: Samples) -> dict[str, Any]:
    """See `Samples.to_joint_trajectory`."""
    names = _names(samples)
    if samples.t[-1] >= _MOST_SECONDS:
        raise TrajectoryError(f"the motion lasts {samples.t[-1]:g} s; ROS counts to {_MOST_SECONDS} s")
    # Halves go up: numpy rounds them to even numbers, so that 1.5 and 2.5 would meet.
    whole = np.floor(samples.t)
    stamps = whole.astype(np.int64) * 10**9 + np.floor((samples.t - whole) * 1e9 + 0.5).astype(np.int64)
    if np.any(np.diff(stamps) <= 0):
        k = int(np.argmax(np.diff(stamps) <= 0))
        raise TrajectoryError(f"t[{k}] and t[{k + 1}], {samples.t[k]!r} s and so, are the same nanosecond")
    rows = zip(*(getattr(samples, what).tolist() for what in _UNITS), stamps.tolist(), strict=True)
    return {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": names,
        "points": [
            {
                "positions": q,
                "velocities": v,
                "accelerations": a,
                "effort": tau,
                "time_from_start": {"sec": stamp // 10**9, "nanosec": stamp % 10**9},
            }
            for q, v, a, tau, stamp in rows
        ],
    }


def joint_trajectory_text(samples: Samples) -> str:
    """The message as JSON, a point per line, that is YAML of the same meaning.

    PyYAML, which ROS reads with, takes 1e-05 for text and 1.0e-05 for a number: YAML 1.1 wants the point.
    """
    fields = joint_trajectory(samples)
    names = ", ".join(_NO_YAML.sub(_escape, json.dumps(name, ensure_ascii=False)) for name in fields["joint_names"])
    points = []
    for point in fields["points"]:
        rows = [
            f'"{what}": [{", ".join(map(_decimal, row))}]' for what, row in point.items() if what != "time_from_start"
        ]
        points.append(f'{{{", ".join(rows)}, "time_from_start": {json.dumps(point["time_from_start"])}}}')
    head = f'{{"header": {json.dumps(fields["header"])},\n"joint_names": [{names}],\n"points": [\n'
    return head + ",\n".join(points) + "\n]}\n"


def mjcf(samples: Samples, motors: bool) -> str:
    """See `Samples.to_mjcf`; its elements are those of https://mujoco.readthedocs.io/en/stable/XMLreference.html."""
    names = [_attribute(name) for name in _names(samples)]
    lines = [f"<mujoco model={_attribute(samples.name or 'motion')}>"]
    if flag(motors, "motors"):
        lines += ["  <actuator>", *(f"    <motor name={name} joint={name}/>" for name in names), "  </actuator>"]
    lines.append("  <keyframe>")
    for t, q, v, tau in zip(*(getattr(samples, what).tolist() for what in ("t", "q", "v", "tau")), strict=True):
        q, v, tau = (" ".join(map(repr, row)) for row in (q, v, tau))
        lines.append(f'    <key time="{t!r}" qpos="{q}" qvel="{v}" ctrl="{tau}"/>')
    return "\n".join([*lines, "  </keyframe>", "</mujoco>", ""])


def _table(samples: Samples) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.column_stack([samples.t, *(getattr(samples, what) for what in _UNITS)])


def _decimal(value: float) -> str:
    """A float with a point, and as many digits as it needs."""
    short = repr(value)
    return short.replace("e", ".0e") if "e" in short and "." not in short else short


def _escape(match: re.Match[str]) -> str:
    return f"\\u{ord(match[0]):04x}"


def _names(samples: Samples) -> list[str]:
    """The joints' names, which others find their joints by."""
    if not samples.joint_names:
        raise TrajectoryError(
            "joint_names is empty; give the joints' names: dataclasses.replace(motion, joint_names=…)"
        )
    return list(samples.joint_names)


def _attribute(name: str) -> str:
    if _NO_XML.search(name):
        raise TrajectoryError(f"the name {name[:80]!r} has characters that XML cannot say")
    from xml.sax.saxutils import quoteattr  # it loads urllib, which nobody else needs

    return quoteattr(name)
