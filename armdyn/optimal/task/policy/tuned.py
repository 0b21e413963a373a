"""A tuned number: its value, unit, reason, and the cases that it was chosen on."""

from collections.abc import Iterator
from dataclasses import field, fields, is_dataclass
from typing import Any, TypeVar

Value = TypeVar("Value")

PLANAR = "planar R, RR and RRR, ten payloads, with and without ±π; Luus' two-link arm"
LARGE = "Panda and UR5, three pairs of poses each; one random pair of 39 library arms, on meshes"
UNRECORDED = "not recorded"


def tuned(value: Value, unit: str, why: str, cases: str = "") -> Value:
    """A field that is the same for every kind of problem.

    Args:
        value: the number.
        unit: of it; "-" for none.
        why: what it is, and why so much.
        cases: that it was chosen on; "": those of its group.
    """
    return field(default=value, metadata={"unit": unit, "why": why, "cases": cases})


def by_kind(unit: str, why: str, cases: str = "") -> Any:
    """A field that `Policy.of` decides for a kind of problem."""
    return field(metadata={"unit": unit, "why": why, "cases": cases})


def rows(group: object, prefix: str = "") -> Iterator[tuple[str, object, str, str, str]]:
    """Name, value, unit, reason and cases of every number of a group and of the groups in it."""
    if not is_dataclass(group):
        raise TypeError(f"{group!r} is no group of numbers")
    for one in fields(group):
        value, name = getattr(group, one.name), f"{prefix}{one.name}"
        if is_dataclass(value):
            yield from rows(value, f"{name}.")
        elif one.name != "overrides":
            about = one.metadata
            yield name, value, about["unit"], about["why"], about["cases"] or getattr(group, "cases", "")
