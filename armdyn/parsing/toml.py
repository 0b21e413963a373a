"""Untrusted TOML files: bounded, and errors with their lines."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

from armdyn.arguments import number, one_of, shown
from armdyn.errors import ArmdynError, ProblemError, did_you_mean
from armdyn.files import read_text

MAX_BYTES = 2**18
"""A file that is larger is not read [bytes]."""

_NAMES = 16
"""Names with dots between, at most: tomllib takes time with their square, a minute and a half for 60,000."""

_NAME = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')"""
_CHAIN = re.compile(rf"(?<![\w-])(?:{_NAME}[ \t]*\.[ \t]*){{{_NAMES}}}")
_HEADER = re.compile(rf"[ \t]*\[\[?[ \t]*({_NAME}(?:[ \t]*\.[ \t]*{_NAME})*)[ \t]*\]")
_UNCLEAR = re.compile(r"[\x00-\x1f\x7f]")
_ARGUMENT = re.compile(r"`([a-z_]+)`")
"""An argument in a message, which is a key of the file."""
_KEY = re.compile(rf"[ \t]*({_NAME}(?:[ \t]*\.[ \t]*{_NAME})*)[ \t]*=")


@dataclass(frozen=True)
class Table:
    """A table of a file, with the lines of its keys.

    Attributes:
        path: of the file.
        values: its keys and their values.
        lines: the line of each table and key, by the names on the way to it; None: the values are no longer the file's,
            and complaints name no line.
        within: the names on the way to this table.
    """

    path: str
    values: Mapping[str, Any]
    lines: Mapping[tuple[str, ...], int] | None
    within: tuple[str, ...] = ()

    def error(self, key: str, why: str) -> ProblemError:
        """Error about a key, with its line, or the table's line if the key is missing.

        A complaint that has its line already stays unchanged.
        """
        if why.startswith(f"{self.path}, line "):
            return ProblemError(why)
        way, lines = (*self.within, key), self.lines
        why = _ARGUMENT.sub(r"\1", _UNCLEAR.sub(" ", why))
        if lines is None:
            return ProblemError(why)
        line = next((lines[way[:n]] for n in range(len(way), 0, -1) if way[:n] in lines), 1)
        return ProblemError(f"{self.path}, line {line}: {why}")

    def about(self, error: ArmdynError, words: Mapping[str, str] | None = None) -> ProblemError:
        """An error about these values, with the line of the key that its message names.

        Args:
            error: whose message names an argument, as all of armdyn's do.
            words: other words that a key goes by in messages, to the key.
        """
        message = str(error)
        found: list[tuple[int, str]] = []
        for word, key in {**{key: key for key in self.values}, **(words or {})}.items():
            if key in self.values and (match := re.search(rf"(?<!\w){re.escape(word)}(?!\w)", message)):
                found.append((match.start(), key))
        return self.error(min(found)[1] if found else "", message)

    @contextmanager
    def locating_errors(self, words: Mapping[str, str] | None = None) -> Iterator[None]:
        """Raise errors of the block with the line of the key that they name: see `about`.

        Raises:
            ProblemError: the complaint, with its line.
        """
        try:
            yield
        except ArmdynError as error:
            raise self.about(error, words) from None

    @contextmanager
    def at(self, key: str) -> Iterator[None]:
        """Raise errors of the block with the line of a key.

        Raises:
            ProblemError: the complaint, with its line.
        """
        try:
            yield
        except ArmdynError as error:
            raise self.error(key, str(error)) from None

    def only(self, known: Collection[str]) -> None:
        """Refuse an unknown key.

        Raises:
            ProblemError: there is one.
        """
        for key in self.values:
            if key not in known:
                what = "table" if isinstance(self.values[key], dict) else "key"
                where = f"in [{'.'.join(self.within)}]" if self.within else "at the top"
                meant = did_you_mean(key, known) or f"; known: {', '.join(known)}"
                raise self.error(key, f"no {what} {shown(key)} {where}{meant}")

    def called(self, key: str) -> str:
        """Full name of a key for messages, with the tables that contain it."""
        return ".".join((*self.within, key))

    def table(self, key: str) -> Table:
        """Subtable by its key; empty if missing.

        Raises:
            ProblemError: it is something else.
        """
        value = self.values.get(key, {})
        if not isinstance(value, dict):
            raise self.error(key, f"{self.called(key)} is {shown(value)}; it must be a table, [{self.called(key)}]")
        return Table(self.path, value, self.lines, (*self.within, key))

    def tables(self, key: str) -> list[Table]:
        """Tables of an array of tables, [[key]]; empty if missing.

        Raises:
            ProblemError: it is something else.
        """
        entries = self.values.get(key, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            called = self.called(key)
            raise self.error(key, f"{called} is {shown(entries)}; it must be an array of tables, [[{called}]] each")
        return [
            Table(self.path, entry, self.lines, (*self.within, _numbered(key, i))) for i, entry in enumerate(entries, 1)
        ]

    def text(self, key: str, default: str, known: tuple[str, ...] = ()) -> str:
        """Text of a key, restricted to the known values if any are given.

        Raises:
            ProblemError: it is something else.
        """
        value = self.values.get(key, default)
        with self.at(key):
            if known:
                return one_of(value, known, self.called(key))
            if not isinstance(value, str):
                raise ProblemError(f"{self.called(key)} is {shown(value)}; it must be text")
        return value

    def number(self, key: str, default: float) -> float:
        """A positive number, for tasks as of docs/extending.md.

        Raises:
            ProblemError: it is something else.
        """
        with self.at(key):
            return number(self.values.get(key, default), self.called(key), sign="positive")


def read_toml(path: str | os.PathLike[str]) -> Table:
    """Read a TOML file, as its outermost table.

    Raises:
        FileError: the file cannot be read, or is too large.
        ProblemError: the file is no TOML; the message says in which line.
    """
    text, name = read_text(path, MAX_BYTES).replace("\r\n", "\n"), os.fspath(path)
    if found := _CHAIN.search(text):
        line = text.count("\n", 0, found.start()) + 1
        raise ProblemError(f"{name}, line {line}: a name of more than {_NAMES} parts with dots between")
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        why = re.sub(r"\s*\(at line (\d+), column (\d+)\)", "", str(error))
        place = re.search(r"at line (\d+), column (\d+)", str(error))
        line, column = (int(one) for one in place.groups()) if place else (text.count("\n") + 1, 1)
        raise ProblemError(f"{name}, line {line}, column {column}: not TOML: {why[:200]}") from None
    except (RecursionError, ValueError) as error:  # brackets in brackets; an integer of thousands of digits
        raise ProblemError(f"{name}: not TOML that can be read ({type(error).__name__})") from None
    return Table(name, values, _lines(text))


def _lines(text: str) -> dict[tuple[str, ...], int]:
    """Lines of keys and tables; a line within a long text may look like a key, and does no harm."""
    lines: dict[tuple[str, ...], int] = {}
    counts: dict[tuple[str, ...], int] = {}
    within: tuple[str, ...] = ()
    for i, line in enumerate(text.split("\n"), start=1):
        if header := _HEADER.match(line):
            way = within = _names(header[1])
            if line.lstrip().startswith("[["):
                counts[way] = counts.get(way, 0) + 1
                within = (*way[:-1], _numbered(way[-1], counts[way]))
                lines.setdefault(within, i)
        elif key := _KEY.match(line):
            way = (*within, *_names(key[1]))
        else:
            continue
        for n in range(1, len(way) + 1):
            lines.setdefault(way[:n], i)
    return lines


def _numbered(key: str, number: int) -> str:
    """Name of one table of an array, by its number from 1 on."""
    return f"{key}[{number}]"


def _names(dotted: str) -> tuple[str, ...]:
    return tuple(name.strip("\"'") for name in re.findall(_NAME, dotted))


def to_toml(tables: Mapping[str, Mapping[str, Any]]) -> str:
    """Tables of numbers, flags, texts, lists and tables as TOML; doubles with all their digits.

    Args:
        tables: by name; a list of tables alone becomes an array of tables.
    """
    lines = []
    for name, values in tables.items():
        several = {key: value for key, value in values.items() if _is_tables(value)}
        lines += [
            f"[{name}]",
            *(f"{_key(key)} = {_value(one)}" for key, one in values.items() if key not in several),
            "",
        ]
        for key, entries in several.items():
            for entry in entries:
                lines += [
                    f"[[{name}.{_key(key)}]]",
                    *(f"{_key(own)} = {_value(one)}" for own, one in entry.items()),
                    "",
                ]
    return "\n".join(lines)


def _is_tables(value: object) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(one, Mapping) for one in value)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _value(name)


def _value(value: object) -> str:
    """A value in TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Integral):  # numpy's, too
        return repr(int(value))
    if isinstance(value, Real):
        return repr(float(value))  # "inf" and "nan" are TOML's words, too
    if isinstance(value, str):
        if "\n" in value and "'''" not in value and not re.search(r"[\x00-\x08\x0b-\x1f\x7f]", value):
            return f"'''\n{value}'''"
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(key)} = {_value(one)}' for key, one in value.items())} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    raise ProblemError(f"TOML has no value such as {shown(value)}")
