"""Positions and poses from arrays, placements and quaternions."""

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from armdyn.arguments import numbers, shown
from armdyn.arrays import Array
from armdyn.errors import ArmdynError, ProblemError

Point = tuple[float, float, float]
Placement: TypeAlias = ArrayLike | pin.SE3
"""A position [m], shape (3,), or a pose, shape (4, 4) or `pin.SE3`."""


def point(value: ArrayLike, name: str, error: type[ArmdynError] = ProblemError) -> Point:
    """Three finite numbers.

    Raises:
        ArmdynError: as `error`; the value is something else.
    """
    array = numbers(value, name, "three numbers", error=error)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise error(f"{name} is {shown(value)}; it must be three finite numbers")
    x, y, z = (float(part) for part in array)
    return x, y, z


def homogeneous(placement: Placement, what: str) -> Array:
    """A position, shape (3,), or a pose, shape (4, 4) or `pin.SE3`, as a matrix of shape (4, 4) [m].

    Raises:
        ProblemError: the value has another type, or an invalid rotation.
    """
    if isinstance(placement, pin.SE3):
        return np.array(placement.homogeneous)
    expected = "a position (3 numbers), a 4 × 4 matrix or a pinocchio.SE3"
    array = numbers(placement, what, expected)
    pose = np.eye(4)
    if array.shape == (3,):
        pose[:3, 3] = array
    elif array.shape == (4, 4):
        pose = array.copy()
    else:
        raise ProblemError(f"{what} has shape {array.shape}; it must be {expected}")
    if not np.all(np.isfinite(pose)):
        raise ProblemError(f"{what} is not finite")
    rotation = pose[:3, :3]
    # 1e-6: a matrix typed with seven digits is a rotation.
    with np.errstate(over="ignore", invalid="ignore"):  # huge numbers make no rotation
        turned = np.max(np.abs(rotation.T @ rotation - np.eye(3)))
    if not turned <= 1e-6 or np.linalg.det(rotation) < 0:
        raise ProblemError(f"{what} has an invalid rotation: {rotation.tolist()}")
    return pose


def pose_rows(placement: Placement, name: str) -> tuple[tuple[float, ...], ...]:
    """A placement, see `homogeneous`, as the rows of its matrix: hashable."""
    return tuple(map(tuple, homogeneous(placement, name).tolist()))


def pose_of(position: ArrayLike, quaternion: ArrayLike | None, rpy: ArrayLike | None, what: str) -> Array:
    """A pose from a position [m] and a quaternion (x, y, z, w) or roll, pitch, yaw [rad], shape (4, 4).

    Raises:
        ProblemError: both, wrong length, not finite, or a quaternion of no length.
    """
    pose = np.eye(4)
    pose[:3, 3] = point(position, f"position of {what}")
    if quaternion is not None and rpy is not None:
        raise ProblemError(f"{what} has a quaternion and rpy; give one of them")
    if rpy is not None:
        pose[:3, :3] = pin.rpy.rpyToMatrix(np.array(point(rpy, f"rpy of {what}")))
    if quaternion is not None:
        q = numbers(quaternion, f"quaternion of {what}", "four numbers x, y, z, w")
        with np.errstate(over="ignore"):
            length = np.linalg.norm(q)
        if q.shape != (4,) or not 1e-9 < length < np.inf:
            raise ProblemError(
                f"quaternion of {what} is {shown(quaternion)}; it must be four numbers x, y, z, w, not all 0"
            )
        pose[:3, :3] = pin.Quaternion(*np.roll(q / length, 1)).toRotationMatrix()
    return pose


POSE_KEYS = ("position", "quaternion", "rpy")
"""Keys of a pose in files."""


def pose_from(entry: Mapping[str, ArrayLike], what: str) -> Array:
    """A pose from a table of `POSE_KEYS`, each of which may be missing; see `pose_of`.

    Raises:
        ProblemError: see `pose_of`.
    """
    return pose_of(entry.get("position", (0.0, 0.0, 0.0)), entry.get("quaternion"), entry.get("rpy"), what)


def pose_entry(pose: Array, *, turned: bool) -> dict[str, list[float]]:
    """A pose, shape (4, 4) [m], by the names that `pose_of` has for it; with its quaternion (x, y, z, w) if turned."""
    position = {"position": pose[:3, 3].tolist()}
    return position | ({"quaternion": pin.Quaternion(pose[:3, :3]).coeffs().tolist()} if turned else {})
