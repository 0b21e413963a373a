"""One-line texts of values: `repr` of dataclasses, for notebooks, logs and debuggers, and percentages.

The default `repr` of a dataclass with arrays writes all of their numbers, which hide the rest.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import MISSING, fields, is_dataclass
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    import numpy as np

Class = TypeVar("Class", bound=type)

MOST_LETTERS = 200
"""Letters of a line."""
USELESS_GAP = 1.0
"""Gap, as a part of the lower bound, above which the bound says nothing of the motion."""
_MOST_NUMBERS = 8
"""Numbers of an array that are written; of a larger one its shape is."""
_MOST_OF_A_NAME = 40
_MOST_OF_A_VALUE = 60


def brief(cls: Class) -> Class:
    """Class decorator, above `@dataclass`: its `repr` is one line of at most `MOST_LETTERS` letters.

    The line has the class's name and the fields that are not as by default: numbers to six digits, arrays of up to
    eight numbers, of larger ones the shape, of long tuples the number of members. Where a class has a method
    `_repr_parts`, its texts take the place of the fields: `<Robot 'panda': 7 joints, tip 'panda_hand_tcp'>`.
    """
    cls.__repr__ = line_of  # type: ignore[method-assign, assignment]  # @dataclass wrote one
    return cls


def line_of(value: Any) -> str:
    """The line of a dataclass; see `brief`."""
    kind = type(value).__name__
    if hasattr(value, "_repr_parts"):
        head, *rest = value._repr_parts()
        return _joined(f"<{kind} {head}{': ' if rest else ''}", rest, ">")
    return _joined(f"{kind}(", list(_given(value)), ")")


def called(name: object) -> str:
    """Quote a name for messages: on one line, cut off where it is long."""
    text = repr(str(name)[:_MOST_OF_A_NAME])  # repr escapes line breaks and characters that cannot be printed
    return _cut(text, _MOST_OF_A_NAME)


def joint_unit(slides: Iterable[object], turning: str = "rad", sliding: str = "m") -> str:
    """Unit of several joints: of their positions, or of another quantity.

    Args:
        slides: whether each slides; of none nothing is known.
        turning: unit for a joint that turns.
        sliding: for one that slides.
    """
    units = {sliding if one else turning for one in slides}
    return units.pop() if len(units) == 1 else f"{turning} or {sliding}"


def joints_of(count: int) -> str:
    """A number of joints in words."""
    return f"{count} joint{'' if count == 1 else 's'}"


def short_time(seconds: float, digits: int = 3) -> str:
    """A time in words, to some digits: in ms below a second."""
    size, unit = (seconds, "s") if abs(seconds) >= 1 else (1000 * seconds, "ms")
    return f"{float(f'{size:.{digits}g}'):g} {unit}"  # without an exponent


def more_payload(per_gram: float, duration: float) -> tuple[str, float]:
    """More payload in words, of a mass that changes a duration by 1 % at most, and its cost [ms].

    Args:
        per_gram: derivative of the duration by the mass [ms/g].
        duration: the duration [s].
    """
    size = math.log(10 * duration, 1000) - math.log(abs(per_gram), 1000) if per_gram and duration > 0 else 0.0
    k = math.floor(min(max(size, -2), 2))
    return f"1 {('µg', 'mg', 'g', 'kg', 't')[k + 2]} more at the tip", 1000.0**k * per_gram


def percent(part: float) -> str:
    """A fraction as text in percent, three digits, rounded up so that an upper bound stays true."""
    if not part or not math.isfinite(part):
        return f"{100 * part:g} %"
    scale = 10.0 ** (2 - math.floor(math.log10(100 * abs(part))))
    return f"{math.ceil(100 * part * scale - 1e-9) / scale:g} %"  # 1e-9: keeps numbers that are even but for rounding


def gap_words(gap: float) -> str:
    """A proven gap to the lower bound as a predicate ("It is …"): the largest excess over the fastest possible time.

    Args:
        gap: as a part of the lower bound.
    """
    if gap > USELESS_GAP:
        return "not known to be near the fastest possible, as no useful lower bound is known"
    return f"proven to be at most {percent(max(gap, 0.0))} slower than the fastest possible"


def optimality_words(extremal: bool, gap: float | None, saving: float | None = None) -> str:
    """The two claims on optimality in a few words: of nearby motions by Pontryagin's conditions, of all by the bound.

    Args:
        extremal: whether Pontryagin's conditions hold.
        gap: proven gap, as a part of the lower bound; None: no gap is proven.
        saving: largest first-order saving by a change, as a part of the duration; None: the switching times are exact.
    """
    proven = gap is not None and gap <= USELESS_GAP
    near = f"proven within {percent(max(gap or 0.0, 0.0))} of the fastest" if proven else ""
    how = "Pontryagin" if saving is None else f"to first order, within {percent(saving)}"
    return ", ".join(filter(None, (f"locally optimal ({how})" if extremal else "", near))) or "not proven optimal"


def saving_words(part: float, duration: float, saved: float | None = None, ties: Sequence[str] = ()) -> str:
    """Time saved by one per cent more of a limit: solved again, or to first order at most the limit's share.

    Args:
        part: share of the duration that the limit decides, −∂ln t_f/∂ln(limit).
        duration: t_f [s].
        saved: time saved, solved again [s]; None: it was not.
        ties: names of limits that tie with it, which makes the saving small.
    """
    if saved is None:
        return f"saves at most {short_time(part * duration / 100, 2)}"
    return f"saves {short_time(saved, 2)}" + (
        f", as {' and '.join(ties)} tie{'s' * (len(ties) == 1)} with it" if ties else ""
    )


def several_numbers(array: Any) -> str:
    """An array's numbers to four digits, or its shape where they are many."""
    import numpy as np

    found: np.ndarray[Any, Any] = np.asarray(array)
    if found.size > _MOST_NUMBERS or found.dtype.kind not in "iufc":
        return f"array{found.shape}" if found.ndim else _cut(" ".join(repr(array).split()), _MOST_OF_A_VALUE)
    if found.ndim > 1:
        return f"[{', '.join(map(several_numbers, found))}]"
    return f"[{', '.join(f'{x:.4g}' for x in found)}]" if found.ndim else f"{found:.6g}"


