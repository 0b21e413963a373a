"""Pieces of a motion: payloads, models and events that change along it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from armdyn.arguments import Checked, checked, each, expect, number, numbers, shown, text
from armdyn.arrays import Array
from armdyn.errors import TrajectoryError
from armdyn.reprs import brief

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
            as three moments, or as the symmetric matrix.
        frame: name of the frame that the body is fixed to.
        at_flange: the same body in the frame of the arm's flange, as robots' controllers take it; None: not known.

    Raises:
        TrajectoryError: a number is not finite, the mass is negative, or a field has another shape.
    """

    mass: float = checked(
        number, name="load mass", unit="kg", sign="not negative", most=_LARGEST, error=TrajectoryError
    )
    com: tuple[float, ...] = checked(_row, (0.0, 0.0, 0.0))
    inertia: tuple[float, ...] = checked(_row, (0.0,) * 6)
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
