"""Presets in TOML: joints, limits and interfaces of an untrusted file, checked and bounded."""

from collections.abc import Sequence

from armdyn.arguments import number, shown, whole
from armdyn.errors import ProblemError
from armdyn.models.presets.interface import COMMANDED, ControllerLimits, Interface, VelocityTaper
from armdyn.models.values.per_joint import per_joint
from armdyn.parsing.toml import Table

MOST_JOINTS = 64
"""Most joints of a preset."""
MOST_RATE = 1e5
"""Largest command rate of a controller [Hz]."""

MOST_LETTERS = 1000
"""Most letters of a text in a preset."""

KINDS = ("necessary", "recommended")


def texts_of(table: Table, key: str) -> tuple[str, ...]:
    """A list of texts; empty where it is not given.

    Raises:
        ProblemError: it is something else; the message says in which line, as those of all functions here.
    """
    values = table.values.get(key, [])
    if not isinstance(values, list) or not all(isinstance(one, str) for one in values):
        raise table.error(key, f"{table.called(key)} is {shown(values)}; it must be a list of texts")
    return tuple(line_of(table, key, one) for one in values)


def line_of(table: Table, key: str, value: str) -> str:
    """A text that a terminal shows as one line."""
    if not value.isprintable() or len(value) > MOST_LETTERS:
        raise table.error(
            key, f"{table.called(key)} has {shown(value)}; it must be one line of up to {MOST_LETTERS} letters"
        )
    return value


def joints_of(table: Table) -> tuple[str, ...]:
    """Ends of the joints' names; empty texts where only their number is known."""
    if isinstance(table.values.get("joints"), list):
        names = texts_of(table, "joints")
    else:
        with table.at("joints"):
            names = ("",) * whole(table.values.get("joints"), table.called("joints"), 1, MOST_JOINTS)
    if not 1 <= len(names) <= MOST_JOINTS:
        raise table.error("joints", f"{table.called('joints')} has {len(names)} names; expected 1 to {MOST_JOINTS}")
    return names


def limits_of(table: Table, joints: Sequence[str], key: str, known: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """The rows of a table of limits, one number per joint each."""
    inner = table.table(key)
    inner.only(known)
    names = [name or f"joint {i + 1}" for i, name in enumerate(joints)]
    found = {}
    for name, value in inner.values.items():
        signed = name in ("lower", "upper", "position_lower", "position_upper")
        with inner.at(name):
            row = per_joint(
                value, names, inner.called(name), error=ProblemError, finite=False,
                sign="any" if signed else "not negative" if name == "offset" else "positive",
            )  # fmt: skip
        found[name] = tuple(row.tolist())
    for below, above in (("position_lower", "position_upper"), ("lower", "upper")):
        for joint, low, high in zip(names, found.get(below, ()), found.get(above, ()), strict=False):
            if not low < high:
                raise inner.error(below, f"{below} of joint {joint!r} is {low:g}, {above} {high:g}; it must be below")
    return found


def taper_of(table: Table, joints: Sequence[str]) -> VelocityTaper | None:
    """Velocity limits that depend on the position; None: none are given."""
    if "velocity_taper" not in table.values:
        return None
    known = ("lower", "upper", "gain", "offset")
    rows = limits_of(table, joints, "velocity_taper", known)
    if missing := [name for name in known if name not in rows]:
        raise table.error("velocity_taper", f"velocity_taper has no {missing[0]}; it needs {', '.join(known)}")
    return VelocityTaper(**rows)


def interfaces_of(table: Table, limits: ControllerLimits) -> tuple[Interface, ...]:
    """Command interfaces; each of their conditions must have a limit."""
    inner, found = table.table("interfaces"), []
    inner.only(COMMANDED)
    for name in inner.values:
        own = inner.table(name)
        own.only(("rate", *KINDS))
        if "rate" not in own.values:
            raise own.error("rate", f"{own.called('rate')} is missing: commands per second [Hz]")
        with own.at("rate"):
            rate = number(own.values["rate"], own.called("rate"), unit="Hz", sign="positive", most=MOST_RATE)
        conditions = {}
        for kind in KINDS:
            conditions[kind] = texts_of(own, kind)
            for condition in conditions[kind]:
                with own.at(kind):
                    limits.expect(condition)
        found.append(Interface(name, rate, **conditions))
    return tuple(found)
