"""TOML files from a stranger: read within bounds, and every message with the line that it is about."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from armdyn.arguments import shown
from armdyn.errors import ArmdynError, FileError, ProblemError, did_you_mean

_HEADER = re.compile(r"\s*\[\[?\s*([^\]]+?)\s*\]\]?\s*(?:#.*)?")
_KEY = re.compile(r"""\s*(?:"([^"]+)"|'([^']+)'|([A-Za-z0-9_.-]+))\s*=""")
_UNCLEAR = re.compile(r"[\x00-\x1f\x7f]")


@dataclass(frozen=True)
class Table:
    """A table of a file, such as `[problem]`.

    Attributes:
        path: the file.
        name: of the table.
        values: its keys.
        lines: key to the line that it stands on, from 1 on; the table's own under "".
    """

    path: Path
    name: str
    values: Mapping[str, Any]
    lines: Mapping[str, int]

    def only(self, known: Iterable[str]) -> None:
        """Refuse a key that is not known.

        Raises:
            ProblemError: there is one; with the nearest that is known.
        """
        names = sorted(known)
        for key in self.values:
            if key not in names:
                meant = did_you_mean(key, names) or "; known: " + ", ".join(names)
                raise self.wrong(key, f"no key {shown(key)} in [{self.name}]{meant}")

    def wrong(self, key: str, what: str) -> ProblemError:
        """An error about a key, with its line."""
        line = self.lines.get(key, self.lines.get("", 0))
        return ProblemError(f"{self.path}{f', line {line}' if line else ''}: {_UNCLEAR.sub(' ', what)}")

    def about(self, error: ArmdynError, words: Mapping[str, str]) -> ProblemError:
        """An error of whoever was given these values, with the line of the key that it speaks of.

        Args:
            error: whose message names an argument, as all of armdyn's do.
            words: other words that a key goes by in messages, to the key.
        """
        said = str(error)
        found: list[tuple[int, str]] = []
        for word, key in {**{key: key for key in self.values}, **words}.items():
            if key in self.values and (match := re.search(rf"(?<!\w){re.escape(word)}(?!\w)", said)):
                found.append((match.start(), key))
        return self.wrong(min(found)[1] if found else "", said)


def read_tables(path: Path, names: Iterable[str]) -> dict[str, Table]:
    """The tables of a file; one that is not there is empty.

    Args:
        path: the file.
        names: the tables that it may have.

    Raises:
        ProblemError: it cannot be read, is no TOML, or has something else.
    """
    from armdyn.toml import parsed  # who types a problem out does not wait for it

    try:
        text, content = parsed(path)
    except FileError as error:
        raise ProblemError(str(error)) from None
    known, lines = sorted(names), _lines(text)
    for key, value in content.items():
        if key not in known or not isinstance(value, dict):
            raise Table(path, "the file", content, lines[""]).wrong(
                key,
                f"{shown(key)} is no table of a problem{did_you_mean(key, known)}; there are [{'], ['.join(known)}]",
            )
    return {name: Table(path, name, content.get(name, {}), lines.get(name, {})) for name in known}


def _lines(text: str) -> dict[str, dict[str, int]]:
    """Table to key to line; a key of a table within a table, and a dotted key, count as the first one's."""
    found: dict[str, dict[str, int]] = {"": {}}
    inside: list[str] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _HEADER.fullmatch(line):
            inside = [part.strip().strip("\"'") for part in header[1].split(".")]
            _note(found, inside, number)
        elif key := _KEY.match(line):
            quoted = key[1] or key[2]
            _note(found, [*inside, *([quoted] if quoted else key[3].split("."))], number)
    return found


def _note(found: dict[str, dict[str, int]], names: list[str], number: int) -> None:
    table, *keys = names
    found.setdefault(table, {}).setdefault(keys[0] if keys else "", number)
    found[""].setdefault(table, number)
