"""Checks of arguments: errors name the argument, its value, and the remedy.

Numpy is imported where an array is read: the command line's help checks arguments, too, and does without.
"""

from __future__ import annotations

import math
import os
import reprlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import MISSING, field, fields
from functools import partial
from itertools import islice
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from armdyn.errors import ArmdynError, ProblemError

if TYPE_CHECKING:
    from armdyn.arrays import Array

Kind = TypeVar("Kind")
Function = TypeVar("Function", bound=Callable[..., object])
Sign = Literal["any", "not negative", "positive"]
StopCondition = Callable[[], bool]
"""Polled regularly; once true, work ends with the results so far."""

MOST_SHOWN = 100
"""Characters of a value that a message shows."""

MOST_NUMBERS = 2**24
"""Most numbers in an array, more than in the largest motion that may be saved: larger arrays are refused unread."""

MOST_MEMBERS = 10_000
"""Members of a list of arms, obstacles, names or the like: ten times the largest one known."""

_DEEPEST = 64
"""Lists in lists, as in numpy's arrays at most."""

MOST_SAMPLES = 1_000_000
"""Most samples or steps of one call: seconds of work, and less than a gigabyte."""


_RIGHT: dict[tuple[Sign, bool], str] = {
    ("any", True): "finite",
    ("not negative", True): "finite and not negative",
    ("positive", True): "positive and finite",
    ("any", False): "a number, not NaN",
    ("not negative", False): "a number that is not negative",
    ("positive", False): "positive",
}
"""Conditions on a number, by its sign and whether it is to be finite."""


def shown(value: object) -> str:
    """A value for a message: bounded in length, also where its `__repr__` raises."""
    import numpy as np

    short = reprlib.Repr()
    short.maxlist = short.maxtuple = short.maxdict = 8
    short.maxstring = short.maxother = short.maxlong = MOST_SHOWN
    try:
        plain = value.item() if isinstance(value, np.generic) else value
        plain = plain[:MOST_SHOWN] if isinstance(plain, bytes | bytearray) else plain  # whose repr is made whole
        words = " ".join(short.repr(plain).split())
    except Exception:  # a foreign object; and Python writes no integer of more than 4300 digits
        words = f"a {type(value).__name__}"
    return words if len(words) <= MOST_SHOWN else f"{words[: MOST_SHOWN - 3]}..."


def expect(
    value: object, kind: type[Kind], name: str, hint: str = "", *, error: type[ArmdynError] = ProblemError
) -> Kind:
    """Return the value if it is of a class; raise otherwise.

    Args:
        value: the argument.
        kind: the class.
        name: of the argument.
        hint: how to obtain the right one.
        error: class of the raised error.

    Raises:
        ArmdynError: as `error`; the value is of another class.
    """
    if isinstance(value, kind):
        return value
    article = "an" if kind.__name__[0] in "AEIO" else "a"
    raise error(f"{name} is {shown(value)}; it must be {article} {kind.__name__}{f': {hint}' if hint else ''}")


def text(value: object, name: str, *, error: type[ArmdynError] = ProblemError) -> str:
    """Return the value if it is text that UTF-8 can encode, for files and C++ libraries; raise otherwise.

    Raises:
        ArmdynError: as `error`; it is no text, or has half a surrogate pair in it.
    """
    if isinstance(value, str):
        try:
            value.encode()
        except UnicodeEncodeError:
            raise error(f"{name} is {shown(value)}; it must be text that UTF-8 can encode") from None
        return value
    raise error(f"{name} is {shown(value)}; it must be text")


def flag(value: object, name: str) -> bool:
    """Return the value if it is True or False; raise otherwise.

    Raises:
        ProblemError: it is neither.
    """
    import numpy as np

    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise ProblemError(f"{name} is {shown(value)}; it must be True or False")


def function(value: object, name: str, default: Function | None = None) -> Function:
    """Return the value if it is callable; raise otherwise.

    Args:
        value: the argument.
        name: of the argument.
        default: value in place of None; None: None is refused.

    Raises:
        ProblemError: it cannot be called.
    """
    if value is None and default is not None:
        return default
    if callable(value):
        return value  # type: ignore[return-value]  # its arguments are checked when it is called
    raise ProblemError(f"{name} is {shown(value)}; it must be a function")


def listener(value: object) -> Callable[[Any], None]:
    """The argument `progress`; one that does nothing for None.

    Raises:
        ProblemError: it cannot be called.
    """
    return function(value, "progress", lambda text: None)


def stopper(value: object) -> StopCondition:
    """The argument `stop`; one that never stops for None.

    Raises:
        ProblemError: it cannot be called.
    """
    return function(value, "stop", lambda: False)


def parts_of(value: object, name: str) -> Array:
    """Numbers from 0 to 1, shape (n,).

    Raises:
        ProblemError: it is no list of such numbers.
    """
    array = numbers(value, name, "numbers from 0 to 1")
    if array.ndim != 1:
        raise ProblemError(f"{name} is {shown(value)}; expected numbers from 0 to 1")
    if wrong := [part for part in array.tolist() if not 0 <= part <= 1]:
        raise ProblemError(f"{name} has {wrong[0]:g}; expected 0 to 1")
    return array


