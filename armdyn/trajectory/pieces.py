"""Pieces of a motion: their payloads, models and events; motions joined, cut and at rest."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import Checked, checked, each, expect, number, numbers, shown, text
from armdyn.arrays import Array, Flags
from armdyn.errors import TrajectoryError
from armdyn.reprs import brief
from armdyn.trajectory.samples import LEAST_STEP

if TYPE_CHECKING:
    from armdyn.trajectory.value import Trajectory


MOST_PIECES = 1000
"""Pieces of one motion: a cycle has some ten."""
_LARGEST = 1e12
"""Of a load's numbers, in SI units: as of a motion's in its file, `npz.MAX_NUMBER`."""


def _row(value: object, name: str) -> tuple[float, ...]:
    """Centre of mass or inertia of a load, three or six numbers."""
    array = numbers(value, f"load {name}", error=TrajectoryError)
    if name == "inertia" and array.shape == (3, 3) and np.array_equal(array, array.T):
        array = np.concatenate([np.diag(array), array[np.triu_indices(3, 1)]])
    if name == "inertia" and array.shape == (3,):
        array = np.append(array, np.zeros(3))
    if array.shape != ((3,) if name == "com" else (6,)) or not np.all(np.abs(array) <= _LARGEST):
        right = "three finite numbers [m]"
        right = right if name == "com" else "Ixx, Iyy, Izz and perhaps Ixy, Ixz, Iyz, finite numbers [kg m²]"
        raise TrajectoryError(f"load {name} is {shown(array.tolist())}; it must be {right}")
    return tuple(array.tolist())


@brief
@dataclass(frozen=True)
class Load(Checked):
    """Rigid body that an arm carries, in plain numbers.

    Attributes:
        mass: [kg]; 0: nothing is carried.
        com: centre of mass in `frame` [m], three numbers.
        inertia: about the centre of mass, along the axes of `frame` [kg m²]: Ixx, Iyy, Izz, Ixy, Ixz, Iyz; may be given
            as three moments, or as the symmetric matrix; kept as a tuple of six.
        frame: name of the frame that the body is fixed to.
        at_flange: the same body in the frame of the arm's flange, as robots' controllers take it; None: not known.

    Raises:
        TrajectoryError: a number is not finite, the mass is negative, or a field has another shape.
    """

    mass: float = checked(
        number, name="load mass", unit="kg", sign="not negative", most=_LARGEST, error=TrajectoryError
    )
    com: Sequence[float] | Array = checked(_row, (0.0, 0.0, 0.0))
    inertia: ArrayLike = checked(_row, (0.0,) * 6)
    frame: str = checked(text, "", name="load frame", error=TrajectoryError)
    at_flange: Load | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.at_flange is not None:
            expect(self.at_flange, Load, "load at_flange", error=TrajectoryError)


@brief
@dataclass(frozen=True)
class Piece(Checked):
    """Part of a motion along which model and payload are constant.

    Attributes:
        start: time of its first sample [s]. The piece ends where the next one starts, or with the motion.
        name: such as the step of a cycle.
        model_hash: `Robot.model_hash` of the arm with its load; empty if it is not known.
        load: carried along the piece; None: not known.
        event: occurs at the start, such as "grasp", "release", "wait"; empty: none.

    Raises:
        TrajectoryError: a field has another type, or start is not finite.
    """

    start: float = checked(number, name="piece start", unit="s", error=TrajectoryError)
    name: str = checked(text, "", name="piece name", error=TrajectoryError)
    model_hash: str = checked(text, "", name="piece model_hash", error=TrajectoryError)
    load: Load | None = checked(expect, None, kind=Load, name="piece load", hint="Load(mass=…)", error=TrajectoryError)
    event: str = checked(text, "", name="piece event", error=TrajectoryError)


def check_pieces(pieces: object, t: Array) -> tuple[Piece, ...]:
    """Check that the pieces of a motion follow each other from its start.

    Args:
        pieces: as given.
        t: times of the motion's samples [s], shape (n,).

    Raises:
        TrajectoryError: they are no pieces, or more than `MOST_PIECES`; or the first one does not start at the first
            sample, and each other one at a later sample before the last.
    """
    own = each(pieces, "pieces", expect, kind=Piece, error=TrajectoryError)
    if len(own) > MOST_PIECES:
        raise TrajectoryError(f"pieces are {len(own)}; expected at most {MOST_PIECES}")
    starts = np.array([one.start for one in own])
    if own and not (starts[0] == t[0] and np.all(np.diff(starts) > 0) and np.all(np.isin(starts, t[:-1]))):
        raise TrajectoryError(
            f"pieces start at {', '.join(f'{start:.9g}' for start in starts[:8])} s; expected increasing times of "
            f"samples, the first {t[0]:.9g} s, where the motion begins, and all before its end, {t[-1]:.9g} s"
        )
    return own


def to_text(pieces: Sequence[Piece]) -> str:
    """Pieces as JSON; floats read back to the last bit."""
    return json.dumps([asdict(one) for one in pieces])


def from_text(content: str) -> tuple[Piece, ...]:
    """Pieces of the text that `to_text` wrote, which may be untrusted.

    Raises:
        TrajectoryError: the text has no pieces.
    """
    entries = json.loads(content)
    if not isinstance(entries, list) or len(entries) > MOST_PIECES:
        raise TrajectoryError(f"pieces are no list of at most {MOST_PIECES}")
    return tuple(Piece(**entry | {"load": _load(entry.get("load"))}) for entry in entries)


def _load(entry: dict[str, Any] | None) -> Load | None:
    return None if entry is None else Load(**entry | {"at_flange": _load(entry.get("at_flange"))})


JOIN_TOLERANCE = 1e-5
"""Largest difference of a joint's position [rad or m] and velocity [rad/s or m/s] between the end of a motion and the
start of the next one: ten times the largest goal error of a certified motion's replay."""

