"""One number per joint, as users give it, read and checked."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import MOST_MEMBERS, Sign, numbers, shown, violated_requirement
from armdyn.arrays import Array
from armdyn.errors import ArmdynError, ProblemError, SpecError, did_you_mean

PerJoint = float | tuple[float, ...]
"""One number for all joints, or one per joint."""


JointNumbers: TypeAlias = ArrayLike | Mapping[str, float]
"""One number for all joints, one per joint, or numbers of some joints by name."""


def filled(
    value: JointNumbers, joints: Sequence[str], name: str, own: ArrayLike, error: type[ArmdynError] = SpecError
) -> ArrayLike:
    """Numbers by name as one per joint, the others as they are; any other value as given.

    Args:
        value: as given by a user.
        joints: their names.
        name: the quantity's name in messages.
        own: numbers of the joints that are not named, one or shape (nv,).
        error: class of the raised error.

    Raises:
        ArmdynError: as `error`; there is no such joint, or a value is no number.
    """
    if not isinstance(value, Mapping):
        return value
    row = np.array(np.broadcast_to(own, len(joints)), dtype=float)
    for joint, number in value.items():
        expect_joint(joint, joints, name, error)
        row[list(joints).index(joint)] = per_joint(number, (joint,), name, error=error, finite=False)[0]
    return row


def per_joint(
    value: ArrayLike,
    joints: Sequence[str] | None,
    name: str,
    *,
    unit: str = "",
    error: type[ArmdynError] = SpecError,
    scalar: bool = True,
    finite: bool = True,
    sign: Sign = "any",
) -> Array:
    """One number per joint, as an array of its own.

    Args:
        value: as given: real numbers; no text, no booleans, no None, no rows of different length.
        joints: their names; None where no arm is known yet: then any number of them is right, and one stays one.
        name: the quantity's name in messages.
        unit: likewise.
        error: class of the raised error.
        scalar: whether one number may stand for all joints; where there is one joint it may anyway.
        finite: whether infinity is refused; NaN always is.
        sign: that every number must have.

    Returns:
        Shape (nv,), or () of one number without joints.

    Raises:
        ArmdynError: as `error`; the message has the quantity, joint, value and the right form.
    """
    expected = _expected(joints, scalar)
    array = numbers(value, name, expected, error=error)
    if joints is not None and array.ndim == 0 and (scalar or len(joints) == 1):
        array = np.full(len(joints), array)
    if array.shape != (len(joints),) if joints is not None else array.ndim > 1 or not array.size:
        raise error(f"{name} has shape {array.shape}; expected {expected}")
    for i, number in enumerate(np.ravel(array)):
        if right := violated_requirement(float(number), sign, finite):
            of = f" of joint {joints[i]!r}" if joints is not None else ""
            at = f" (index {i})" if array.ndim else ""
            raise error(f"{name}{of} is {f'{number} {unit}'.rstrip()}{at}; it must be {right}")
    return array


def one_or_each(value: ArrayLike, name: str, *, sign: Sign) -> PerJoint:
    """One number for all joints of an arm that is not known yet, or one per joint; see `per_joint`."""
    array = per_joint(value, None, name, error=ProblemError, sign=sign)
    if array.size > MOST_MEMBERS:
        raise ProblemError(f"{name} has {array.size} numbers; expected one, or one per joint, at most {MOST_MEMBERS}")
    return float(array) if array.ndim == 0 else tuple(map(float, array))


def expect_one_count(what: str, *given: PerJoint) -> None:
    """Refuse numbers per joint that are for arms of different numbers of joints."""
    counts = sorted({len(one) for one in given if isinstance(one, tuple)})
    if len(counts) > 1:
        raise ProblemError(f"{what} are for {' and '.join(map(str, counts))} joints at once")


def expect_joint(name: str, joints: Sequence[str], what: str, error: type[ArmdynError] = SpecError) -> None:
    """Refuse a name that none of the joints has; the message begins with the argument's name."""
    if name not in joints:
        meant = did_you_mean(str(name), joints)
        raise error(f"{what}: there is no joint {shown(name)}{meant}; there are {', '.join(joints)}")


def _expected(joints: Sequence[str] | None, scalar: bool) -> str:
    """The expected count, in words."""
    if joints is None:
        return "one number, or one per joint"
    one = "one number or " if scalar and len(joints) > 1 else ""
    many = f"{one}{len(joints)}" if one else f"{len(joints)} number{'s' * (len(joints) > 1)}"
    return f"{many}, one per joint: {', '.join(joints)}"
