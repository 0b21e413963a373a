"""Facts of a result file, which may be untrusted or of another version."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

_LONGEST = 2000
_MOST = 400


@dataclass(frozen=True)
class Facts:
    """The facts of a run, as `result.json` has them; missing and unexpected values read as empty.

    Attributes:
        values: by name; as JSON says them.
    """

    values: Mapping[str, Any] = field(default_factory=dict)

    def __contains__(self, name: str) -> bool:
        return name in self.values

    @property
    def unresolved(self) -> bool:
        """Whether arcs were looked for and are not exact: there are none, or they are read off a resolved mesh."""
        return "arcs" in self and (not self._list("arcs") or self.part("certificate").number("saving") is not None)

    def number(self, name: str) -> float | None:
        """A finite number."""
        return as_number(self.values.get(name))

    def numbers(self, name: str) -> list[float | None]:
        """A list of numbers; None in place of anything else."""
        return [as_number(value) for value in self._list(name)]

    def text(self, name: str) -> str:
        """A text, of bounded length; empty if there is none."""
        value = self.values.get(name)
        return value[:_LONGEST] if isinstance(value, str) else ""

    def texts(self, name: str) -> list[str]:
        """A list of texts."""
        return [value[:_LONGEST] for value in self._list(name) if isinstance(value, str)]

    def true(self, name: str) -> bool:
        """Whether the value is true; False if it is missing."""
        return self.values.get(name) is True

    def given(self) -> dict[str, Any]:
        """All values but None."""
        return {name: value for name, value in self.values.items() if value is not None}

    def part(self, name: str) -> Facts:
        """Facts inside of these."""
        value = self.values.get(name)
        return Facts(value) if isinstance(value, dict) else Facts()

    def parts(self, name: str) -> list[Facts]:
        """A list of facts."""
        return [Facts(value) for value in self._list(name) if isinstance(value, dict)]

    def _list(self, name: str) -> list[Any]:
        value = self.values.get(name)
        return list(value[:_MOST]) if isinstance(value, (list, tuple)) else []


def as_number(value: object) -> float | None:
    """A finite number; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if abs(value) < 1e300 else None  # ints have no largest
