"""Motions joined, cut and at rest."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from armdyn.arguments import number
from armdyn.arrays import Array, Flags
from armdyn.errors import TrajectoryError
from armdyn.trajectory.samples import LEAST_STEP

if TYPE_CHECKING:
    from armdyn.trajectory.value import Trajectory


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
    )


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
    return replace(motion, t=t, q=q, v=v, tau=tau, pieces=pieces)


def split(motion: Trajectory) -> tuple[Trajectory, ...]:
    """See `Trajectory.split`."""
    if not motion.pieces:
        return (motion,)
    ends = [*(one.start for one in motion.pieces[1:]), float(motion.t[-1])]
    return tuple(
        replace(cut(motion, one.start, end), name=one.name or motion.name)
        for one, end in zip(motion.pieces, ends, strict=True)
    )
