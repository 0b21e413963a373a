"""Attributes of an MJCF as numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from armdyn.errors import UrdfError
from armdyn.models.reading.urdf_xml import clipped, finite_numbers

ROTATIONS = {"quat": 4, "axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}
"""Ways to say how something is turned, and how many numbers each takes."""


@dataclass(frozen=True)
class Values:
    """The attributes of one element.

    Attributes:
        given: as text, completed by the element's class.
        source: name of the MJCF, in messages.
        where: name of the element, in messages.
    """

    given: Mapping[str, str]
    source: str
    where: str

    def numbers(self, key: str, least: int, most: int | None = None) -> list[float]:
        """A number of finite numbers; empty if the attribute is missing.

        Raises:
            UrdfError: it is something else.
        """
        if key not in self.given:
            return []
        return finite_numbers(self.given[key], key, self.source, self.where, least, most)

    def number(self, key: str, default: float) -> float:
        """One finite number."""
        return (self.numbers(key, 1) or [default])[0]

    def positive(self, key: str, default: float) -> float:
        """One finite number that is not negative."""
        value = self.number(key, default)
        if value < 0:
            raise UrdfError(self.source, f"{key} is {value}; it must not be negative", self.where)
        return value

    def word(self, key: str, known: tuple[str, ...]) -> str:
        """One of some words, the first if the attribute is missing."""
        text = self.given.get(key, known[0])
        if text not in known:
            raise UrdfError(self.source, f"{key}={clipped(text)!r} is none of {', '.join(known)}", self.where)
        return text

    def bounds(self, key: str, flag: str, automatic: bool) -> tuple[float, float] | None:
        """A range that is in force; None if there is none.

        Args:
            key: the range's attribute.
            flag: the attribute that says whether it is in force.
            automatic: whether that goes without saying.
        """
        limited = self.word(flag, ("auto", "true", "false"))
        pair = self.numbers(key, 2)
        if limited == "false" or not pair or (limited == "auto" and not automatic):
            return None
        lower, upper = pair
        if lower > upper:
            raise UrdfError(self.source, f"{key}: {lower} is above {upper}", self.where)
        return lower, upper

    def copy(self, to: Element, key: str, least: int, most: int | None = None) -> list[float]:
        """Give another element the same numbers, if there are some."""
        values = self.numbers(key, least, most)
        if values:
            to.set(key, " ".join(map(repr, values)))
        return values