def whole(value: object, name: str, least: int, most: int | None = None) -> int:
    """Return the value as an int if it is a whole number in a range; raise otherwise.

    Raises:
        ProblemError: the value is no whole number, less than the least or, if there is one, more than the most.
    """
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise ProblemError(f"{name} is {shown(value)}; it must be a whole number of at least {least}")
    if value < least:
        raise ProblemError(f"{name} is {shown(value)}; it must be at least {least}")
    if most is not None and int(value) > most:
        raise ProblemError(f"{name} is {shown(value)}; it must be at most {most}")
    return int(value)


def number(
    value: object,
    name: str,
    *,
    unit: str = "",
    sign: Sign = "any",
    finite: bool = True,
    least: float = -math.inf,
    most: float = math.inf,
    error: type[ArmdynError] = ProblemError,
) -> float:
    """Return the value as a float if it is a number of the required sign and in range; raise otherwise.

    Args:
        value: the argument; text and booleans are refused.
        name: of the argument.
        unit: in messages.
        sign: that it must have.
        finite: whether infinity is refused; NaN always is.
        least: smallest allowed value.
        most: largest allowed value.
        error: class of the raised error.

    Raises:
        ArmdynError: as `error`; the value is no number, has the wrong sign, or is out of range.
    """
    array = _real(value)
    if array is None or array.ndim:
        raise error(f"{name} is {shown(value)}; it must be a number{f' [{unit}]' if unit else ''}")
    one = float(array)
    if right := violated_requirement(one, sign, finite):
        raise error(f"{name} is {f'{shown(value)} {unit}'.rstrip()}; it must be {right}")
    if not least <= one <= most:
        right = f"it must be at most {most:g}" if math.isinf(least) else f"expected {least:g} to {most:g}"
        raise error(f"{name} is {f'{one:g} {unit}'.rstrip()}; {f'{right} {unit}'.rstrip()}")
    return one


def violated_requirement(one: float, sign: Sign, finite: bool) -> str:
    """Requirement of `number` in words, such as "positive and finite", if a number violates it; else empty."""
    signed = sign == "any" or one > 0 or (sign == "not negative" and one == 0)
    return _RIGHT[sign, finite] if math.isnan(one) or (finite and math.isinf(one)) or not signed else ""


def numbers(value: object, name: str, expected: str = "numbers", *, error: type[ArmdynError] = ProblemError) -> Array:
    """Copy of an array of real numbers, without further checks.

    Args:
        value: the argument; text, complex numbers, booleans, and rows of different length are refused.
        name: of the argument.
        expected: the right values, in messages.
        error: class of the raised error.

    Raises:
        ArmdynError: as `error`; the value is no such object.
    """
    array = _real(value)
    if array is None:
        raise error(f"{name} is {shown(value)}; expected {expected}")
    return array


def interval(
    value: object,
    name: str,
    *,
    unit: str = "",
    sign: Sign = "any",
    widths: Literal["any", "positive"] = "positive",
) -> tuple[float, float]:
    """Two numbers, the least and the greatest.

    Args:
        value: as given.
        name: of the argument.
        unit: in messages.
        sign: that both must have.
        widths: whether the greatest may be the least.

    Raises:
        ProblemError: it is not two finite numbers in order.
    """
    ends = several(value, name)
    if len(ends) != 2:
        expected = f"its least and its greatest{f' [{unit}]' if unit else ''}"
        raise ProblemError(f"{name} is {shown(value)}; expected {expected}")
    low, high = each(ends, name, number, unit=unit, sign=sign)
    if low > high or (low == high and widths == "positive"):
        raise ProblemError(f"{name} goes from {f'{low:g} to {high:g} {unit}'.rstrip()}; the least comes first")
    return low, high


def several(value: object, name: str, *, error: type[ArmdynError] = ProblemError) -> tuple[object, ...]:
    """The members of a list or another iterable, but no text.

    Args:
        value: the argument; at most `MOST_MEMBERS` members are read, also of an endless iterator.
        name: of the argument.
        error: class of the raised error.

    Raises:
        ArmdynError: as `error`; the value is no iterable, or has too many members.
    """
    if not isinstance(value, Iterable) or isinstance(value, str | bytes):
        raise error(f"{name} is {shown(value)}; it must be a list")
    try:
        members = tuple(islice(value, MOST_MEMBERS + 1))
    except Exception as why:  # an array without dimensions; a foreign iterator
        raise error(f"{name} is {shown(value)}; it must be a list ({why})") from None
    if len(members) > MOST_MEMBERS:
        raise error(f"{name} is {shown(value)}; it must have at most {MOST_MEMBERS} members")
    return members


