"""Reader of planners' motions: a table with a head, an npz of arrays, or ROS 2's message.

Nothing of a file is executed, and its size is bounded.
"""

import csv
import io
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armdyn.arguments import path_of, shown
from armdyn.arrays import Array
from armdyn.errors import FileError, TrajectoryError, reraised
from armdyn.files import read_text
from armdyn.parsing.numbers import to_number
from armdyn.reprs import brief
from armdyn.trajectory import messages, npz
from armdyn.trajectory.formats.csv_table import PIECE_COLUMNS, UNITS
from armdyn.trajectory.tables import check_columns, check_times
from armdyn.trajectory.value import Hold

SUFFIXES = (".csv", ".tsv", ".txt", ".npz", *messages.SUFFIXES)
"""Suffixes of motions' files: no robot's file has them."""

MAX_BYTES = 64 * 2**20
"""A larger table is refused [bytes]: half a million rows of seven joints' q, v and tau."""

_NAMES = {
    "t": "t ts time times time_from_start t_sample ts_sample timestamp stamp",
    "q": "q qs pos position positions joint_position joint_positions q_sample qs_sample",
    "v": "v vs qd qds dq qdot vel velocity velocities joint_velocity joint_velocities qd_sample qds_sample",
    "a": "a qdd qdds ddq qddot acc acceleration accelerations joint_accelerations qdd_sample qdds_sample",
    "tau": "tau taus effort efforts torque torques u",
}
"""Planners' names of time, positions, velocities, accelerations, torques; toppra's examples have ts_sample."""

_USAGE = "a table's first line is such as t,q1,q2,v1,v2; an npz has arrays t and q, and may have v, a, tau"

_MEANS = {word: what for what, words in _NAMES.items() for word in words.split()}
_HEAD = re.compile(r"(?!(?s:.{200}))\s*(?P<name>.*?)\s*(?:[\[(](?P<unit>[^\])]*)[\])])?\s*")
_UNITS = {
    **dict.fromkeys(("", "s", "sec", "rad", "m", "N", "Nm"), 1.0),
    **dict.fromkeys(("deg", "degrees", "°"), np.pi / 180),
    "mm": 1e-3, "cm": 1e-2, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9,
}  # fmt: skip
"""Factors to SI of the first of a column's units, such as deg of deg/s."""
_REST_OF_UNIT = {"s", "sec", "m", "or", "rad", "N"}
"""Words of the rest of a column's unit, such as of rad/s or m/s."""
_COLUMN = re.compile(r"(?P<what>[a-z_]+?)[_\[./ ]*(?P<number>\d+)\]?")


@brief
@dataclass(frozen=True, eq=False)
class Planned:
    """A motion of a file; None for missing quantities.

    Attributes:
        t: times [s], shape (n,).
        q: joint positions [rad or m], shape (n, nv).
        v: joint velocities [rad/s or m/s], shape (n, nv).
        a: joint accelerations [rad/s² or m/s²], shape (n, nv).
        tau: joint torques [N m or N], shape (n, nv).
        hold: torque between two samples, as of `Trajectory`.
        joint_names: one name per column; empty: not known.
    """

    t: Array
    q: Array
    v: Array | None = None
    a: Array | None = None
    tau: Array | None = None
    hold: Hold = "linear"
    joint_names: tuple[str, ...] = ()

    def accelerations(self) -> Array:
        """Accelerations [rad/s² or m/s²], shape (n, nv), by differences of velocities or positions.

        Each is a mean of the accelerations between the samples around it: where those jump, as a planner's do that goes
        from limit to limit, it is between them, and a spline would be beyond. The first and the last are the means
        nearest to them: no extrapolation, joint by joint, is a mean of accelerations that the motion has.

        Raises:
            TrajectoryError: there are fewer than three samples, or times do not increase.
        """
        check_times(self.t, [self.q], least=3)
        steps = np.diff(self.t)[:, None]
        if self.v is not None:
            return np.asarray(np.gradient(self.v, self.t, axis=0))
        inside = np.diff(np.diff(self.q, axis=0) / steps, axis=0) / ((steps[1:] + steps[:-1]) / 2)
        return np.vstack([inside[:1], inside, inside[-1:]])