_UNITS = {"q": "rad or m", "v": "rad/s or m/s"}
_HELD = {"linear": "linear", "zero-order": "constant"}


def joined(first: Trajectory, second: Trajectory, tolerance: float) -> Trajectory:
    """See `Trajectory.join`."""
    names = _common_names(first, second, tolerance)
    start = max(float(np.nextafter(first.t[-1], np.inf)), first.t[-1] + LEAST_STEP)
    later = _spaced(second.t - second.t[0] + start, second.jumps)
    pieces = first.own_pieces + tuple(
        replace(one, start=float(later[np.searchsorted(second.t, one.start)])) for one in second.own_pieces
    )
    return replace(
        first,
        t=np.concatenate([first.t, later]),
        q=np.concatenate([first.q, second.q]),
        v=np.concatenate([first.v, second.v]),
        tau=np.concatenate([first.tau, second.tau]),
        joint_names=names,
        name=first.name or second.name,
        pieces=pieces,
        ends=_ends(first, second),
    )


def _ends(first: Trajectory, last: Trajectory) -> Array | None:
    """Start of the first motion's `ends`, and end of the last one's; None: both unknown."""
    known = np.stack([_known(first)[0], _known(last)[1]])
    return None if np.all(np.isnan(known)) else known


def _known(motion: Trajectory) -> Array:
    """`ends` of a motion, NaN where unknown, shape (2, 2, nv)."""
    return np.full((2, 2, motion.v.shape[1]), np.nan) if motion.ends is None else motion.ends


def _common_names(first: Trajectory, second: Trajectory, tolerance: float) -> tuple[str, ...]:
    """Joint names of two motions that can be joined.

    Raises:
        TrajectoryError: joints or hold differ, or the second motion does not start where the first one ends.
    """
    most = number(tolerance, "tolerance", sign="not negative", error=TrajectoryError)
    names = first.joint_names or second.joint_names
    if first.q.shape[1:] != second.q.shape[1:] or first.v.shape[1:] != second.v.shape[1:]:
        raise TrajectoryError(f"motions of {first.v.shape[1]} and {second.v.shape[1]} joints cannot be joined")
    if second.joint_names and second.joint_names != names:
        raise TrajectoryError(
            f"motions of other joints cannot be joined: {', '.join(names)}; {', '.join(second.joint_names)}"
        )
    if first.hold != second.hold:
        raise TrajectoryError(
            f"a motion whose torques are {_HELD[first.hold]} between samples and one whose torques are "
            f"{_HELD[second.hold]} cannot be joined"
        )
    for field, unit in _UNITS.items():
        end, start = getattr(first, field)[-1], getattr(second, field)[0]
        worst = int(np.argmax(np.abs(end - start)))
        if abs(end[worst] - start[worst]) > most:
            joint = names[worst] if len(names) == end.size else f"joint {worst + 1}"
            raise TrajectoryError(
                f"{second.name or 'the second motion'} does not start where {first.name or 'the first one'} ends: "
                f"{'position' if field == 'q' else 'velocity'} of {joint} is {end[worst]:.9g} at the end and "
                f"{start[worst]:.9g} at the start, {abs(end[worst] - start[worst]):.3g} {unit} apart; at most {most:g}"
            )
    return names