def each(value: object, name: str, of: Callable[..., Kind], **conditions: Any) -> tuple[Kind, ...]:
    """The members of a list, each checked under its own name: `links[1] of an arm` of `links of an arm`.

    Args:
        value: see `several`.
        name: of the list.
        of: the check of a member, such as `number`.
        conditions: further arguments of the check; its `error` is the list's, too.

    Raises:
        ArmdynError: as `error`; the value is no list, or a member is refused.
    """
    members, (first, *rest) = several(value, name, error=conditions.get("error", ProblemError)), name.split(" ", 1)
    return tuple(of(one, name=" ".join([f"{first}[{i}]", *rest]), **conditions) for i, one in enumerate(members))


def one_of(value: object, known: Sequence[str], name: str, *, error: type[ArmdynError] = ProblemError) -> str:
    """Return the value if it is one of the known names; raise otherwise.

    Raises:
        ArmdynError: as `error`; the name is unknown.
    """
    if isinstance(value, str) and value in known:
        return value
    raise error(f"{name} is {shown(value)}; it is one of {', '.join(map(repr, known))}")


def path_of(value: object, name: str, *, error: type[ArmdynError] = ProblemError) -> str:
    """A path that the file system can have; the file need not exist.

    Raises:
        ArmdynError: as `error`; the value is no such object.
    """
    try:
        found = os.fsdecode(value)  # type: ignore[arg-type]  # it refuses other values
        good = b"\0" not in os.fsencode(found)  # which refuses half a surrogate pair
    except Exception:  # any error of a foreign __fspath__
        good = False
    if not good:
        raise error(f"{name} is {shown(value)}; it must be a path")
    return found


def checked(check: Callable[..., object], default: Any = MISSING, *, in_repr: bool = True, **conditions: Any) -> Any:
    """A field of a `Checked` dataclass.

    Args:
        check: `number`, `whole` or another function of a value and its `name`; the field becomes what it returns.
        default: of the field; if it is None, None is not checked.
        in_repr: whether the field is in the dataclass's `repr`.
        conditions: further arguments of `check`; its `name` is by default the field's.
    """
    return field(default=default, repr=in_repr, metadata={"check": partial(check, **conditions)})


class Checked:
    """Base of a frozen dataclass: its `checked` fields are checked, in their order, when a value is made.

    Arrays become read-only.
    """

    def __post_init__(self) -> None:
        for one in fields(self):  # type: ignore[arg-type]  # a dataclass
            check = one.metadata.get("check")
            if check and not ((value := getattr(self, one.name)) is None and one.default is None):
                kept = check(value, **{"name": f"{one.name}{self._of_whom()}", **check.keywords})
                if hasattr(kept, "setflags"):
                    kept.setflags(write=False)
                object.__setattr__(self, one.name, kept)

    def _of_whom(self) -> str:
        """Words after a field's name in messages, such as " of obstacle 'box'"."""
        return ""


def _real(value: object) -> Array | None:
    """Copy of a value as an array of floats; None: it is no array of real numbers."""
    import numpy as np

    if type(value) is np.ndarray and value.dtype == float and value.size <= MOST_NUMBERS:  # inner loops come by
        return value.astype(float)
    try:
        array = np.array(_entries(value, _lengths(value)))
        if array.dtype.kind == "O" and all(isinstance(x, Real) and not isinstance(x, bool) for x in array.flat):
            array = array.astype(float)  # fractions, integers beyond 64 bits
        return array.astype(float) if array.dtype.kind in "iuf" else None
    except Exception:  # lists of no right length, integers beyond floats, any error of a foreign __array__
        return None


def _lengths(value: object) -> list[int]:
    """Shape of nested lists and arrays, by the first entry of each list.

    Raises:
        ValueError: they are too many, or too deep: a list that contains itself.
    """
    lengths: list[int] = []
    while isinstance(value, Sequence) and not isinstance(value, str) and 0 not in lengths:
        lengths.append(len(value))
        value = value[0] if lengths[-1] else None
        if len(lengths) > _DEEPEST:
            raise ValueError
    lengths += getattr(value, "shape", ())  # of an array
    if math.prod(lengths) > MOST_NUMBERS:
        raise ValueError
    return lengths


def _entries(value: object, lengths: list[int]) -> object:
    """Nested lists of known lengths as lists of numbers and arrays: other sequences may be read without end.

    Raises:
        ValueError: other lengths, booleans or masked entries, which numpy turns into numbers, or no numbers.
    """
    import numpy as np

    if hasattr(value, "__array__"):
        if isinstance(value, np.bool_) or (isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value)):
            raise ValueError
        return value
    if lengths and isinstance(value, Sequence) and not isinstance(value, str | bytes) and len(value) == lengths[0]:
        members = list(islice(value, lengths[0]))
        return members if set(map(type, members)) <= {int, float} else [_entries(x, lengths[1:]) for x in members]
    if lengths or isinstance(value, bool) or not isinstance(value, Real):
        raise ValueError
    return value