def read_planned(path: str | os.PathLike[str], joint_names: Sequence[str], *, ends: bool = False) -> Planned:
    """Read a motion from a file.

    A table's first line names its columns: the time, and q, v, a, tau of each joint, such as `t,q1,q2,v1,v2`,
    `time,position_elbow,…`, or the joints' own names for their positions. A unit may stand behind a name in brackets:
    `_UNITS` are converted to SI. Where names have joints in them, columns may come in any order. An npz has arrays t
    and q, and may have v, a, tau, each of shape (n,) or (n, nv), by these names or toppra's. ROS 2's JointTrajectory
    is read as `messages.read_message` says. Torques of a table or message of armdyn's are held from row to row.

    Args:
        path: of a file .csv, .tsv or .txt; .npz; or .json, .yaml or .yml.
        joint_names: of the robot, in its order.
        ends: `joint_names` are ends of the file's names, "joint1" of "panda_joint1"; an end that no name has is kept.
            Empty texts: any names, if the file has as many; nothing: all joints of a message.

    Raises:
        TrajectoryError: it cannot be read, has no times or positions, a joint is missing, times do not increase, or
            columns are in different units: see `check_columns`; or two joints of the file end alike.
    """
    file = Path(path_of(path, "path of a motion", error=TrajectoryError))
    suffix = file.suffix.lower()
    read = _arrays if suffix == ".npz" else messages.read_message if suffix in messages.SUFFIXES else _table
    with reraised(TrajectoryError, "", FileError):
        content = read(file)
        joints = _by_ends(file, content, joint_names) if ends else tuple(joint_names)
        found = content.columns(joints)
    missing = [what for what in ("t", "q") if what not in found]
    if missing:
        of = f" of {', '.join(joints)}" if "q" in missing else ""
        raise TrajectoryError(f"{file}: there is no {' and no '.join(missing)}{of}; {_USAGE}")
    with reraised(TrajectoryError, str(file)):
        check_times(found["t"], [array for what, array in found.items() if what != "t"], content.called)
        arrays = {what: npz.bounded(array, what) for what, array in found.items()}
    check_columns(arrays["t"], (arrays["q"], arrays.get("v"), arrays.get("a")), joints, str(file))
    return Planned(**arrays, hold="zero-order" if content.held else "linear", joint_names=joints)


def _by_ends(file: Path, content: messages.Content, ends: Sequence[str]) -> tuple[str, ...]:
    """Names of a file's joints with given ends; see `read_planned`."""
    named = content.names
    if not any(ends):
        whole = content.message and len(ends) in (0, len(named))
        if not (whole or ends):
            raise TrajectoryError(f"{file}: its joints are not known; name the robot")
        return tuple(named) if whole else tuple(f"joint{i + 1}" for i in range(len(ends)))
    found = []
    for end in ends:
        alike = list(dict.fromkeys(name for name in named if name.endswith(end)))
        if len(alike) > 1 and end not in alike:
            raise TrajectoryError(f"{file}: {' and '.join(map(shown, alike[:2]))} both end in {end!r}; name the robot")
        found.append(alike[0] if len(alike) == 1 else end)
    return tuple(found)


def _arrays(file: Path) -> messages.Content:
    """Known arrays of an npz; their columns are the joints in the robot's order."""
    with npz.opened(file) as members:
        bare = [name.removesuffix(".npy") for name in members.namelist()]
        names = {name: _MEANS.get(name.lower()) for name in bare}
        given = [what for what in names.values() if what]
        if len(given) != len(set(given)):
            raise TrajectoryError(f"two arrays are {next(what for what in given if given.count(what) > 1)}")
        found = {what: npz.numbers_of(members, name) for name, what in names.items() if what}
    for what, array in found.items():
        if array.ndim == 1 and what != "t":
            found[what] = array[:, None]
        elif array.ndim == 2 and what == "t" and 1 in array.shape:
            found[what] = array.ravel()
    return messages.Content([], lambda joints: found, "t[{}]".format)


