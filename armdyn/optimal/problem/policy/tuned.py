"""Tuned numbers: value, unit, reason, and the cases of the tuning."""

from dataclasses import field
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