def backwards(motion: Trajectory) -> Trajectory:
    """Reverse a motion in time: q(T - t), -v, the same torques; pieces keep their loads and lose their events.

    It is a motion of the arm only as `reversed_motion` says.
    """
    t = _spaced(motion.t[0] + (motion.t[-1] - motion.t[::-1]), motion.jumps[::-1])
    starts = np.searchsorted(motion.t, [one.start for one in motion.pieces[1:]])
    firsts = t.size - 1 - np.append(starts - motion.jumps[starts - 1], t.size - 1)  # of the last sample of each piece
    pieces = tuple(
        replace(one, start=float(t[k]), event="") for one, k in zip(motion.pieces, firsts.tolist(), strict=False)
    )
    return replace(
        motion, t=t, q=motion.q[::-1], v=-motion.v[::-1], tau=motion.tau[::-1], pieces=pieces[::-1],
        name=f"{motion.name} backwards".lstrip(),
        ends=None if motion.ends is None else motion.ends[::-1] * np.array([[1.0], [-1.0]]),
    )  # fmt: skip


def _spaced(t: Array, jumps: Flags) -> Array:
    """Times whose jumps are one ulp long, and no shorter anywhere [s], shape (n,).

    Args:
        t: times that were moved, and so rounded anew [s], shape (n,).
        jumps: mask of intervals without duration, shape (n - 1,).
    """
    for k in np.flatnonzero(jumps | (np.diff(t) <= 0)).tolist():
        t[k + 1] = np.nextafter(t[k], np.inf)
        while k + 2 < t.size and t[k + 2] <= t[k + 1]:
            k += 1
            t[k + 1] = np.nextafter(t[k], np.inf)
    return t


def cut(motion: Trajectory, begin: float | None, end: float | None) -> Trajectory:
    """See `Trajectory.slice`."""
    low, high = (
        float(motion.t[k]) if time is None else number(time, name, unit="s", error=TrajectoryError)
        for time, name, k in ((begin, "begin", 0), (end, "end", -1))
    )
    if not motion.t[0] <= low < high <= motion.t[-1]:
        raise TrajectoryError(
            f"begin is {low:.9g} s and end {high:.9g} s; expected increasing times within the motion, "
            f"{motion.t[0]:.9g} s to {motion.t[-1]:.9g} s"
        )
    first, last = int(np.searchsorted(motion.t, low)), int(np.searchsorted(motion.t, high, side="right")) - 1
    jumps = motion.jumps
    if first < last and motion.t[first] == low and jumps[first]:
        first, low = first + 1, float(motion.t[first + 1])
    if first < last and motion.t[last] == high and jumps[last - 1]:
        last, high = last - 1, float(motion.t[last - 1])
    t = np.unique([low, *motion.t[first : last + 1], high])
    state = motion(t)
    q, v, tau = (
        np.concatenate([rows[:-1], own[-1:]]) if high == motion.t[-1] else rows  # to the bit
        for rows, own in ((state.q, motion.q), (state.v, motion.v), (state.tau, motion.tau))
    )
    before = sum(one.start <= low for one in motion.pieces) - 1
    pieces = tuple(replace(one, start=max(one.start, low)) for one in motion.pieces[before:] if one.start < high)
    ends = motion.ends
    if ends is not None:
        inside = np.array([low > motion.t[0], high < motion.t[-1]])
        ends = np.where(inside[:, None, None], np.nan, ends)
    return replace(motion, t=t, q=q, v=v, tau=tau, pieces=pieces, ends=ends)


def split(motion: Trajectory) -> tuple[Trajectory, ...]:
    """See `Trajectory.split`."""
    if not motion.pieces:
        return (motion,)
    ends = [*(one.start for one in motion.pieces[1:]), float(motion.t[-1])]
    parts = [
        replace(cut(motion, one.start, end), name=one.name or motion.name)
        for one, end in zip(motion.pieces, ends, strict=True)
    ]
    for k, after in enumerate(parts[1:] if motion.q.shape == motion.v.shape else ()):
        required = np.stack([_known(parts[k])[0], [after.q[0], after.v[0]]])  # a piece ends where the next one starts
        parts[k] = replace(parts[k], ends=required)
    return tuple(parts)