def _table(file: Path) -> messages.Content:
    """A table whose first line names its columns."""
    text = read_text(file, MAX_BYTES)
    head, _, _ = text.lstrip().partition("\n")
    between = max(",;\t", key=head.count)
    try:
        rows = [(number, row) for number, row in enumerate(csv.reader(io.StringIO(text), delimiter=between), 1) if row]
    except csv.Error as error:
        raise TrajectoryError(f"{file}: no table ({error}); {_USAGE}") from None
    if len(rows) < 2:
        raise TrajectoryError(f"{file}: no rows; {_USAGE}")
    names = [name.lstrip("# ") for name in rows[0][1]]
    try:
        [float(name) for name in names]
    except ValueError:
        pass
    else:
        raise TrajectoryError(f"{file}: its first line is numbers; {_USAGE}")
    table = _numbers(file, rows[1:], names)
    heads = [match["name"] for name in names if (match := _HEAD.fullmatch(name))]  # without units, and quantities:
    parts = [(head, *head.partition("_")) for head in heads]
    bare = [rest if rest and first.lower() in _MEANS else head for head, first, _, rest in parts]
    return messages.Content(
        bare,
        lambda joints: _sorted(file, names, table, joints),
        lambda k: f"row {k + 1} (line {rows[k + 1][0]})",
        held=f"[{UNITS['tau']}]" in head,  # of `CsvTable`, whose torques are means until the next row
    )


def _numbers(file: Path, rows: Iterable[tuple[int, list[str]]], names: Sequence[str]) -> Array:
    """The rows as numbers, shape (n, columns); NaN for text in `PIECE_COLUMNS`."""
    values, width = [], len(names)
    for number, row in rows:
        if len(row) != width:
            raise TrajectoryError(f"{file}, line {number}: {len(row)} values; the first line names {width}")
        for name, value in zip(names, row, strict=True):
            try:
                values.append(to_number(value))
            except ValueError:
                if name in PIECE_COLUMNS:
                    values.append(np.nan)
                    continue
                raise TrajectoryError(f"{file}, line {number}: {shown(value)} is not a number") from None
    return np.reshape(values, (-1, width))


def _sorted(file: Path, names: Sequence[str], table: Array, joints: Sequence[str]) -> dict[str, Array]:
    """Columns of each quantity in the robot's order; unknown columns are left out."""
    found: dict[str, dict[int, Array]] = {}
    for k, name in enumerate(names):
        if (match := _HEAD.fullmatch(name)) is None:  # too long: the expressions take time with its square
            continue
        bare, unit = match["name"], match["unit"] or ""
        what, joint = _meaning(f"{bare}_{unit}" if unit.isdigit() else bare, joints)  # q[0] is q_0
        if what is None:
            continue
        if joint in found.setdefault(what, {}):
            raise TrajectoryError(f"{file}: column {shown(name)} is there twice")
        first, *others = re.findall(r"[a-zA-Z°µ]+", unit) or ["" if unit.isdigit() or not unit.strip() else unit]
        if first not in _UNITS or not _REST_OF_UNIT.issuperset(others):
            known = ", ".join(one for one in _UNITS if one)
            raise TrajectoryError(f"{file}: column {shown(name)} has no unit that is known: {known}")
        found[what][joint] = _UNITS[first] * table[:, k]
    return {what: _stacked(file, what, columns, joints) for what, columns in found.items()}


def _meaning(name: str, joints: Sequence[str]) -> tuple[str | None, int]:
    """Quantity of a column, and the index of its joint or the number in its name."""
    if name in joints:
        return "q", list(joints).index(name)
    if _MEANS.get(name.lower()) == "t":
        return "t", 0
    for i, joint in sorted(enumerate(joints), key=lambda each: -len(each[1])):  # the longest of names that end alike
        if name.endswith(joint) and (what := _MEANS.get(name.removesuffix(joint).rstrip("_./ ").lower())):
            return what, i
        if name.startswith(joint) and (what := _MEANS.get(name.removeprefix(joint).lstrip("_./ ").lower())):
            return what, i
    match = _COLUMN.fullmatch(name.lower())
    what = _MEANS.get(match["what"].rstrip("_")) if match else _MEANS.get(name.lower())
    return (what, int(match["number"]) if match else 0) if what != "t" else (None, 0)


def _stacked(file: Path, what: str, columns: Mapping[int, Array], joints: Sequence[str]) -> Array:
    """The columns of one kind, shape (n, nv); of the time (n,)."""
    if what == "t":
        return columns[0]
    first = min(columns)
    if sorted(columns) != list(range(first, first + len(joints))) or first > 1:
        raise TrajectoryError(
            f"{file}: {len(columns)} columns are {what}, of {len(joints)} joints: {', '.join(joints)}; {_USAGE}"
        )
    return np.column_stack([columns[i] for i in sorted(columns)])