def _joined(head: str, parts: list[str], end: str) -> str:
    """Join head, as many parts as fit on the line, and end."""
    line = head
    for i, part in enumerate(parts):
        more = f"{', ' if i else ''}{part}"
        if len(line) + len(more) + len(end) + 3 > MOST_LETTERS:  # 3: the comma and the sign that more follows
            return f"{_cut(line, MOST_LETTERS - len(end) - 3)}{', ' if i else ''}…{end}"
        line += more
    return _cut(line, MOST_LETTERS - len(end)) + end


def _given(value: Any) -> Iterator[str]:
    """Fields of a dataclass that differ from their defaults, as constructor arguments."""
    for field in fields(value):
        if not field.repr:
            continue
        content = getattr(value, field.name)
        usual = field.default if field.default_factory is MISSING else None
        plain = isinstance(content, str | int | float | tuple | None)
        if not (plain and usual is not MISSING and type(content) is type(usual) and content == usual):
            yield f"{field.name}={_short(content)}"


def _short(content: object) -> str:
    """A field's content in a few letters."""
    if isinstance(content, float):
        return f"{content:.6g}"
    if isinstance(content, str):
        return called(content) if type(content) is str else str(content)
    if hasattr(content, "__array__"):
        return several_numbers(content)
    if is_dataclass(content) and not isinstance(content, type):
        name = getattr(content, "name", None)
        return f"{type(content).__name__}({called(name) if name and isinstance(name, str) else '…'})"
    if isinstance(content, tuple | list) and len(content) > _MOST_NUMBERS:
        return f"<{len(content)} of {type(content[0]).__name__}>"
    if isinstance(content, tuple | list):
        inside = ", ".join(map(_short, content))
        return f"({inside})" if len(inside) < _MOST_OF_A_VALUE else f"<{len(content)} of {type(content[0]).__name__}>"
    return _cut(" ".join(reprlib.repr(content).split()), _MOST_OF_A_VALUE)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"
