"""Tuned numbers: value, unit, reason, and the cases of the tuning."""

from collections.abc import Iterator
from dataclasses import field, fields, is_dataclass
from typing import Any, TypeVar

Value = TypeVar("Value")

PLANAR = "planar R, RR and RRR, ten payloads, with and without ±π; Luus' two-link arm"
LARGE = "Panda and UR5, three pairs of poses each; one random pair of 39 library arms, on meshes"
UNRECORDED = "not recorded"


def tuned(value: Value, unit: str, why: str, cases: str = "") -> Value:
    """Field with one value for all classes of problems.

    Args:
        value: the number.
        unit: of the number; "-" for none.
        why: meaning of the number, and reason of its value.
        cases: cases of the tuning; "": those of its group.
    """
    return field(default=value, metadata={"unit": unit, "why": why, "cases": cases})


def by_kind(unit: str, why: str, cases: str = "") -> Any:
    """Field that `Policy.of` sets by the class of the problem."""
    return field(metadata={"unit": unit, "why": why, "cases": cases})


def rows(group: object, prefix: str = "") -> Iterator[tuple[str, object, str, str, str]]:
    """Name, value, unit, reason and cases of every number of a group and its subgroups."""
    if not is_dataclass(group):
        raise TypeError(f"{group!r} is no group of numbers")
    for one in fields(group):
        value, name = getattr(group, one.name), f"{prefix}{one.name}"
        if is_dataclass(value):
            yield from rows(value, f"{name}.")
        elif one.name != "overrides":
            about = one.metadata
            yield name, value, about["unit"], about["why"], about["cases"] or getattr(group, "cases", "")
